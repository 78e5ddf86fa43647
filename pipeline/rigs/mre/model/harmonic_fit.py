"""Global separable fit of the dynamic model to the harmonics of all loops (mre.md section 5).

Periodic runs only; records that are not periodic go through `time_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.estimation.scatter import GainVectors, Scatter, estimate_scatter, gain_vectors, whitening
from pipeline.estimation.separable import RowMap, SeparableFit, fit_separable, multi_start
from pipeline.rigs.mre.model.determination import judge
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit, VariantFit
from pipeline.rigs.mre.model.dynamic_model import (
    SCALE,
    SHAPE_NAMES,
    HarmonicModel,
    Layout,
    bounds_reached,
    real_rows,
    spread_starts,
)
from pipeline.rigs.mre.model.fit_errors import (
    PHYSICAL_BOUNDS,
    Key,
    errors_of_wrong_model,
    errors_with_scatter,
    increment_of,
)
from pipeline.rigs.mre.model.fit_estimates import estimates_of, impossible
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.model.loop_noise import level_variance
from pipeline.rigs.mre.model.many import conditions_of, in_a_row, standing_for, widened
from pipeline.rigs.mre.model.variants import NEGLIGIBLE, REJECTED_BEYOND, compare_variants, rms_force
from pipeline.rigs.mre.pads import group_levels
from pipeline.rigs.over_runs import MANY

VARIANTS = ("ks", "ka", "km", "k", "ksa")
# Twice the log-likelihood that a run scatter must gain to be taken (one-sided 95 %).
_SCATTER_RATIO = 2.71
_PASSES = 3
_MOST_EVALUATIONS = 60  # a model that fits needs about 10
_NO_SCATTER = Scatter(0.0, 0.0, 0.0, 0.0, False, 0.0)
_COLUMN_NAMES = {"u": "k1", "x": "k2", "w": "alpha_bw", "m": "moving_mass"}
_FIELD_NAMES = {"x": "k_mr", "v": "s_mr", "u": increment_of("k1"), "w": increment_of("alpha_bw")}


@dataclass(frozen=True)
class FitOptions:
    """How to fit.

    `force_lag` (s) is held when `fit_lag` is False; `moving_mass` (kg) is subtracted, `fit_mass` adds
    its column, `mass_known` says that no other mass is to be looked for. `scatter` allows a run-to-run gain scatter up to `scatter_cap`. `current_tolerance` (A)
    separates levels of the measured current.
    """

    variants: tuple[str, ...] = VARIANTS
    fit_lag: bool = True
    force_lag: float = 0.0
    fit_mass: bool = False
    moving_mass: float = 0.0
    mass_known: bool = False
    scatter: bool = True
    scatter_cap: float = 0.02
    current_tolerance: float = 0.25
    starts: int = 6
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Identification:
    """All variants fitted to the same loops; `selected` is the one that BIC chooses."""

    selected: DynamicFit
    variants: tuple[VariantFit, ...]


def identify_loops(loops: Sequence[Loop], options: FitOptions | None = None) -> Identification:
    """Fit every variant that the currents allow and choose by BIC; one loop is enough to be called.

    Loops without a force harmonic clear of the mains are left out. Of more than `over_runs.MANY` the starts are tried with some
    that span their conditions, and loops are held to be in the order in which they were made.

    Raises
    ------
    ValueError
        If there is no loop, or fewer data than parameters.
    """
    options = options or FitOptions()
    loops = [loop for loop in loops if loop.kept.any()]
    if not loops:
        raise ValueError("there is no loop to fit, or all harmonics lie on the mains frequency")
    layouts = layouts_of(loops, options)
    loops = [_without_known_mass(loop, options) for loop in loops]
    held_lag = None if options.fit_lag else options.force_lag
    models = [HarmonicModel(loops, layout, held_lag) for layout in layouts]
    starts = spread_starts(max(loop.amplitude for loop in loops), options.starts, options.seed)
    first, agreeing, tried = _searched(models[0], starts)
    blocks = models[0].noise_around(first.q, first.c)
    models = [HarmonicModel(loops, model.layout, model.held_lag, blocks) for model in models]
    found = [_search(model, [first.q]) for model in models]
    found[0] = (found[0][0], agreeing, tried)
    cap = options.scatter_cap if options.scatter else 0.0
    variants, chosen = compare_variants(models, [fit for fit, _, _ in found], cap)
    if chosen != 0:  # so far the winner was only started from another variant's optimum
        found[chosen] = _searched(models[chosen], [found[chosen][0].q, *starts])
        variants, chosen = compare_variants(models, [fit for fit, _, _ in found], cap)
    return Identification(_finished(models[chosen], *found[chosen], options), tuple(variants))


def layouts_of(loops: Sequence[Loop], options: FitOptions) -> list[Layout]:
    """Return the coefficients of each variant that the currents of the loops allow."""
    labels, levels = group_levels([loop.current for loop in loops], options.current_tolerance)
    reference = int(np.argmin(np.abs(levels)))
    names = options.variants if len(levels) > 1 else ("base",)
    field = levels[reference] != 0
    return [Layout(name, tuple(labels), tuple(levels), reference, options.fit_mass, field) for name in names]


def refit(fit: DynamicFit, loops: Sequence[Loop], options: FitOptions | None = None) -> DynamicFit:
    """Fit the same variant to other loops of the same levels, from the same shape, with its run scatter.

    Raises
    ------
    ValueError
        If there are fewer data than parameters.
    """
    options = options or FitOptions()
    labels = tuple(fit.level_of(loop.current) for loop in loops)
    blocks = tuple(fit.noise[loop.run] for loop in loops)
    held_lag = None if options.fit_lag else options.force_lag
    model = HarmonicModel(loops, replace(fit.layout, labels=labels), held_lag, blocks)
    found = _search(model, [np.r_[np.log(fit.values[:2]), fit.values[2 : model.n_shape]]])
    return _finished(model, *found, options, held_scatter=fit.run_scatter)


def _without_known_mass(loop: Loop, options: FitOptions) -> Loop:
    """Take the inertia of a known moving mass out of the force (late by the given lag)."""
    if options.moving_mass == 0:
        return loop
    angular = loop.omega * np.arange(1, loop.X.size + 1)
    F = loop.F.copy()
    F[: loop.X.size] += options.moving_mass * angular**2 * loop.X * np.exp(-1j * angular * options.force_lag)
    return replace(loop, F=F)


def _search(model: HarmonicModel, starts: Sequence[np.ndarray]) -> tuple[SeparableFit, int, int]:
    """Fit by plain weighted least squares from every start: best fit, starts that agree, starts tried."""

    def admissible(end: SeparableFit) -> bool:
        return bool(np.all(end.c[:3] > 0)) and not set(_at_bound(model, end)) - PHYSICAL_BOUNDS.keys()

    return multi_start(lambda q0: solve(model, q0[: model.n_shape]), starts, admissible)


def _searched(model: HarmonicModel, starts: Sequence[np.ndarray]) -> tuple[SeparableFit, int, int]:
    """Search from every start, of many runs with some that stand for all; from there with all."""
    few = standing_for(model.loops, model.layout.labels)
    if len(few) == len(model.loops):
        return _search(model, starts)
    layout = replace(model.layout, labels=tuple(model.layout.labels[i] for i in few))
    blocks = tuple(model.blocks[i] for i in few)
    first, agreeing, tried = _search(
        HarmonicModel([model.loops[i] for i in few], layout, model.held_lag, blocks), starts
    )
    return _search(model, [first.q])[0], agreeing, tried


def solve(model: HarmonicModel, q0: np.ndarray, whiten: RowMap | None = None) -> SeparableFit:
    """Fit from one start by plain weighted least squares; `whiten` is applied to the whitened rows.

    Raises
    ------
    ValueError
        If there are fewer data than parameters, or nothing finite to fit.
    """
    return fit_separable(
        model,
        model.data,
        q0,
        lower=model.lower,
        upper=model.upper,
        scale=SCALE[: model.n_shape],
        whiten=model.whitened if whiten is None else lambda rows: whiten(model.whitened(rows)),
        tolerance=1e-9,
        max_evaluations=_MOST_EVALUATIONS,
    )


def _at_bound(model: HarmonicModel, fit: SeparableFit) -> dict[str, float]:
    return bounds_reached(fit.q, fit.at_bound, model.lower, model.upper)


def _finished(
    model: HarmonicModel,
    base: SeparableFit,
    agreeing: int,
    tried: int,
    options: FitOptions,
    held_scatter: float | None = None,
) -> DynamicFit:
    """Allow for run scatter, then turn the fit into parameters with errors."""
    groups = model.groups
    if options.scatter and len(model.loops) > 1:
        scatter, fit, V = _with_scatter(model, base, groups, options.scatter_cap, held_scatter)
    else:
        scatter, fit, V = _NO_SCATTER, base, gain_vectors(np.zeros(groups.size), groups)
    factor = max(fit.chi2 / max(fit.dof, 1), 1.0)
    missed = rms_force(model.real_data - model.predicted(fit.q, fit.c), 1) / rms_force(model.real_data, 1)
    rejected = factor > REJECTED_BEYOND and missed > NEGLIGIBLE and held_scatter is None
    if rejected:
        fit, scatter = base, replace(scatter, value=0.0)
        factor = max(fit.chi2 / max(fit.dof, 1), 1.0)

    keys, values, per_natural = _natural(model, fit)
    jacobian = fit.jacobian * per_natural
    bounds = _at_bound(model, fit)
    held = np.array([bounds.get(key.name, math.nan) == PHYSICAL_BOUNDS.get(key.name) for key in keys])
    if rejected:
        errors = errors_of_wrong_model(jacobian, fit.residual, groups, fit.dof)
    else:
        levels = np.tile(np.concatenate([level_variance(loop)[loop.kept] for loop in model.loops]), 2)
        errors = errors_with_scatter(jacobian, V, scatter, factor, held, levels)
    if len(model.loops) > MANY:
        _, condition = np.unique(conditions_of(model.loops, model.layout.labels), axis=0, return_inverse=True)
        together = (np.arange(len(model.loops)), condition.ravel(), in_a_row(len(model.loops)))
        errors = widened(errors, jacobian, fit.residual, groups, together)
    verdict = judge(keys, values, jacobian, factor, errors, bounds)
    reference = model.layout.levels[model.layout.reference]
    estimates = (
        *estimates_of(keys, values, errors, verdict, bounds, reference),
        *((_scatter_estimate(scatter, rejected),) if options.scatter and len(model.loops) > 1 else ()),
    )
    sd = np.sqrt(np.diag(errors.covariance))
    misfit = model.real_data - model.predicted(fit.q, fit.c)
    raw = model.whitened(misfit)
    V_raw = gain_vectors(model.whitened(model.real_data) - raw, groups)
    runs = [loop.run for loop in model.loops]
    square = scatter.value**2
    gains = square * V_raw.across(raw) / (1 + square * V_raw.squares)
    signal = model.real_data

    order = np.argsort(groups, kind="stable")
    ends = np.cumsum(np.bincount(groups, minlength=len(runs)))[:-1]

    def each_run(rows: np.ndarray) -> list[np.ndarray]:
        return np.split(rows[order], ends)

    return DynamicFit(
        loops=model.loops,
        layout=model.layout,
        reference_current=None if all(loop.current is None for loop in model.loops) else reference,
        estimates=estimates,
        names=tuple(key.text for key in keys),
        values=values,
        held_lag=model.held_lag,
        errors=errors,
        information=jacobian.T @ jacobian / factor,
        correlation=errors.covariance / np.outer(sd, sd),
        condition=verdict.condition,
        statements=verdict.statements,
        undetermined=verdict.undetermined,
        at_bound=tuple(bounds),
        inadmissible=impossible(keys, values, errors, verdict),
        chi2=fit.chi2,
        dof=fit.dof,
        chi2_by_run={run: float(r @ r) / r.size for run, r in zip(runs, each_run(raw), strict=True)},
        gain_by_run=dict(zip(runs, gains.tolist(), strict=True)),
        nrmse_by_run={
            run: math.sqrt(float(m @ m) / float(f @ f))
            for run, m, f in zip(runs, each_run(misfit), each_run(signal), strict=True)
        },
        rms_residual=rms_force(misfit, len(runs)),
        nrmse=rms_force(misfit, 1) / rms_force(signal, 1),
        n_data=fit.residual.size,
        scatter=scatter,
        noise=dict(zip(runs, model.blocks, strict=True)),
        rejected=rejected,
        starts_agreeing=(agreeing, tried),
    )


def _with_scatter(
    model: HarmonicModel, base: SeparableFit, groups: np.ndarray, cap: float, held: float | None
) -> tuple[Scatter, SeparableFit, GainVectors]:
    """Return the run scatter, the fit that allows for it, and its whitened gain vectors.

    The gain vectors are the model's prediction, renewed in each pass; never the data (Peelle's puzzle).
    """
    fit, residual, jacobian = base, base.residual, base.jacobian
    before = 0.0
    for _ in range(_PASSES):
        V = gain_vectors(model.whitened(model.real_data) - residual, groups)
        scatter = estimate_scatter(residual, V, jacobian, cap=cap)
        if held is not None:
            scatter = replace(scatter, value=held)
        elif scatter.ratio < _SCATTER_RATIO:
            scatter = replace(scatter, value=0.0)
        if scatter.value == 0:
            return scatter, base, V
        whiten = whitening(V, scatter.value)
        fit = solve(model, fit.q, whiten)
        A, dA = model(fit.q)
        jacobian = model.whitened(real_rows(np.hstack([(dA @ fit.c).T, A])))
        residual = model.whitened(model.real_data - model.predicted(fit.q, fit.c))
        if abs(scatter.value - before) < 1e-3 * scatter.value:
            break
        before = scatter.value
    return scatter, fit, V.shrunk(scatter.value)


def keys_of(layout: Layout, n_shape: int) -> list[Key]:
    """Return the parameters of a layout in the order of the fit: `n_shape` nonlinear ones, then the coefficients."""
    keys = [Key(name) for name in (*SHAPE_NAMES, "force_lag")[:n_shape]]
    for term in layout.terms:
        if term.level is None:
            keys.append(Key(_COLUMN_NAMES[term.column]))
        else:
            keys.append(Key(_FIELD_NAMES[term.column], layout.levels[term.level]))
    return keys


def _natural(model: HarmonicModel, fit: SeparableFit) -> tuple[list[Key], np.ndarray, np.ndarray]:
    """Return keys and values of all parameters, and d(search parameter)/d(natural one) per column."""
    values = np.r_[np.exp(fit.q[:2]), fit.q[2:], fit.c]
    slope = np.ones(values.size)
    slope[:2] = 1 / values[:2]
    return keys_of(model.layout, model.n_shape), values, slope


def _scatter_estimate(scatter: Scatter, rejected: bool) -> Estimate:
    name = "run_scatter"
    if rejected:
        return undetermined(name, "the residual is not a gain error of whole runs: the model does not hold")
    if scatter.value == 0:
        reason = "no scatter between runs beyond the noise; the upper limit is that of the likelihood"
        return Estimate(name, 0.0, None, (0.0, scatter.upper), reason=reason)
    from scipy.special import chdtri

    dof = scatter.dof
    if not dof > 0.5:
        return Estimate(name, scatter.value, reason="too few runs to tell how well it is known")
    low, high = (scatter.value * math.sqrt(dof / float(chdtri(dof, tail))) for tail in (0.025, 0.975))
    sd = math.sqrt(scatter.variance_of_square) / (2 * scatter.value)
    reason = "held at the largest gain error that is believed" if scatter.at_cap else ""
    return Estimate(name, scatter.value, sd, (low, high), reason=reason, dof=dof)
