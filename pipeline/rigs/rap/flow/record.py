"""One run as `rap.flow` looks at it: signals by name, and what the conditions say of set, clamp, tube and meter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import Recording
from pipeline.rigs.rap.conditions import pressure
from pipeline.rigs.rap.tables import Entry, Signal, entries, signal

Set = Literal["calibration", "holdout", ""]
METER, OWN = "blood_flow_bench", "blood_flow_rap"
# The passages are looked for in the first of these that a run logs fast enough, Hz.
_PULSATING = ("prefilter", "return", "access")
FASTEST_LINE, LEAST_RATE = 3.5, 7.8
_SETS: dict[str, Set] = {
    **dict.fromkeys(("calibration", "calibrate", "calib", "cal", "training", "train", "fit"), "calibration"),
    **dict.fromkeys(("holdout", "hold-out", "hold_out", "hold out", "validation", "valid", "val", "test"), "holdout"),
}  # fmt: skip
_PLACES = {
    **dict.fromkeys(("access", "access line", "inlet", "arterial"), "access"),
    **dict.fromkeys(("return", "return line", "outlet", "venous"), "return"),
}


@dataclass(frozen=True, eq=False)
class FlowRun:
    """A run.

    Attributes
    ----------
    pressures
        The device's pressures by tap, those that it logs.
    meter, own, flow_set, uf, speed
        Flow meter of the bench; the device's own estimate; blood flow as set; UF rate as commanded, else as set; encoder.
    one_clock
        Whether the meter stands in the same table as the pressures, on one clock.
    clamps
        Changes of the access clamp within the run.
    role, clamp, tube, location
        set, clamp, tube_set_id and flowmeter_location as stated; '' where not.
    """

    name: str
    recording: Recording
    pressures: dict[str, Signal]
    meter: Signal | None
    own: Signal | None
    flow_set: Signal | None
    uf: Signal | None
    speed: Signal | None
    one_clock: bool
    clamps: tuple[Entry, ...]
    role: Set
    clamp: str
    tube: str
    location: str

    def number(self, name: str) -> float | None:
        """Return a condition that is a number, SI; None where the run does not state it."""
        value = self.recording.conditions.get(name)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    @property
    def pulsating(self) -> tuple[str, Signal] | None:
        """The pressure in which the passages are looked for, with its tap; None where none is logged fast enough."""
        for tap in _PULSATING:
            found = self.pressures.get(tap)
            if found is not None and found.time.size > 50 and found.rate >= LEAST_RATE:
                return tap, found
        return None


def run_of(recording: Recording) -> FlowRun:
    """Look at a recording.

    Raises
    ------
    InputError
        If the run has neither a pressure in which roller passages could be seen nor the pump's encoder, or a condition is
        not understood.
    """
    taps = ("access", "prefilter", "return", "uf")
    pressures = {tap: one for tap in taps if (one := signal(recording, pressure(tap, "rap"))) is not None}
    command = signal(recording, "uf_pump_command")
    run = FlowRun(
        name=recording.run,
        recording=recording,
        pressures=pressures,
        meter=signal(recording, METER),
        own=signal(recording, OWN),
        flow_set=signal(recording, "blood_flow_set"),
        uf=command if command is not None else signal(recording, "uf_flow_set"),
        speed=signal(recording, "blood_pump_speed"),
        one_clock=_one_clock(recording),
        clamps=tuple(entries(recording, "clamp")),
        role=_role(recording),
        clamp=_words(recording, "clamp"),
        tube=_words(recording, "tube_set_id"),
        location=_location(recording),
    )
    if run.pulsating is None and run.speed is None:
        rates = {s.name: s.rate for s in pressures.values() if s.time.size > 1}
        found = (
            ", ".join(f"{name} at {rate:.3g} Hz" for name, rate in rates.items())
            or f"no pressure of the device (it has {listing(sorted(channel.name for channel in recording), 12)})"
        )
        raise InputError(
            f"run '{run.name}' has {found}: roller passages come up to {FASTEST_LINE:g} times a second and need a pressure "
            f"logged at {LEAST_RATE:.0f} Hz or more (pressure_prefilter_rap for choice), or the pump's encoder as blood_pump_speed."
        )
    return run


def _one_clock(recording: Recording) -> bool:
    meter = next((name for name, s in recording.streams.items() if METER in s.channels), None)
    return meter is not None and any(
        pressure(tap, "rap") in recording.streams[meter].channels for tap in ("access", "prefilter", "return")
    )


def _words(recording: Recording, name: str) -> str:
    value = recording.conditions.get(name)
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) and np.isfinite(value) else str(value).strip()


def _role(recording: Recording) -> Set:
    word = _words(recording, "set")
    found = _SETS.get(word.lower(), "")
    if word and not found:
        raise InputError(f"run '{recording.run}' states set '{word}'; expected calibration or holdout.")
    return found


def _location(recording: Recording) -> str:
    word = _words(recording, "flowmeter_location")
    found = _PLACES.get(word.lower(), "")
    if word and not found:
        raise InputError(
            f"run '{recording.run}' states flowmeter_location '{word}'; expected access or return: the line on which the "
            "bench's flow meter sits."
        )
    return found
