"""Frequency of the roller passages in each window of 10 s, and whether the pump turns there (rap.md, 3.5).

Periodogram peak between 0.8 and 3.5 Hz, then least squares of mean, trend and three harmonics over the frequency. It
does not know flows; `harmonics` gives other channels at the frequencies found here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.rap.pulsation.harmonics import Harmonics, design, harmonics, modelled, solved
from pipeline.rigs.rap.pulsation.windows import Stack, Windows, cut, sampling_rate, stacks

BAND = (0.8, 3.5)
WINDOW = 10.0
_ORDERS = np.array([1.0, 2.0, 3.0])
# Of its standard error: a weaker line is no pulsation, the pump stands.
_LEAST_LINE = 6.0
# The search around the peak of the periodogram, as a share of it, and where it is exact enough.
_SEARCH = 0.08
_STEPS = 8
# A step below that share of the frequency's standard error is none.
_SETTLED = 0.02
# A frequency that changes by one of these factors, within that share, while the level does not, is another line of the same pump.
_JUMPS = (2.0, 3.0, 0.5, 1.0 / 3.0)
_NEAR = 0.05

TURNING, STOPPED, JUMP, UNSTEADY, LOST = "turning", "stopped", "jump", "unsteady", "lost"


@dataclass(frozen=True, eq=False)
class Passages:
    """What the windows hold.

    Attributes
    ----------
    harmonics
        Mean, trend, orders 1 to 3 of the channel in which the passages were looked for; all windows.
    frequency_error
        Standard error of the frequency for a white residual, Hz, shape (w,).
    state
        Per window, shape (w,): "turning"; "stopped" (line below 6 standard errors); "jump" (a sub-harmonic or a multiple was
        picked); "unsteady" (the pump starts, stops or changes its speed within); "lost" (too few samples).
    """

    harmonics: Harmonics
    frequency_error: np.ndarray
    state: np.ndarray

    @property
    def windows(self) -> Windows:
        """The windows."""
        return self.harmonics.windows

    @property
    def turning(self) -> np.ndarray:
        """Windows in which the pump turns steadily at a frequency that is known, mask of shape (w,)."""
        return np.asarray(self.state == TURNING)

    @property
    def frequency(self) -> np.ndarray:
        """Roller passages a second, Hz, shape (w,); NaN where the window is not turning."""
        return np.where(self.turning, self.harmonics.frequency, np.nan)

    @property
    def amplitude(self) -> np.ndarray:
        """A_1, amplitude of the passages' line, unit of the channel, shape (w,); NaN where the window is not turning."""
        return np.where(self.turning, self.harmonics.amplitude(1), np.nan)


def find_passages(
    time: np.ndarray,
    values: np.ndarray,
    windows: Windows | None = None,
    band: tuple[float, float] = BAND,
    refined: bool = True,
) -> Passages:
    """Find the roller passages in a pressure.

    Parameters
    ----------
    time, values
        The pressure (pre-filter for choice), s and Pa, shape (n,); 10 Hz or more.
    windows
        By default windows of 10 s side by side over the whole record.
    band
        Where the passages are looked for, Hz; its upper end is cut at 0.45 of the sampling rate.
    refined
        False leaves the frequency at the periodogram's peak: enough to tell whether the pump turns, in a fifth of the time.
    """
    if windows is None:
        windows = cut(float(time[0]), float(time[-1]), WINDOW) if time.size else Windows(np.empty(0), np.empty(0))
    frequency = np.full(windows.size, np.nan)
    error = np.full(windows.size, np.nan)
    if windows.size and time.size > 1 and 0.45 * sampling_rate(time) > band[0]:
        rate = sampling_rate(time)
        for stack in stacks(time, values, windows):
            coarse = _peak(stack, rate, (band[0], min(band[1], 0.45 * rate)))
            frequency[stack.rows] = coarse
            if refined:
                _refine(stack, coarse, rate, frequency[stack.rows], error[stack.rows])
    fitted = harmonics(time, values, windows, frequency)
    state = np.full(windows.size, TURNING, dtype=object)
    line, noise = fitted.amplitude(1), fitted.amplitude_error(1)
    state[~np.isfinite(line)] = LOST
    state[np.isfinite(line) & ~(line > _LEAST_LINE * noise)] = STOPPED
    found = Passages(fitted, error, state)
    return _without_jumps(_without_unsteady(found))


def _peak(stack: Stack, rate: float, band: tuple[float, float]) -> np.ndarray:
    """Return where the periodogram of each window peaks within the band, Hz, shape (w,); NaN for windows without samples."""
    trend = np.stack([np.ones_like(stack.offset), stack.offset], axis=1) * stack.weight[:, None]
    solution, _, _ = solved(stack, trend)
    flat = (stack.values - modelled(solution, trend)) * stack.weight
    slots = np.rint((stack.offset - stack.offset.min()) * rate).astype(int)
    size = 1 << int(np.ceil(np.log2(8 * (slots.max() + 1))))
    grid = np.zeros((stack.offset.shape[0], slots.max() + 1))
    rows = np.broadcast_to(np.arange(grid.shape[0])[:, None], slots.shape)
    inside = stack.weight > 0
    grid[rows[inside], slots[inside]] = flat[inside]
    lines = np.fft.rfftfreq(size, 1.0 / rate)
    within = np.flatnonzero((lines >= band[0]) & (lines <= band[1]))
    power = np.abs(np.fft.rfft(grid, size, axis=1)[:, within])
    return np.where(stack.weight.sum(axis=1) > 8, lines[within[power.argmax(axis=1)]], np.nan)


def _refine(stack: Stack, coarse: np.ndarray, rate: float, frequency: np.ndarray, error: np.ndarray) -> None:
    """Fill in frequency and error (views, Hz, shape (w,)), with as many of the three orders as the sampling rate lets see."""
    seen = np.clip(np.nan_to_num(0.47 * rate / (1.0 + _SEARCH) / coarse, nan=1.0).astype(int), 1, _ORDERS.size)
    for count in np.unique(seen[np.isfinite(coarse)]):
        at = np.flatnonzero(np.isfinite(coarse) & (seen == count))
        part = Stack(stack.rows, stack.offset[at], stack.values[at], stack.weight[at])
        frequency[at], error[at] = _refined(part, coarse[at], _ORDERS[:count])


def _refined(stack: Stack, coarse: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequency of least residual within 8 % of `coarse` and its standard error, Hz, shape (w,) each.

    Gauss-Newton on the frequency with the linear part projected out; a step that does not help is shortened. Windows that
    stand still leave the iteration.
    """
    best, error = coarse.copy(), np.full(coarse.shape, np.nan)
    least = np.full(coarse.shape, np.inf)
    trial, step = coarse.copy(), np.zeros_like(coarse)
    left = np.arange(coarse.size)
    for _ in range(_STEPS):
        part = Stack(stack.rows, stack.offset[left], stack.values[left], stack.weight[left])
        columns = design(part, trial[left], orders)
        solution, inverse, sigma = solved(part, columns)
        gradient, curvature = _slope(part, columns, solution, inverse, orders)
        better = sigma <= least[left]
        gained = left[better]
        best[gained], least[gained] = trial[gained], sigma[better]
        error[gained] = sigma[better] / np.sqrt(curvature[better])
        proposed = best[left] + np.where(better, gradient / curvature, 0.25 * step[left])
        trial[left] = np.clip(proposed, coarse[left] * (1.0 - _SEARCH), coarse[left] * (1.0 + _SEARCH))
        step[left] = trial[left] - best[left]
        left = left[np.abs(step[left]) > _SETTLED * np.maximum(error[left], 1e-9)]
        if not left.size:
            break
    return best, error


def _slope(
    stack: Stack, columns: np.ndarray, solution: np.ndarray, inverse: np.ndarray, orders: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual's projection on the change with frequency, and that change's square, shape (w,) each."""
    turning = 2.0 * np.pi * np.repeat(orders, 2)
    # d/df of a cos - b sin is the same pair turned by a quarter: -(b cos + a sin) 2 pi k t, written with the columns at hand.
    swapped = np.empty_like(solution[:, 2:])
    swapped[:, 0::2], swapped[:, 1::2] = -solution[:, 3::2], solution[:, 2::2]
    change = modelled(swapped * turning, columns[:, 2:]) * stack.offset
    change = change - modelled((inverse @ (columns @ change[..., None]))[..., 0], columns)
    residual = (stack.values - modelled(solution, columns)) * stack.weight
    curvature = np.maximum((change**2).sum(axis=1), 1e-300)
    return (change * residual).sum(axis=1), curvature


def _without_unsteady(found: Passages) -> Passages:
    """Mark windows whose residual is far above that of the others, relative to the line: the pump changes within."""
    turning = found.turning
    if turning.sum() < 3:
        return found
    ratio = found.harmonics.sigma / np.maximum(found.harmonics.amplitude(1), 1e-300)
    usual = float(np.median(ratio[turning]))
    state = found.state.copy()
    state[turning & (ratio > max(3.0 * usual, 0.25))] = UNSTEADY
    return replace(found, state=state)


def _without_jumps(found: Passages) -> Passages:
    """Mark the shorter side where the frequency jumps by 2, 3, 1/2 or 1/3 while the level stays: not the pump's doing."""
    at = np.flatnonzero(found.turning)
    if at.size < 2:
        return found
    f, level = found.harmonics.frequency[at], found.harmonics.mean[at]
    groups = np.zeros(at.size, dtype=int)
    suspicious = []
    for i in range(1, at.size):
        ratio = f[i] / f[i - 1]
        jumps = any(abs(ratio / factor - 1.0) < _NEAR for factor in _JUMPS)
        stays = abs(level[i] - level[i - 1]) < 0.2 * max(abs(level[i]), abs(level[i - 1]))
        groups[i] = groups[i - 1] + (jumps and stays)
        if jumps and stays:
            suspicious.append(groups[i])
    state = found.state.copy()
    sizes = np.bincount(groups)
    while suspicious:
        border = suspicious.pop()
        side = border if sizes[border] <= sizes[border - 1] else border - 1
        state[at[groups == side]] = JUMP
    return replace(found, state=state)
