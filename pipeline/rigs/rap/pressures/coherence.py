"""Coherence and gain of device over bench at the pump's lines, with the threshold of chance (rap.md, 5.2).

Between the lines there is noise alone: nothing is read there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate
from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.pulsation.passages import Passages
from pipeline.signals.spectra import Spectra, welch

HARMONICS = (1, 2, 3, 4, 5)
# One segment, s: 256 samples at 20 Hz.
_SEGMENT = 12.8


@dataclass(frozen=True)
class Line:
    """One line: `harmonic` of the strokes, where it shows (`frequency`, Hz; folded where it lies above half the sampling rate).

    `coherence` is an Estimate; `gain` |H| and `phase` (rad) of device over bench there.
    """

    harmonic: int
    frequency: float
    folded: bool
    coherence: Estimate
    significant: bool
    gain: float
    phase: float


@dataclass(frozen=True, eq=False)
class AtSetPoint:
    """One tap at one set-point: lines, threshold of chance at 95 %, median coherence between the lines, whole spectra.

    `flow_set` (m^3/s) is None where set-points are not logged; `strokes` is the frequency of the passages, Hz.
    """

    name: str
    flow_set: float | None
    strokes: float
    lines: tuple[Line, ...]
    threshold: float
    between: float
    spectra: Spectra


def coherence_at_lines(one: Aligned, levels: Sequence[Level], passages: Passages) -> tuple[AtSetPoint, ...]:
    """Return the coherence of one tap at the pump's lines, set-point by set-point (or level by level where none is logged).

    Parameters
    ----------
    one
        Device and bench side by side.
    levels
        Steady stretches of the run.
    passages
        Frequency of the strokes in windows on the bench's clock.
    """
    groups: dict[float | int, list[Level]] = {}
    for i, level in enumerate(level for level in levels if level.turning and level.steady):
        groups.setdefault(i if level.flow_set is None else level.flow_set, []).append(level)
    found = [_at(one, group, passages) for group in groups.values()]
    return tuple(one for one in found if one is not None)


def _at(one: Aligned, group: Sequence[Level], passages: Passages) -> AtSetPoint | None:
    inside = np.zeros(one.time.size, dtype=bool)
    mine = np.zeros(passages.windows.size, dtype=bool)
    for level in group:
        inside |= (one.time >= level.start) & (one.time <= level.end)
        mine |= (passages.windows.centre >= level.start) & (passages.windows.centre <= level.end)
    strokes = passages.frequency[mine & passages.turning]
    if not strokes.size:
        return None
    used = inside & one.good
    x, y = np.where(used, one.plain, np.nan), np.where(used, one.device, np.nan)
    try:
        spectra = welch(x, y, one.rate, 2 * round(0.5 * _SEGMENT * one.rate))
    except InputError:
        return None
    if spectra.averages <= 2.0:
        return None
    frequency = float(np.median(strokes))
    lines, shown = [], np.zeros(spectra.frequency.size, dtype=bool)
    for k in HARMONICS:
        at, folded = _folded(k * frequency, one.rate)
        # A line is as wide as the window's and what the speed scatters.
        width = 1.5 / _SEGMENT + k * float(np.std(strokes))
        near = np.abs(spectra.frequency - at) <= width
        shown |= np.abs(spectra.frequency - at) <= 2.0 / _SEGMENT + 2.0 * k * float(np.std(strokes))
        if near.any():
            best = int(np.flatnonzero(near)[np.argmax((spectra.pxx * spectra.pyy)[near])])
            lines.append(_line(one.name, group[0].flow_set, k, folded, spectra, best, _scatter(x, y, spectra, best)))
    for k in range(1, 31):
        at, _ = _folded(k * frequency / 3.0, one.rate)
        shown |= np.abs(spectra.frequency - at) <= 2.0 / _SEGMENT
    free = ~shown & (spectra.frequency > 0.3)
    between = float(np.nanmedian(spectra.coherence[free])) if free.any() else float("nan")
    return AtSetPoint(
        one.name, group[0].flow_set, frequency, tuple(lines), spectra.coherence_threshold(), between, spectra
    )


def _scatter(x: np.ndarray, y: np.ndarray, spectra: Spectra, best: int) -> tuple[float, float]:
    """Return the standard error of atanh of the modulus of coherency at a bin, and its degrees of freedom.

    Pairs of segments are left out one after the other: a line of the pump is no Gaussian noise, for which the textbook's
    error holds.
    """
    size = 2 * (spectra.frequency.size - 1)
    hann = np.hanning(size + 1)[:-1]
    turn = hann * np.exp(-2j * np.pi * best * np.arange(size) / size)
    both = [np.lib.stride_tricks.sliding_window_view(one, size)[:: size // 2] for one in (x, y)]
    whole = np.isfinite(both[0]).all(axis=1) & np.isfinite(both[1]).all(axis=1)
    X, Y = ((one[whole] - one[whole].mean(axis=1, keepdims=True)) @ turn for one in both)
    pairs = np.arange(X.size) // 2
    count = int(pairs[-1]) + 1
    if count < 3:
        return 1.0 / math.sqrt(2.0 * spectra.averages), math.inf
    products = (np.abs(X) ** 2, np.abs(Y) ** 2, (np.conj(X) * Y).real, (np.conj(X) * Y).imag)
    xx, yy, real, imaginary = (one.sum() - np.bincount(pairs, one) for one in products)
    size_of = np.arctanh(np.minimum(np.hypot(real, imaginary) / np.sqrt(xx * yy), 1.0 - 1e-12))
    return float(np.sqrt((count - 1.0) / count * ((size_of - size_of.mean()) ** 2).sum())), count - 1.0


def _line(
    name: str, flow_set: float | None, k: int, folded: bool, spectra: Spectra, best: int, scatter: tuple[float, float]
) -> Line:
    value = float(spectra.coherence[best])
    size = math.atanh(min(math.sqrt(max(value, 0.0)), 1.0 - 1e-12))
    sd, dof = scatter
    significant = value > spectra.coherence_threshold()
    half = t_quantile(dof) * sd
    interval = (math.tanh(max(size - half, 0.0)) ** 2 if significant else 0.0, math.tanh(size + half) ** 2)
    # The distribution is skew: the error is that which the interval spans.
    error = 0.5 * (interval[1] - interval[0]) / t_quantile(dof)
    where: dict[str, float | str | bool] = {"channel": name, "harmonic": float(k)}
    if flow_set is not None:
        where["flow_set"] = flow_set
    remark = "" if significant else f"not above what chance gives ({spectra.coherence_threshold():.2f})"
    if folded:
        remark = "; ".join(
            filter(None, (remark, "the line lies above half the sampling rate and is read where it folds to"))
        )
    transfer = spectra.pxy[best] / spectra.pxx[best]
    found = Estimate("coherence", value, error, interval, where, remark, dof)
    return Line(
        k,
        float(spectra.frequency[best]),
        folded,
        found,
        significant,
        float(np.abs(transfer)),
        float(np.angle(transfer)),
    )


def _folded(frequency: float, rate: float) -> tuple[float, bool]:
    """Return where a line shows at a sampling rate (Hz), and whether it was folded."""
    folds = frequency % rate
    return (rate - folds if folds > 0.5 * rate else folds), frequency > 0.5 * rate
