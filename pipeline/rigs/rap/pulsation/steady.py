"""Windows in which nothing is changed: cut between starts, stops, steps of a set-point and touches of a clamp."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from pipeline.rigs.rap.pulsation.windows import Windows, cut, joined


def steady_windows(
    stretches: Iterable[tuple[float, float]], changes: np.ndarray, length: float, settle: float, before: float
) -> Windows:
    """Return windows of `length` s side by side in `stretches`, none of them near a change.

    Parameters
    ----------
    stretches
        (first, last) in s, in which windows may lie; their ends count as changes.
    changes
        Moments of change, s, shape (c,), in any order.
    settle, before
        Time that is left out behind and ahead of a change, s.
    """
    parts = []
    for first, last in stretches:
        inside = np.sort(changes[(changes > first) & (changes < last)])
        edges = np.concatenate([[first], inside, [last]])
        parts += [cut(a + settle, b - before, length) for a, b in pairwise(edges)]
    return joined([part for part in parts if part.size])


def steps(time: np.ndarray, values: np.ndarray, share: float) -> np.ndarray:
    """Return when a set value changes by more than a `share` of its largest, s, shape (c,): the stamp of the first sample of the new value."""
    return np.asarray(time[1:][np.abs(np.diff(values)) > share * np.abs(values).max(initial=1e-300)])


def held(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the set value that holds at times `at`, shape (w,): that of the last sample before; the first one ahead of it."""
    return np.asarray(values[np.clip(np.searchsorted(time, at, side="right") - 1, 0, values.size - 1)])
