"""The tank's Kalman filter: volume and gain of the pump, one step an echo (rap.md, eq. 9). What is fed to it is `tank_filter`'s."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter

GATE, PATIENCE = 9.0, 60
LITRE = 1e-3
NOISE = np.array([(0.05e-3) ** 2, 0.02**2 / 3600.0])
"""Variances that drive V (litre^2/s) and the pump's gain (1/s), as eq. 9 has them."""
GAIN_SD, EMPTY_SD = 0.15, 5e-3
"""Standard deviations at the start: of the gain, and of the volume in a tank that the key says is empty (litre)."""


@dataclass(frozen=True, eq=False)
class Course:
    """What the filter gave at m steps, litres and metres: states (m, 2), covariances (m, 2, 2), the rest (m,)."""

    states: np.ndarray
    covariances: np.ndarray
    innovation: np.ndarray
    spread: np.ndarray
    gated: np.ndarray
    extra: np.ndarray


class TankFilter(KalmanFilter):  # type: ignore[misc]
    """x = [V, s], V in litres, H = [1e-3/A, 0]; `advance` carries it along a run, `smoothed` back again."""

    x: np.ndarray
    P: np.ndarray

    def __init__(
        self, volume: float, volume_sd: float, area: float, *, noise: np.ndarray = NOISE, compiled: bool = True
    ) -> None:
        super().__init__(dim_x=2, dim_z=1)
        self.x = np.array([volume, 1.0])
        self.P = np.diag([volume_sd**2, GAIN_SD**2])
        self.H = np.array([[LITRE / area, 0.0]])
        self.noise, self.compiled = noise, compiled

    def advance(
        self, steps: np.ndarray, asked: np.ndarray, level: np.ndarray, R: np.ndarray, gate: float = GATE
    ) -> Course:
        """Carry the filter along: steps (s), volume asked for (litre), levels (m; NaN: none), variances (m^2), (m,) each."""
        m = level.size
        made = Course(
            np.zeros((m, 2)), np.zeros((m, 2, 2)), np.zeros(m), np.zeros(m), np.zeros(m, dtype=bool), np.zeros(m)
        )
        if self.compiled:
            from pipeline.rigs.rap.therapy.tank_loop import run

            out = (made.states, made.covariances, made.innovation, made.spread, made.gated, made.extra)
            run(steps, asked, level, R, float(self.H[0, 0]), self.noise, self.x, self.P, gate, PATIENCE, *out)
            return made
        row, waiting = 0, 0.0
        for i in range(m):
            made.extra[i], waiting = waiting, 0.0
            Q = np.diag([self.noise[0] * steps[i] + made.extra[i], self.noise[1] * steps[i]])
            self.predict(F=np.array([[1.0, asked[i]], [0.0, 1.0]]), Q=Q)
            made.innovation[i] = made.spread[i] = np.nan
            if np.isfinite(level[i]):
                x, P = self.x.copy(), self.P.copy()
                self.update(level[i], R=R[i])
                y, S = float(self.y[0]), float(self.S[0, 0])
                made.innovation[i], made.spread[i] = y, math.sqrt(S)
                made.gated[i] = y * y > gate * S
                row = row + 1 if made.gated[i] else 0
                if made.gated[i]:
                    self.x, self.P = x, P
                if row >= PATIENCE:
                    waiting, row = (y / float(self.H[0, 0])) ** 2, 0
            made.states[i], made.covariances[i] = self.x, self.P
        return made

    def smoothed(self, steps: np.ndarray, asked: np.ndarray, made: Course) -> tuple[np.ndarray, np.ndarray]:
        """Return states (m, 2) and covariances (m, 2, 2) with the later levels used as well."""
        if self.compiled:
            from pipeline.rigs.rap.therapy.tank_loop import smooth

            states, covariances = made.states.copy(), made.covariances.copy()
            smooth(steps, asked, self.noise, made.extra, states, covariances)
            return states, covariances
        F = np.tile(np.eye(2), (steps.size, 1, 1))
        F[:, 0, 1] = asked
        Q = np.zeros_like(F)
        Q[:, 0, 0], Q[:, 1, 1] = self.noise[0] * steps + made.extra, self.noise[1] * steps
        x, P, _, _ = self.rts_smoother(made.states, made.covariances, Fs=F, Qs=Q)
        return np.asarray(x), np.asarray(P)
