"""What the loop model needs: fits without hysteresis, without the cubic term, and with both, by BIC."""

from __future__ import annotations

import math

import numpy as np

from pipeline.findings import ModelResult
from pipeline.rigs.mre.axial.loop import along_strokes
from pipeline.rigs.mre.axial.run_fit import RunFit

_TEXTS = {
    "linear": "k d + F_off",
    "elastic": "k d + k_3 d^3 + F_off",
    "hysteretic": "k d + alpha w + F_off",
    "full": "k d + k_3 d^3 + alpha w + F_off",
}


def variants_of(found: RunFit) -> list[ModelResult]:
    """Return the variants fitted to one run, the motion and rho as in the whole fit; the whole one is selected.

    Where no hysteresis is seen (alpha is null) the elastic one is.
    """
    fit = found.fit
    F, path = fit.data.force, fit.path
    w = along_strokes(path.d, path.stroke, path.turns.tolist(), fit.model.rho)
    one = np.ones(F.size)
    columns = {
        "linear": [path.d],
        "elastic": [path.d, path.d**3],
        "hysteretic": [path.d, w],
        "full": [path.d, path.d**3, w],
    }
    releases = len(fit.data.motion.strokes) > 1
    chosen = "elastic" if releases and found.numbers.estimates["alpha"].value is None and found.numbers.estimates["stiffness"].value is not None else "full"  # fmt: skip
    out = []
    for name, parts in columns.items():
        A = np.column_stack([*parts, one, fit.data.extra])
        A = A / np.linalg.norm(A, axis=0)
        c, *_ = np.linalg.lstsq(A, F, rcond=None)
        rms = max(float(np.sqrt(np.mean((F - A @ c) ** 2))), 1e-12)
        k = A.shape[1] + (w is parts[-1])
        out.append(
            ModelResult(
                name=name,
                family=found.run,
                selected=name == chosen,
                n_parameters=k,
                n_data=F.size,
                rms_residual=rms,
                unit="N",
                nrmse=rms / max(float(np.std(F)), 1e-300),
                bic=fit.effective * math.log(rms**2) + k * math.log(max(fit.effective, 2.0)),
                description=_TEXTS[name],
            )
        )
    return out
