"""Which parameters of the dynamic model the data determine, and where only a sum of them (mre.md section 5)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.identifiability import assess
from pipeline.rigs.mre.model.fit_errors import PHYSICAL_BOUNDS, Errors, Key, increment_of, shared_name

# Beyond it only sums are told.
CONDITION_LIMIT = 500.0
# A sum with a larger relative standard error is as undetermined as its members.
_LARGEST_OF_SUM = 0.1
# A tau this uncertain (one frequency only) leaves the range where the model is straight, and with it the
# errors of all that correlates with it.
_LOOSE, _TIED = 0.3, 0.5
# Relative standard errors from which on only lucky draws would look determined, and be biased.
LARGEST_RELATIVE = {"tau": 0.2, **dict.fromkeys(("rho", "c_bw", "n_bw", "k1", "alpha_bw"), 0.3)}
_NEEDS_TAU = "is not determined: only tau tells k1 and k2 apart, and tau is not determined"
_TIED_TO_TAU = "is not determined: it is tied to tau, which is all but free"
_UNITS = {"k1": "N/m", "k2": "N/m", "k_mr": "N/m", "s_mr": "N s/m", "alpha_bw": "N", "rho": "1/m", "tau": "s"}
_UNITS |= {"c_bw": "1", "n_bw": "1", "force_lag": "s", "moving_mass": "kg"}


@dataclass(frozen=True)
class Determination:
    """Why parameters (by `Key.text`) have no value, the two sums, and all that in sentences."""

    condition: float
    reasons: Mapping[str, str]
    sums: tuple[Estimate, ...]
    statements: tuple[str, ...]

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names without a value."""
        return tuple(self.reasons)


def judge(
    keys: Sequence[Key],
    values: np.ndarray,
    jacobian: np.ndarray,
    factor: float,
    errors: Errors,
    at_bound: Mapping[str, float],
) -> Determination:
    """Tell which parameters the data determine.

    Parameters
    ----------
    keys, values, errors
        The free parameters, natural units.
    jacobian, factor
        Whitened, in natural units, shape (rows, p), and the variance of its rows' noise.
    at_bound
        Parameters that ended at a bound, and that bound.

    Notes
    -----
    Lost are: what `identifiability.assess` finds; what ran to the edge of the search; what is tied to
    a tau that is all but free; k1 and k2 without tau, since nothing then tells the Maxwell
    branch from the spring. Of a sum that is known better than each of its members, one of which is
    lost, all members are.
    """
    names = [key.text for key in keys]
    size = np.abs(values)
    sd = np.sqrt(np.maximum(np.diag(errors.covariance), 0.0))
    relative = dict(zip(names, (sd / np.maximum(size, 1e-300)).tolist(), strict=True))
    found = _assessed(keys, values, jacobian, factor)
    lost = dict.fromkeys(found[1], "")
    for name, bound in at_bound.items():
        if bound != PHYSICAL_BOUNDS.get(name):
            lost[name] = f"{name} is not determined: the fit ran to the edge of its search, {bound:.4g}{_unit(name)}"
    for name, largest in LARGEST_RELATIVE.items():  # positive by nature: no honest zero
        if relative[name] > largest:
            lost.setdefault(name, "")
    tau = names.index("tau")
    loose = relative["tau"] > _LOOSE or "tau" in lost.keys() & at_bound.keys()
    for name, row in zip(names, np.eye(len(keys)), strict=True):
        if loose and name != "tau" and _correlation(errors, row, tau) > _TIED:
            lost.setdefault(name, f"{name} {_TIED_TO_TAU}")
    if "tau" in lost:
        lost = {"k1": "", "k2": "", **lost}
    sums = []
    for name, text, members, total, gradient in _sums_of(names, values):
        spread, dof = errors.of(gradient)
        share = spread / abs(total)
        if loose and _correlation(errors, gradient, tau) > _TIED:
            sums.append(undetermined(name, f"{text} {_TIED_TO_TAU}"))
            continue
        if share > _LARGEST_OF_SUM:
            sums.append(undetermined(name, f"{text} is not determined: {_percent(share)}"))
            continue
        sums.append(estimate(name, total, spread, dof=dof))
        if lost.keys() & {*members} and share < 0.5 * min(relative[member] for member in members):
            said = f"{', '.join(members)} are not determined one by one; only {text} = {total:.4g} N/m "
            lost |= {member: lost.get(member) or f"{said}(standard error {100 * share:.2g} %) is" for member in members}
    if "tau" in lost:
        lost |= {name: lost[name] or f"{name} {_NEEDS_TAU}" for name in ("k1", "k2")}
    if "k2" in lost and "k1" not in lost:
        # Told beside k1, their sum would tell k2: the local error misses what alpha_bw and rho can make up for.
        sums[0] = undetermined("k1_plus_k2", "k1 + k2 is not determined: k1 is, but k2 is not")
    reasons = {name: said or f"{name} is not determined: {_percent(relative[name])}" for name, said in lost.items()}
    statements = tuple(f"{said}." for said in dict.fromkeys(reasons.values())) or found[2]
    return Determination(found[0], reasons, tuple(sums), statements)


def _assessed(
    keys: Sequence[Key], values: np.ndarray, jacobian: np.ndarray, factor: float
) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """Return condition number, undetermined parameters and statements of the general assessment.

    Field terms and the lag may well be zero: they are measured against what they add to.
    """
    by_text = {key.text: float(value) for key, value in zip(keys, values, strict=True)}
    stiffness = abs(by_text["k2"]) + abs(by_text["k1"])
    typical = {"k_mr": stiffness, "s_mr": abs(by_text["k1"]) * by_text["tau"], "force_lag": 1e-4}
    typical |= {increment_of(name): abs(by_text[name]) for name in ("k1", "alpha_bw")}
    found = assess(
        by_text,
        jacobian,
        sigma=math.sqrt(factor),
        condition_limit=CONDITION_LIMIT,
        units={key.text: _UNITS[shared_name(key.name)] for key in keys},
        sizes={key.text: typical[key.name] for key in keys if key.name in typical},
    )
    return found.condition, found.undetermined, found.statements


def _correlation(errors: Errors, gradient: np.ndarray, index: int) -> float:
    """Return how strongly a function with that gradient correlates with a parameter, 0..1."""
    covariance = errors.covariance
    spread = math.sqrt(max(float(gradient @ covariance @ gradient) * covariance[index, index], 0.0))
    return abs(float(gradient @ covariance[:, index])) / spread if spread > 0 else 0.0


def _percent(share: float) -> str:
    if share < _LARGEST_OF_SUM:
        return "the other parameters can make up for it"
    return f"its standard error would be {100 * share:.0f} % of its value" if share < 10 else "the data do not hold it"


def _unit(name: str) -> str:
    unit = _UNITS[shared_name(name)]
    return "" if unit == "1" else f" {unit}"


def _sums_of(names: list[str], values: np.ndarray) -> list[tuple[str, str, tuple[str, ...], float, np.ndarray]]:
    """Return name, formula, members, value and gradient of k1 + k2 and of k2 + alpha_bw rho."""
    k1, k2, alpha, rho = (names.index(name) for name in ("k1", "k2", "alpha_bw", "rho"))
    stiff, small = np.zeros(len(names)), np.zeros(len(names))
    stiff[[k1, k2]] = 1.0
    small[[k2, alpha, rho]] = 1.0, values[rho], values[alpha]
    at_once, at_rest = float(values[k1] + values[k2]), float(values[k2] + values[alpha] * values[rho])
    return [
        ("k1_plus_k2", "k1 + k2", ("k1", "k2"), at_once, stiff),
        ("k2_plus_alpha_rho", "k2 + alpha_bw rho", ("k2", "alpha_bw", "rho"), at_rest, small),
    ]
