"""Fitted parameters, their errors and what is determined -> estimates by name, for the findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.mre.model.determination import Determination
from pipeline.rigs.mre.model.fit_errors import Errors, Key, increment_of, shared_name


def impossible(keys: Sequence[Key], values: np.ndarray, errors: Errors, verdict: Determination) -> tuple[str, ...]:
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
    verdict: Determination,
    at_bound: Mapping[str, float],
    reference_current: float | None,
) -> tuple[Estimate, ...]:
    """Return the estimates of all free parameters, of s1 = k1 tau, and of the two sums.

    `at_bound` maps a parameter that ended at a bound to that bound. k_mr is relative to the reference
    current, which the remark tells where it is not 0 A.
    """
    index = {key: i for i, key in enumerate(keys)}
    unit = np.eye(len(keys))
    out: list[Estimate] = []
    varying = {name for name in ("k1", "alpha_bw") if any(key.name == increment_of(name) for key in keys)}
    for key, i in index.items():
        if key.name in varying:
            out += _totals(key, index, values, errors, verdict, reference_current)
        elif shared_name(key.name) != key.name:
            continue  # told as a total at its current
        elif key.text in verdict.reasons:
            out.append(undetermined(key.name, verdict.reasons[key.text], key.at))
        elif key.name in at_bound:
            out.append(_at_limit(key, at_bound[key.name], *errors.of(unit[i])))
        else:
            sd, dof = errors.of(unit[i])
            positive = key.name in ("tau", "rho")
            relative = key.name == "k_mr" and bool(reference_current)
            remark = f"relative to {reference_current:g} A, the least current of these runs" if relative else ""
            value = float(values[i])
            out.append(estimate(key.name, value, sd, dof=dof, at=key.at, logarithmic=positive, reason=remark))
    return (*out, _damper(index, values, errors, verdict), *verdict.sums)


def _at_limit(key: Key, limit: float, sd: float, dof: float) -> Estimate:
    reason = f"lies at the limit {limit:g} of the physically admissible; the interval is one-sided"
    return Estimate(key.name, limit, sd, (limit, limit + t_quantile(dof) * sd), key.at, reason, dof)


def _totals(
    base: Key,
    index: Mapping[Key, int],
    values: np.ndarray,
    errors: Errors,
    verdict: Determination,
    reference_current: float | None,
) -> list[Estimate]:
    """Return a shared coefficient at every current where the variant lets it vary (shared + increment)."""
    increments = [(key.current, [index[base], i]) for key, i in index.items() if key.name == increment_of(base.name)]
    out: list[Estimate] = []
    for current, members in [(reference_current, [index[base]]), *increments]:
        at: dict[str, float | str | bool] = {"coil_current": float(current or 0.0)}
        if base.text in verdict.undetermined:
            out.append(undetermined(base.name, verdict.reasons[base.text], at))
            continue
        gradient = np.zeros(len(index))
        gradient[members] = 1.0
        sd, dof = errors.of(gradient)
        out.append(estimate(base.name, float(values[members].sum()), sd, dof=dof, at=at))
    return out


def _damper(
    index: Mapping[Key, int],
    values: np.ndarray,
    errors: Errors,
    verdict: Determination,
) -> Estimate:
    """Return s1 = k1 tau, where both are determined."""
    tau, k1 = index[Key("tau")], index[Key("k1")]
    gradient = np.zeros(len(index))
    gradient[[k1, tau]] = values[tau], values[k1]
    sd, dof = errors.of(gradient)
    value = float(values[k1] * values[tau])
    lost = {"k1", "tau"} & {*verdict.undetermined}
    if lost:
        return undetermined("s1", f"needs k1 and tau; {' and '.join(sorted(lost))} not determined")
    return estimate("s1", value, sd, dof=dof)
