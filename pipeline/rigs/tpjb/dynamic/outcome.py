"""Parameters, models and tables of `tpjb.dynamic` from the solutions of its operating points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.estimation.selection import Candidate
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import ModelResult, Parameter, Published
from pipeline.rigs.tpjb.dynamic.declaration import PARAMETERS
from pipeline.rigs.tpjb.dynamic.laws import Law, choice_error, for_intercept
from pipeline.rigs.tpjb.dynamic.nonlinearity import Products
from pipeline.rigs.tpjb.dynamic.solution import NAMES, Coefficient, Solution
from pipeline.rigs.tpjb.gains import Gains, gains_of, type_a, with_type_b

_METHOD = "ratio of coherent means over blocks"
# A shift by what is in doubt that counts, in standard errors.
_COUNTS = 2.0
_CURVE = 80
# Relative change of a stiffness below which "nearly independent" of frequency is agreed with.
_NEARLY = 0.1
_SPEC = {spec.name: spec for spec in PARAMETERS}


def parameters_of(solution: Solution) -> list[Parameter]:
    """Return the coefficients at each tone and at shaft speed, null with the reason where they are not told."""
    at = solution.pool.at
    found = []
    if not solution.fatal:
        dropped = sorted(solution.pool.dropped.items())
        for name in NAMES:
            entry = solution.coefficients[name]
            found += [_at_tone(solution, entry, k) for k in range(solution.tones.size)]
            found += [
                _null(name, {**at, "frequency": _hz(tone)}, f"tone not used: {reason}") for tone, reason in dropped
            ]
    for name in NAMES:
        found.append(_synchronous(solution, name))
    return found


def _hz(tone: float) -> float:
    return round(float(tone), 3)


def _at_tone(solution: Solution, entry: Coefficient, k: int) -> Parameter:
    at = {**solution.pool.at, "frequency": _hz(solution.tones[k])}
    sd, value = float(entry.std_error[k]), float(entry.value[k])
    if reason := _doubted(solution, entry.name, sd, k):
        return _null(entry.name, at, reason)
    description = (
        f"type A: {t_quantile(float(entry.dof[k])):.2f} standard errors, {entry.dof[k]:.3g} degrees of freedom"
    )
    found = _parameter(entry.name, value, sd, float(entry.dof[k]), at, description)
    return _with_type_b(solution, found, float(entry.inertia[k]))


def _synchronous(solution: Solution, name: str) -> Parameter:
    at = {**solution.pool.at, "synchronous": True}
    if solution.fatal:
        return _null(name, at, solution.fatal)
    shaft, entry = solution.pool.shaft, solution.coefficients[name]
    if not shaft or entry.law is None:
        return _null(name, at, "the shaft speed is not known")
    if not solution.tones.min() <= shaft <= solution.tones.max():
        span = f"{solution.tones.min():g} to {solution.tones.max():g} Hz"
        return _null(
            name, at, f"no tones on both sides of the shaft's {shaft:.4g} Hz (used: {span}); it would be extrapolated"
        )
    goes = _goes(solution)
    law = for_intercept(entry.law, entry.laws, goes)
    (value,), (scatter,) = law.at(0.0)
    chosen = 0.0 if goes else choice_error(law, entry.laws)
    sd = float(np.hypot(scatter, chosen))
    nearest = int(np.abs(solution.tones - shaft).argmin())
    if reason := _doubted(solution, name, sd, nearest):
        return _null(name, at, reason)
    judged = f"chi-square {law.chi2:.3g} with {law.dof} degrees of freedom" if law.dof else "no degree of freedom left"
    widened = f", errors widened {law.widening:.2g} times" if law.widening > 1 else ""
    by_mass = float(np.interp(shaft, solution.tones, entry.inertia))
    widened += (
        f", of the error {chosen:.2g} {_SPEC[name].unit} by the choice of the degree" if chosen > 0.1 * sd else ""
    )
    enough = f", where degree {entry.law.degree} would do" if law is not entry.law else ""
    text = f"order {law.degree}: polynomial of degree {law.degree} in frequency{enough} ({judged}{widened})"
    return _with_type_b(solution, _parameter(name, float(value), sd, law.noise_dof, at, text), by_mass)


def _goes(solution: Solution) -> bool:
    """Tell whether any coefficient goes with frequency."""
    return any(other.law is not None and other.law.degree > 0 for other in solution.coefficients.values())


def _doubted(solution: Solution, name: str, sd: float, k: int) -> str:
    shift = solution.shift.get(name)
    if shift is None or shift[k] <= _COUNTS * sd:
        return ""
    return (
        f"not told, since {solution.doubt} would explain the trend of stiffness with frequency and shift this by "
        f"{shift[k]:.3g} {_SPEC[name].unit}"
    )


def _gains(solution: Solution) -> Gains:
    return gains_of(member.conditions for member in solution.pool.members)


def _with_type_b(solution: Solution, found: Parameter, by_inertia: float) -> Parameter:
    """Return a parameter with what gains and the error of the stator's inertia add, and say so."""
    gains = _gains(solution)
    by_gains = gains.share(1, 1) * abs(found.value or 0.0)
    told = with_type_b(with_type_b(found, by_gains), by_inertia)
    inertia = (
        "error of the stator's mass not stated and not in the interval"
        if np.isnan(solution.inertia.mass_error)
        else f"with ±{by_inertia:.2g} {found.unit} (standard, type B) by the stator's inertia"
    )
    return told.model_copy(update={"description": f"{found.description}; {gains.text(1, 1)}; {inertia}"})


def _parameter(
    name: str, value: float, sd: float, dof: float, at: dict[str, float | str | bool], description: str
) -> Parameter:
    half = t_quantile(dof) * sd
    spec = _SPEC[name]
    return Parameter(
        name=name,
        symbol=spec.symbol,
        value=value,
        std_error=sd,
        ci95=(value - half, value + half),
        unit=spec.unit,
        at=at,
        description=description,
        source=spec.source,
        method=_METHOD,
    )


def _null(name: str, at: dict[str, float | str | bool], reason: str) -> Parameter:
    spec = _SPEC[name]
    return Parameter(
        name=name, symbol=spec.symbol, value=None, unit=spec.unit, at=at, description=reason, source=spec.source
    )


def models_of(solutions: Sequence[Solution]) -> list[ModelResult]:
    """Return the laws of degree 0, 1, 2 of every coefficient, the taken one selected."""
    models = []
    for solution in solutions:
        for entry in solution.coefficients.values():
            models += [_model(solution, entry, law) for law in entry.laws]
    return models


def _model(solution: Solution, entry: Coefficient, law: Law) -> ModelResult:
    r = solution.tones / (solution.pool.shaft or 1.0) - 1
    left = entry.value - law.at(r)[0]
    candidate = Candidate("", law.chi2, r.size, law.degree + 1, sigma_known=True)
    return ModelResult(
        name=f"{entry.name}, degree {law.degree}, {solution.pool.label}",
        family=f"{entry.name}, {solution.pool.label}",
        selected=law is entry.law,
        n_parameters=law.degree + 1,
        n_data=r.size,
        rms_residual=float(np.sqrt(np.mean(left**2))),
        unit=_SPEC[entry.name].unit,
        chi2_reduced=law.chi2 / law.dof if law.dof else None,
        bic=candidate.bic,
        aicc=candidate.aicc,
        description="passes" if law.passes else "rejected by chi-square",
    )


def published_of(solutions: Sequence[Solution]) -> list[Published]:
    """Return the paper's claim about frequency beside what was found."""
    rows = []
    for solution in solutions:
        for name in ("kxx", "kyy"):
            entry = solution.coefficients.get(name)
            if entry is None or entry.law is None or not solution.pool.shaft:
                continue
            rows.append(_change(solution, entry))
    return rows


def _change(solution: Solution, entry: Coefficient) -> Published:
    """Return the change from the lowest to the highest tone, relative, with its interval."""
    low, high = int(solution.tones.argmin()), int(solution.tones.argmax())
    level = abs(float(np.mean(entry.value)))
    change = float(entry.value[high] - entry.value[low]) / level
    half = float(np.hypot(*(t_quantile(float(entry.dof[k])) * entry.std_error[k] for k in (low, high)))) / level
    told = not any(_doubted(solution, entry.name, float(entry.std_error[k]), k) for k in (low, high)) and low != high
    agrees = True if abs(change) + half < _NEARLY else False if abs(change) - half > _NEARLY else None
    span = f"from {solution.tones[low]:g} to {solution.tones[high]:g} Hz, over the mean of all tones"
    doubt = solution.doubt or "there is one tone"
    return Published(
        name=f"change of {entry.name} with frequency, {solution.pool.label}",
        published="nearly independent",
        found=change if told else None,
        where="section 2",
        agrees=agrees if told else None,
        remark=f"{span}; 95 % interval {change - half:.2g} to {change + half:.2g}"
        if told
        else f"{span}; not told: {doubt}",
    )


def arrays_of(solutions: Sequence[Solution], products: Sequence[Sequence[Products]]) -> dict[str, Any]:
    """Return the tables that the report draws: coefficients, laws, synchronous values, tones, blocks and more."""
    tables: dict[str, list[dict[str, Any]]] = {
        name: []
        for name in (
            "coefficients",
            "laws",
            "synchronous",
            "tones",
            "blocks",
            "products",
            "shares",
            "added_mass",
            "inertia",
        )
    }
    for solution, lines in zip(solutions, products, strict=True):
        here = {"point": solution.pool.label, "shaft": solution.pool.shaft or np.nan}
        _coefficient_rows(solution, here, tables)
        _tone_rows(solution, here, tables)
        inertia = solution.inertia
        if inertia.mass is not None:
            row = {**here, "mass": inertia.mass, "mass_error": inertia.mass_error, "source": inertia.source}
            row |= {"stiffness": inertia.stiffness, "stiffness_error": inertia.stiffness_error}
            tables["inertia"].append(row)
        for line in lines:
            for f, amplitude, noise in zip(line.frequency, line.amplitude, line.noise, strict=True):
                tables["products"].append(
                    {**here, "excitation": line.kind, "frequency": f, "amplitude": amplitude, "noise": noise}
                )
            tables["shares"].append(
                {**here, "excitation": line.kind, "share": line.share, "std_error": line.share_error}
            )
    return {name: pd.DataFrame(rows) for name, rows in tables.items() if rows}


def _coefficient_rows(solution: Solution, here: dict[str, Any], tables: dict[str, list[dict[str, Any]]]) -> None:
    gains, shaft = _gains(solution), solution.pool.shaft
    gain = None if gains.probe is None and gains.cell is None else gains.share(1, 1)
    for entry in solution.coefficients.values():
        half = np.array([t_quantile(float(dof)) for dof in entry.dof]) * entry.std_error
        for k, tone in enumerate(solution.tones):
            value = float(entry.value[k])
            tables["coefficients"].append(
                {**here, "name": entry.name, "frequency": tone, "value": value, "std_error": entry.std_error[k]}
                | {"low": value - half[k], "high": value + half[k], "dof": entry.dof[k]}
                | {"type_b_gain": np.nan if gain is None else gain * abs(value), "type_b_inertia": entry.inertia[k]}
            )
        if not shaft or entry.law is None:
            continue
        f = np.linspace(min(solution.tones.min(), shaft), max(solution.tones.max(), shaft), _CURVE)
        for law in entry.laws:
            values = law.at(f / shaft - 1)[0]
            tables["laws"] += [
                {
                    **here,
                    "name": entry.name,
                    "degree": law.degree,
                    "frequency": x,
                    "value": y,
                    "taken": law is entry.law,
                }
                for x, y in zip(f, values, strict=True)
            ]
        parameter = _synchronous(solution, entry.name)
        low, high = parameter.ci95 or (np.nan, np.nan)
        read = for_intercept(entry.law, entry.laws, _goes(solution))
        tables["synchronous"].append(
            {
                **here,
                "name": entry.name,
                "value": parameter.value,
                "std_error": type_a(parameter),
                "low": low,
                "high": high,
            }
            | {"degree": read.degree, "chi2": read.chi2, "dof": read.dof, "passes": read.passes}
            | {"type_b_gain": None if gain is None or parameter.value is None else gain * abs(parameter.value)}
            | {"type_b_inertia": float(np.interp(shaft, solution.tones, entry.inertia))}
        )
    for axes, (mass, error, stiffness) in solution.added_mass.items():
        tables["added_mass"].append({**here, "axes": axes, "mass": mass, "std_error": error, "stiffness": stiffness})


def _tone_rows(solution: Solution, here: dict[str, Any], tables: dict[str, list[dict[str, Any]]]) -> None:
    kinds = [kind.replace("_", " ") for kind in solution.pool.kinds]
    if solution.result is not None:
        for k, tone in enumerate(solution.tones):
            row = {**here, "frequency": tone, "used": True, "reason": "", "condition": solution.result.condition[k]}
            row |= {f"snr_{m + 1}": solution.snr[k, m] for m in range(len(kinds))}
            tables["tones"].append(row)
    for tone, reason in sorted(solution.pool.dropped.items()):
        tables["tones"].append({**here, "frequency": tone, "used": False, "reason": reason, "condition": np.nan})
    for record in solution.pool.records:
        for start, kind, used in zip(record.start, record.kinds, record.usable, strict=True):
            tables["blocks"].append(
                {
                    **here,
                    "run": record.run,
                    "start": start,
                    "length": record.block.length,
                    "excitation": kind,
                    "used": bool(used),
                }
            )
