"""The joint filter along a log as it comes in: samples go in block by block, parameters over time come out.

The same code runs live and in identification. What its numbers are worth is in `online_verdict`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.rigs.mre.rich.joint_filter import R_START, JointFilter, Start
from pipeline.rigs.mre.rich.joint_state import PARAMETERS, STATES, from_logs
from pipeline.rigs.mre.rich.look_ahead import LookAhead, Steps
from pipeline.rigs.mre.rich.start import enough, start_from

CUTOFF = 60.0  # Hz, of the sheet
NAMES = STATES[PARAMETERS]
_KEPT_EVERY = 0.02  # s, of the history
_SIGMA_FROM = 256


@dataclass
class History:
    """What the filter said over time, thinned: `time` (n,), `logs` and their sd (n, 7), `others` (n, 1 to 3); per step `innovation` over sigma."""

    time: list[float] = field(default_factory=list)
    logs: list[np.ndarray] = field(default_factory=list)
    spread: list[np.ndarray] = field(default_factory=list)
    others: list[np.ndarray] = field(default_factory=list)
    step_time: list[float] = field(default_factory=list)
    innovation: list[float] = field(default_factory=list)
    modelled: list[float] = field(default_factory=list)

    @property
    def values(self) -> dict[str, np.ndarray]:
        """Parameters by name, shape (n,) each; s1 = k1 tau among them."""
        return _with_s1(from_logs(np.array(self.logs).reshape(-1, 7)))

    def band(self, width: float = 1.96) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Low and high limits by name, as the filter claims them."""
        logs, spread = np.array(self.logs).reshape(-1, 7), np.array(self.spread).reshape(-1, 8)
        out = {}
        low, high = (from_logs(logs + side * width * spread[:, :7]) for side in (-1.0, 1.0))
        for name in NAMES:
            out[name] = (low[name], high[name])
        s1 = np.exp(logs[:, 0] + logs[:, 1])
        out["s1"] = (s1 * np.exp(-width * spread[:, 7]), s1 * np.exp(width * spread[:, 7]))
        return out


class Online:
    """Feed it, read `history`; `failed` says at what time the filter broke down, `refused` why it did not start."""

    def __init__(
        self,
        *,
        viscous: bool,
        force_lag: float | None = None,
        cutoff: float = CUTOFF,
        start: Start | None = None,
        r_start: float = R_START,
    ) -> None:
        """`force_lag` (s) is None where it is to be found; a `start` may be given, else the first seconds give it."""
        self.ahead = LookAhead(cutoff, force_lag or 0.0)
        self.viscous, self.lag_known, self.given, self.r_start = viscous, force_lag is not None, start, r_start
        self.history, self.filter = History(), None
        self.failed: float | None = None
        self.refused = ""
        self.sigma = self.zero = float("nan")
        self._waiting: list[Steps] = []
        self._raw: list[np.ndarray] = []
        self._kept = -np.inf

    filter: JointFilter | None

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
        if enough(so_far):
            self._begin(so_far)

    def finish(self) -> None:
        """Say that the log is over: a short one is started from what there is."""
        if self.filter is None and not self.refused:
            self._begin(Steps.joined(self._waiting))

    def _begin(self, steps: Steps) -> None:
        start = self.given or start_from(steps, viscous=self.viscous, lag_known=self.lag_known)
        if start is None:
            self.refused = "the force does not rise with the displacement, or hardly anything moves"
            return
        raw = np.concatenate(self._raw)
        noise = float(np.median(np.abs(np.diff(raw, 3))) / 0.6745 / np.sqrt(20)) if raw.size > 4 else 0.0
        swing = float(np.ptp(raw)) if raw.size else 0.0
        noise *= float(np.sqrt((self.ahead.force_kernel**2).sum()))
        self.sigma = max(noise, 1e-4 * swing)
        self.zero = float(steps.path[0, 0])
        self.filter = JointFilter(start, self.sigma, self.r_start)
        self._waiting, self._raw = [], []
        self._run(steps)

    def _run(self, steps: Steps) -> None:
        assert self.filter is not None
        path = steps.path - self.zero
        dt = self.ahead.every / self.ahead.rate / self.ahead.pieces
        for i in range(steps.time.size):
            if steps.fresh[i]:
                self.filter.forget()
            try:
                innovation = self.filter.step(path[i], dt, float(steps.velocity[i]), float(steps.force[i]))
            except np.linalg.LinAlgError:
                self.failed = float(steps.time[i])
                return
            self._keep(float(steps.time[i]), innovation)

    def _keep(self, time: float, innovation: float) -> None:
        assert self.filter is not None
        history, ukf = self.history, self.filter.ukf
        history.step_time.append(time)
        history.innovation.append(innovation)
        if time - self._kept < _KEPT_EVERY:
            return
        self._kept = time
        covariance = ukf.P[PARAMETERS, PARAMETERS]
        s1 = covariance[0, 0] + covariance[1, 1] + 2 * covariance[0, 1]
        history.time.append(time)
        history.logs.append(ukf.x[PARAMETERS].copy())
        history.spread.append(np.sqrt(np.maximum(np.r_[np.diag(covariance), s1], 0.0)))
        history.others.append(np.r_[ukf.x[9:], np.sqrt(np.maximum(np.diag(ukf.P)[9:], 0.0))])


def _with_s1(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {**values, "s1": values["k1"] * values["tau"]}
