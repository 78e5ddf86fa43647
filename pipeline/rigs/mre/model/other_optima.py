"""Do quite other parameters fit the loops as well? Then those that differ are not determined.

Few or alike loops leave a curved valley in which the errors at one point promise too much (mre.md
section 5, identifiability). It is followed along tau and along rho; what moves is told without a value.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.estimation.separable import fit_separable
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.dynamic_model import SCALE, HarmonicModel
from pipeline.rigs.mre.model.many import standing_for
from pipeline.rigs.mre.pads import group_levels

# chi2 (in units of chi2/dof) above the best within which another optimum is as good: 95 % of one parameter.
_AS_GOOD = 4.0
# A parameter that differs there by more standard errors is not determined.
_FAR = 3.0
_STEPS = 12
# Below this rho X the loops are hardly bent.
_BENT = 1.6


def without_other_optima(fit: DynamicFit) -> DynamicFit:
    """Return the fit with those parameters undetermined that differ in another optimum as good.

    Only designs that invite it are searched: one run, one amplitude, one frequency, or small loops.
    """
    if fit.rejected or not _inviting(fit):
        return fit
    rivals = _rivals(fit)
    if not rivals:
        return fit
    sd = np.sqrt(np.diag(fit.errors.covariance))
    apart = np.abs(np.array(rivals) - fit.values)
    far = {name for j, name in enumerate(fit.names) if apart[:, j].max() > _FAR * sd[j]}
    lost = {name for name in far if name not in fit.undetermined}
    if not lost:
        return fit
    told = tuple(_without_value(e, far, fit, rivals) for e in fit.estimates)
    ranges = ", ".join(f"{name} {_range(fit, rivals, name)}" for name in fit.names if name in lost)
    statement = f"quite other parameters fit as well within the noise: {ranges}"
    return replace(
        fit,
        estimates=told,
        undetermined=tuple(name for name in fit.names if name in {*fit.undetermined, *lost}),
        statements=(*fit.statements, statement),
    )


def _inviting(fit: DynamicFit) -> bool:
    amplitudes = [loop.amplitude for loop in fit.loops]
    _, different = group_levels(amplitudes, 0.15 * max(amplitudes))
    _, frequencies = group_levels([loop.frequency for loop in fit.loops], 0.2)
    rho = float(fit.values[fit.names.index("rho")])
    return len(different) < 2 or len(frequencies) < 2 or rho * max(amplitudes) < _BENT


def _rivals(fit: DynamicFit) -> list[np.ndarray]:
    """Return parameters (natural, in the order of `names`) of other points as good as the optimum."""
    few = standing_for(fit.loops, fit.layout.labels)
    loops = [fit.loops[i] for i in few]
    layout = replace(fit.layout, labels=tuple(fit.layout.labels[i] for i in few))
    model = HarmonicModel(loops, layout, fit.held_lag, tuple(fit.noise[loop.run] for loop in loops))
    best = np.r_[np.log(fit.values[:2]), fit.values[2 : model.n_shape]]

    def solved(q0: np.ndarray, held: int) -> tuple[float, np.ndarray, np.ndarray]:
        lower, upper = model.lower.copy(), model.upper.copy()
        if held >= 0:
            lower[held], upper[held] = q0[held] - 1e-9, q0[held] + 1e-9
        end = fit_separable(
            model,
            model.data,
            np.clip(q0, lower, upper),
            lower=lower,
            upper=upper,
            scale=SCALE[: model.n_shape],
            whiten=model.whitened,
            tolerance=1e-7,
            max_evaluations=30,
        )
        return end.chi2, end.q, end.c

    lowest, _, _ = solved(best, -1)
    share = len(few) / len(fit.loops)  # of chi2, where some runs stand for many
    allowed = lowest + share * _AS_GOOD * max(lowest / max(share * fit.dof, 1), 1.0)
    rivals = []
    for held in (0, 1):
        grid = np.linspace(model.lower[held], model.upper[held], _STEPS)
        for side in (grid[grid > best[held]], grid[grid < best[held]][::-1]):
            q = best.copy()
            for value in side:
                q[held] = value
                chi2, end, c = solved(q, held)
                if chi2 < allowed and np.all(c[:3] > 0):
                    rivals.append(np.r_[np.exp(end[:2]), end[2:], c])
                q = end
    return rivals


def _without_value(estimate: Estimate, far: set[str], fit: DynamicFit, rivals: list[np.ndarray]) -> Estimate:
    """Take the value from an estimate whose members are not determined; sums and products are judged as such."""
    combined = {
        "s1": lambda p: p["k1"] * p["tau"],
        "k1_plus_k2": lambda p: p["k1"] + p["k2"],
        "k2_plus_alpha_rho": lambda p: p["k2"] + p["alpha_bw"] * p["rho"],
    }.get(estimate.name)
    if estimate.value is None:
        return estimate
    reason = "quite other parameters fit these runs as well within the noise"
    if combined is None:
        current = estimate.at.get("coil_current")
        text = estimate.name if current is None else f"{estimate.name} at {current:g} A"
        members = {text, f"{estimate.name}_increment at {current:g} A"} if current is not None else {text}
        lost = bool(members & far) or (text not in fit.names and estimate.name in far)
        return undetermined(estimate.name, f"{reason}: {_range(fit, rivals, text)}", estimate.at) if lost else estimate
    values = [combined(dict(zip(fit.names, row, strict=True))) for row in rivals]
    moved = max(abs(value - estimate.value) for value in values)
    if moved > _FAR * (estimate.std_error or 0.0):
        return undetermined(estimate.name, reason, estimate.at)
    return estimate


def _range(fit: DynamicFit, rivals: list[np.ndarray], name: str) -> str:
    if name not in fit.names:
        return "its value moves with the others"
    column = [float(row[fit.names.index(name)]) for row in [fit.values, *rivals]]
    return f"from {min(column):.3g} to {max(column):.3g}"
