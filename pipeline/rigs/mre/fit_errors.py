"""Standard errors, degrees of freedom and identifiability of a fitted dynamic model -> estimates.

Works on the weighted Jacobian in natural parameters; knows the names and what is physical, not how
the fit was found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.identifiability import Identifiability, assess
from pipeline.estimation.scatter import Scatter
from pipeline.estimation.separable import covariance_of
from pipeline.estimation.uncertainty import clustered, t_quantile

# A bound that is physics (a parameter may truly lie there), not the edge of the search.
PHYSICAL_BOUNDS = {"n_bw": 1.0, "c_bw": 0.5}
_UNITS = {"k1": "N/m", "k2": "N/m", "k_mr": "N/m", "s_mr": "N s/m", "alpha_bw": "N", "rho": "1/m", "tau": "s"}
_UNITS |= {"c_bw": "1", "n_bw": "1", "force_lag": "s", "moving_mass": "kg"}
# A sum with a larger relative standard error is as undetermined as its members.
_LARGEST_OF_SUM = 0.1
_INCREMENT = "_increment"


def increment_of(name: str) -> str:
    """Return the name of what a current adds to a shared coefficient."""
    return name + _INCREMENT


@dataclass(frozen=True)
class Key:
    """A free parameter: its name in the findings and, for field terms, the current (A)."""

    name: str
    current: float | None = None

    @property
    def text(self) -> str:
        """Name for matrices and messages."""
        return self.name if self.current is None else f"{self.name} at {self.current:g} A"

    @property
    def at(self) -> dict[str, float | str | bool]:
        """Operating point."""
        return {} if self.current is None else {"coil_current": self.current}


@dataclass(frozen=True, eq=False)
class Errors:
    """Covariance of the parameters (p, p) and how well it is known.

    `pull` (p, runs) is d(parameter)/d(gain of a run) times the gain's part in the fit: with a run
    scatter s the covariance moves by pull pull^T per s^2, so an error's degrees of freedom follow from
    the variance of s^2 (Satterthwaite 1946). `dof` holds where there is no scatter.
    """

    covariance: np.ndarray
    pull: np.ndarray
    variance_of_square: float
    dof: float = math.inf

    def of(self, gradient: np.ndarray) -> tuple[float, float]:
        """Return standard error and degrees of freedom of a function with that gradient, shape (p,)."""
        variance = max(float(gradient @ self.covariance @ gradient), 0.0)
        moved = float(((gradient @ self.pull) ** 2).sum())
        if moved == 0 or self.variance_of_square == 0:
            return math.sqrt(variance), self.dof
        return math.sqrt(variance), max(2 * variance**2 / (moved**2 * self.variance_of_square), 1.0)

    def through(self, function: Callable[[np.ndarray], float], values: np.ndarray) -> tuple[float, float, float]:
        """Return value, standard error and degrees of freedom of a function of the parameters."""
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        gradient = np.zeros(values.size)
        for i in np.flatnonzero(sd):
            step = np.zeros(values.size)
            step[i] = min(0.1 * sd[i], 1e-3 * abs(values[i]) or math.inf)
            gradient[i] = (function(values + step) - function(values - step)) / (2 * step[i])
        return function(values), *self.of(gradient)


def errors_with_scatter(
    jacobian: np.ndarray, V: np.ndarray, scatter: Scatter, factor: float, held: np.ndarray
) -> Errors:
    """Return the errors of a (generalised) least-squares fit.

    `jacobian` (rows, p) and the gain vectors `V` (rows, runs) are whitened, `factor` multiplies the
    covariance (Birge), `held` (p,) marks parameters at a bound: the others take them as known.
    """
    covariance = covariance_of(jacobian)[0] * factor
    if held.any():
        own = np.where(held, np.diag(covariance), 0.0)
        covariance = np.diag(own)
        covariance[np.ix_(~held, ~held)] = covariance_of(jacobian[:, ~held])[0] * factor
    if scatter.value == 0:
        return Errors(covariance, np.zeros((jacobian.shape[1], 0)), 0.0)
    return Errors(covariance, covariance @ jacobian.T @ V, scatter.variance_of_square)


def errors_of_wrong_model(jacobian: np.ndarray, residual: np.ndarray, runs: np.ndarray, dof: int) -> Errors:
    """Return the errors of plain least squares whose residual is not noise.

    The larger of the covariance scaled by chi2/dof and the sandwich over runs; the degrees of freedom
    are those of the runs, since their residuals are anything but independent.
    """
    covariance = covariance_of(jacobian)[0] * max(float(residual @ residual) / max(dof, 1), 1.0)
    number = np.unique(runs).size
    try:
        spread = np.sqrt(np.diag(clustered(jacobian, residual, runs).matrix) / np.diag(covariance))
    except (ValueError, np.linalg.LinAlgError):
        spread = np.ones(covariance.shape[0])
    wider = np.maximum(np.nan_to_num(spread, nan=1.0), 1.0)
    return Errors(covariance * np.outer(wider, wider), np.zeros((wider.size, 0)), 0.0, max(number - 1.0, 1.0))


def judge(keys: Sequence[Key], values: np.ndarray, jacobian: np.ndarray, factor: float) -> Identifiability:
    """Tell which parameters the data determine; `jacobian` (rows, p) is whitened, in natural units."""
    by_text = {key.text: float(value) for key, value in zip(keys, values, strict=True)}
    stiffness = abs(by_text.get("k2", 0.0)) + abs(by_text.get("k1", 0.0))
    damping = abs(by_text.get("k1", 0.0)) * by_text.get("tau", 0.0)
    typical = {"k_mr": stiffness, "s_mr": damping, "force_lag": 1e-4}
    typical |= {increment_of(name): abs(by_text.get(name, 0.0)) for name in ("k1", "alpha_bw")}
    return assess(
        by_text,
        jacobian,
        sigma=math.sqrt(factor),
        units={key.text: _UNITS[key.name.removesuffix(_INCREMENT)] for key in keys},
        sizes={key.text: typical[key.name] for key in keys if key.name in typical},
        candidates={"k2 + alpha_bw*rho": lambda p: p["k2"] + p["alpha_bw"] * p["rho"]}
        if {"k2", "alpha_bw", "rho"} <= by_text.keys()
        else None,
    )


def impossible(keys: Sequence[Key], values: np.ndarray, errors: Errors, verdict: Identifiability) -> tuple[str, ...]:
    """Return the determined parameters that cannot be negative and are, by more than two standard errors."""
    sd = np.sqrt(np.diag(errors.covariance))
    return tuple(
        key.text
        for key, value, error in zip(keys, values, sd, strict=True)
        if key.name in ("k1", "k2", "alpha_bw") and value < -2 * error and key.text not in verdict.undetermined
    )


def estimates_of(
    keys: Sequence[Key],
    values: np.ndarray,
    errors: Errors,
    verdict: Identifiability,
    at_bound: Mapping[str, float],
    reference_current: float | None,
) -> tuple[Estimate, ...]:
    """Return the estimates of all free parameters, of s1 = k1 tau, and of the two sums.

    `at_bound` maps a parameter that ended at a bound to that bound.
    """
    index = {key: i for i, key in enumerate(keys)}
    unit = np.eye(len(keys))
    out: list[Estimate] = []
    varying = {name for name in ("k1", "alpha_bw") if any(key.name == increment_of(name) for key in keys)}
    for key, i in index.items():
        if key.name in varying:
            out += _totals(key, index, values, errors, verdict, reference_current)
        elif key.name.endswith(_INCREMENT):
            continue  # told as a total at its current
        elif key.name in at_bound:
            out.append(_at_bound(key, at_bound[key.name], *errors.of(unit[i])))
        elif key.text in verdict.undetermined:
            out.append(undetermined(key.name, _reason(key.text, verdict), key.at))
        else:
            sd, dof = errors.of(unit[i])
            positive = key.name in ("tau", "rho")
            out.append(estimate(key.name, float(values[i]), sd, dof=dof, at=key.at, logarithmic=positive))
    out += _derived(index, values, errors, verdict, at_bound)
    return tuple(out)


def _at_bound(key: Key, bound: float, sd: float, dof: float) -> Estimate:
    if key.name in PHYSICAL_BOUNDS and bound == PHYSICAL_BOUNDS[key.name]:
        half = t_quantile(dof) * sd
        reason = f"lies at the limit {bound:g} of the physically admissible; the interval is one-sided"
        return Estimate(key.name, bound, sd, (bound, bound + half), key.at, reason, dof)
    return undetermined(key.name, f"ran to the edge of the search, {bound:g}: the data do not hold it", key.at)


def _reason(text: str, verdict: Identifiability) -> str:
    said = [s for s in verdict.statements if text in s.split(" not determined")[0]]
    return said[0] if said else f"{text} is not determined (condition number {verdict.condition:.3g})"


def _totals(
    base: Key,
    index: Mapping[Key, int],
    values: np.ndarray,
    errors: Errors,
    verdict: Identifiability,
    reference_current: float | None,
) -> list[Estimate]:
    """Return a shared coefficient at every current where the variant lets it vary (shared + increment)."""
    increments = [(key.current, [index[base], i]) for key, i in index.items() if key.name == increment_of(base.name)]
    out: list[Estimate] = []
    for current, members in [(reference_current, [index[base]]), *increments]:
        at: dict[str, float | str | bool] = {"coil_current": float(current or 0.0)}
        if base.text in verdict.undetermined:
            out.append(undetermined(base.name, _reason(base.text, verdict), at))
            continue
        gradient = np.zeros(len(index))
        gradient[members] = 1.0
        sd, dof = errors.of(gradient)
        out.append(estimate(base.name, float(values[members].sum()), sd, dof=dof, at=at))
    return out


def _derived(
    index: Mapping[Key, int],
    values: np.ndarray,
    errors: Errors,
    verdict: Identifiability,
    at_bound: Mapping[str, float],
) -> list[Estimate]:
    def part(name: str) -> int | None:
        return index.get(Key(name))

    tau, k1, k2, alpha, rho = (part(name) for name in ("tau", "k1", "k2", "alpha_bw", "rho"))
    out: list[Estimate] = []
    gradient = np.zeros(len(index))
    if k1 is not None and tau is not None:
        gradient[[k1, tau]] = values[tau], values[k1]
        sd, dof = errors.of(gradient)
        value = float(values[k1] * values[tau])
        lost = {"k1", "tau"} & {*verdict.undetermined, *at_bound}
        known = sd < 0.2 * abs(value)  # the product may hold where its factors do not (w tau << 1)
        if lost and not known:
            out.append(undetermined("s1", f"needs k1 and tau; {' and '.join(sorted(lost))} not determined"))
        else:
            out.append(estimate("s1", value, sd, dof=dof))
    if k1 is not None and k2 is not None:
        gradient = np.zeros(len(index))
        gradient[[k1, k2]] = 1.0
        out.append(_sum("k1_plus_k2", float(values[k1] + values[k2]), *errors.of(gradient)))
    if k2 is not None and alpha is not None and rho is not None:
        gradient = np.zeros(len(index))
        gradient[[k2, alpha, rho]] = 1.0, values[rho], values[alpha]
        out.append(_sum("k2_plus_alpha_rho", float(values[k2] + values[alpha] * values[rho]), *errors.of(gradient)))
    return out


def _sum(name: str, value: float, sd: float, dof: float) -> Estimate:
    if not sd < _LARGEST_OF_SUM * abs(value):
        return undetermined(name, f"standard error {sd:.2g} N/m: not even the sum is determined")
    return estimate(name, value, sd, dof=dof)
