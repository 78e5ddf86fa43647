"""Harmonics of both clocks' channels over the same strokes, the pump's phase followed within each window (rap.md, 5.1 b).

A pump's speed wanders by half a per cent: over 15 s a line of fixed frequency loses its fourth harmonic. The phase is a
polynomial in each window, fitted to the bench; device and bench are compared on it, so that it cancels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.pulsation.passages import find_passages
from pipeline.rigs.rap.pulsation.windows import Stack, Windows, stacks

ORDERS = (1, 2, 3, 4)
# Degree of the level and of the phase within a window; Gauss-Newton steps of the phase.
_LEVEL, _PHASE, _STEPS = 3, 6, 4
# Lines above this share of the sampling rate are not looked at.
_HIGHEST = 0.47
# A window that has lost more of its samples is left out.
_FILLED = 0.8


@dataclass(frozen=True, eq=False)
class Strokes:
    """The pump's phase in each of w windows: `frequency` (Hz) at its middle, polynomial `phase` (rad), `turning` (w,)."""

    windows: Windows
    frequency: np.ndarray
    phase: np.ndarray
    turning: np.ndarray

    def angle(self, rows: slice, offset: np.ndarray) -> np.ndarray:
        """Return the phase (rad, shape (w, n)) of the windows in `rows` at times `offset` (s) from their centres."""
        half = 0.5 * (self.windows.end - self.windows.start)[rows, None]
        steady = 2.0 * np.pi * np.nan_to_num(self.frequency[rows, None]) * offset
        return np.asarray(steady + _sum(self.phase[rows], offset / half))


@dataclass(frozen=True, eq=False)
class Lines:
    """Complex amplitudes (w, k) of a channel on the pump's phase, standard error of Re and of Im, residual (w,), level (w,)."""

    amplitude: np.ndarray
    error: np.ndarray
    sigma: np.ndarray
    level: np.ndarray


def follow(time: np.ndarray, values: np.ndarray, windows: Windows) -> Strokes:
    """Follow the pump's phase in each window by a channel with strong pulsation.

    Parameters
    ----------
    time, values
        Pre-filter pressure of the bench for choice, s and Pa, shape (n,).
    windows
        On the same clock, some ten seconds each.
    """
    passages = find_passages(time, values, windows)
    frequency = passages.frequency
    strokes = Strokes(windows, frequency, np.zeros((windows.size, _PHASE)), passages.turning.copy())
    rate = 1.0 / float(np.median(np.diff(time)))
    for stack in stacks(time, values, windows):
        use = strokes.turning[stack.rows]
        if use.any():
            _follow_stack(stack, rate, use, strokes)
    return strokes


def lines(time: np.ndarray, values: np.ndarray, strokes: Strokes) -> Lines:
    """Return the harmonics 1 to 4 of a channel on the pump's phase; NaN where a line or a window cannot be used.

    `time` (n,) is on the clock of the strokes' windows.
    """
    w, k = strokes.windows.size, len(ORDERS)
    found = Lines(np.full((w, k), np.nan + 0j), np.full((w, k), np.nan), np.full(w, np.nan), np.full(w, np.nan))
    rate = 1.0 / float(np.median(np.diff(time)))
    orders = np.array(ORDERS, dtype=float)
    length = strokes.windows.end - strokes.windows.start
    for stack in stacks(time, values, strokes.windows):
        rows = np.arange(w)[stack.rows]
        enough = strokes.turning[rows] & (stack.weight.sum(axis=1) >= _FILLED * rate * length[rows])
        below = orders * strokes.frequency[rows][:, None] < _HIGHEST * rate
        angle = strokes.angle(stack.rows, stack.offset)
        for count in np.unique(below[enough].sum(axis=1)):
            same = np.flatnonzero(enough & (below.sum(axis=1) == count))
            if not count or not same.size:
                continue
            part = Stack(stack.rows, stack.offset[same], stack.values[same], stack.weight[same])
            columns = _columns(part, angle[same], orders[:count], length[rows[same]])
            solution, inverse, sigma = _solved(part, columns)
            real = _LEVEL + 1 + 2 * np.arange(count)
            at = np.ix_(rows[same], np.arange(count))
            found.amplitude[at] = solution[:, real] + 1j * solution[:, real + 1]
            variance = 0.5 * (inverse[:, real, real] + inverse[:, real + 1, real + 1])
            found.error[at] = sigma[:, None] * np.sqrt(variance)
            found.sigma[rows[same]], found.level[rows[same]] = sigma, solution[:, 0]
    return found


def _follow_stack(stack: Stack, rate: float, use: np.ndarray, strokes: Strokes) -> None:
    rows = np.arange(strokes.windows.size)[stack.rows][use]
    part = Stack(stack.rows, stack.offset[use], stack.values[use], stack.weight[use])
    length = (strokes.windows.end - strokes.windows.start)[rows]
    frequency = strokes.frequency[rows]
    orders = np.array([k for k in ORDERS if k * float(frequency.max()) < _HIGHEST * rate] or [1], dtype=float)
    scaled = part.offset / (0.5 * length[:, None])
    steady = 2.0 * np.pi * frequency[:, None] * part.offset
    phase = np.zeros((rows.size, _PHASE))
    least = np.full(rows.size, np.inf)
    best = phase.copy()
    for _ in range(_STEPS + 1):
        angle = steady + _sum(phase, scaled)
        columns = _columns(part, angle, orders, length)
        solution, _, sigma = _solved(part, columns)
        better = sigma < least
        best[better], least[better] = phase[better], sigma[better]
        real = solution[:, _LEVEL + 1 :: 2, None]
        imaginary = solution[:, _LEVEL + 2 :: 2, None]
        turned = orders[:, None, None] * angle
        slope = -(
            orders[:, None, None]
            * (np.moveaxis(real, 1, 0) * np.sin(turned) + np.moveaxis(imaginary, 1, 0) * np.cos(turned))
        ).sum(axis=0)
        bends = np.stack([slope * p for p in _polynomials(scaled)], axis=-1) * part.weight[..., None]
        step = _solved(part, np.concatenate([columns, bends], axis=-1))[0][:, columns.shape[2] :]
        phase = phase + np.clip(step, -0.5, 0.5)
    strokes.phase[rows] = best


def _columns(stack: Stack, angle: np.ndarray, orders: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Return level polynomial, then cos and -sin of each order, shape (w, n, p)."""
    scaled = stack.offset / (0.5 * length[:, None])
    out = np.empty((*angle.shape, _LEVEL + 1 + 2 * orders.size))
    for degree in range(_LEVEL + 1):
        out[..., degree] = scaled**degree
    turn = np.exp(1j * angle)
    power = np.ones_like(turn)
    for i in range(orders.size):
        power = power * turn
        out[..., _LEVEL + 1 + 2 * i] = power.real
        out[..., _LEVEL + 2 + 2 * i] = -power.imag
    out *= stack.weight[..., None]
    return out


def _polynomials(scaled: np.ndarray) -> list[np.ndarray]:
    """Return the Legendre polynomials of degree 1 to `_PHASE` at -1..1."""
    before, now = np.ones_like(scaled), scaled
    found = [now]
    for n in range(1, _PHASE):
        before, now = now, ((2 * n + 1) * scaled * now - n * before) / (n + 1)
        found.append(now)
    return found


def _sum(coefficients: np.ndarray, scaled: np.ndarray) -> np.ndarray:
    return np.asarray(sum(coefficients[:, i, None] * p for i, p in enumerate(_polynomials(scaled))))


def _solved(stack: Stack, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coefficients (w, p), inverse normal matrices (w, p, p), residual standard deviations (w,)."""
    weight = stack.weight.sum(axis=1)
    level = stack.values.sum(axis=1) / np.maximum(weight, 1.0)
    y = (stack.values - level[:, None]) * stack.weight
    across = columns.transpose(0, 2, 1)
    normal = across @ columns
    size = np.sqrt(np.maximum(np.einsum("wpp->wp", normal), 1e-300))
    inverse = np.linalg.pinv(normal / size[:, :, None] / size[:, None, :], hermitian=True)
    inverse = inverse / size[:, :, None] / size[:, None, :]
    solution = (inverse @ (across @ y[..., None]))[..., 0]
    residual = y - (columns @ solution[..., None])[..., 0]
    sigma = np.sqrt((residual**2).sum(axis=1) / np.maximum(weight - columns.shape[2], 1.0))
    solution[:, 0] += level
    return solution, inverse, sigma
