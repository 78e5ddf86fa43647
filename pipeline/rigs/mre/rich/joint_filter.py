"""Joint state-and-parameter unscented Kalman filter of the dynamic model, on filterpy (mre.md section 5).

The state is that of `joint_state`. State, covariance, weights and noise are filterpy's; its loop over steps is compiled
(`compiled_filter`), and `compiled=False` lets filterpy make it. Nothing here reads logs or judges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from pipeline.rigs.mre.rich import joint_state
from pipeline.rigs.mre.rich.compiled_filter import run
from pipeline.rigs.mre.rich.joint_state import PARAMETERS, SHEET

ALPHA, BETA, KAPPA = 0.5, 2.0, 0.0
# Variances that a step adds to w, to u as a share of the excursion squared, and to each parameter: more lets a chirp
# forget its low frequencies before it reaches the high ones, and only both together tell k1 from tau.
_DRIFT_W, _DRIFT_U, _DRIFT_P = 1e-6, 1e-9, 1e-10
# R over the variance of the force's noise: what stays, what is added at the start, and how fast that fades (s). What
# is added is at least this share of the force's amplitude, squared: so much wrong parameters miss.
R_END, R_START, R_FADES, R_START_SHARE = 4.0, 1000.0, 5.0, 0.15
# A parameter that strays from its start by more than this factor is held there: no data say so.
FARTHEST = 100.0
# An innovation beyond so many standard deviations is a wild sample, but not more of them in a row.
_GATE, _GATED_AT_MOST = 10.0, 5


@dataclass(frozen=True, eq=False)
class Start:
    """Where the filter starts.

    Attributes
    ----------
    logs
        Of the parameters as `joint_state.to_logs` gives them, shape (7,); `spread` is the standard deviation of each.
    excursion, swing
        Amplitudes of displacement (m) and force (N) so far.
    offset, offset_sd, lag_sd, viscous_sd
        Offset of the force with its standard deviation (N); those of the lag (s, 0 where it is known) and
        of s_MR (N s/m, None where there is no such column).
    """

    logs: np.ndarray
    excursion: float
    swing: float
    offset: float
    offset_sd: float
    lag_sd: float
    viscous_sd: float | None
    spread: float = 0.4


@dataclass(frozen=True, eq=False)
class Track:
    """What some steps gave: innovation (N, NaN where none), states (steps, n), and variances (steps, n + 1).

    The last variance is that of ln k1 + ln tau, the logarithm of s1.
    """

    innovation: np.ndarray
    states: np.ndarray
    variances: np.ndarray


class JointFilter(UnscentedKalmanFilter):  # type: ignore[misc]
    """The filter: `advance` carries it along steps. `held` tells which parameters ran to the edge of what is allowed."""

    x: np.ndarray
    P: np.ndarray

    def __init__(self, start: Start, sigma: float, *, annealed: bool = True, compiled: bool = True) -> None:
        """`sigma` is the standard deviation of the force's noise, N; without annealing R is constant."""
        size = SHEET + 2 + (start.viscous_sd is not None)
        points = MerweScaledSigmaPoints(size, alpha=ALPHA, beta=BETA, kappa=KAPPA)
        super().__init__(size, 1, 1.0, hx=self._measured, fx=self._carried, points=points)
        self.start, self.sigma, self.compiled = start, sigma, compiled
        self.added = max(R_START * sigma**2, (R_START_SHARE * start.swing) ** 2) if annealed else 0.0
        self.x[PARAMETERS], self.x[SHEET] = start.logs, start.offset
        others = (start.offset_sd, start.lag_sd, start.viscous_sd or 0.0)
        spread = np.r_[0.1, 0.1 * start.excursion, np.full(7, start.spread), others]
        self.P = np.diag(np.maximum(spread[:size], 1e-12) ** 2)
        still = np.zeros(size)
        still[0], still[1], still[PARAMETERS] = _DRIFT_W, _DRIFT_U * start.excursion**2, _DRIFT_P
        self.Q = np.diag(still)
        self.time = 0.0
        self.low, self.high = start.logs - np.log(FARTHEST), start.logs + np.log(FARTHEST)
        self.held = np.zeros(7, dtype=bool)
        self._gated = np.zeros(1, dtype=np.int64)

    @staticmethod
    def _carried(state: np.ndarray, dt: float, path: np.ndarray) -> np.ndarray:
        out = np.empty((1, state.size))
        joint_state.carry(state[None], path, dt, out)
        return np.asarray(out[0])

    @staticmethod
    def _measured(state: np.ndarray, x: float, v: float) -> np.ndarray:
        return np.array([joint_state.force(state, x, v)])

    def noise(self, time: np.ndarray) -> np.ndarray:
        """Return R at times (s) since the start: 4 sigma^2, and what the annealing adds."""
        return np.asarray(R_END * self.sigma**2 + self.added * np.exp(-time / R_FADES))

    def forget(self) -> None:
        """Take w and u for unknown, as after a gap: anything within +-1, and within the excursion."""
        self.x[:2] = 0.0
        self.P[:2, :] = self.P[:, :2] = 0.0
        self.P[0, 0], self.P[1, 1] = 0.25, (0.5 * self.start.excursion) ** 2

    def advance(self, path: np.ndarray, dt: float, velocity: np.ndarray, force: np.ndarray) -> Track:
        """Carry the filter along steps; fewer come back where the covariance broke down: the filter has failed then.

        Parameters
        ----------
        path
            Displacements from one sample to the next, shape (steps, pieces + 1), m; `dt` (s) is the time of a piece.
        velocity, force
            At the end of each step, shape (steps,), m/s and N (NaN where not measured).
        """
        steps, size = velocity.size, self.x.size
        whole = dt * (path.shape[1] - 1)
        R = self.noise(self.time + whole * np.arange(1, steps + 1))
        track = Track(np.full(steps, np.nan), np.zeros((steps, size)), np.zeros((steps, size + 1)))
        if self.compiled:
            made = self._compiled(path, dt, velocity, force, R, track)
        else:
            made = self._by_filterpy(path, dt, velocity, force, R, track)
        self.time += whole * made
        return Track(track.innovation[:made], track.states[:made], track.variances[:made])

    def _compiled(
        self, path: np.ndarray, dt: float, velocity: np.ndarray, force: np.ndarray, R: np.ndarray, track: Track
    ) -> int:
        factor = ALPHA**2 * (self.x.size + KAPPA)
        bounds = (self.low, self.high, self.held, self._gated, _GATE, _GATED_AT_MOST)
        out = (track.innovation, track.states, track.variances)
        return int(run(self.x, self.P, self.Q, self.Wm, self.Wc, factor, path, dt, velocity, force, R, *bounds, *out))

    def _by_filterpy(
        self, path: np.ndarray, dt: float, velocity: np.ndarray, force: np.ndarray, R: np.ndarray, track: Track
    ) -> int:
        for i in range(velocity.size):
            try:
                self.predict(dt=dt, path=path[i])
                if np.isfinite(force[i]):
                    before = self.x.copy(), self.P.copy()
                    self.update(np.array([force[i]]), R=R[i], x=float(path[i, -1]), v=float(velocity[i]))
                    wild = float(self.y[0]) ** 2 > _GATE**2 * float(self.S[0, 0]) and self._gated[0] < _GATED_AT_MOST
                    self._gated[0] = self._gated[0] + 1 if wild else 0
                    if wild:
                        self.x, self.P = before
                    else:
                        track.innovation[i] = self.y[0]
            except np.linalg.LinAlgError:
                return i
            self.P = 0.5 * (self.P + self.P.T)
            self.x[0] = min(max(self.x[0], -1.0), 1.0)
            logs = self.x[PARAMETERS]
            self.held |= (logs < self.low) | (logs > self.high)
            self.x[PARAMETERS] = np.clip(logs, self.low, self.high)
            track.states[i], track.variances[i, :-1] = self.x, np.diag(self.P)
            track.variances[i, -1] = self.P[2, 2] + self.P[3, 3] + 2 * self.P[2, 3]
        return int(velocity.size)
