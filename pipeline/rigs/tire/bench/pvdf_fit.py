"""The PVDF film against the flex sensor: gain, time constants and mounting offset from the ratio of their orders (T8).

Both sensors are noisy; the ratio is fitted with errors in both (total least squares), so noise of the flex sensor does not
bias it. No gain of the film alone: only G' = G h/(2c) shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.separable import covariance_of
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tire.bench.order_noise import noise_of_orders
from pipeline.rigs.tire.bench.run_scatter import likely_scatter
from pipeline.rigs.tire.ring.pvdf import film_over_flex
from pipeline.rigs.tire.ring.ring import grid

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

NAMES = ("pvdf_gain", "pvdf_time_constant", "pvdf_offset_angle", "sensor_lag")
LOWEST, HIGHEST = 2, 32
# Orders too near the flex sensor's null (sin(y)/y below this) carry its noise only.
_LEAST_AVERAGING = 0.15
# Gain, two time constants and angle in these sizes; then the logarithms of both lengths over what is told of them.
_SIZES = np.array([1.0, 1e-3, 1e-2, 1e-3, 1.0, 1.0])
# A length that is told as exact.
_EXACT = 1e-6
# Scatter between runs and noise of the orders hide each other: found in turn.
_PASSES = 2
_FURTHEST = 0.3
_LIMIT = 0.1
_LEAST_ANGLE = 0.02
_SAME_SPEED = 1.1
_GOOD, _BAD = 0.02, 0.1
_POOR = 4.0
_QUIET = 0.03


@dataclass(frozen=True, eq=False)
class FilmRun:
    """Averaged waveforms of one run on the same even angles: R2 (ohm) and film (V) with standard errors, shape (n,).

    Errors of noise alone: `ring_run.incoherent_error` and `quiet_error`.
    """

    run: str
    rotation: float
    resistance: np.ndarray
    resistance_se: np.ndarray
    film: np.ndarray
    film_se: np.ndarray


@dataclass(frozen=True, eq=False)
class FilmRunFit:
    """One run: orders of film over flex, and the film as the flex sensor predicts it.

    Attributes
    ----------
    orders, measured, modelled
        Orders used, V_n/R2_n as measured and by the fit, V/ohm, complex, shape (k,).
    predicted, film
        V, of these orders only, shape (n,).
    nrmse
        Rms of their difference over the rms of the film.
    """

    run: str
    orders: np.ndarray
    measured: np.ndarray
    modelled: np.ndarray
    predicted: np.ndarray
    film: np.ndarray
    nrmse: float


@dataclass(frozen=True, eq=False)
class FilmFit:
    """Result of the PVDF check.

    Attributes
    ----------
    estimates
        pvdf_gain (V/ohm), pvdf_time_constant (s), pvdf_offset_angle (rad) and sensor_lag (s; of the flex sensor, as this
        ratio shows it), each with a value or a reason.
    values, covariance
        The four as fitted, SI, (4,) and (4, 4), told or not.
    film_length, flex_length
        Lengths as fitted, m.
    chi2_reduced
        Mean squared residual over the noise of both sensors.
    left_out
        Runs that were not used, with the reason.
    verdict
        "good" below 2 % NRMSE, "fair", "bad" above 10 %.
    """

    estimates: dict[str, Estimate]
    values: np.ndarray
    covariance: np.ndarray
    film_length: float
    flex_length: float
    chi2_reduced: float
    runs: tuple[FilmRunFit, ...]
    left_out: dict[str, str]
    verdict: str
    statement: str


@dataclass(frozen=True, eq=False)
class _Orders:
    """Orders of one run: of flex X (ohm) and film V (V), standard deviations of their real and imaginary parts."""

    run: FilmRun
    n: np.ndarray
    X: np.ndarray
    V: np.ndarray
    flex_sd: float
    film_sd: float


def fit_film(
    runs: Sequence[FilmRun],
    *,
    film_length: float,
    flex_length: float,
    R: float,
    flex_lag: float | None = None,
    film_length_u: float = 0.0,
    flex_length_u: float = 0.0,
) -> FilmFit:
    """Fit film over flex (T8) to all runs.

    Parameters
    ----------
    runs
        With the same sensors.
    film_length, flex_length, R
        Lengths of the sensors; belt radius; m.
    flex_lag
        Lag of the flex sensor from the ring fit, s: where to start.
    film_length_u, flex_length_u
        Relative standard uncertainties of the lengths. Both are fitted along within them: a film or sensor that is longer
        than told lowers the high orders as a longer time constant would.

    Raises
    ------
    InputError
        If no run can be used.

    Notes
    -----
    Minimises |V - H X|^2/(film_sd^2 + |H|^2 flex_sd^2) over all orders and runs: the likelihood with the true order of the flex
    sensor solved for. With X taken as exact, G' would come out biased by the noise of X.
    """
    spectra, left_out = _spectra(runs, flex_length, R)
    if not spectra:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "there are no runs"
        raise InputError(f"the PVDF check needs runs with both sensors ({reasons}).")

    count = len(NAMES)

    def model(x: np.ndarray, s: _Orders) -> np.ndarray:
        gain, tau_p, angle, tau_f, flex, film = x[: _SIZES.size] * _SIZES
        gain *= math.exp(x[_SIZES.size + spectra.index(s)])
        return film_over_flex(
            s.n,
            s.run.rotation,
            gain=gain,
            time_constant=tau_p,
            offset_angle=angle,
            film_length=film_length * math.exp(film),
            flex_length=flex_length * math.exp(flex),
            flex_lag=tau_f,
            R=R,
        )

    def residual(x: np.ndarray, spread: np.ndarray, louder: np.ndarray) -> np.ndarray:
        rows = []
        for s in spectra:
            H = model(x, s)
            r = (s.V - H * s.X) / np.sqrt(s.film_sd**2 + np.abs(H) ** 2 * s.flex_sd**2)
            rows += [r.real, r.imag]
        return np.concatenate([np.concatenate(rows) / louder, x[count:] / spread])

    def start(tau_p: float) -> np.ndarray:
        x = np.array([1.0, tau_p, 0.0, flex_lag or 0.0, 0.0, 0.0, *np.zeros(len(spectra))])
        x[: _SIZES.size] /= _SIZES
        x[0] = _gain(x, spectra, model)
        return x

    spread = np.array([*np.maximum([flex_length_u, film_length_u], _EXACT), *np.full(len(spectra), _EXACT)])
    rows = 2 * sum(s.n.size for s in spectra)
    louder = np.ones(rows)
    best = min(
        (_searched(residual, start(tau_p), spread, louder) for tau_p in (2e-3, 2e-2, 2e-4)), key=lambda one: one.cost
    )
    scatter = 0.0
    for _ in range(_PASSES):
        # One run tells nothing of what changes from run to run.
        scatter = _scatter(best, spread) if len(spectra) > 1 else 0.0
        spread[2:] = scatter or _EXACT
        best = _searched(residual, best.x, spread, louder)
        louder = noise_of_orders(best.fun[:rows] * louder, len(spectra))
        best = _searched(residual, best.x, spread, louder)
    jacobian = np.asarray(best.jac)
    plain, _ = covariance_of(jacobian)
    dof = max(rows - count, 1)
    assumed = best.fun[:rows] * louder
    reduced = float(assumed @ assumed) / dof
    left = max(float(best.fun[:rows] @ best.fun[:rows]) / dof, 1.0)
    bent = plain @ jacobian[:rows].T @ _noise(spectra, [model(best.x, s) for s in spectra])
    told = plain @ jacobian[rows:].T
    by_noise = left * (bent @ bent.T)
    by_order = plain @ (jacobian[:rows].T * best.fun[:rows] ** 2) @ jacobian[:rows] @ plain * rows / dof
    # What the orders leave is not alike where the law itself is off.
    wider = np.sqrt(np.maximum(np.diag(by_order) / np.diag(by_noise), 1.0))
    covariance = (by_noise * np.outer(wider, wider) + told @ told.T)[:count, :count] * np.outer(
        _SIZES[:count], _SIZES[:count]
    )
    values = np.asarray(best.x[: _SIZES.size] * _SIZES)
    fitted = tuple(_run_fit(s, model(best.x, s)) for s in spectra)
    speeds = _distinct([s.run.rotation for s in spectra])
    worst = max(run.nrmse for run in fitted)
    verdict = "good" if worst < _GOOD else "bad" if worst > _BAD else "fair"
    return FilmFit(
        {name: _told(i, values, covariance, speeds, verdict) for i, name in enumerate(NAMES)},
        values[:count],
        covariance,
        film_length * math.exp(values[count + 1]),
        flex_length * math.exp(values[count]),
        reduced,
        fitted,
        left_out,
        verdict,
        _said(verdict, worst, reduced, scatter),
    )


def _searched(
    residual: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    start: np.ndarray,
    spread: np.ndarray,
    louder: np.ndarray,
) -> OptimizeResult:
    from scipy.optimize import least_squares

    free = [np.inf, 10.0, 1.0, 5e-2, *np.full(spread.size, _FURTHEST)]
    least = [-np.inf, 1e-5, -1.0, -1e-3, *np.full(spread.size, -_FURTHEST)]
    sizes = np.array([*_SIZES, *np.ones(spread.size - 2)])
    scale = np.array([abs(start[0]) or 1.0, 1.0, 1.0, 1.0, *spread])
    return least_squares(
        residual, start, args=(spread, louder), bounds=(np.array(least) / sizes, np.array(free) / sizes), x_scale=scale,
        jac="3-point", ftol=1e-12, xtol=1e-12, max_nfev=300,
    )  # fmt: skip


def _scatter(best: OptimizeResult, spread: np.ndarray) -> float:
    """Return by how much the ratio differs from run to run beyond noise, relative; 0 where nothing convinces.

    By the marginal likelihood of the linearised residual, as `run_scatter` does it for the ring.
    """
    rows = best.fun.size - spread.size
    J, r = np.asarray(best.jac)[:rows], best.fun[:rows]
    sd = np.array([*np.full(len(NAMES), np.inf), *spread])
    return likely_scatter(J.T @ J, J.T @ r, best.x, lambda s: np.where(np.arange(sd.size) < _SIZES.size, sd, s))


def _spectra(runs: Sequence[FilmRun], flex_length: float, R: float) -> tuple[list[_Orders], dict[str, str]]:
    n = np.arange(LOWEST, HIGHEST + 1)
    n = n[np.abs(np.sinc(n * flex_length / (2.0 * np.pi * R))) > _LEAST_AVERAGING]
    # Beyond the null the averaging changes sign and little is left.
    null = 2.0 * np.pi * R / flex_length
    n = n[n < null]
    used, left_out = [], {}
    for run in runs:
        arrays = (run.resistance, run.resistance_se, run.film, run.film_se)
        if not all(np.all(np.isfinite(values)) for values in arrays):
            left_out[run.run] = "flex sensor or film were not measured all round"
        elif not (math.isfinite(run.rotation) and run.rotation > 0.0):
            left_out[run.run] = "no rotation"
        elif not (np.ptp(run.film) > 0.0 and np.ptp(run.resistance) > 0.0):
            left_out[run.run] = "one of the sensors tells nothing"
        elif n.size < 4:
            left_out[run.run] = "the flex sensor is too long to compare"
        else:
            size = run.resistance.size
            X, V = (np.fft.rfft(np.fft.ifftshift(values))[n] / size for values in (run.resistance, run.film))
            sd = [
                max(math.sqrt(float(np.sum(se**2)) / 2.0) / size, 1e-9 * float(np.abs(Y).max()))
                for se, Y in ((run.resistance_se, X), (run.film_se, V))
            ]
            used.append(_Orders(run, n, X, V, sd[0], sd[1]))
    return used, left_out


def _noise(spectra: Sequence[_Orders], ratios: Sequence[np.ndarray]) -> np.ndarray:
    """Return what unit noise of every angle does to the weighted residual, shape (rows, angles of both sensors).

    The flex sensor's noise is largest at the peak, so its orders are correlated.
    """
    blocks = []
    for s, H in zip(spectra, ratios, strict=True):
        size = s.run.film.size
        waves = np.exp(-1j * np.outer(s.n, grid(size))) / size
        weight = 1.0 / np.sqrt(s.film_sd**2 + np.abs(H) ** 2 * s.flex_sd**2)
        both = np.hstack([waves * s.run.film_se, -H[:, None] * waves * s.run.resistance_se]) * weight[:, None]
        blocks.append(np.vstack([both.real, both.imag]))
    out = np.zeros((sum(b.shape[0] for b in blocks), sum(b.shape[1] for b in blocks)))
    row = column = 0
    for b in blocks:
        out[row : row + b.shape[0], column : column + b.shape[1]] = b
        row, column = row + b.shape[0], column + b.shape[1]
    return out


def _gain(x: np.ndarray, spectra: Sequence[_Orders], model: Callable[[np.ndarray, _Orders], np.ndarray]) -> float:
    along = across = 0.0
    for s in spectra:
        shape = model(x, s) * s.X
        along += float((np.conj(shape) * s.V).real.sum()) / s.film_sd**2
        across += float((np.abs(shape) ** 2).sum()) / s.film_sd**2
    return along / across


def _run_fit(s: _Orders, H: np.ndarray) -> FilmRunFit:
    size = s.run.film.size
    predicted, film = (_back(s.n, values, size) for values in (H * s.X, s.V))
    nrmse = float(np.sqrt(np.mean((predicted - film) ** 2) / np.mean(film**2)))
    return FilmRunFit(s.run.run, s.n, s.V / s.X, H, predicted, film, nrmse)


def _back(n: np.ndarray, values: np.ndarray, size: int) -> np.ndarray:
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    spectrum[n] = values
    return np.asarray(np.fft.fftshift(np.fft.irfft(spectrum, size) * size))


def quiet_error(film: np.ndarray, film_se: np.ndarray) -> np.ndarray:
    """Return the standard error of the film's noise alone, the same at all angles, V, shape (n,).

    Taken where the film is at rest: in a passage the load's waves are in it, which film and flex sensor share.
    """
    rest = np.median(film)
    quiet = np.abs(film - rest) < _QUIET * np.ptp(film)
    few = np.count_nonzero(quiet) < film.size // 8
    return film_se if few else np.full(film.size, float(np.sqrt(np.mean(film_se[quiet] ** 2))))


def _distinct(rotation: Sequence[float]) -> int:
    count, last = 0, 0.0
    for value in sorted(rotation):
        if count == 0 or value > _SAME_SPEED * last:
            count, last = count + 1, value
    return count


def _told(i: int, values: np.ndarray, covariance: np.ndarray, speeds: int, verdict: str) -> Estimate:
    name, value, se = NAMES[i], float(values[i]), math.sqrt(covariance[i, i])
    if verdict == "bad":
        return undetermined(
            name, "the flex sensor does not predict the film (NRMSE above 10 %): bond or channel is suspect."
        )
    size = max(abs(value), {"pvdf_offset_angle": _LEAST_ANGLE, "sensor_lag": 2e-4}.get(name, 0.0))
    if not se < _LIMIT * size:
        remedy = (
            "at one speed the time constants of film and flex sensor and the mounting offset stand for each other; roll at "
            "two speeds or more."
            if speeds < 2
            else "roll faster, or more revolutions."
        )
        return undetermined(name, f"its relative standard error is {100.0 * se / size:.0f} %: {remedy}")
    return estimate(name, value, se)


def _said(verdict: str, worst: float, reduced: float, scatter: float) -> str:
    said = {
        "good": f"The flex sensor predicts the film within {100.0 * worst:.2f} % of its rms: both are well bonded.",
        "fair": f"The flex sensor predicts the film within {100.0 * worst:.1f} % of its rms; below 2 % is good.",
        "bad": f"The flex sensor misses the film by {100.0 * worst:.0f} % of its rms: a bond or a channel is suspect.",
    }[verdict]
    if reduced > _POOR:
        said += f" The ratio departs from its law ({times_noise(reduced)}); intervals are widened."
    if scatter > 0.0:
        said += f" The ratio of the two differs by {100.0 * scatter:.2f} % from run to run, more than noise; the intervals hold that."
    return said
