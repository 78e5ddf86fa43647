"""What one load-unload ramp tells: it is no steady loop."""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.mre.pads import Pads


def half_cycle_metrics(
    run: str, displacement: np.ndarray, force: np.ndarray, *, pads: Pads | None = None
) -> list[Estimate]:
    """Return what one load-unload ramp tells: it is no steady loop, so no damping and no model.

    `stiffness_secant` (N/m, from the start to the turn), `loss_work` (J) and `loss_ratio` (lost work
    over loading work), both over the displacements that the unloading covers again, and with `pads`
    `shear_modulus_secant` (Pa). Errors are those of the force noise; a gain error is not in them.

    Raises
    ------
    ValueError
        If one of the branches has fewer than 5 samples.
    """
    x = displacement - displacement[0]
    turn = int(np.argmax(np.abs(x)))
    if turn < 4 or x.size - turn < 5:
        raise ValueError("a ramp needs at least 5 samples on each branch")
    side = math.copysign(1.0, x[turn])
    x, F = side * x, side * force
    sigma = float(np.median(np.abs(np.diff(F, 2))) / 0.6745 / math.sqrt(6))
    start, sd_start = _force_at(x[: turn + 1], F[: turn + 1], 0.0, sigma)
    F = F - start
    force_top, sd_top = _force_at(x[: turn + 1], F[: turn + 1], float(x[turn]), sigma)
    sd_top = math.hypot(sd_top, sd_start)
    low = max(0.0, float(x[turn:].min()))
    grid = np.linspace(low, x[turn], 2001)
    loading, unloading = (_branch(x[part], F[part], grid) for part in (slice(0, turn + 1), slice(turn, None)))
    work = float(np.trapezoid(loading, grid))
    lost = work - float(np.trapezoid(unloading, grid))
    span = x[turn] - low
    sd_work = [sigma * span / math.sqrt(count) for count in (turn + 1, x.size - turn)]
    sd_lost = math.hypot(*sd_work)
    at = {"run": run}
    secant = estimate("stiffness_secant", force_top / x[turn], sd_top / x[turn], at=at)
    out = [
        secant,
        estimate("loss_work", lost, sd_lost, at=at),
        estimate("loss_ratio", lost / work, math.hypot(sd_lost, lost / work * sd_work[0]) / abs(work), at=at),
    ]
    if pads is not None:
        g = pads.modulus_per_stiffness
        out.append(estimate("shear_modulus_secant", force_top / x[turn] * g, sd_top / x[turn] * g, at=at))
    return out


def _force_at(x: np.ndarray, F: np.ndarray, at: float, sigma: float) -> tuple[float, float]:
    """Return the force of a branch at one of its ends, and its error, from a straight line nearby.

    Through the samples within 2 % of the stroke, at least four: one sample alone is noise.
    """
    near = np.argsort(np.abs(x - at), kind="stable")[: max(4, int((np.abs(x - at) < 0.02 * x.max()).sum()))]
    A = np.c_[np.ones(near.size), x[near] - at]
    inverse = np.linalg.pinv(A)
    return float(inverse[0] @ F[near]), sigma * float(np.linalg.norm(inverse[0]))


def _branch(x: np.ndarray, F: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return the force of one branch at displacements `grid`."""
    order = np.argsort(x, kind="stable")
    return np.asarray(np.interp(grid, x[order], F[order]))
