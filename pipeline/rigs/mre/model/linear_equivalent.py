"""Equivalent spring and damper of a record without a period: what is told of a device that is linear.

The dynamic model has branches that such a device lacks, and leaves all of them undetermined.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.estimation.separable import linear_fit
from pipeline.estimation.uncertainty import newey_west
from pipeline.rigs.mre.model.time_columns import Record, segments_of


@dataclass(frozen=True)
class LinearEquivalent:
    """`stiffness_storage` (N/m) and `damping` (N s/m) of F = K x + C v, and the share of the force that it misses."""

    run: str
    estimates: tuple[Estimate, Estimate]
    nrmse: float


def linear_equivalent(record: Record, cutoff: float | None = None) -> LinearEquivalent | None:
    """Fit F = K x + C v + F0 to a record, one F0 a stretch; None where no stretch is long enough.

    A force that is late by d takes K d from C. The errors allow for coloured residuals.
    """
    parts = segments_of(record, cutoff)
    if not parts:
        return None
    usable = np.concatenate([part.usable for part in parts])
    stretch = np.concatenate([np.full(part.time.size, i) for i, part in enumerate(parts)])
    offsets = (stretch[:, None] == np.arange(len(parts))).astype(float)
    motion = np.column_stack([np.concatenate([getattr(part, name) for part in parts]) for name in ("x", "velocity")])
    force = np.concatenate([part.force for part in parts])[usable]
    offsets = offsets[usable][:, offsets[usable].any(axis=0)]
    motion = motion[usable]
    if force.size < 10 * (2 + offsets.shape[1]) or not np.std(force) > 0:
        return None
    basis = np.linalg.qr(offsets)[0]
    columns = motion - basis @ (basis.T @ motion)
    fit = linear_fit(np.hstack([motion, offsets]), force)
    spread = newey_west(columns, fit.residual)
    sd = np.sqrt(np.diag(spread.matrix))
    stiffness, damping = (float(value) for value in fit.c[:2])
    at: dict[str, float | str | bool] = {"run": record.run}
    return LinearEquivalent(
        record.run,
        (
            estimate("stiffness_storage", stiffness, float(sd[0]), dof=spread.dof, at=at),
            estimate("damping", damping, float(sd[1]), dof=spread.dof, at=at),
        ),
        float(np.sqrt(np.mean(fit.residual**2)) / np.std(force)),
    )
