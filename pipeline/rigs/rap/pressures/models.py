"""How well the models of a run fit: eq. (2) to the pump's lines of device over bench."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.findings import ModelResult
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers


def models_of(runs: Sequence[RunNumbers]) -> list[ModelResult]:
    """Return the fits of all runs."""
    found = []
    for run in runs:
        ratios = run.alignment.ratios if run.alignment is not None else None
        if ratios is None or run.alignment is None or not ratios.used.any():
            continue
        off = np.abs(ratios.ratio - ratios.model)[ratios.used]
        chi2 = float(np.sum((off / ratios.sd[ratios.used]) ** 2))
        parameters = 2 + len(run.alignment.gains) + len(run.alignment.poles)
        where = f", run {run.name}" if len(runs) > 1 else ""
        found.append(
            ModelResult(
                name="gain, pole, lag and rate of the device (eq. 2)", family=f"lines of device over bench{where}", selected=True, n_parameters=parameters,
                n_data=2 * int(off.size), rms_residual=float(np.sqrt(np.mean(off**2))), unit="1", chi2_reduced=chi2 / max(2 * off.size - parameters, 1),
                description="complex ratios at harmonics 1 to 4, all taps and windows",
            )
        )  # fmt: skip
    return found
