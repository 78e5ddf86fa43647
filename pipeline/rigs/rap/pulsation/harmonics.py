"""Mean, trend and harmonics of a channel in each window, by least squares at the exact stamps (rap.md, 3.5 and 5.1).

The frequency is given window by window; `passages` finds it. Gaps and jitter only cost their samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.pulsation.windows import Stack, Windows, sampling_rate, stacks

# A window that has lost more of its samples than that is left out; so is a line above that share of the sampling rate.
_LEAST_FILLED = 0.6
_HIGHEST = 0.47
# Keeps windows whose samples do not tell the columns apart from stopping the others, relative.
_RIDGE = 1e-13


@dataclass(frozen=True, eq=False)
class Harmonics:
    """x(t) = mean + slope (t - c) + Re sum_k X_k exp(j 2 pi k f (t - c)) in each window, c its centre.

    Attributes
    ----------
    windows
        The w windows.
    frequency
        f, Hz, shape (w,).
    orders
        k, shape (k,).
    coefficients
        X_k, complex, in the unit of the channel, shape (w, k); NaN where a window has too few samples, no frequency, or the
        line lies above half the sampling rate.
    errors
        Standard error of the real and of the imaginary part of X_k for a white residual, shape (w, k).
    mean, slope
        Level at the centre (unit) and its trend (unit/s), shape (w,).
    mean_error
        Standard error of `mean` for a white residual, shape (w,).
    sigma
        Standard deviation of the residual, shape (w,).
    count
        Samples used, shape (w,).
    """

    windows: Windows
    frequency: np.ndarray
    orders: np.ndarray
    coefficients: np.ndarray
    errors: np.ndarray
    mean: np.ndarray
    mean_error: np.ndarray
    slope: np.ndarray
    sigma: np.ndarray
    count: np.ndarray

    def amplitude(self, order: int = 1) -> np.ndarray:
        """Return |X_k| of one order, shape (w,)."""
        return np.asarray(np.abs(self.coefficients[:, np.flatnonzero(self.orders == order)[0]]))

    def amplitude_error(self, order: int = 1) -> np.ndarray:
        """Return the standard error of |X_k| for a white residual, shape (w,)."""
        return np.asarray(self.errors[:, np.flatnonzero(self.orders == order)[0]])


def harmonics(
    time: np.ndarray, values: np.ndarray, windows: Windows, frequency: np.ndarray, orders: Sequence[float] = (1, 2, 3)
) -> Harmonics:
    """Fit mean, trend and harmonics of a channel in every window.

    Parameters
    ----------
    time, values
        A channel on its own clock, s and its unit, shape (n,), time increasing.
    windows
        On the clock of `time`, w of them.
    frequency
        Hz, shape (w,); NaN leaves the window out.
    orders
        Multiples of the frequency; fractions are sub-harmonics.
    """
    wanted = np.asarray(orders, dtype=float)
    w, k = windows.size, wanted.size
    found = Harmonics(
        windows=windows,
        frequency=np.asarray(frequency, dtype=float),
        orders=wanted,
        coefficients=np.full((w, k), np.nan + 0j),
        errors=np.full((w, k), np.nan),
        mean=np.full(w, np.nan),
        mean_error=np.full(w, np.nan),
        slope=np.full(w, np.nan),
        sigma=np.full(w, np.nan),
        count=np.zeros(w, dtype=int),
    )
    if not w or not time.size:
        return found
    rate = sampling_rate(time) if time.size > 1 else 1.0
    for stack in stacks(time, values, windows):
        _fit_stack(stack, rate, found)
    return found


def _fit_stack(stack: Stack, rate: float, found: Harmonics) -> None:
    """Fit the windows of one stack; orders above the sampling limit are left out window by window."""
    frequency = found.frequency[stack.rows]
    count = stack.weight.sum(axis=1)
    length = (found.windows.end - found.windows.start)[stack.rows]
    found.count[stack.rows] = count
    usable = np.isfinite(frequency) & (count >= _LEAST_FILLED * rate * length)
    fitting = (found.orders * frequency[:, None] < _HIGHEST * rate) & usable[:, None]
    at = np.arange(found.windows.size)[stack.rows]
    for pattern in np.unique(fitting[usable], axis=0):
        same = np.flatnonzero(usable & (fitting == pattern).all(axis=1) & (count > 4 + 2 * pattern.sum()))
        if not same.size:
            continue
        chosen = np.flatnonzero(pattern)
        part = Stack(stack.rows, stack.offset[same], stack.values[same], stack.weight[same])
        solution, inverse, sigma = solved(part, design(part, frequency[same], found.orders[chosen]))
        rows = at[same]
        found.mean[rows], found.slope[rows], found.sigma[rows] = solution[:, 0], solution[:, 1], sigma
        found.mean_error[rows] = sigma * np.sqrt(inverse[:, 0, 0])
        real, imaginary = 2 + 2 * np.arange(chosen.size), 3 + 2 * np.arange(chosen.size)
        found.coefficients[np.ix_(rows, chosen)] = solution[:, real] + 1j * solution[:, imaginary]
        variance = 0.5 * (inverse[:, real, real] + inverse[:, imaginary, imaginary])
        found.errors[np.ix_(rows, chosen)] = sigma[:, None] * np.sqrt(variance)


def design(stack: Stack, frequency: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """Return 1, t, cos and -sin of each order for every window, shape (w, 2 + 2 k, n): weight 0 where there is no sample."""
    columns = np.empty((stack.offset.shape[0], 2 + 2 * orders.size, stack.offset.shape[1]))
    columns[:, 0] = 1.0
    columns[:, 1] = stack.offset
    angle = 2.0 * np.pi * frequency[:, None] * stack.offset
    first = np.exp(-1j * angle)
    turned = first
    for i, order in enumerate(orders):
        if order == 1:
            turned = first
        elif i and order == orders[i - 1] + 1:
            turned = turned * first
        else:
            turned = np.exp(-1j * order * angle)
        columns[:, 2 + 2 * i], columns[:, 3 + 2 * i] = turned.real, turned.imag
    columns *= stack.weight[:, None]
    return columns


def solved(stack: Stack, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coefficients (w, p), inverse normal matrices (w, p, p) and residual standard deviations (w,) for `columns` (w, p, n)."""
    level = stack.values.sum(axis=1) / np.maximum(stack.weight.sum(axis=1), 1.0)
    y = (stack.values - level[:, None]) * stack.weight
    normal = columns @ columns.transpose(0, 2, 1)
    size = np.sqrt(np.maximum(np.einsum("wpp->wp", normal), 1e-300))
    scaled = normal / size[:, :, None] / size[:, None, :] + _RIDGE * np.eye(normal.shape[1])
    inverse = np.linalg.inv(scaled) / size[:, :, None] / size[:, None, :]
    solution = (inverse @ (columns @ y[..., None]))[..., 0]
    residual = y - modelled(solution, columns)
    dof = np.maximum(stack.weight.sum(axis=1) - columns.shape[1], 1.0)
    solution[:, 0] += level
    return solution, inverse, np.sqrt((residual**2).sum(axis=1) / dof)


def modelled(solution: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return coefficients (w, p) times columns (w, p, n), shape (w, n)."""
    return np.asarray((solution[:, None, :] @ columns)[:, 0])
