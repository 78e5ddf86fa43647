"""Where the strongest line of a record lies: a coarse search over all frequencies.

Stamps may jitter and have gaps. The result is good to a fraction of 1/T; `pipeline.estimation.harmonic`
refines it and gives its error. Not a power spectral density.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from pipeline.errors import InputError

# Cells of the grid that the samples are put on; beyond it the highest frequencies are given up.
_MOST_CELLS = 1 << 22


def block_means(time: np.ndarray, values: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Average `size` samples each; blocks that span a gap, and an incomplete last one, are dropped.

    Returns the mean stamps and mean values, shape (n // size or fewer,); the input for `size` < 2.
    """
    count = time.size // max(size, 1)
    if size < 2 or count < 2:
        return time, values
    blocks = time[: count * size].reshape(count, size)
    extent = blocks[:, -1] - blocks[:, 0]
    whole = extent <= 1.5 * np.median(extent)
    return blocks.mean(axis=1)[whole], values[: count * size].reshape(count, size).mean(axis=1)[whole]


def strongest_line(time: np.ndarray, values: np.ndarray, band: tuple[float, float] | None = None) -> float:
    """Return the frequency (Hz) of the strongest line, to about a tenth of 1/T.

    Parameters
    ----------
    time, values
        Stamps (s, increasing) and finite samples, shape (n,).
    band
        Lowest and highest frequency to consider, Hz; by default from 0.7/T to half the rate.

    Raises
    ------
    InputError
        If nothing moves apart from a straight drift, or there is no time between the samples.

    Notes
    -----
    Fewer than eight cycles: least squares of [1, t, cos, sin] at each frequency, so that the drift
    cannot be taken for the line. Above: periodogram of the detrended samples put on a grid, gaps
    empty. A wander of less than two cycles gives way to a line that makes up half of what it leaves.
    """
    duration = float(time[-1] - time[0]) if time.size > 1 else 0.0
    if not duration > 0:
        raise InputError("the samples have no duration, so they have no frequency.")
    scaled = (time - time[0]) / duration
    x = values - Polynomial.fit(scaled, values, 1)(scaled)
    if not np.ptp(x) > 1e-12 * np.ptp(values):
        raise InputError("the signal does not move (apart from a straight drift), so it has no frequency.")
    low, high = band or (0.7 / duration, np.inf)
    limits = (low * duration, high * duration)
    cycles, power, left = _strongest(scaled, x, *limits)
    if cycles < 2 and limits[1] > 4:
        line, line_power, _ = _strongest(scaled, left, max(limits[0], 4.0), limits[1])
        if line_power > max(0.5 * (left @ left), 0.03 * power):
            cycles = line
    return cycles / duration


def _strongest(scaled: np.ndarray, x: np.ndarray, low: float, high: float) -> tuple[float, float, np.ndarray]:
    """Return the cycles of the strongest line, the sum of squares it explains, and what is left of x."""
    few, power_few = _few_cycles(scaled, x, low, min(high, 8.0))
    many, power_many = _many_cycles(scaled, x, max(low, 8.0), high)
    cycles, power = np.r_[few, many], np.r_[power_few, power_many]
    if not cycles.size:
        raise InputError(f"no frequency between {low:.3g} and {high:.3g} cycles a record can be told from this log.")
    best = int(np.argmax(power))
    return float(cycles[best]), float(power[best]), _without(scaled, x, cycles[best])


def _without(t: np.ndarray, x: np.ndarray, cycles: float) -> np.ndarray:
    """Return x less its least-squares fit of [1, t, cos, sin]."""
    columns = np.c_[np.ones(t.size), t, np.cos(2 * np.pi * cycles * t), np.sin(2 * np.pi * cycles * t)]
    gram = columns.T @ columns
    return np.asarray(x - columns @ np.linalg.lstsq(gram, columns.T @ x, rcond=None)[0])


def _few_cycles(scaled: np.ndarray, x: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return cycles a record and the sum of squares that [1, t, cos, sin] explains."""
    t, x = block_means(scaled, x, scaled.size // 1024)
    cycles = np.arange(low, high, 0.1)
    angle = 2 * np.pi * cycles[:, None] * t
    columns = np.stack([np.ones_like(angle), np.broadcast_to(t, angle.shape), np.cos(angle), np.sin(angle)], axis=1)
    products = columns @ x
    # A trace of damping: at a fraction of a cycle the columns are nearly dependent.
    gram = columns @ columns.transpose(0, 2, 1) + 1e-9 * t.size * np.eye(4)
    power = (products * np.linalg.solve(gram, products[..., None])[..., 0]).sum(axis=1)
    scale = scaled.size / t.size  # a block mean stands for this many samples
    return cycles, scale * power


def _many_cycles(scaled: np.ndarray, x: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return cycles a record and the sum of squares that a sine explains, by FFT on a grid."""
    step = max(float(np.median(np.diff(scaled))), 1 / _MOST_CELLS)
    cells = np.bincount(np.rint(scaled / step).astype(np.int64), weights=x)
    size = 1 << int(np.ceil(np.log2(4 * cells.size)))
    cycles = np.arange(size // 2 + 1) / (size * step)
    wanted = slice(int(np.searchsorted(cycles, low)), int(np.searchsorted(cycles, high, side="right")))
    power = 2 * np.abs(np.fft.rfft(cells, size)[wanted]) ** 2 / x.size
    return cycles[wanted], power
