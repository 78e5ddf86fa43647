"""Where a torque channel tells nothing: samples that are no numbers, rows that are missing, a reading that stands still.

What stands in their place is a straight line or a constant: it may do for a mean, never for a peak or a slope.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.rigs.gearbox.aligned_run import Span
from pipeline.rigs.gearbox.record import TORQUES, Record

# Shorter losses than this (s) the low-pass of the peaks bridges as well; steps of the stamps that are no gap.
_LEAST, _STEPS = 0.01, 4.0
# Equal samples that last this long (s), and so many, and so many times as long as others do: the reading stands.
_STANDS, _MANY, _LONGER = 0.1, 20, 4
# A channel whose neighbours are equal more often than that is coarse or without noise, and may stand still.
_COARSE = 0.5


def lost_samples(record: Record) -> dict[str, tuple[Span, ...]]:
    """Return torque channel -> where its samples are none of the sensor's, s, in the order of time."""
    time = record.torque.time
    missing = _missing_rows(time)
    found = {}
    for name in TORQUES:
        spans = [*record.bridged.get(name, ()), *missing, *standing_still(time, record.torque[name])]
        found[name] = tuple(sorted(span for span in spans if span[1] - span[0] > _LEAST))
    return found


def _missing_rows(time: np.ndarray) -> list[Span]:
    steps = np.diff(time)
    long = np.flatnonzero(steps > _STEPS * float(np.median(steps)))
    return [(float(time[i]), float(time[i + 1])) for i in long]


def standing_still(time: np.ndarray, values: np.ndarray) -> list[Span]:
    """Return where a noisy reading does not change at all, but at an end of its range, s.

    Parameters
    ----------
    time, values
        s and N m as logged, shape (n,).

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=4000)
    >>> x[1000:2000] = x[1000]
    >>> standing_still(np.arange(4000) / 1000.0, x)
    [(1.0, 1.999)]
    """
    equal = np.concatenate([[False], values[1:] == values[:-1], [False]])
    edges = np.flatnonzero(np.diff(equal.astype(np.int8)))
    first, last = edges[0::2], edges[1::2]
    length = last - first + 1
    inside = (values[first] > values.min()) & (values[first] < values.max())
    long = inside & (length >= _MANY) & (time[last] - time[first] >= _STANDS)
    rest = ~long
    elsewhere = values.size - 1 - int((length[long] - 1).sum())
    if not long.any() or elsewhere <= 0 or int((length[rest] - 1).sum()) > _COARSE * elsewhere:
        return []
    least = _LONGER * int(length[rest].max(initial=1))
    return [
        (float(time[i]), float(time[j]))
        for i, j, n in zip(first[long], last[long], length[long], strict=True)
        if n >= least
    ]


def overlap(spans: Sequence[Span], span: Span) -> float:
    """Return for how long the spans lie inside `span`, s.

    Examples
    --------
    >>> overlap([(0.0, 1.0), (2.0, 5.0)], (0.5, 3.0))
    1.5
    """
    return float(sum(max(min(end, span[1]) - max(start, span[0]), 0.0) for start, end in spans))
