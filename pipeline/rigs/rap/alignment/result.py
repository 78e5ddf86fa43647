"""What alignment found, as data: the clock, the poles, and what each rests on. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.stamps import evened

Method = Literal["harmonics", "steps", "none"]
BENCH_POLE = 5e-3
"""Time constant of the bench's sensors where the run does not state it, s."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """The lag that starts, stops and steps tell, and whether another fits them as well.

    Attributes
    ----------
    lag, sd
        s at `at` (bench's clock, where most of the features lie); NaN where nothing was found.
    peak, second, second_lag
        Correlation there, the highest one beside it, and its lag (s).
    lags, correlation
        The whole course, s and 1, shape (m,), NaN where too little overlaps.
    wide
        Whether it was looked for beyond the usual search, because the stamps lie far apart.
    featured
        Whether anything but pulsation and noise is there to tell it.
    flipped
        Names of pairs whose course runs against that of the others.
    """

    lag: float
    sd: float
    at: float
    peak: float
    second: float
    second_lag: float
    lags: np.ndarray
    correlation: np.ndarray
    wide: bool = False
    featured: bool = True
    flipped: tuple[str, ...] = ()

    @property
    def margin(self) -> float:
        """Second peak over the first; the lag is ambiguous from 0.9 on."""
        return self.second / self.peak if self.peak > 0 else float("nan")


@dataclass(frozen=True, eq=False)
class Track:
    """Lag window by window: bench `time` (s), `lag` (s), its `sd` (s), whether it was `used`; shape (w,) each."""

    time: np.ndarray
    lag: np.ndarray
    sd: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class Ratios:
    """Device over bench at the pump's lines after the clocks were aligned, one row a window, pair and order; shape (r,).

    `ratio` complex, `sd` of its real and imaginary part, `model` eq. (2) as fitted (without the lag), `used` in the fit.
    """

    name: np.ndarray
    time: np.ndarray
    frequency: np.ndarray
    order: np.ndarray
    ratio: np.ndarray
    sd: np.ndarray
    model: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class Alignment:
    """How the device's clock stands to the bench's.

    Attributes
    ----------
    clock
        Always usable: the best that is known, stamps as logged where nothing is.
    method
        From what: pulsation and steps, steps alone, or nothing.
    sure
        Whether the lag is that and not another one; where not, `lag` has no value and says why.
    lag, rate
        Estimates `lag` (s, at `clock.reference`, the middle of what both logged) and `clock_rate` (1).
    poles
        Estimates `sensor_pole` (s): one where the device's sensors agree, else one a pair, `at` its channel.
    gains
        Estimates `pulsation_gain` (1) a pair: g of eq. (2), from the lines alone.
    pole_by_name
        Best pole of each pair's device sensor (s), for equalising.
    bench_pole, bench_pole_stated
        Time constant of the bench's sensors as used (s), and whether the run states it.
    jitter
        rms distance of the device's stamps to an even grid, s.
    evened, bench_evened
        Whether stamps of the device, of the bench were replaced by an even grid, because the samples were taken on it.
    problems
        What must be told, without the run.
    """

    clock: Clock
    method: Method
    sure: bool
    lag: Estimate
    rate: Estimate
    coarse: Coarse
    poles: tuple[Estimate, ...] = ()
    gains: tuple[Estimate, ...] = ()
    pole_by_name: Mapping[str, float] = field(default_factory=dict)
    bench_pole: float = 0.0
    bench_pole_stated: bool = True
    track: Track | None = None
    ratios: Ratios | None = None
    jitter: float = float("nan")
    evened: bool = False
    bench_evened: bool = False
    stroke: float | None = None
    problems: tuple[QualityFinding, ...] = ()

    def device_on_bench(self, time: np.ndarray) -> np.ndarray:
        """Return stamps of the device, shape (n,), on the bench's clock, evened where its samples were taken evenly."""
        return self.clock.to_bench(evened(time) if self.evened else time)

    def bench_time(self, time: np.ndarray) -> np.ndarray:
        """Return stamps of the bench, shape (n,), evened where its samples were taken evenly."""
        return evened(time) if self.bench_evened else np.asarray(time, dtype=float)
