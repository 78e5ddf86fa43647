"""Comparison of the variants of the dynamic model: which field terms the data ask for (mre.md 3.6)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.estimation.scatter import estimate_scatter, gain_vectors
from pipeline.estimation.selection import Candidate, rank
from pipeline.estimation.separable import SeparableFit
from pipeline.rigs.mre.model.dynamic_fit import VariantFit
from pipeline.rigs.mre.model.dynamic_model import HarmonicModel

# chi2/dof beyond which no run scatter explains the residual: the model is wrong.
REJECTED_BEYOND = 2.0
# A share of the force (rms) that no sensor resolves: a misfit below it speaks of nearly noiseless data, not
# against the model.
NEGLIGIBLE = 2e-4
# A difference of BIC that decides (Kass and Raftery 1995: strong evidence from 6 on).
DECISIVE = 6.0
# The paper's variant is taken unless another one is decisively better: a smaller one that fits by chance
# would hide what its parameters cannot tell.
PREFERRED = "ks"
# What each variant holds as a special case of itself.
_WITHIN = {"ks": {"k"}, "ka": {"k"}, "km": {"k"}, "ksa": {"k", "ks", "ka"}}


def compare_variants(
    models: Sequence[HarmonicModel], fits: Sequence[SeparableFit], scatter_cap: float
) -> tuple[list[VariantFit], int]:
    """Compare variants by BIC, each with its own run scatter; return them and which is selected.

    Where every variant is rejected the noise is not what the weights say, and misfit is counted in
    units of the best chi2/dof. `scatter_cap` 0 allows no scatter.
    """
    fitted = scatter_cap > 0 and len(models[0].loops) > 1
    deviances = [
        _deviance(model, fit, scatter_cap) if fitted else fit.chi2 for model, fit in zip(models, fits, strict=True)
    ]
    unit = min(d / max(fit.dof, 1) for d, fit in zip(deviances, fits, strict=True))
    unit = unit if unit > REJECTED_BEYOND else 1.0
    candidates = [
        Candidate(model.layout.variant, deviance / unit, fit.residual.size, fit.jacobian.shape[1] + fitted, True)
        for model, fit, deviance in zip(models, fits, deviances, strict=True)
    ]
    selected = next(entry.candidate for entry in rank(candidates) if entry.selected)
    best = min(candidate.bic for candidate in candidates)
    selected = next((c for c in candidates if c.name == PREFERRED and c.bic < best + DECISIVE), selected)
    variants = []
    for model, fit, candidate in zip(models, fits, candidates, strict=True):
        misfit = model.real_data - model.predicted(fit.q, fit.c)
        variants.append(
            VariantFit(
                variant=candidate.name,
                n_parameters=fit.jacobian.shape[1],
                n_data=candidate.n_data,
                chi2=fit.chi2,
                dof=fit.dof,
                deviance=candidate.chi2,
                aicc=candidate.aicc,
                bic=candidate.bic,
                rms_residual=rms_force(misfit, len(model.loops)),
                nrmse=rms_force(misfit, 1) / rms_force(model.real_data, 1),
            )
        )
    return variants, candidates.index(selected)


def undecided(variants: Sequence[VariantFit], selected: str) -> list[str]:
    """Return the rivals of the selected variant that the data do not decide against.

    Special cases of it are no rivals, nor is what holds it as a special case: their fit says the same.
    """
    bic = {variant.variant: variant.bic for variant in variants}
    related = {selected} | _WITHIN.get(selected, set()) | {name for name, inner in _WITHIN.items() if selected in inner}
    return [name for name in bic if name not in related and bic[name] < bic[selected] + DECISIVE]


def _deviance(model: HarmonicModel, fit: SeparableFit, cap: float) -> float:
    """Return -2 ln(likelihood) of a plain fit, with the run scatter that suits it best."""
    V = gain_vectors(model.whitened(model.real_data) - fit.residual, model.groups)
    return estimate_scatter(fit.residual, V, fit.jacobian, cap=cap, restricted=False).deviance


def rms_force(rows: np.ndarray, runs: int) -> float:
    """Return the rms over time of the force whose harmonics' parts are `rows`, averaged over `runs`."""
    return math.sqrt(float(rows @ rows) / 2 / runs)
