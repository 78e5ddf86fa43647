"""Columns u, x, v, w, m of the dynamic model along a record, and what is done to the record before.

The displacement is low-passed without phase shift: its noise would ratchet w and spoil the velocity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.mre.model.dynamic_model import Shape
from pipeline.signals.filtering import low_pass
from pipeline.signals.resampling import stretches

# Samples per period of the cutoff, by thinning or by a spline: straight lines between them cost u 0.1 % at a
# quarter of it.
_OVERSAMPLING = 16.0
_FEWEST = 100
_ORDER = 8  # flat below the cutoff: a third of it is passed to 1e-7
# The state at the start is unknown: rows before the path has covered this many ranges of x do not count.
_WARM_UP_RANGES = 2.0
_LONGEST_WARM_UP = 0.05


_ARRAYS = ("time", "x", "velocity", "acceleration", "force", "counts", "usable", "first_half")


@dataclass(frozen=True, eq=False)
class Record:
    """Displacement (m) and force (N) over time (s), shape (n,) each; current (A) where known.

    `counts` is False where the force was not measured; None where it was throughout.
    """

    run: str
    time: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    current: float | None = None
    counts: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Segment:
    """An unbroken part of a record, filtered and thinned; arrays of shape (n,), SI.

    `x`, `velocity`, `acceleration` are low-passed at `cutoff` (Hz), `force` only against aliasing.
    `counts` are rows that were logged with a force, `usable` those of them after the unknown state at the start
    has faded; `first_half` is that of the record.
    """

    run: str
    current: float | None
    cutoff: float
    time: np.ndarray
    x: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray
    counts: np.ndarray
    usable: np.ndarray
    first_half: np.ndarray


def segments_of(record: Record, cutoff: float | None) -> list[Segment]:
    """Return the unbroken parts of a record that are long enough to fit."""
    time, x, F = (np.asarray(v, dtype=float) for v in (record.time, record.displacement, record.force))
    both = np.isfinite(x) & np.isfinite(F)
    rate = 1 / float(np.median(np.diff(time)))
    cutoff = highest_motion(time[both], x[both]) if cutoff is None else cutoff
    counts = np.ones(time.size, dtype=bool) if record.counts is None else record.counts
    middle = 0.5 * (time[both][0] + time[both][-1])
    segments = []
    for part in stretches(time, np.where(both, F, np.nan), max(2.5 / rate, 0.25 / cutoff)):
        step = max(int(rate / (_OVERSAMPLING * cutoff)), 1)
        if part.size < _FEWEST * step:
            continue
        t = time[part]
        smooth = low_pass(t, x[part], cutoff, _ORDER)
        force = low_pass(t, F[part], 0.4 * rate / step) if step > 1 else F[part]
        rows = _undisturbed(counts[part], step)
        times = math.ceil(0.9 * _OVERSAMPLING * cutoff / rate)
        if times > 1:
            t, smooth, force, rows = _refined(t, smooth, force, rows, times)
        velocity = np.gradient(smooth, t)
        acceleration = np.gradient(velocity, t)
        segments.append(
            Segment(
                run=record.run,
                current=record.current,
                cutoff=cutoff,
                time=t[::step],
                x=smooth[::step],
                velocity=velocity[::step],
                acceleration=acceleration[::step],
                force=force[::step],
                counts=rows[::step],
                usable=_after_warm_up(smooth[::step]) & rows[::step],
                first_half=t[::step] < middle,
            )
        )
    return segments


def largest_excursion(segments: Sequence[Segment]) -> float:
    """Return half the largest range of displacement, m."""
    return max(0.5 * float(np.ptp(part.x)) for part in segments)


def livelier_part(segments: Sequence[Segment], count: int) -> Segment:
    """Return the `count` successive samples of the longest segment in which x strays most."""
    whole = max(segments, key=lambda part: part.time.size)
    count = min(count, whole.time.size)
    strayed = np.r_[0.0, np.cumsum(np.abs(whole.x - whole.x.mean()))]
    start = int(np.argmax(strayed[count:] - strayed[:-count]))
    rows = slice(start, start + count)
    cut = {name: getattr(whole, name)[rows] for name in _ARRAYS}
    cut["usable"] = _after_warm_up(cut["x"]) & cut["counts"]
    return replace(whole, **cut)


def _after_warm_up(x: np.ndarray) -> np.ndarray:
    """Tell which samples come after the unknown state at the start has faded."""
    path = np.r_[0.0, np.cumsum(np.abs(np.diff(x)))]
    usable = path > _WARM_UP_RANGES * np.ptp(x)
    usable[round(_LONGEST_WARM_UP * usable.size) :] = True
    return np.asarray(usable)


def _refined(
    t: np.ndarray, x: np.ndarray, F: np.ndarray, usable: np.ndarray, times: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Put samples between those of a coarse log, where the path is a spline of x and the force does not count."""
    from scipy.interpolate import make_interp_spline

    between = np.interp(np.arange((t.size - 1) * times + 1) / times, np.arange(t.size), t)
    logged = np.zeros(between.size, dtype=bool)
    logged[::times] = usable
    return between, make_interp_spline(t, x, k=3)(between), np.interp(between, t, F), logged


def _undisturbed(counts: np.ndarray, step: int) -> np.ndarray:
    """Tell which rows the low-pass of the force keeps clear of those that do not count."""
    if counts.all() or step == 1:
        return counts
    reach = 4 * step  # a low-pass at 0.4 of the thinned rate forgets within four of its samples
    near = np.convolve(~counts, np.ones(2 * reach + 1), "same") > 0.5
    return np.asarray(~near)


def highest_motion(time: np.ndarray, x: np.ndarray) -> float:
    """Return three times the frequency below which 99.9 % of the motion's power lies, Hz.

    The noise floor is the median of the upper half of the spectrum. At most 0.4 times the rate.
    """
    rate = (time.size - 1) / (time[-1] - time[0])
    centred = x - np.polynomial.Polynomial.fit(time, x, 1)(time)
    size = 1 << max(int(x.size).bit_length() - 1, 1)
    power = np.abs(np.fft.rfft(centred[:size] * np.hanning(size))) ** 2
    floor = float(np.median(power[power.size // 2 :])) / np.log(2)  # of an exponential distribution
    share = np.cumsum(np.maximum(power - floor, 0.0) * (power > 10 * floor))
    top = int(np.searchsorted(share, 0.999 * share[-1])) * rate / size
    return float(np.clip(3 * top, 8 * rate / size, 0.4 * rate))


def segment_columns(
    segment: Segment, shape: Shape, count: int
) -> tuple[Mapping[str, np.ndarray], list[dict[str, np.ndarray]]]:
    """Return the columns at the first `count` samples, and their derivatives where they have any.

    The derivatives are by (ln tau, ln rho, C, n, lag). The lag delays the motion: its Taylor series to
    the second order is exact enough for lags of a few per cent of a period.
    """
    from pipeline.rigs.mre.model.bouc_wen import along, path_through
    from pipeline.rigs.mre.model.linear_solid import maxwell_along

    t, v, a = segment.time[:count], segment.velocity[:count], segment.acceleration[:count]
    lag = shape.lag
    x = segment.x[:count] - lag * v + 0.5 * lag**2 * a
    velocity = v - lag * a
    x = x - x[0]
    u = maxwell_along(t, x, shape.tau, velocity)
    w = along(path_through(x), shape.rho, shape.c_bw, shape.n_bw)
    columns = {"u": u[:, 0], "x": x, "v": velocity, "w": w[:, 0], "m": a}
    slopes: list[dict[str, np.ndarray]] = [
        {"u": u[:, 1]},
        {"w": shape.rho * w[:, 1]},
        {"w": w[:, 2]},
        {"w": w[:, 3]},
        {"u": u[:, 0] / shape.tau - velocity, "x": velocity[0] - velocity, "v": -a, "w": -np.gradient(w[:, 0], t)},
    ]
    return columns, slopes
