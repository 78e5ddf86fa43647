"""Clipped and stuck channels in records of steady levels: values that repeat exactly where noise should not let them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Share of equal samples in a hold that means clipping, and in usual holds the most that noise and steps leave.
_EQUAL, _USUAL = 0.3, 0.15
_STUCK = 0.9


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
    shares, modes = [], []
    for values in holds:
        if values.size < 8:
            shares.append(0.0)
            modes.append(np.nan)
            continue
        levels, counts = np.unique(values, return_counts=True)
        shares.append(float(counts.max()) / values.size)
        modes.append(float(levels[counts.argmax()]))
    share, mode = np.array(shares), np.array(modes)
    none = np.zeros(share.size, dtype=bool)
    if not share.size or np.quantile(share, 0.25) > _USUAL:
        return none, none
    extreme = (mode == whole.max()) | (mode == whole.min())
    return (share > _EQUAL) & extreme, (share > _STUCK) & ~extreme
