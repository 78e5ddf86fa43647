"""The torque map of all runs together: one slope for all, and T_00 as a mean over runs, with whose speed it goes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.rigs.gearbox.many import blocks
from pipeline.rigs.gearbox.torques.torque_map import Transfer
from pipeline.rigs.over_runs import MANY


def pooled(transfers: Sequence[Transfer], phase: str = "brake", speeds: Sequence[object] = ()) -> Transfer | None:
    """Return what the runs' transfers give together; errors grow where the runs differ by more than they say.

    Parameters
    ----------
    transfers
        One a run, in their order.
    speeds
        Which speed each run has, as its group is called; each a speed of its own where none are given.

    Returns
    -------
    The weighted mean of the slopes, and the plain mean of T_00 over these runs: between speeds T_00 differs because the
    drag does, which is no scatter; between runs of one speed it is. None without transfers.
    """
    groups = list(speeds) or list(range(len(transfers)))
    used = [(t, group) for t, group in zip(transfers, groups, strict=True) if t.slope_error > 0]
    if not used:
        return None
    if len(used) == 1:
        return used[0][0]
    a, error, dof = _weighted(*_columns([(t.slope, t.slope_error, t.dof) for t, _ in used]))
    known = [(t, group) for t, group in used if math.isfinite(t.intercept)]
    t_00, error_00, dof_00 = math.nan, math.nan, dof
    if known:
        t_00, error_00, dof_00 = _over_speeds(
            *_columns([(t.intercept, t.intercept_error, t.dof) for t, _ in known]), [group for _, group in known]
        )
    return Transfer(phase, a, error, t_00, error_00, dof, dof_00)


def _columns(rows: Sequence[tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    values, errors, dofs = np.array(rows, dtype=float).T
    return values, errors, dofs


def _weighted(x: np.ndarray, errors: np.ndarray, dofs: np.ndarray) -> tuple[float, float, float]:
    """Return weighted mean, error and degrees of freedom.

    Where the runs, or blocks of neighbouring runs, differ by more than their errors allow, it is wider (Birge ratio);
    what that adds is as uncertain as a variance of so many values.
    """
    weight = 1 / np.square(errors)
    total = float(weight.sum())
    mean = float(weight @ x / total)
    single = float(weight @ (x - mean) ** 2) / max(x.size - 1, 1)
    together, count = _by_blocks(weight * (x - mean), total)
    birge, count = max((single, x.size), (together, count), (1.0, x.size))
    share = weight / total
    spread = float(np.sum(share**2 / dofs)) + (birge - 1.0) ** 2 / max(count - 1, 1)
    return mean, math.sqrt(birge / total), birge**2 / spread


def _over_speeds(
    x: np.ndarray, errors: np.ndarray, dofs: np.ndarray, groups: Sequence[object]
) -> tuple[float, float, float]:
    """Return the plain mean, its error and degrees of freedom; the runs of each group should have one value."""
    names = list(dict.fromkeys(groups))
    own = np.array([names.index(group) for group in groups])
    means = np.bincount(own, x) / np.bincount(own)
    left, free = x - means[own], x.size - len(names)
    noise = float(np.sum(errors**2))
    single = float(np.sum((left / errors) ** 2)) / free if free else 1.0
    together, count = _by_blocks(left, noise) if free else (1.0, x.size)
    birge, freedom = max((single, free), (together, count - 1), (1.0, max(free, 1)))
    share = errors**2 / noise
    spread = float(np.sum(share**2 / dofs)) + (birge - 1.0) ** 2 / freedom
    return float(x.mean()), math.sqrt(birge * noise) / x.size, birge**2 / spread


def _by_blocks(pulls: np.ndarray, variance: float) -> tuple[float, int]:
    """Return how many times `variance`, that of all pulls together, blocks of neighbours of many runs tell; and how many blocks."""
    sums = np.array([float(pulls[block].sum()) for block in blocks(pulls.size)])
    if pulls.size <= MANY:
        return 0.0, int(sums.size)
    return float(sums @ sums) / variance * sums.size / max(sums.size - 1, 1), int(sums.size)
