"""Profile intervals of eq. 7: what T_0, T_inf and tau may be by the samples, however curved the valley (rap.md, 5.5).

Given tau the law is a straight line in T_0 and T_inf, so that the profile over tau is exact and costs a small solve each.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.uncertainty import t_quantile

_POINTS = 400
# Time constants beyond these shares of the record look alike: a step, a straight line.
_SHORTEST, _LONGEST = 0.02, 30.0


def profile_intervals(time: np.ndarray, values: np.ndarray, least: float) -> dict[str, tuple[float, float] | None]:
    """Return the 95 % intervals of T_0 and T_inf (K) and tau (s); None where the samples leave tau open at the top.

    Parameters
    ----------
    time
        Since switching on, s, shape (n,).
    values
        Temperature, K, shape (n,).
    least
        Noise (K) below which no residual is believed: the readings' steps.
    """
    span = float(time[-1] - time[0])
    taus = np.geomspace(_SHORTEST * span, _LONGEST * span, _POINTS)
    misfit = np.empty(_POINTS)
    best = np.empty((_POINTS, 2))
    spread = np.empty((_POINTS, 2))
    for k, tau in enumerate(taus):
        fading = np.exp(-time / tau)
        design = np.column_stack([fading, 1.0 - fading])
        inverse = np.linalg.pinv(design.T @ design)
        best[k] = inverse @ (design.T @ values)
        misfit[k] = float(np.sum((values - design @ best[k]) ** 2))
        spread[k] = np.maximum(np.diag(inverse), 0.0)
    dof = max(time.size - 3, 1)
    noise = max(float(misfit.min()) / dof, least**2)
    allowed = misfit - misfit.min() <= noise * t_quantile(dof) ** 2
    room = np.clip(noise * t_quantile(dof) ** 2 - (misfit - misfit.min()), 0.0, None)
    inside = np.flatnonzero(allowed)
    is_open = bool(allowed[-1])
    intervals: dict[str, tuple[float, float] | None] = {}
    for at, name in enumerate(("T_0", "T_inf")):
        half = np.sqrt(room[inside] * spread[inside, at])
        low, high = float((best[inside, at] - half).min()), float((best[inside, at] + half).max())
        intervals[name] = None if name == "T_inf" and is_open else (low, high)
    first, last = max(int(inside[0]) - 1, 0), min(int(inside[-1]) + 1, _POINTS - 1)
    intervals["tau"] = (
        None if is_open else (math.sqrt(taus[first] * taus[inside[0]]), math.sqrt(taus[last] * taus[inside[-1]]))
    )
    return intervals
