"""What the re-derivation of alarms takes and yields; every time is in seconds on the device's clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.tables import Entry, Signal

RATIOS = ("access", "filter", "return", "membrane")
Verdict = Literal["match", "late", "missed", "extra"]
Kind = Literal["step", "drift", "stuck"]


@dataclass(frozen=True, eq=False)
class DeviceLog:
    """What the device wrote of one run.

    Attributes
    ----------
    control, protective
        Pressures by tap as either unit reads them, Pa.
    flow_set, flow_device, pump_speed
        Blood flow as set and as estimated (m^3/s), strokes a second; None where not logged.
    uf_set, uf_command
        Ultrafiltration as set and as asked of the pump, m^3/s; None where not logged.
    flags
        Channels of 0 and 1 by name, such as ``air_detected``.
    states, codes, warnings
        Rows of the list of events.
    lists_codes
        Whether the log has a column of alarm codes at all, be it empty.
    """

    run: str
    control: Mapping[str, Signal]
    protective: Mapping[str, Signal]
    flow_set: Signal | None = None
    flow_device: Signal | None = None
    pump_speed: Signal | None = None
    uf_set: Signal | None = None
    uf_command: Signal | None = None
    flags: Mapping[str, Signal] = field(default_factory=dict)
    states: tuple[Entry, ...] = ()
    codes: tuple[Entry, ...] = ()
    warnings: tuple[Entry, ...] = ()
    lists_codes: bool = False


@dataclass(frozen=True, eq=False)
class Ratios:
    """Resistances over their baseline on the grid of the device's samples, shape (n,) each.

    `values` (by `RATIOS`) are NaN where not judged: pump off, blanked, no ultrafiltration. `baseline` is a resistance
    (Pa s/m^3), that of the membrane its coefficient (m^3/(s Pa)); `noise` the standard deviation of the ratio;
    `zero` what each tap reads while the blood stands, Pa.
    """

    time: np.ndarray
    values: Mapping[str, np.ndarray]
    baseline: Mapping[str, float]
    noise: Mapping[str, float]
    zero: Mapping[str, float]
    pump_on: np.ndarray
    flow: np.ndarray
    uf: np.ndarray


@dataclass(frozen=True)
class StateSpan:
    """The device was in `state` from `start` to `end` (s); `reason` is the event that led there."""

    state: str
    start: float
    end: float
    reason: str


@dataclass(frozen=True)
class Alarm:
    """One alarm that the log gives cause for.

    `index` counts those of one code from 1; `began` is when the cause was first seen, `time` when the alarm was due,
    `ended` when the cause was gone, None where the log ends first. `fluid_removed` (m^3) is what the ultrafiltrate
    pump took from `began` until it stopped or the cause was gone; None where no rate is logged.
    """

    code: str
    index: int
    time: float
    std_error: float
    began: float
    ended: float | None
    cause: str
    fluid_removed: float | None = None
    uf_stopped: bool = False


@dataclass(frozen=True)
class ComparisonRow:
    """One alarm as re-derived and as logged (s; None where there is none); `delay` is logged less derived."""

    code: str
    derived: float | None
    logged: float | None
    delay: float | None
    verdict: Verdict


@dataclass(frozen=True)
class Comparison:
    """Re-derived alarms beside logged ones; `unknown` are logged words that name no alarm known here."""

    rows: tuple[ComparisonRow, ...]
    unknown: tuple[Entry, ...]
    logged_any: bool


@dataclass(frozen=True)
class Rate:
    """`count` events in `hours`; `upper95` is the one-sided 95 % bound of a Poisson rate, 1/h."""

    count: int
    hours: float
    per_hour: float
    upper95: float


@dataclass(frozen=True)
class UfAlone:
    """Ultrafiltration ran from `start` to `end` while the blood stood, `volume` m^3; `certain` where pressures say so too."""

    start: float
    end: float
    volume: float
    certain: bool


@dataclass(frozen=True)
class Mismatch:
    """The two units disagree at one tap.

    `index` counts from 1; `onset` is estimated from the residual, `time` the first detection, `delay` the one less the
    other, s. `size` is the step in Pa, the drift in Pa/s, of a stuck unit the largest difference in Pa.
    """

    tap: str
    index: int
    time: float
    std_error: float
    onset: float
    kind: Kind
    size: float
    by_threshold: float | None
    by_cusum: float | None
    end: float | None

    @property
    def delay(self) -> float:
        """Seconds from onset to first detection."""
        return self.time - self.onset


@dataclass(frozen=True, eq=False)
class Redundancy:
    """Protective less control unit at one tap.

    Attributes
    ----------
    skew, skew_error
        How much later the protective unit samples, and its standard error, s; NaN where the log cannot tell.
    noise
        Standard deviation of the residual's samples after the skew is removed, Pa.
    time, residual, cusum_up, cusum_down
        1 s means of that residual and the cumulative sums, shape (n,), s and Pa.
    false_raw, false_kept
        Onsets of the threshold outside mismatches, on the raw difference and with the skew removed.
    """

    tap: str
    skew: float
    skew_error: float
    noise: float
    time: np.ndarray
    residual: np.ndarray
    cusum_up: np.ndarray
    cusum_down: np.ndarray
    mismatches: tuple[Mismatch, ...]
    false_raw: Rate
    false_kept: Rate
    problems: tuple[QualityFinding, ...] = ()


@dataclass(frozen=True, eq=False)
class AlarmNumbers:
    """All that is known of one run's alarms; `undetermined` says why pressures give none, '' where they could be judged."""

    log: DeviceLog
    ratios: Ratios | None
    states: tuple[StateSpan, ...]
    alarms: tuple[Alarm, ...]
    redundancy: tuple[Redundancy, ...]
    comparison: Comparison
    false_alarms: Rate
    uf_alone: tuple[UfAlone, ...]
    problems: tuple[QualityFinding, ...]
    undetermined: str = ""
