"""Clipped and stuck channels in records of steady levels: values that repeat exactly where noise should not let them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Share of equal samples in a hold that means clipping, and in usual holds the most that noise and steps leave.
_EQUAL, _USUAL = 0.3, 0.15
# Share of a hold that one unbroken run of equal samples must have to be a sensor that hangs.
_STUCK = 0.3
_MANY = 8
_WILD, _MOST_WILD = 8.0, 0.05  # standard deviations; share of the samples


def clipped_or_stuck(holds: Sequence[np.ndarray], whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell in which holds a channel was clipped (equal samples at its extreme) or stuck, shape (H,) each.

    A coarse converter repeats values in every hold: then nothing is told.

    Parameters
    ----------
    holds
        Samples of each hold.
    whole
        All samples of the channel.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal((6, 50))
    >>> noise[5] = np.minimum(noise[5], -0.5) * 0 + 3.5
    >>> clipped_or_stuck(list(noise), noise.ravel())[0].tolist()
    [False, False, False, False, False, True]
    """
    shares, modes, runs = [], [], []
    for values in holds:
        if values.size < 8:
            shares.append(0.0)
            modes.append(np.nan)
            runs.append(0.0)
            continue
        levels, counts = np.unique(values, return_counts=True)
        shares.append(float(counts.max()) / values.size)
        modes.append(float(levels[counts.argmax()]))
        runs.append(_longest(values) / values.size)
    share, mode, run = np.array(shares), np.array(modes), np.array(runs)
    none = np.zeros(share.size, dtype=bool)
    usual = np.quantile(share, 0.25) if share.size >= _MANY else share.min(initial=1.0)
    if not share.size or usual > _USUAL:
        return none, none
    extreme = (mode == whole.max()) | (mode == whole.min())
    return (share > _EQUAL) & extreme, (run > _STUCK) & ~extreme


def _longest(values: np.ndarray) -> int:
    """Return the length of the longest run of equal samples."""
    starts = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
    return int(np.diff(np.r_[starts, values.size]).max())


def lone_spikes(values: np.ndarray, noise: float | None = None) -> np.ndarray:
    """Tell samples that stand far off the running median of five, shape of `values`; a steep but steady rise has none.

    Examples
    --------
    >>> x = np.r_[np.zeros(20), np.arange(5.0) * 100, np.full(20, 400.0)] + 0.1 * np.sin(np.arange(45))
    >>> x[7] = 50.0
    >>> np.flatnonzero(lone_spikes(x)).tolist()
    [7]
    """
    padded = np.r_[values[:2][::-1], values, values[-2:][::-1]]
    off = np.abs(values - np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))
    steps = np.abs(np.diff(values))
    noise = 1.4826 * float(np.median(steps)) / np.sqrt(2) if noise is None else noise
    least = float(steps[steps > 0].min()) if (steps > 0).any() else 0.0
    wild = off > max(_WILD * noise, 3 * least)
    return np.asarray(wild) if wild.mean() < _MOST_WILD else np.zeros(values.size, dtype=bool)
