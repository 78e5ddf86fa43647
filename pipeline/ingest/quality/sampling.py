"""How evenly a stream was sampled: rate, gaps, uneven steps, changes of rate. Fed block by block.

Steps are judged against the steps around them (`_CHUNK` rows), so that a log with two rates is not
one long gap. A late stamp that the next ones catch up with is no gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import counted
from pipeline.recording import Level, QualityFinding

_CHUNK = 1024
# Stamps on either side of a suspected gap that tell whether samples are missing or one came late.
_AROUND = 8
# A step longer than this many usual steps is looked at.
_LONG = 1.6


@dataclass(frozen=True)
class Gap:
    """Missing samples between two stamps (s)."""

    start: float
    end: float
    lost: int


class Sampling:
    """Accumulates what `findings` says about the time base of one stream."""

    def __init__(self) -> None:
        self.n = 0
        self.first = self.last = float("nan")
        self._gaps: list[Gap] = []
        self._n_gaps = self._lost = self._late = 0
        self._longest: Gap | None = None
        self._medians: list[float] = []
        self._sizes: list[int] = []
        self._begins: list[float] = []
        self._spread = 0.0
        self._counted = 0
        self._smallest, self._largest = np.inf, 0.0
        self._tail = np.empty(0)

    def add(self, time: np.ndarray) -> None:
        """Take the next block of a strictly increasing time base (n,), s."""
        if not time.size:
            return
        if self.n == 0:
            self.first = float(time[0])
        self.n += time.size
        self.last = float(time[-1])
        stamps = np.concatenate((self._tail, time))
        judged = self._judge(stamps, whole=False)
        self._tail = stamps[judged:]

    def finish(self) -> None:
        """Judge the rows that waited for more."""
        self._judge(self._tail, whole=True)
        self._tail = self._tail[-1:]

    @property
    def step(self) -> float:
        """The usual step, s; NaN for fewer than two samples."""
        if not self._medians:
            return float("nan")
        order = np.argsort(self._medians)
        reached = np.cumsum(np.asarray(self._sizes)[order])
        return float(np.asarray(self._medians)[order][np.searchsorted(reached, reached[-1] / 2)])

    @property
    def rate(self) -> float:
        """Samples per second from the usual step, Hz; NaN for fewer than two samples."""
        return 1.0 / self.step

    @property
    def mean_rate(self) -> float:
        """Samples per second over the whole record, those missing in gaps counted, Hz; NaN where steps scatter."""
        is_even = self.n > 1 and self.duration > 0 and self._uneven <= 0.2 and self._late <= 0.01 * self.n
        return (self.n - 1 + self._lost) / self.duration if is_even else float("nan")

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return self.last - self.first if self.n else 0.0

    def _judge(self, stamps: np.ndarray, whole: bool) -> int:
        """Judge the steps of full chunks (of all rows, if `whole`); return the row to go on from."""
        steps = np.diff(stamps)
        full = steps.size // _CHUNK
        if full:
            self._judge_chunks(stamps, steps[: full * _CHUNK].reshape(full, _CHUNK))
        rest = steps[full * _CHUNK :]
        if whole and rest.size:
            self._judge_chunks(stamps[full * _CHUNK :], rest.reshape(1, -1))
        return full * _CHUNK

    def _judge_chunks(self, stamps: np.ndarray, steps: np.ndarray) -> None:
        median = np.median(steps, axis=1)
        # Rounded stamps alternate between two steps: their mean is the usual one, not either of them.
        near = steps <= 2.5 * median[:, None]
        usual = np.where(near, steps, 0.0).sum(axis=1) / near.sum(axis=1)
        relative = np.where(near, steps / usual[:, None] - 1.0, 0.0)
        self._spread += float(np.square(relative).sum())
        self._counted += int(near.sum())
        self._medians += usual.tolist()
        self._sizes += [steps.shape[1]] * steps.shape[0]
        self._begins += stamps[: steps.size : steps.shape[1]].tolist()
        self._smallest = min(self._smallest, float(steps.min()))
        self._largest = max(self._largest, float(steps.max()))
        long = steps > _LONG * usual[:, None]
        often = long.sum(axis=1) > max(0.05 * steps.shape[1], 2)
        self._late += int(long[often].sum())
        long[often] = False
        for at in np.flatnonzero(long).tolist():
            self._judge_gap(stamps, at, float(usual[at // steps.shape[1]]))

    def _judge_gap(self, stamps: np.ndarray, at: int, usual: float) -> None:
        """Take the long step from row `at` for a gap, unless those around make up for it or are long as well."""
        begin, end = max(at - _AROUND, 0), min(at + 1 + _AROUND, stamps.size - 1)
        if np.median(np.diff(stamps[begin : end + 1])) > _LONG * usual:
            return
        missing = (stamps[end] - stamps[begin]) / usual - (end - begin)
        if missing < 0.6:
            self._late += 1
            return
        start, stop = float(stamps[at]), float(stamps[at + 1])
        gap = Gap(start, stop, max(round((stop - start) / usual) - 1, 1))
        self._n_gaps += 1
        self._lost += gap.lost
        if self._longest is None or gap.end - gap.start > self._longest.end - self._longest.start:
            self._longest = gap

    def findings(self, losses_counted: bool = False) -> list[QualityFinding]:
        """Return what is to be said, at most one finding of each kind; gaps only as a note where losses are counted."""
        if self.n < 2:
            return []
        return [*self._said_gaps(losses_counted), *(self._said_rate() or self._said_spread())]

    def _said_gaps(self, losses_counted: bool) -> list[QualityFinding]:
        gap = self._longest
        if gap is None:
            return []
        part = self._lost / (self.n + self._lost)
        level: Level = "note" if losses_counted or (gap.lost <= 3 and part <= 5e-3) else "warning"
        where = f"from {gap.start:.6g} s to {gap.end:.6g} s ({counted(gap.lost, 'sample')})"
        if self._n_gaps == 1:
            message = f"a gap {where}: {100 * part:.2g} % of the samples are missing."
        else:
            message = (
                f"{self._n_gaps} gaps, {self._lost} samples ({100 * part:.2g} %) are missing; the longest is {where}."
            )
        return [QualityFinding(level, message, span=(gap.start, gap.end))]

    def _said_rate(self) -> list[QualityFinding]:
        """Say where the rate changes for good: by more than 10 % between stretches of several chunks."""
        steps = np.asarray(self._medians[:-1] if len(self._medians) > 2 else self._medians)
        low, high = float(steps.min()), float(steps.max())
        if high <= 1.1 * low or self._uneven > 0.2:
            return []
        at = int(np.argmax(np.abs(np.diff(np.log(steps))))) + 1
        return [
            QualityFinding(
                "note",
                f"the sample rate changes between {1 / high:.5g} Hz and {1 / low:.5g} Hz, first near "
                f"{self._begins[at]:.5g} s.",
            )
        ]

    @property
    def _uneven(self) -> float:
        """Root mean square deviation of the steps from the usual step around them, gaps aside."""
        return float(np.sqrt(self._spread / max(self._counted, 1)))

    def _said_spread(self) -> list[QualityFinding]:
        if self.n < 10 or (self._uneven <= 0.2 and self._late <= 0.01 * self.n):
            return []
        irregular = self._uneven > 0.5 or self._late > 0.1 * self.n
        return [
            QualityFinding(
                "warning" if irregular else "note",
                f"sampled unevenly: steps from {self._smallest:.3g} s to {self._largest:.3g} s, usually "
                f"{self.step:.3g} s, scatter {100 * self._uneven:.2g} %.",
            )
        ]
