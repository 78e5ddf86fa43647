"""Where a torque channel stands at the end of its converter or amplifier: those samples are lower bounds, not torques."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.rigs.gearbox.aligned_run import Span, within

# So many equal samples in a row at the maximum are an end stop, unless equal neighbours are common by chance.
_FLAT = 3
_CHANCE = 1e-2
_LONGER = 3
# A mean over which less than that share is cut is off by a few thousandths of its noise.
_NEGLIGIBLE = 0.01


@dataclass(frozen=True, eq=False)
class Clip:
    """Samples of a channel at its end stop: their `times` (s, shape (n,)) and the reading there, N m, as logged."""

    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    limit: float = float("inf")

    def count(self, span: Span) -> int:
        """Return how many samples are cut inside `span`."""
        return int(np.diff(np.searchsorted(self.times, span))[0])

    def first(self, span: Span) -> float:
        """Return when the first sample is cut inside `span`, s; its end where none is."""
        inside = self.times[within(self.times, span)]
        return float(inside[0]) if inside.size else span[1]

    def spoils(self, span: Span, rate: float) -> bool:
        """Tell whether a mean over `span` of samples at `rate` Hz is cut by more than noise now and then."""
        return self.count(span) > _NEGLIGIBLE * rate * (span[1] - span[0])


NONE = Clip()


def clip_of(time: np.ndarray, values: np.ndarray) -> Clip:
    """Find the samples at either end stop of a channel.

    Parameters
    ----------
    time, values
        s and N m as logged, shape (n,).

    Examples
    --------
    >>> x = np.clip(np.random.default_rng(1).normal(size=4000), None, 2.0)
    >>> clip = clip_of(np.arange(4000.0), np.sort(x))
    >>> clip.limit, clip.times.size == int((x == 2.0).sum())
    (2.0, True)
    """
    cut = np.zeros(values.size, dtype=bool)
    limit = NONE.limit
    ends = (float(values.min()), float(values.max()))
    # A channel may be cut at both ends: the other end is no place where samples are equal by chance.
    inside = (values > ends[0]) & (values < ends[1])
    for top in ends:
        at = values == top
        longest = _longest(at)
        equal = (values[1:] == values[:-1]) & inside[1:]
        chance = float(equal.sum()) / max(int(inside.sum()), 1)
        # Coarse converters and held samples are flat everywhere.
        elsewhere = 1 + _longest(equal)
        least = _FLAT if elsewhere < _FLAT else _LONGER * elsewhere
        if longest >= least and chance ** (longest - 1) < _CHANCE:
            cut |= at
            limit = top
    return Clip(np.asarray(time[cut], dtype=float), limit) if cut.any() else NONE


def _longest(flags: np.ndarray) -> int:
    """Return the length of the longest stretch of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[0::2]).max()) if edges.size else 0
