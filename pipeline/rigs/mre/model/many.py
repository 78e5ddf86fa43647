"""Fits over hundreds of runs: which of them are enough for a search, and what else than noise widens the errors.

With many runs noise is averaged away, and what stays is what they have in common: a condition that the model misses,
hours in which the rig was another. So runs of one condition, and runs made one after the other, are held together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.estimation.uncertainty import clustered
from pipeline.rigs.mre.model.fit_errors import Errors
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.pads import group_levels

_ENOUGH = 60  # runs to search with
_SAME_FREQUENCY, _SAME_AMPLITUDE = 0.05, 0.1  # relative


def standing_for(loops: Sequence[Loop], labels: Sequence[int], count: int = _ENOUGH) -> list[int]:
    """Return the places of `count` loops, or all, that span the conditions of all at each current level (`labels`)."""
    if len(loops) <= count:
        return list(range(len(loops)))
    chosen: list[int] = []
    levels = sorted(set(labels))
    for level in levels:
        members = [i for i, label in enumerate(labels) if label == level]
        members.sort(key=lambda i: (loops[i].frequency, loops[i].amplitude, loops[i].run))
        share = max(count // len(levels), 2)
        picked = {round(at) for at in np.linspace(0, len(members) - 1, min(share, len(members)))}
        chosen += [members[at] for at in picked]
    return sorted(chosen)


def conditions_of(loops: Sequence[Loop], labels: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return the condition of each loop: current level, and which frequency and amplitude."""
    frequency, _ = group_levels([math.log(loop.frequency) for loop in loops], _SAME_FREQUENCY)
    amplitude, _ = group_levels([math.log(loop.amplitude) for loop in loops], _SAME_AMPLITUDE)
    return list(zip(labels, frequency, amplitude, strict=True))


def in_a_row(runs: int) -> np.ndarray:
    """Return to which stretch of the campaign each run belongs, about as many stretches as runs in each; (runs,)."""
    stretches = round(math.sqrt(runs))
    return np.arange(runs) * stretches // runs


def widened(
    errors: Errors, jacobian: np.ndarray, residual: np.ndarray, groups: np.ndarray, together: Sequence[np.ndarray]
) -> Errors:
    """Widen errors to what the scatter between groups of runs says, where that is more.

    Parameters
    ----------
    jacobian, residual, groups
        Whitened, natural units, shapes (rows, p), (rows,), and the run of each row.
    together
        Ways to group the runs, each of shape (runs,): residuals within a group may be correlated in any way. One that
        cannot be told (a group that alone determines a parameter, fewer groups than parameters) is passed over.
    """
    sd = np.sqrt(np.diag(errors.covariance))
    wider, dof = np.ones(sd.size), errors.dof
    for way in together:
        count = np.unique(way).size
        if count <= sd.size:
            continue
        try:
            found = clustered(jacobian, residual, way[groups])
        except (ValueError, np.linalg.LinAlgError):
            continue
        ratio = np.nan_to_num(found.std_error / sd, nan=1.0)
        if (ratio > wider).any():
            wider, dof = np.maximum(wider, ratio), min(dof, found.dof)
    covariance = errors.covariance * np.outer(wider, wider)
    return Errors(covariance, errors.pull * wider[:, None], errors.variance_of_square, dof)
