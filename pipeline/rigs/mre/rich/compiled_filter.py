"""Predict and update of the joint filter over many steps at once, compiled: what filterpy does, ten times as fast.

A test holds it against filterpy step by step. Numba is imported here.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from pipeline.rigs.mre.rich.joint_state import carry, force


@nb.njit(cache=True)
def _points(x: np.ndarray, P: np.ndarray, factor: float, L: np.ndarray, out: np.ndarray) -> bool:
    """Draw the scaled sigma points; False where P is not positive definite."""
    n = x.size
    for j in range(n):
        for i in range(j, n):
            total = factor * P[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                L[j, j] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    for i in range(n):
        out[0, i] = x[i]
        for k in range(n):
            part = L[i, k] if k <= i else 0.0
            out[1 + k, i] = x[i] + part
            out[1 + n + k, i] = x[i] - part
    return True


@nb.njit(cache=True)
def run(
    x: np.ndarray,
    P: np.ndarray,
    Q: np.ndarray,
    Wm: np.ndarray,
    Wc: np.ndarray,
    factor: float,
    path: np.ndarray,
    dt: float,
    velocity: np.ndarray,
    measured: np.ndarray,
    R: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    held: np.ndarray,
    gated: np.ndarray,
    gate: float,
    most: int,
    innovation: np.ndarray,
    states: np.ndarray,
    variances: np.ndarray,
) -> int:
    """Carry `x` and `P` along all steps; return how many were made, fewer where the covariance broke down.

    `path` (steps, pieces + 1), `velocity`, `measured` (NaN: none), `R`, `innovation` (steps,), `states` (steps, n) and
    `variances` (steps, n + 1), the last of which is that of ln k1 + ln tau. `low`, `high`, `held` (7,) bound the
    parameters; `gated` (1,) counts innovations beyond `gate` standard deviations that were passed over in a row.
    """
    n = x.size
    count = 2 * n + 1
    sigmas, moved, L = np.zeros((count, n)), np.zeros((count, n)), np.zeros((n, n))
    h, cross, gain = np.zeros(count), np.zeros(n), np.zeros(n)
    for step in range(velocity.size):
        if not _points(x, P, factor, L, sigmas):
            return step
        carry(sigmas, path[step], dt, moved)
        for i in range(n):
            total = 0.0
            for s in range(count):
                total += Wm[s] * moved[s, i]
            x[i] = total
        for i in range(n):
            for j in range(i + 1):
                total = Q[i, j]
                for s in range(count):
                    total += Wc[s] * (moved[s, i] - x[i]) * (moved[s, j] - x[j])
                P[i, j] = P[j, i] = total
        innovation[step] = np.nan
        if measured[step] == measured[step]:
            if not _points(x, P, factor, L, sigmas):
                return step
            mean = 0.0
            for s in range(count):
                h[s] = force(sigmas[s], path[step, -1], velocity[step])
                mean += Wm[s] * h[s]
            S = R[step]
            cross[:] = 0.0
            for s in range(count):
                S += Wc[s] * (h[s] - mean) ** 2
                for i in range(n):
                    cross[i] += Wc[s] * (sigmas[s, i] - x[i]) * (h[s] - mean)
            y = measured[step] - mean
            if not S > 0.0:
                return step
            if y * y > gate * gate * S and gated[0] < most:
                gated[0] += 1
            else:
                gated[0] = 0
                innovation[step] = y
                for i in range(n):
                    gain[i] = cross[i] / S
                    x[i] += gain[i] * y
                for i in range(n):
                    for j in range(n):
                        P[i, j] -= gain[i] * S * gain[j]
        x[0] = min(max(x[0], -1.0), 1.0)
        for k in range(7):
            if x[2 + k] < low[k] or x[2 + k] > high[k]:
                held[k] = True
                x[2 + k] = min(max(x[2 + k], low[k]), high[k])
        for i in range(n):
            states[step, i] = x[i]
            variances[step, i] = P[i, i]
        variances[step, n] = P[2, 2] + P[3, 3] + 2.0 * P[2, 3]
    return velocity.size
