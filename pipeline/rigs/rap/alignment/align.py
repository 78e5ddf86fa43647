"""The clock of the device against that of the bench: coarse by steps, fine by the pump's lines (rap.md, 5.1).

Nothing is moved here: the result tells what to do with the stamps, and how sure that is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.estimation.estimate import undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.by_lines import by_lines, clock_step
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.coarse import SEARCH, coarse_lag
from pipeline.rigs.rap.alignment.from_lines import from_lines
from pipeline.rigs.rap.alignment.from_steps import from_steps, step_of_features
from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.alignment.result import BENCH_POLE, Alignment, Coarse
from pipeline.rigs.rap.alignment.stamps import jitter
from pipeline.rigs.rap.alignment.told import COPIED, stepped, unlike

# A peak below it is no agreement of two courses.
_LEAST_PEAK = 0.5


def align(pairs: Sequence[Pair], bench_pole: float | None = None, search: float = SEARCH) -> Alignment:
    """Return how the device's clock stands to that of the bench.

    Parameters
    ----------
    pairs
        Channels that both see, from `pairs_of` or made by hand; one is enough. Pulsation is used where both sides show it
        (alike pairs, 10 Hz or more), steps alone otherwise.
    bench_pole
        Time constant of the bench's pressure sensors, s; None where the run does not state it.
    search
        Lags up to that are expected, s; beyond is looked only where nothing within fits.

    Raises
    ------
    InputError
        If there is no usable pair.
    """
    usable = [pair for pair in pairs if pair.usable]
    if not usable:
        raise InputError(
            "no channel of the device can be laid beside one of the bench: both must have 20 samples at least, and move. "
            "Log a pressure on both."
        )
    coarse = coarse_lag(usable, search)
    lag = coarse.lag if math.isfinite(coarse.lag) else 0.0
    own = [pair for pair in usable if not pair.copied(lag)]
    if not own:
        return _nothing(usable, coarse, bench_pole, COPIED)
    usable = own
    if not coarse.peak >= _LEAST_PEAK:
        return _nothing(usable, coarse, bench_pole, unlike(coarse))
    jump = step_of_features(usable, coarse)
    if jump is not None:
        return _nothing(usable, coarse, bench_pole, stepped(*jump))
    alike = [pair for pair in usable if pair.alike and pair.name not in coarse.flipped]
    pole = BENCH_POLE if bench_pole is None else bench_pole
    found = by_lines(alike, coarse, pole) if alike else None
    if found is not None:
        jump = clock_step(found.track)
        if jump is not None:
            return _nothing(usable, coarse, bench_pole, stepped(*jump))
        return from_lines(found, coarse, bench_pole is not None, search)
    return from_steps(usable, coarse, bench_pole, search)


def _nothing(pairs: Sequence[Pair], coarse: Coarse, bench_pole: float | None, reason: str) -> Alignment:
    """Return an alignment that leaves the stamps as logged, for a reason."""
    middle = 0.5 * float(pairs[0].bench.time[0] + pairs[0].bench.time[-1])
    return Alignment(
        clock=Clock(middle, 0.0),
        method="none",
        sure=False,
        lag=undetermined("lag", reason),
        rate=undetermined("clock_rate", reason),
        coarse=coarse,
        poles=(undetermined("sensor_pole", reason),),
        bench_pole=BENCH_POLE if bench_pole is None else bench_pole,
        bench_pole_stated=bench_pole is not None,
        jitter=jitter(pairs[0].device.time),
        problems=(QualityFinding("error", reason),),
    )
