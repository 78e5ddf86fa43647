"""Mean of a channel over each window, free of the cycles that the window cuts."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.rap.flow.record import LEAST_RATE
from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.windows import Windows
from pipeline.rigs.rap.tables import Signal

# A window that lost more of a channel's samples than that is left out.
_FILLED = 0.6


def means(one: Signal | None, windows: Windows, f: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard error of a channel over each window, shape (w,) each; NaN without channel or samples.

    Where the pulsation's frequency `f` (Hz, shape (w,)) is given and the channel fast enough to show it, the mean is that of
    the fit with its harmonics: a plain one over 14.3 strokes is off by a part of the pulsation.
    """
    if one is None or not windows.size:
        return np.full(windows.size, np.nan), np.full(windows.size, np.nan)
    if f is not None and one.rate >= LEAST_RATE:
        fitted = harmonics(one.time, one.values, windows, f)
        return fitted.mean, fitted.mean_error
    first, last = (np.searchsorted(one.time, at - 1e-9) for at in (windows.start, windows.end))
    level = float(np.mean(one.values))
    sums = np.concatenate([[0.0], np.cumsum(one.values - level)])
    squares = np.concatenate([[0.0], np.cumsum((one.values - level) ** 2)])
    n = np.maximum(last - first, 1)
    mean = (sums[last] - sums[first]) / n
    variance = np.maximum((squares[last] - squares[first]) / n - mean**2, 0.0)
    expected = one.rate * (windows.end - windows.start) if np.isfinite(one.rate) else np.ones(windows.size)
    enough = (last - first >= np.maximum(_FILLED * expected, 1.0)) & (last > first)
    return np.where(enough, mean + level, np.nan), np.where(enough, np.sqrt(variance / np.maximum(n - 1, 1)), np.nan)
