"""The joint filter along a log as it comes in: samples go in block by block, parameters over time come out.

The same code runs live and in identification. What its numbers are worth is in `online_verdict`.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pipeline.rigs.mre.rich.joint_filter import JointFilter, Start, Track
from pipeline.rigs.mre.rich.joint_state import PARAMETERS, SHEET, STATES, from_logs
from pipeline.rigs.mre.rich.look_ahead import LookAhead, Steps
from pipeline.rigs.mre.rich.start import SECONDS, start_from, steps_to_start_from

CUTOFF = 60.0  # Hz, of the sheet
_KEPT_EVERY = 0.02  # s, of the history


class History:
    """What the filter said over time.

    `innovation` (N) is there for every step with its `step_time`; states are kept every 20 ms, their `time` (n,).
    """

    def __init__(self) -> None:
        self._steps: list[np.ndarray] = []
        self._kept: list[np.ndarray] = []
        self._last = -np.inf

    def add(self, time: np.ndarray, track: Track) -> None:
        """Add the steps that the filter has made, which end at the first of these times."""
        time = time[: track.innovation.size]
        self._steps.append(np.array([time, track.innovation]))
        kept = []
        for i, at in enumerate(time.tolist()):
            if at - self._last > _KEPT_EVERY - 1e-9:
                kept.append(i)
                self._last = at
        self._kept.append(np.column_stack([time, track.states, track.variances])[kept])

    @property
    def step_time(self) -> np.ndarray:
        """Time of every step, s."""
        return np.concatenate([part[0] for part in self._steps]) if self._steps else np.zeros(0)

    @property
    def innovation(self) -> np.ndarray:
        """Measured less predicted force at every step, N, NaN where there was none."""
        return np.concatenate([part[1] for part in self._steps]) if self._steps else np.zeros(0)

    @property
    def _table(self) -> np.ndarray:
        return np.concatenate(self._kept) if self._kept else np.zeros((0, 2 + 2 * SHEET))

    @property
    def time(self) -> np.ndarray:
        """Time of the states that are kept, s, shape (n,)."""
        return np.asarray(self._table[:, 0])

    def band(self, width: float = 0.0) -> dict[str, np.ndarray]:
        """Return the parameters by name, shape (n,), `width` of the filter's own standard deviations off its estimate.

        s1 = k1 tau is among them, and what else the record needed: offset, force_lag, s_mr.
        """
        table = self._table
        size = (table.shape[1] - 2) // 2
        states, spread = table[:, 1 : 1 + size], np.sqrt(np.maximum(table[:, 1 + size :], 0.0))
        values = from_logs(states[:, PARAMETERS] + width * spread[:, PARAMETERS])
        values["s1"] = np.exp(states[:, 2] + states[:, 3] + width * spread[:, size])
        return values | {STATES[i]: states[:, i] + width * spread[:, i] for i in range(SHEET, size)}


class Online:
    """Feed it, read `history`; `failed` says at what time the filter broke down, `refused` why it did not start."""

    def __init__(
        self,
        *,
        viscous: bool,
        force_lag: float | None = None,
        cutoff: float = CUTOFF,
        start: Start | None = None,
        annealed: bool = True,
    ) -> None:
        """`force_lag` (s) is None where it is to be found; a `start` may be given, else the first seconds give it."""
        self.ahead = LookAhead(cutoff, force_lag or 0.0)
        self.viscous, self.lag_known, self.given, self.annealed = viscous, force_lag is not None, start, annealed
        self.history = History()
        self.filter: JointFilter | None = None
        self.failed: float | None = None
        self.refused = ""
        self.sigma = self.zero = float("nan")
        self._waiting: list[Steps] = []
        self._raw: list[np.ndarray] = []

    def feed(self, time: np.ndarray, x: np.ndarray, force: np.ndarray) -> None:
        """Take the next samples: s, m, N, shape (n,) each."""
        if self.filter is None and not self.refused:
            self._raw.append(force[np.isfinite(force)])
        steps = self.ahead.feed(time, x, force)
        if not steps.time.size or self.failed is not None or self.refused:
            return
        if self.filter is not None:
            self._run(steps)
            return
        self._waiting.append(steps)
        so_far = Steps.joined(self._waiting)
        count = steps_to_start_from(so_far)
        if count:
            self._begin(so_far, count)

    def finish(self) -> None:
        """Say that the log is over: a short one is started from what there is."""
        if self.filter is None and not self.refused:
            steps = Steps.joined(self._waiting)
            self._begin(steps, steps.time.size)

    def _begin(self, steps: Steps, count: int) -> None:
        start = self.given or start_from(steps.first(count), viscous=self.viscous, lag_known=self.lag_known)
        if start is None:
            self.refused = "hardly anything moves, or the force drives the motion"
            return
        raw = np.concatenate(self._raw)[: round(SECONDS * self.ahead.rate)]
        noise = float(np.median(np.abs(np.diff(raw, 3))) / 0.6745 / np.sqrt(20)) if raw.size > 4 else 0.0
        swing = float(np.ptp(raw)) if raw.size else 0.0
        noise *= float(np.sqrt((self.ahead.force_kernel**2).sum()))
        self.sigma = max(noise, 1e-4 * swing)
        self.zero = float(steps.path[0, 0])
        self.filter = JointFilter(start, self.sigma, annealed=self.annealed)
        self._waiting, self._raw = [], []
        self._run(steps)

    def _run(self, steps: Steps) -> None:
        assert self.filter is not None
        path = steps.path - self.zero
        dt = self.ahead.every / self.ahead.rate / self.ahead.pieces
        edges = [0, *(i for i in np.flatnonzero(steps.fresh).tolist() if i > 0), steps.time.size]
        for first, last in pairwise(edges):
            if steps.fresh[first]:
                self.filter.forget()
            track = self.filter.advance(path[first:last], dt, steps.velocity[first:last], steps.force[first:last])
            self.history.add(steps.time[first:last], track)
            if track.innovation.size < last - first:
                self.failed = float(steps.time[first + track.innovation.size])
                return
