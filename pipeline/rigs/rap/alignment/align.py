"""The clock of the device against that of the bench: coarse by steps, fine by the pump's lines (rap.md, 5.1).

Nothing is moved here: the result tells what to do with the stamps, and how sure that is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.by_lines import ByLines, by_lines, clock_step, wander
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.coarse import AMBIGUOUS, SEARCH, coarse_lag
from pipeline.rigs.rap.alignment.fine import model_of
from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.alignment.result import Alignment, Coarse, Ratios, Track
from pipeline.rigs.rap.alignment.stamps import jitter
from pipeline.rigs.rap.alignment.steps import Features, feature_lags

BENCH_POLE, BENCH_POLE_SD = 5e-3, 5e-3
"""Time constant of the bench's sensors, and its standard uncertainty, where the run does not state it, s."""
# Unknown delays of two sensors of one kind, and of a pressure against a flow meter: standard uncertainties, s.
_SENSOR_DELAY, _OTHER_DELAY = 0.02, 0.25
# A peak below it is no agreement of two courses.
_LEAST_PEAK = 0.5
# A lag from the pump's lines with a larger standard error is none, s.
_LARGEST_ERROR = 0.1
# Told from that drift, relative, and that jitter, s, on.
_DRIFT, _JITTER = 10e-6, 5e-4


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
        return _nothing(usable, coarse, bench_pole, _COPIED)
    usable = own
    if not coarse.peak >= _LEAST_PEAK:
        return _nothing(usable, coarse, bench_pole)
    alike = [pair for pair in usable if pair.alike and pair.name not in coarse.flipped]
    pole = BENCH_POLE if bench_pole is None else bench_pole
    found = by_lines(alike, coarse, pole) if alike else None
    if found is not None:
        jump = clock_step(found.track)
        if jump is not None:
            return _nothing(usable, coarse, bench_pole, _stepped(*jump))
        return _from_lines(found, coarse, bench_pole is not None, search)
    return _from_steps(usable, coarse, feature_lags(usable, coarse.lag), bench_pole, search)


def _from_lines(found: ByLines, coarse: Coarse, stated: bool, search: float) -> Alignment:
    fit, below = found.fine.fit, found.clock
    names = list(fit.names)
    poles = sorted({found.fine.pole(p) for p in found.fine.pairs})
    type_b = dict.fromkeys(names, 0.0)
    if not stated:
        other = found.refitted(found.bench_pole + BENCH_POLE_SD).fit.values
        type_b = {name: abs(other.get(name, fit.values[name]) - fit.values[name]) for name in names}
    # What jitter leaves in an evened grid is the same for all windows: their scatter does not show it.
    shaken = jitter(found.pairs[0].device.time)
    if found.device_evened:
        count, span = found.pairs[0].device.time.size, float(np.ptp(found.pairs[0].device.time))
        type_b["delay"] = math.hypot(type_b["delay"], shaken / math.sqrt(count))
        if "rate" in names:
            type_b["rate"] = math.hypot(type_b["rate"], shaken * math.sqrt(12.0 / count) / span)
    strays = wander(found.track)
    type_b["delay"] = math.hypot(type_b["delay"], strays)
    if strays and "rate" in names:
        type_b["rate"] = math.hypot(type_b["rate"], strays * math.sqrt(12.0) / float(np.ptp(found.track.time)))
    dof = fit.covariance.dof
    sd = {name: float(np.hypot(fit.std_error[name], type_b[name])) for name in names}
    covariance = np.diag([sd["delay"] ** 2, sd.get("rate", 100e-6) ** 2])
    if "rate" in names:
        both = [names.index("delay"), names.index("rate")]
        covariance[0, 1] = covariance[1, 0] = fit.covariance.matrix[both[0], both[1]]
    clock = Clock(below.reference, below.lag + fit.values["delay"], below.rate + fit.values["rate"], covariance)
    stroke = float(1.0 / np.nanmedian(found.strokes.frequency))
    doubt = _doubt(coarse, stroke, found.sure)
    if not sd["delay"] < _LARGEST_ERROR:
        doubt = (
            doubt
            or f"the pump's lines do not tell lag and pole apart (lag to {sd['delay']:.2g} s at best): pulsation is hardly seen, or both sides hold the readings of one sensor"
        )
    remark = (
        ""
        if stated
        else f"the run does not state bench_sensor_time_constant: {1e3 * BENCH_POLE:g} ms with a standard uncertainty of {1e3 * BENCH_POLE_SD:g} ms taken"
    )
    lag = undetermined("lag", doubt) if doubt else estimate("lag", clock.lag, sd["delay"], dof=dof, reason=remark)
    rate = (
        estimate("clock_rate", clock.rate, sd["rate"], dof=dof)
        if "rate" in names
        else undetermined(
            "clock_rate", "the record is too short to tell a drift of the clock: log minutes, not seconds"
        )
    )
    told = list(_told_coarse(coarse, search)) + _told_clock(clock, found.track, doubt)
    if strays:
        told.append(
            QualityFinding(
                "warning",
                f"the clocks do not drift evenly: the lag strays from a straight line by {1e3 * strays:.1f} ms rms; lag and rate carry it",
            )
        )
    if not stated:
        told.append(QualityFinding("note", f"{remark}; lag and pole carry it"))
    for name in found.strange:
        told.append(
            QualityFinding(
                "warning",
                f"the pulsation of {name} differs in size between device and bench by more than 30 %: left out of the alignment",
                channel=name,
            )
        )
    if found.device_evened and shaken > _JITTER:
        told.append(
            QualityFinding(
                "note",
                f"the device's stamps jitter by {1e3 * shaken:.1f} ms while its samples were taken evenly: stamps were evened",
            )
        )
    rows, fine = found.fine.rows, found.fine
    return Alignment(
        clock=clock,
        method="harmonics",
        sure=not doubt,
        lag=lag,
        rate=rate,
        coarse=coarse,
        poles=tuple(_pole(found, name, sd, dof, remark) for name in poles),
        gains=tuple(
            estimate(
                "pulsation_gain", fit.values[f"gain_{p}"], sd[f"gain_{p}"], dof=dof, at={"channel": found.pairs[p].name}
            )
            for p in fine.pairs
        ),
        pole_by_name=_pole_by_name(found),
        bench_pole=found.bench_pole,
        bench_pole_stated=stated,
        track=found.track,
        ratios=Ratios(
            np.array([pair.name for pair in found.pairs])[rows.pair],
            found.strokes.windows.centre[rows.window],
            found.strokes.frequency[rows.window],
            rows.order,
            rows.ratio * np.exp(-1j * rows.omega * (fit.values["delay"] + fit.values["rate"] * rows.ahead)),
            rows.sd,
            model_of(rows, fit.values, found.bench_pole, fine.separate, delayed=False),
            fine.used,
        ),
        jitter=shaken,
        evened=found.device_evened,
        bench_evened=found.bench_evened,
        stroke=stroke,
        problems=tuple(told),
    )


def _pole(found: ByLines, name: str, sd: dict[str, float], dof: float, remark: str) -> Estimate:
    at = {} if name == "pole" else {"channel": found.pairs[int(name.removeprefix("pole_"))].name}
    if name in found.fine.fit.at_bound or not math.isfinite(sd[name]):
        return undetermined("sensor_pole", "the pump's lines that stand out do not tell it", at)
    return estimate("sensor_pole", found.fine.fit.values[name], sd[name], dof=dof, at=at, reason=remark)


def _pole_by_name(found: ByLines) -> dict[str, float]:
    return {found.pairs[p].name: found.fine.fit.values[found.fine.pole(p)] for p in found.fine.pairs}


def _from_steps(
    pairs: Sequence[Pair], coarse: Coarse, features: Features, bench_pole: float | None, search: float
) -> Alignment:
    first = max(float(pair.bench.time[0]) for pair in pairs)
    last = min(float(pair.bench.time[-1]) for pair in pairs)
    first = max(first, max(float(pair.device.time[0]) + coarse.lag for pair in pairs))
    last = min(last, min(float(pair.device.time[-1]) + coarse.lag for pair in pairs))
    reference = 0.5 * (first + last)
    delay = _SENSOR_DELAY if all(pair.alike for pair in pairs) else _OTHER_DELAY
    what = (
        "no pulsation is seen on both sides: starts and steps alone tell the lag, and the delay of the sensors is in it"
    )
    covariance = np.diag([max(coarse.sd, delay) ** 2, (100e-6) ** 2])
    value, slope, slope_sd, dof = coarse.lag, 0.0, math.nan, math.inf
    if features.time.size:
        value, slope, slope_sd, matrix, dof = _line(features, reference)
        covariance = matrix + np.diag([delay**2, 0.0])
    clock = Clock(reference, value, slope, covariance)
    doubt = _doubt(coarse, None, sure=True)
    sd = math.sqrt(covariance[0, 0])
    track = Track(features.time, features.lag, features.sd, np.ones(features.time.size, dtype=bool))
    return Alignment(
        clock=clock,
        method="steps",
        sure=not doubt,
        lag=undetermined("lag", doubt) if doubt else estimate("lag", value, sd, dof=dof, reason=what),
        rate=estimate("clock_rate", slope, slope_sd, dof=dof)
        if math.isfinite(slope_sd)
        else undetermined(
            "clock_rate", "one step alone tells no drift of the clock: stop or start the pump at both ends of the run"
        ),
        coarse=coarse,
        poles=(
            undetermined("sensor_pole", "no pulsation is seen on both sides: nothing tells the poles of the sensors"),
        ),
        bench_pole=BENCH_POLE if bench_pole is None else bench_pole,
        bench_pole_stated=bench_pole is not None,
        track=track,
        jitter=jitter(pairs[0].device.time),
        problems=(QualityFinding("warning", what), *_told_coarse(coarse, search), *_told_clock(clock, track, doubt)),
    )


def _line(features: Features, reference: float) -> tuple[float, float, float, np.ndarray, float]:
    """Return lag at the reference, rate, its standard error (NaN with one place only), covariance, degrees of freedom."""
    x, y, w = features.time - reference, features.lag, 1.0 / np.maximum(features.sd, 1e-3) ** 2
    several = np.ptp(x) > 60.0
    columns = np.stack([np.ones_like(x), x], axis=1) if several else np.ones((x.size, 1))
    normal = np.linalg.inv(columns.T @ (columns * w[:, None]))
    solution = normal @ (columns.T @ (w * y))
    dof = x.size - columns.shape[1]
    off = y - columns @ solution
    normal = normal * max(float(w @ off**2) / dof if dof > 0 else 1.0, 1.0)
    if not several:
        return float(solution[0]), 0.0, math.nan, np.diag([float(normal[0, 0]), (100e-6) ** 2]), max(dof, 1)
    sd = math.sqrt(normal[1, 1])
    return float(solution[0]), float(solution[1]), sd if dof > 0 else math.nan, normal, max(dof, 1)


_COPIED = (
    "the bench's pressures are the device's, number for number: a copy tells nothing of its clock nor of its sensors; "
    "log the bench's own readings"
)


def _stepped(time: float, size: float) -> str:
    return (
        f"the device's clock (or the bench's) steps by about {1e3 * size:+.0f} ms, or that and whole strokes, about {time:.0f} s or later: no one lag "
        "holds. Cut both logs there and identify the parts as runs of their own"
    )


def _nothing(pairs: Sequence[Pair], coarse: Coarse, bench_pole: float | None, why: str = "") -> Alignment:
    reason = why or (
        f"nothing that starts, stops or steps is seen alike by device and bench (best correlation {coarse.peak:.2f} of 1)"
        if math.isfinite(coarse.peak)
        else "the stamps of device and bench share nothing that moves"
    )
    if not why:
        reason += ": check that both logs are of the same run, and include a pump start"
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


def _doubt(coarse: Coarse, stroke: float | None, sure: bool) -> str:
    """Return why the lag may be another one, empty where it cannot."""
    strokes = f" by n x stroke ({stroke:.2f} s)" if stroke else ""
    if not coarse.featured:
        return f"lag ambiguous{strokes}: the run holds one speed only, and every stroke looks like the next; include a pump start"
    if coarse.margin >= AMBIGUOUS:
        return (
            f"lag ambiguous{strokes}: {coarse.lag:.2f} s and {coarse.second_lag:.2f} s fit about as well "
            f"(correlation {coarse.peak:.3f} and {coarse.second:.3f}); include a pump start"
        )
    if not sure:
        return f"lag ambiguous{strokes}: the pump stood so long that the strokes before and behind cannot be counted through"
    return ""


def _told_coarse(coarse: Coarse, search: float) -> tuple[QualityFinding, ...]:
    told = []
    if coarse.wide:
        told.append(
            QualityFinding(
                "warning",
                f"the stamps of device and bench lie {abs(coarse.lag):.6g} s apart, more than the {search:g} s that are usual: the clocks "
                "count from different moments. The lag was found by laying the records over each other",
            )
        )
    for name in coarse.flipped:
        told.append(
            QualityFinding(
                "warning",
                f"{name} runs against the bench's: sign flipped? It was left out of the fine alignment",
                channel=name,
            )
        )
    return tuple(told)


def _told_clock(clock: Clock, track: Track, doubt: str) -> list[QualityFinding]:
    told = [QualityFinding("warning", doubt)] if doubt else []
    if (
        abs(clock.rate) > _DRIFT
        and math.isfinite(clock.covariance[1, 1])
        and abs(clock.rate) > 3.0 * math.sqrt(clock.covariance[1, 1])
        and track.time.size
    ):
        end = float(clock.lag_at(track.time[-1:])[0])
        told.append(
            QualityFinding(
                "note",
                f"rate error {1e6 * clock.rate:+.1f} ppm of the device's clock; lag at end {end:.3f} s; corrected",
            )
        )
    return told
