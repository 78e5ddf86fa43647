"""Zero-phase smoothing and slopes of logged signals, gaps and jitter included.

Nothing is shifted in time and nothing is filled: samples that are NaN stay NaN, and long gaps
separate stretches that know nothing of each other. Not for real time.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.errors import InputError
from pipeline.signals.resampling import interpolated, stretches

# Stamps that stray less than this share of a step from a uniform grid count as uniform.
_JITTER = 0.02


def low_pass(time: np.ndarray, values: np.ndarray, cutoff: float, order: int = 4) -> np.ndarray:
    """Low-pass without phase shift: Butterworth forwards and backwards.

    Parameters
    ----------
    time, values
        Stamps (s, increasing) and samples, shape (n,).
    cutoff
        Where the amplitude has fallen to 0.707 after both passes, Hz. From 0.45 of the sampling
        rate on there is nothing to take away, and the values come back as they are.
    order
        Of one pass; the two together fall by 2 x 6 x `order` dB an octave.

    Returns
    -------
    Smoothed samples at the same stamps, shape (n,), NaN where they were. Dropouts shorter than a
    quarter period of the cutoff are bridged, longer ones part the record. Ends are extended by
    reflection about a local straight line, so that a single noisy end sample does not bend them.

    Raises
    ------
    InputError
        If the cutoff is not positive.

    Examples
    --------
    >>> t = np.arange(0, 2, 1e-3)
    >>> slow, fast = np.sin(2 * np.pi * 2 * t), np.sin(2 * np.pi * 200 * t)
    >>> bool(np.abs(low_pass(t, slow + fast, 20.0) - slow)[100:-100].max() < 1e-3)
    True
    """
    if not cutoff > 0:
        raise InputError(f"a low-pass needs a cutoff above 0 Hz, not {cutoff:g} Hz.")

    def smooth(samples: np.ndarray, rate: float) -> np.ndarray:
        from scipy.signal import butter, sosfiltfilt

        # Two passes halve the power twice; this design frequency puts the 0.707 back on the cutoff.
        design = cutoff / (math.sqrt(2) - 1) ** (1 / (2 * order))
        if cutoff >= 0.45 * rate or samples.size < 4:
            return samples
        sections = butter(order, min(design, 0.49 * rate), fs=rate, output="sos")
        length = min(samples.size - 1, math.ceil(2 * rate / cutoff))
        extended = _extended(samples, length, max(2, round(0.2 * rate / cutoff)))
        return np.asarray(sosfiltfilt(sections, extended, padtype=None)[length : length + samples.size])

    return _stretch_by_stretch(time, values, smooth, 0.25 / cutoff)


def slope(time: np.ndarray, values: np.ndarray, window: float, degree: int = 3) -> np.ndarray:
    """Return the time derivative by local polynomials (Savitzky and Golay 1964), same shape.

    Parameters
    ----------
    time, values
        Stamps (s, increasing) and samples, shape (n,).
    window
        Width of the local fit, s; it is rounded to an odd number of samples above `degree`. A window
        of a sixth of the shortest period costs less than 1 % of the slope with degree 3.
    degree
        Of the polynomials.

    Returns
    -------
    Slope in the unit of the values per second, NaN where the value was NaN, or a stretch between
    gaps is shorter than the window.

    Examples
    --------
    >>> t = np.arange(0, 1, 0.01)
    >>> bool(np.allclose(slope(t, t**3, 0.1), 3 * t**2))
    True
    """

    def differentiate(samples: np.ndarray, rate: float) -> np.ndarray:
        from scipy.signal import savgol_filter

        points = max(2 * round((window * rate - 1) / 2) + 1, degree + 1 + degree % 2)
        if samples.size < points:
            return np.full(samples.size, np.nan)
        return np.asarray(savgol_filter(samples, points, degree, deriv=1, delta=1 / rate, mode="interp"))

    return _stretch_by_stretch(time, values, differentiate, 0.25 * window)


def _extended(samples: np.ndarray, length: int, local: int) -> np.ndarray:
    """Reflect both ends about the value and slope that a straight line through the last few has."""

    def beyond(reversed_end: np.ndarray) -> np.ndarray:
        few = min(local, reversed_end.size)
        pivot = np.polynomial.Polynomial.fit(np.arange(few), reversed_end[:few], 1)(0) if few > 2 else reversed_end[0]
        return np.asarray(2 * pivot - reversed_end[1 : length + 1][::-1])

    before = beyond(samples)
    after = beyond(samples[::-1])[::-1]
    return np.concatenate([before, samples, after])


def _stretch_by_stretch(
    time: np.ndarray,
    values: np.ndarray,
    operation: Callable[[np.ndarray, float], np.ndarray],
    bridge: float,
) -> np.ndarray:
    """Apply ``operation(uniform samples, rate)`` to each stretch, over a uniform grid where needed."""
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    out = np.full(values.shape, np.nan)
    finite = np.isfinite(values) & np.isfinite(time)
    if finite.sum() < 2:
        return np.where(finite, values, np.nan)
    step = float(np.median(np.diff(time[finite])))
    for part in stretches(time, values, max(2.5 * step, bridge)):
        t, x = time[part], values[part]
        if part.size < 2:
            out[part] = operation(x, 1 / step)
            continue
        grid = np.linspace(t[0], t[-1], max(round((t[-1] - t[0]) / step) + 1, 2))
        if grid.size == t.size and np.abs(t - grid).max() < _JITTER * step:
            out[part] = operation(x, (t.size - 1) / (t[-1] - t[0]))
        else:
            own = (grid.size - 1) / (t[-1] - t[0])
            done = operation(interpolated(t, x, grid, np.inf), own)
            out[part] = interpolated(grid, done, t, np.inf) if np.isfinite(done).all() else np.nan
    return out
