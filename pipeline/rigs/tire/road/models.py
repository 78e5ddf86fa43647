"""How the bench's ring fits the revolutions of the drives, as the report's comparison of models shows it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.findings import ModelResult
from pipeline.rigs.tire.road.passage_voltage import ANGLES
from pipeline.rigs.tire.road.run_numbers import RunNumbers

# Numbers fitted to each revolution: load, force, angle of the patch, resistance.
_FITTED = 4


def models_of(runs: Sequence[RunNumbers]) -> list[ModelResult]:
    """Return the fit of the library to all revolutions; nothing where no bench gave one."""
    with_forces = [run for run in runs if run.has_forces and run.forces.fits.any()]
    if not with_forces:
        return []
    misfit = np.concatenate([run.forces.misfit[run.forces.fits] for run in with_forces])
    share = np.concatenate([run.forces.share[run.forces.fits] for run in with_forces])
    benches = ", ".join(dict.fromkeys(run.carried.tire.bench.campaign for run in with_forces if run.carried.tire))
    left = [float(np.sqrt(np.mean(run.shape_error.left**2))) for run in with_forces if run.shape_error is not None]
    median = float(np.nanmedian(misfit)) if np.isfinite(misfit).any() else math.nan
    return [
        ModelResult(
            name=f"ring of '{benches}', contact solved",
            selected=True,
            n_parameters=_FITTED * misfit.size,
            n_data=int(np.sum(share) * ANGLES),
            chi2_reduced=median,
            rms_residual=max(left) if left else None,
            unit="V",
            description="load, longitudinal force, angle and resistance of each revolution; reduced chi-squared "
            "under the drive's own noise, median over the revolutions",
        )
    ]
