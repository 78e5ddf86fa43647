"""Joint fit of ring, tread and flex sensor to the averaged waveforms of all bench runs with a known load (variant B).

The model is in `ring_model`, what may be told of the result in `identifiability` and `ring_verdict`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.residuals import whiteness
from pipeline.estimation.separable import covariance_of
from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.tire.bench.ring_information import SOURCES, RingInformation, information_of, shared_changes
from pipeline.rigs.tire.bench.ring_model import NAMES, SCALED, SIZES, RingModel, Unknowns, unknowns_at
from pipeline.rigs.tire.bench.ring_result import Influence, RingFit, RunFit
from pipeline.rigs.tire.bench.ring_run import Known, RingRun
from pipeline.rigs.tire.bench.run_scatter import run_scatter
from pipeline.rigs.tire.ring.sensor import highest_order

_START = Unknowns(10.0, 0.2, 4e5, 1e5, 1e8, 4000.0, 0.05, 1e-3, 0.05)
# Tried after the first where it ends at a bound or far from the data: factors on bending, foundations and tread.
_OTHER_STARTS = ((0.3, 1.0, 2.0, 1.0), (3.0, 2.0, 1.0, 0.3), (1.0, 0.3, 3.0, 3.0))
_DECADE = math.log(10.0)
_LINEAR_BOUNDS = {"loss_factor": (-0.1, 1.0), "sensor_lag": (-1e-3, 5e-2)}
_USUAL_LOAD, _SIZES_OF_TIRES = 2000.0, (0.1, 10.0)
_STIFFNESSES = ("bending_stiffness", "foundation_radial", "foundation_tangential", "tread_stiffness")
_POOR = 2.0
_AGREE = 1e-3
_FEWEST_BINS = 64
# Where neither loads nor anything else set the scale, the belt's width is held about as well as one can guess it.
_GUESS_U = 0.1
# How well the ends of the contact are known between the nodes of its mesh, in steps.
_EDGE = 0.03


def fit_ring(
    runs: Sequence[RingRun],
    known: Known,
    start: Unknowns | None = None,
    *,
    near: Unknowns | None = None,
    scattered: bool = False,
) -> RingFit:
    """Fit ring, tread and sensor to all runs at once.

    Parameters
    ----------
    runs
        Averaged waveforms on grids of the same size; those without load are left out.
    known
        What is not fitted, and priors.
    start
        Other than the usual one.
    near
        Where a fit of nearly the same runs ended: the search begins there and nowhere else.
    scattered
        Whether load, sensor gain and pressure may differ from run to run by more than their noise, as on real benches; by
        how much is found from the runs themselves (`run_scatter`).

    Raises
    ------
    InputError
        If no run can be used.

    Notes
    -----
    Weighted least squares within bounds of a decade either side of the start; R0, a drift within the turn, the angle, the
    error of the mean load and a rotation that is not quite even within the turn are fitted along for each run. Breglio 2019 gives no algorithm; tire.md, 5.8.
    """
    used, left_out = _usable(runs)
    if not used:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "there are no runs"
        raise InputError(
            f"the ring fit has no run to work on ({reasons}); it needs averaged passages under a known load."
        )
    loads = _distinct([run.nominal_load for run in used])
    speeds = _distinct([run.rotation for run in used])
    b = known.belt_width or _START.belt_width
    heights = any(run.hub_height is not None for run in used)
    scale_held = loads < 3 and not heights and known.belt_width_u is None
    prior = _GUESS_U if scale_held else known.belt_width_u
    model = RingModel(used, Known(**{**vars(known), "belt_width": b, "belt_width_u": prior}))
    x, at_bound, converged = _searched(model, near or start or _start(known, b, used), near is not None)
    if scattered and (scatter := run_scatter(model, x)).size > 0.0:
        model = RingModel(used, model.known, scatter)
        x, at_bound, converged = _searched(model, unknowns_at(x[: len(NAMES)]), True)
    return _result(model, known, x, at_bound, converged, (loads, speeds), left_out, scale_held)


def _usable(runs: Sequence[RingRun]) -> tuple[list[RingRun], dict[str, str]]:
    used: list[RingRun] = []
    left_out: dict[str, str] = {}
    for run in runs:
        valid = int(np.count_nonzero(np.isfinite(run.resistance) & np.isfinite(run.std_error)))
        if not (math.isfinite(run.load) and run.load > 0.0):
            left_out[run.run] = f"its load is {run.load:.4g} N"
        elif not (math.isfinite(run.pressure) and run.pressure > 0.0):
            left_out[run.run] = "its inflation pressure is not known"
        elif valid < _FEWEST_BINS:
            left_out[run.run] = f"only {valid} of {run.theta.size} angles have a value"
        elif used and run.theta.size != used[0].theta.size:
            left_out[run.run] = f"its waveform has {run.theta.size} angles, the others' {used[0].theta.size}"
        else:
            used.append(run)
    return used, left_out


def _distinct(values: Sequence[float], apart: float = 0.1) -> int:
    """Return how many of the values differ by more than `apart` from the next smaller one counted."""
    count, last = 0, 0.0
    for value in sorted(values):
        if count == 0 or value > last * (1.0 + apart):
            count, last = count + 1, value
    return count


def _start(known: Known, b: float, runs: Sequence[RingRun]) -> Unknowns:
    """Return where to begin: stiffnesses of a tire for these loads."""
    size = float(np.clip(np.median([run.load for run in runs]) / _USUAL_LOAD, *_SIZES_OF_TIRES))
    scaled = {name: getattr(_START, name) * size for name in _STIFFNESSES}
    return Unknowns(**{**vars(_START), **scaled, "belt_width": b, "sensor_length": known.sensor_length})


def _searched(model: RingModel, first: Unknowns, near: bool) -> tuple[np.ndarray, tuple[str, ...], bool]:
    """Return the best end point, which names are at a bound there, and whether the search converged.

    Where `first` is not known to be near the end, a poor end is tried from other starts too.
    """
    best: tuple[float, np.ndarray, tuple[str, ...], bool] | None = None
    for factors in ((1.0, 1.0, 1.0, 1.0), *(() if near else _OTHER_STARTS)):
        moved = {n: getattr(first, n) * f for n, f in zip(_STIFFNESSES, factors, strict=True)}
        start = Unknowns(**{**vars(first), **moved})
        try:
            cost, x, held, converged = _descended(model, start)
        except ArithmeticError:
            continue
        agreed = best is not None and abs(cost - best[0]) < _AGREE * best[0]
        if best is None or cost < best[0]:
            best = (cost, x, held, converged)
        if agreed:
            break
        data = sum(np.count_nonzero(w) for w in model.weights)
        if not best[2] and 2.0 * best[0] < _POOR * data:
            break
    if best is not None and any(best[1][NAMES.index(name)] < 0.0 for name in SIZES):
        best = min(best, _mirrored(model, best), key=lambda one: one[0])
    if best is None:
        raise InputError(
            "the ring fit found no start from which the contact can be solved; look at loads and pressure."
        )
    return best[1:]


def _mirrored(
    model: RingModel, best: tuple[float, np.ndarray, tuple[str, ...], bool]
) -> tuple[float, np.ndarray, tuple[str, ...], bool]:
    """Search once more from where loss and lag are not negative: to the angles alone a lag of either sign looks alike."""
    values = unknowns_at(best[1][: len(NAMES)])
    try:
        return _descended(model, replace(values, **{name: abs(getattr(values, name)) for name in SIZES}))
    except ArithmeticError:
        return best


def _descended(model: RingModel, start: Unknowns) -> tuple[float, np.ndarray, tuple[str, ...], bool]:
    from scipy.optimize import least_squares

    x = np.zeros(model.size)
    x[: len(NAMES)] = start.coordinates()
    for i, run in enumerate(model.runs):
        x[model.own(i).start] = run.theta[np.nanargmax(run.resistance)]
    x[NAMES.index("sensor_gain")] += math.log(_gain(model, x))
    low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    for i, name in enumerate(NAMES):
        linear = _LINEAR_BOUNDS.get(name)
        low[i] = linear[0] / SIZES[name] if linear else x[i] - _DECADE
        high[i] = linear[1] / SIZES[name] if linear else x[i] + _DECADE
    found = least_squares(
        model.residual,
        x,
        model.jacobian,
        bounds=(low, high),
        x_scale="jac",
        ftol=1e-8,
        xtol=1e-8,
        gtol=1e-12,
        max_nfev=80,
    )
    near = np.minimum(found.x - low, high - found.x)[: len(NAMES)] < 1e-3
    held = tuple(name for name, is_near in zip(NAMES, near, strict=True) if is_near)
    return float(found.cost), np.asarray(found.x), held, bool(found.status > 0)


def _gain(model: RingModel, x: np.ndarray) -> float:
    """Return the factor on the sensor's gain that fits the data best, all else as at x."""
    along = across = 0.0
    for i, (run, w) in enumerate(zip(model.runs, model.weights, strict=True)):
        wave = w * model.waveform(x, i)
        measured = w * np.where(w > 0.0, run.resistance - np.nanmean(run.resistance), 0.0)
        along, across = along + float(wave @ measured), across + float(wave @ wave)
    return max(along / across, 1e-3) if across > 0.0 else 1.0


def _result(
    model: RingModel,
    known: Known,
    x: np.ndarray,
    at_bound: tuple[str, ...],
    converged: bool,
    counts: tuple[int, int],
    left_out: dict[str, str],
    scale_held: bool,
) -> RingFit:
    J = model.jacobian(x)
    plain, _ = covariance_of(J)
    residuals = model.run_residuals(x)
    data = sum(int(np.count_nonzero(w)) for w in model.weights)
    dof = max(data - len(NAMES) - 3 * len(model.runs), 1)
    reduced = sum(float(r @ r) for r in residuals) / dof
    lengths = [_correlation_length(r[w > 0.0]) for r, w in zip(residuals, model.weights, strict=True)]
    correlation = float(np.mean(lengths))
    widening = max(1.0, reduced) * correlation
    order = highest_order(known.sensor_length, known.R)
    bands = [_band(r, w, order) for r, w in zip(residuals, model.weights, strict=True)]
    band_dof = max(2 * order * len(bands) - len(NAMES) - len(model.runs), 1)
    shared = J[:, : len(NAMES)]
    influences = _influences(model, x, J)
    # Noise that the model or its colour makes larger; what is known beforehand of loads, gains and lengths stays as it is.
    measured = J[: J.shape[0] - len(model.priors)]
    covariance = plain + (widening - 1.0) * plain @ (measured.T @ measured) @ plain
    slopes = model.length_slopes(x)
    fitted = tuple(
        _run_fit(model, x, i, residuals[i], bands[i] / (2 * order), slopes, covariance) for i in range(len(model.runs))
    )
    units = np.array([SIZES.get(n, 1.0) for n in NAMES])
    k = len(NAMES)
    return RingFit(
        values=unknowns_at(x[:k]),
        covariance=covariance[:k, :k] * np.outer(units, units),
        influences=tuple(Influence(name, u, s[:k] * units) for name, u, s in influences),
        known=known,
        runs=fitted,
        chi2_reduced=reduced,
        band_chi2_reduced=sum(bands) / band_dof,
        widening=widening,
        correlation_length=correlation,
        singular=np.linalg.svd(shared / np.linalg.norm(shared, axis=0), compute_uv=False),
        at_bound=at_bound,
        converged=converged,
        evaluations=model.solves,
        loads=counts[0],
        speeds=counts[1],
        left_out=left_out,
        scale_held=scale_held,
        scatter=model.scatter,
        information=_as_wide(information_of(model, x), covariance[:k, :k]),
        held=_GUESS_U**-2.0 if scale_held else 0.0,
        noise=math.sqrt(widening) * float(np.median([np.median(1.0 / w[w > 0.0]) for w in model.weights])),
        load_se=float(np.median([run.load_se / run.load for run in model.runs])),
    )


def _as_wide(found: RingInformation, covariance: np.ndarray) -> RingInformation:
    """Return information that leaves this covariance, and by which the coordinates follow what all runs share as before."""
    size = 1.0 / np.sqrt(np.diag(covariance))
    matrix = np.linalg.pinv(covariance * np.outer(size, size), rcond=1e-14, hermitian=True) * np.outer(size, size)
    return RingInformation(matrix, matrix @ np.linalg.lstsq(found.matrix, found.pulls, rcond=1e-14)[0])


def _correlation_length(residual: np.ndarray) -> float:
    """Return over how many bins the residual is correlated; 1 where no correlation can be told."""
    return 1.0 if whiteness(residual).passed else residual.size / effective_size(residual)


def _band(residual: np.ndarray, w: np.ndarray, order: int) -> float:
    """Return the sum of squares of the weighted residual's orders 1..`order`: where a misfit of the model shows first."""
    spectrum = np.abs(np.fft.rfft(residual)[1 : order + 1]) ** 2
    return float(2.0 * spectrum.sum() / np.count_nonzero(w))


def _influences(model: RingModel, x: np.ndarray, J: np.ndarray) -> list[tuple[str, float, np.ndarray]]:
    """Return source, relative uncertainty and d(coordinates)/d ln(source) of what all runs share.

    The fit follows a small change d of its residual by -(J'J)^-1 J'd.
    """
    known = model.known
    change = -np.linalg.lstsq(J, shared_changes(model, x, J), rcond=1e-13)[0]
    sizes = (known.pressure_u, known.load_gain_u, known.R_u, known.outer_radius_u)
    return [(name, u, change[:, j]) for j, (name, u) in enumerate(zip(SOURCES, sizes, strict=True))]


def _run_fit(
    model: RingModel,
    x: np.ndarray,
    i: int,
    residual: np.ndarray,
    band: float,
    slopes: np.ndarray,
    covariance: np.ndarray,
) -> RunFit:
    run, w, g = model.runs[i], model.weights[i], model.member[i]
    own = model.own(i).start
    wave = model.waveform(x, i)
    good = w > 0.0
    line = np.stack([np.ones(run.theta.size), run.theta], axis=1)
    offset = np.linalg.lstsq(line[good] * w[good, None], w[good] * (run.resistance[good] - wave[good]), rcond=None)[0]
    contact = model.loaded(x)[g].contact
    # The group's mean load stands for the run's own: they are within 0.3 %, which moves Lc by less than its mesh error.
    # Gain of the load cell, pressure and outer radius change stiffnesses and loads so that Lc stays; the belt's radius
    # scales it.
    slope = slopes[g].copy()
    slope[own + 1] = -slope[[NAMES.index(name) for name in SCALED]].sum()
    if model.scatter.size > 0.0:
        slope[model.own(i).stop - 1] = slope[NAMES.index("belt_width")]
    mesh = _EDGE * 2.0 * math.pi * model.known.R / contact.theta.size
    variance = float(slope @ covariance @ slope) + (model.known.R_u * contact.length) ** 2 + mesh**2
    angle = float(x[own])
    return RunFit(
        run=run.run,
        nominal_load=run.nominal_load,
        nominal_speed=run.nominal_speed,
        rotation=run.rotation,
        angle=angle,
        resistance=float(offset[0]),
        resistance_se=float(1.0 / np.sqrt((w**2).sum())),
        load=run.load * math.exp(float(x[own + 1])),
        model=wave + line @ offset,
        residual=run.resistance - wave - line @ offset,
        chi2_reduced=float(residual @ residual) / max(int(np.count_nonzero(good)) - 4, 1),
        band_chi2_reduced=band,
        contact_length=contact.length,
        contact_length_se=math.sqrt(variance),
        front=contact.front + angle,
        rear=contact.rear + angle,
        loaded_radius=contact.loaded_radius + (float(x[-1]) if model.heights else 0.0),
    )


__all__ = ["Influence", "RingFit", "RunFit", "fit_ring"]
