"""Where the joint filter starts: a coarse grid of shapes on the first seconds, the linear part solved at each.

Coarse on purpose: the filter is to find the parameters, the start only has to be within a factor of about two.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from pipeline.estimation.separable import linear_fit
from pipeline.rigs.mre.rich.joint_filter import Start
from pipeline.rigs.mre.rich.joint_state import to_logs
from pipeline.rigs.mre.rich.look_ahead import Steps

SECONDS, _RANGES = 3.0, 4.0
_C, _N = 1.0, 1.8
_TAU, _RHO = (0.25, 0.5, 1.0), (1.0, 2.0, 4.0)
_LEAST = 0.05  # of the stiffness, that each of the parts gets at least
_LAG_SD = 5e-5  # s
_VISCOUS = 0.1  # of the damping as a whole, that the field may add


def steps_to_start_from(steps: Steps) -> int:
    """Return how many of the first steps last long and move enough to start from, 0 where they do not yet."""
    x = steps.path[:, -1]
    if x.size < 2:
        return 0
    covered = np.cumsum(np.abs(np.diff(x, prepend=x[0])))
    reach = np.maximum.accumulate(x) - np.minimum.accumulate(x)
    ready = (steps.time - steps.time[0] >= SECONDS) & (covered > _RANGES * reach) & (reach > 0)
    return int(np.argmax(ready)) + 1 if ready.any() else 0


def start_from(steps: Steps, *, viscous: bool, lag_known: bool) -> Start | None:
    """Return the start that the first steps give, None where the force does not rise with the displacement."""
    from pipeline.rigs.mre.model.bouc_wen import along, path_through
    from pipeline.rigs.mre.model.linear_solid import maxwell_along

    known = np.isfinite(steps.force)
    t, x, v = steps.time, steps.path[:, -1] - steps.path[0, -1], steps.velocity
    force, excursion = steps.force[known], 0.5 * float(np.ptp(x))
    if known.sum() < 50 or not excursion > 0 or not np.std(v) > 0:
        return None
    ones = np.ones(x.size)
    stiffness, damping = linear_fit(np.column_stack([x, v, ones])[known], force).c[:2].tolist()
    path, slowest = path_through(x), float(np.std(x) / np.std(v))
    scale = math.hypot(stiffness, damping / slowest)
    if not scale > 0 or max(stiffness, damping / slowest) < 0:
        return None
    best: tuple[float, float, float, np.ndarray] | None = None
    for tau, rho in itertools.product((slowest * f for f in _TAU), (f / excursion for f in _RHO)):
        u = maxwell_along(t, x, tau, v)[:, 0]
        w = along(path, rho, _C, _N, sensitivities=False)[:, 0]
        fit = linear_fit(np.column_stack([u, x, w, ones])[known], force)
        if best is None or fit.chi2 < best[0]:
            best = (fit.chi2, tau, rho, fit.c)
    assert best is not None
    _, tau, rho, (k1, k2, alpha, offset) = best
    least = _LEAST * scale
    values = {"k1": max(k1, least), "tau": tau, "k2": max(k2, least), "alpha_bw": max(alpha, least * excursion)}
    values |= {"rho": rho, "c_bw": _C, "n_bw": _N}
    swing = 0.5 * float(np.ptp(force))
    return Start(
        logs=to_logs(values),
        excursion=excursion,
        swing=swing,
        offset=float(offset),
        offset_sd=0.1 * swing,
        lag_sd=0.0 if lag_known else _LAG_SD,
        viscous_sd=_VISCOUS * abs(damping) if viscous else None,
    )
