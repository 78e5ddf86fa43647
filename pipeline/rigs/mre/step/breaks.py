"""Where force or current is missing, or stands still, while a step is answered: which steps that hides.

Works on the raw channels. A fit would bridge such a break by its own shape, and its intervals would not know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_LEAST = 6.0  # samples
_SHARE, _MOST = 0.05, 0.5  # of t63 right after the onset; of the whole answer
_RUNS = 4.0  # a run of equal samples over the longest that is usual
_FEWEST_EQUAL = 6


@dataclass(frozen=True)
class Break:
    """A stretch (s) in which a channel is missing or stands still."""

    channel: str
    start: float
    stop: float
    frozen: bool

    @property
    def words(self) -> str:
        """What there is, and when."""
        what = "stands still" if self.frozen else "has no sample"
        return f"{self.channel} {what} from {self.start:.4g} to {self.stop:.4g} s"


def breaks_of(channel: str, time: np.ndarray, values: np.ndarray) -> tuple[list[Break], np.ndarray]:
    """Return the breaks of a channel, and which samples are frozen, shape (n,).

    Parameters
    ----------
    channel
        Its name.
    time, values
        Stamps (s) and samples, shape (n,), without NaN.

    Notes
    -----
    A converter that is coarse, or a channel without noise, repeats samples everywhere: then nothing is called frozen.

    Examples
    --------
    >>> t = np.arange(0, 2, 1e-3)
    >>> noise = np.random.default_rng(0).standard_normal(t.size)
    >>> noise[1000:1050] = noise[1000]
    >>> [(round(b.start, 3), round(b.stop, 3)) for b in breaks_of("force", t, noise)[0]]
    [(1.0, 1.049)]
    """
    apart = np.diff(time)
    # Stamps may stand in batches.
    period = max(float(np.median(apart)), float(np.median(apart[apart > 0])) if (apart > 0).any() else 0.0)
    gaps = np.flatnonzero(apart > _LEAST * period)
    found = [Break(channel, float(time[k]), float(time[k + 1]), False) for k in gaps.tolist()]
    edges = np.flatnonzero(np.r_[True, values[1:] != values[:-1], True])
    lengths = np.diff(edges)
    # Weighed by samples: the run that the usual sample lies in.
    usual = float(np.median(np.repeat(lengths, lengths)))
    still = np.zeros(time.size, dtype=bool)
    for k in np.flatnonzero(lengths > max(_FEWEST_EQUAL, _RUNS * usual)).tolist():
        a, b = int(edges[k]), int(edges[k + 1])
        if channel == "current" and values[a] in (values.min(), values.max()):
            continue  # a level without noise, as 0 A of a sensor that clips there
        if usual > 1 and b - a < 30 * usual:  # a coarse converter: such runs come by chance
            continue
        still[a + 1 : b] = True
        found.append(Break(channel, float(time[a]), float(time[b - 1]), True))
    return found, still


def lost(breaks: Sequence[Break], onset: float, t63: float, t90: float, period: float, start: float) -> Break | None:
    """Return the break that hides how the answer to a step begins, or most of it; None where there is none.

    Parameters
    ----------
    breaks
        Of force and current.
    onset, t63, t90
        Onset of the step, and times from there to 63 and 90 % of the answer, s.
    period
        Of the samples, s.
    start
        When the current is last seen at its level before, s.
    """
    for gap in breaks:
        first = _overlap(gap, min(onset - 2 * period, start), onset + 0.5 * t63)
        if gap.channel == "current" and gap.stop > start - 3 * period and gap.start < onset + 0.5 * t63:
            first = gap.stop - gap.start  # the onset itself is not known
        whole = _overlap(gap, onset, onset + t90)
        if first > max(_LEAST * period, _SHARE * t63) or whole > _MOST * t90:
            return gap
    return None


def _overlap(gap: Break, start: float, stop: float) -> float:
    return max(min(gap.stop, stop) - max(gap.start, start), 0.0)
