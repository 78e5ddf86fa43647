"""The channels of one run brought onto one clock, about a hundred values a turn of the load.

Averages are taken as the rig's own slow log takes them: plain means of equal stretches of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError, counted, listing
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.axes import xy
from pipeline.rigs.tpjb.rotating.orbit import rotation
from pipeline.signals.periodogram import block_means
from pipeline.signals.resampling import interpolated

_A_TURN = 100
# Values that show how the load turns, whatever the rate of the log.
_COARSE = 4000
# A value that stands still for this share of a turn at full force is stuck: the vector turns by 30 deg.
_STUCK = 1.0 / 12.0
# Levels beside an end of the range that show how often a value is met there.
_BESIDE = 20
# Streams of more than twice as many samples are averaged while they are read.
_MANY = 100_000


@dataclass(frozen=True, eq=False)
class Sampled:
    """Channels on one clock: `time`, shape (n,), s; `values` by name, shape (n,) each, NaN where missing."""

    time: np.ndarray
    values: dict[str, np.ndarray]
    averaged: int
    findings: tuple[QualityFinding, ...] = ()


def sampled(recording: Recording, names: Sequence[str], average: float | None) -> Sampled:
    """Return the channels `names` on one clock.

    Parameters
    ----------
    average
        Over which time to average, s; None for a hundredth of a turn of the load.

    Raises
    ------
    InputError
        If a force has no samples, or does not turn.
    """
    findings: list[QualityFinding] = []
    wild: dict[str, np.ndarray] = {}
    columns, thinned = _columns(recording, names)
    turns = _turns(recording, columns)
    for name in names:
        if name.startswith(("gap_", "force_u", "force_v")):
            columns[name] = _without_flat_tops(recording.run, name, *columns[name], findings)
            columns[name] = _without_stuck(recording.run, name, *columns[name], turns, findings)
            columns[name], left = _without_wild(*columns[name])
            if left.size:
                wild[name] = left
    if wild:
        findings.append(_told_wild(recording.run, wild))
    base, _ = columns["force_u"]
    if base.size < 2:
        raise InputError(f"{base.size} samples of force_u")
    step = max(float(np.median(np.diff(time))) for time, _ in columns.values() if time.size > 1)
    fastest = min(float(np.median(np.diff(time))) for time, _ in columns.values() if time.size > 1)
    width = turns.period / _A_TURN if average is None else average
    width = max(width, step)
    one_clock = len({id(time) for time, _ in columns.values()}) == 1
    if width < 1.9 * fastest:
        if one_clock:
            return Sampled(base, {name: values for name, (_, values) in columns.items()}, 1, tuple(findings))
        aligned = {name: _onto(base, time, values) for name, (time, values) in columns.items()}
        return Sampled(base, aligned, 1, tuple(findings))
    time, values = _means(columns, base, width)
    return Sampled(time, values, max(round(width / fastest * thinned), 1), tuple(findings))


def _columns(recording: Recording, names: Sequence[str]) -> tuple[dict[str, tuple[np.ndarray, np.ndarray]], int]:
    """Return stamps and values by channel, and how many samples each value stands for.

    Streams with far more samples than an orbit needs are averaged piece by piece, so that memory is
    bounded by the piece and not by the log.
    """
    columns: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    most = 1
    for stream in recording.streams.values():
        own = [name for name in names if name in stream.channels and name not in columns]
        size = stream.size // _MANY
        if not own:
            continue
        if size < 2:
            columns |= {name: (stream.time, stream.channels[name].values) for name in own}
            continue
        most = max(most, size)
        parts, rest = [], np.empty((1 + len(own), 0))
        for time, values in stream.blocks(own):
            table = np.hstack([rest, np.vstack([time, *values])])
            whole = table.shape[1] // size * size
            parts.append(_block_means(table[:, :whole].reshape(table.shape[0], -1, size)))
            rest = table[:, whole:]
        table = np.hstack(parts)
        columns |= {name: (table[0], row) for name, row in zip(own, table[1:], strict=True)}
    return columns, most


def _block_means(blocks: np.ndarray) -> np.ndarray:
    """Average the last axis over what is finite; NaN where that is less than half."""
    finite = np.isfinite(blocks)
    number = finite.sum(axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(finite, blocks, 0.0).sum(axis=2) / number
    return np.where(2 * number >= blocks.shape[2], mean, np.nan)


@dataclass(frozen=True)
class _Turns:
    """How long the load takes for a turn, and from when to when it has its full size, s."""

    period: float
    start: float
    end: float


def _turns(recording: Recording, columns: dict[str, tuple[np.ndarray, np.ndarray]]) -> _Turns:
    """Look at the forces, coarsely; where they do not turn the rotation is as set.

    Raises
    ------
    InputError
        If the force neither turns nor is told to.
    """
    time, u = columns["force_u"]
    v = _onto(time, *columns["force_v"])
    kept = np.isfinite(u) & np.isfinite(v)
    block = int(kept.sum()) // _COARSE
    coarse = [block_means(time[kept], part[kept], block) for part in (u, v)]
    try:
        turning = rotation(coarse[0][0], xy(coarse[0][1], coarse[1][1]))
    except InputError:
        stated = recording.conditions.get("force_rotation_frequency")
        if isinstance(stated, int | float) and stated > 0:
            return _Turns(1.0 / float(stated), float(time[0]), float(time[-1]))
        raise
    at_full = coarse[0][0][turning.steady]
    return _Turns(1.0 / abs(turning.frequency), float(at_full[0]), float(at_full[-1]))


def _onto(base: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values if time is base else interpolated(time, values, base, linear=True)


def _means(
    columns: dict[str, tuple[np.ndarray, np.ndarray]], base: np.ndarray, width: float
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Average each channel over stretches of `width`; a stretch less than half full is dropped."""
    count = max(int((base[-1] - base[0]) / width * (1 + 1e-9)), 1)
    edges = base[0] + width * np.arange(count + 1)
    values = {}
    for name, (time, samples) in columns.items():
        finite = np.isfinite(samples)
        place = np.floor((time[finite] - edges[0]) / width + 1e-9).astype(int)
        inside = (place >= 0) & (place < count)
        number = np.bincount(place[inside], minlength=count)
        total = np.bincount(place[inside], weights=samples[finite][inside], minlength=count)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / number
        expected = width / float(np.median(np.diff(time))) if time.size > 1 else 1.0
        mean[number < 0.5 * expected] = np.nan
        values[name] = mean
    return 0.5 * (edges[1:] + edges[:-1]), values


def _without_flat_tops(
    run: str, name: str, time: np.ndarray, values: np.ndarray, findings: list[QualityFinding]
) -> tuple[np.ndarray, np.ndarray]:
    """Blank all samples at an end of the range that is met far more often than the values beside it: clipped."""
    levels, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    if levels.size < 3 * _BESIDE:
        return time, values
    flat = np.zeros(values.size, dtype=bool)
    for end, beside in ((0, slice(1, 1 + _BESIDE)), (-1, slice(-1 - _BESIDE, -1))):
        usual = max(float(np.median(counts[beside])), float(counts[beside].mean()))
        if counts[end] > 4 and counts[end] > 12 * (usual - 1) + 4:
            flat |= values == levels[end]
    if not flat.any():
        return time, values
    stamps = time[flat]
    text = (
        f"{name} stands still at the end of its range: it is clipped, {counted(int(flat.sum()), 'sample')} "
        f"({100 * flat.mean():.2g} %), all of which are left out."
    )
    findings.append(QualityFinding("warning", text, run, name, (float(stamps[0]), float(stamps[-1]))))
    return time, np.where(flat, np.nan, values)


def _without_stuck(
    run: str, name: str, time: np.ndarray, values: np.ndarray, turns: _Turns, findings: list[QualityFinding]
) -> tuple[np.ndarray, np.ndarray]:
    """Blank what stands still while the channel moves otherwise: stuck at a value or clipped at an end."""
    finite = values[np.isfinite(values)]
    if finite.size < 8 or not np.ptp(finite) > 0:
        return time, values
    steps = np.abs(np.diff(np.unique(finite)))
    if float(np.median(steps)) > 0.02 * float(np.ptp(finite)):
        return time, values  # too coarse for a stuck value to be told
    same = np.flatnonzero(np.diff(values) != 0) + 1
    first, last = np.r_[0, same], np.r_[same, values.size] - 1
    duration = np.minimum(time[last], turns.end) - np.maximum(time[first], turns.start)
    stuck = (duration > _STUCK * turns.period) & (last - first >= 4)
    if not stuck.any():
        return time, values
    blanked = values.copy()
    for start, end in zip(first[stuck], last[stuck], strict=True):
        blanked[start : end + 1] = np.nan
    ends = np.isin(values[first[stuck]], [finite.min(), finite.max()]).all()
    what = "stands still at the end of its range: it is clipped" if ends else "stands still: it is stuck"
    total = float((time[last] - time[first])[stuck].sum())
    text = f"{name} {what} for {total:.3g} s in all, which is left out."
    span = (float(time[first[stuck]][0]), float(time[last[stuck]][-1]))
    findings.append(QualityFinding("warning", text, run, name, span))
    return time, blanked


def _without_wild(time: np.ndarray, values: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Blank single samples far from the line between their neighbours; return the channel and the stamps of those."""
    kept = np.flatnonzero(np.isfinite(values))
    none = np.zeros(0)
    if kept.size < 11:
        return (time, values), none
    t, x = time[kept], values[kept]
    bend = x[1:-1] - 0.5 * (x[:-2] + x[2:])
    bend[t[2:] - t[:-2] > 3.0 * float(np.median(np.diff(t)))] = 0.0  # a gap lies between
    spread = 1.4826 * float(np.median(np.abs(bend)))
    size = np.pad(np.abs(bend), 1)
    # The neighbours of a wild sample show half of it.
    far = size > max(12.0 * spread, 0.05 * float(np.ptp(np.quantile(x, [0.02, 0.98]))))
    far[1:-1] &= (size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:])
    if not far.any():
        return (time, values), none
    blanked = values.copy()
    blanked[kept[far]] = np.nan
    return (time, blanked), t[far]


def _told_wild(run: str, wild: dict[str, np.ndarray]) -> QualityFinding:
    """Say which channels have lone wild samples, and that they are left out."""
    told = listing((f"{name} ({counted(stamps.size, 'sample')})" for name, stamps in wild.items()), 12)
    every = np.concatenate(list(wild.values()))
    channel = next(iter(wild)) if len(wild) == 1 else None
    text = f"samples far from their neighbours on both sides are left out: {told}."
    return QualityFinding("note", text, run, channel, (float(every.min()), float(every.max())))
