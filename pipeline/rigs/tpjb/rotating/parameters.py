"""From fits to the parameters and models of the findings (tpjb.md, section 10); nothing is computed anew here."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.estimation.selection import Candidate
from pipeline.findings import ModelResult, Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tpjb.gains import gains_of, with_type_b
from pipeline.rigs.tpjb.rotating.declaration import PARAMETERS
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.harmonics import amplitude
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.model_fit import LawFit
from pipeline.rigs.tpjb.rotating.turns import Turns

_SPECS = {spec.name: spec for spec in PARAMETERS}
_HARMONICS = "harmonic regression at the stamps of the steady turns"
# Powers of the gains of probes and load cells that a number goes with; a load ratio needs the force only.
_POWERS = (
    dict.fromkeys(COEFFICIENTS[:4], (1.0, 1.0))
    | dict.fromkeys(COEFFICIENTS[4:], (2.0, 1.0))
    | {"linear_limit": (0.0, 1.0), "thd": (0.0, 0.0), "orbit_harmonic_x": (1.0, 0.0), "orbit_harmonic_y": (1.0, 0.0)}
)
_FIT = "displacement-domain fit to all ratios at this static load"


def parameter(found: Estimate, at: OperatingPoint, description: str = "", method: str = "") -> Parameter:
    """Return an estimate as a parameter of the findings."""
    spec = _SPECS[found.name]
    known = (
        (f"{_sentence(spec.description)}", description) if found.determined else (_sentence(found.reason), description)
    )
    text = " ".join(part for part in known if part)
    return Parameter(
        name=found.name,
        symbol=spec.symbol,
        value=found.value,
        std_error=found.std_error if found.determined else None,
        ci95=found.ci95 if found.determined else None,
        unit=spec.unit,
        at=at,
        description=text,
        source=spec.source,
        method=method,
    )


def _sentence(reason: str) -> str:
    return f"{reason[0].upper()}{reason[1:].rstrip('.')}." if reason else ""


def parameters_of(groups: Sequence[LoadGroup], single: Sequence[Turns], refused: str = "") -> list[Parameter]:
    """Return coefficients and linear limit of each static load, THD and harmonics of each run.

    Parameters
    ----------
    groups
        One a static load.
    single
        All runs.
    refused
        Why no coefficient of this campaign is to be used; empty where they are.
    """
    found: list[Parameter] = []
    for group in groups:
        found += _coefficients(group, refused)
        found.append(_limit(group, refused))
    by_run = {run: distortion for group in groups for run, distortion in group.distortions.items()}
    for turns in single:
        distortion = by_run.get(turns.run)
        if distortion is not None and not refused:
            thd = estimate("thd", distortion.value, distortion.std_error)
        else:
            thd = Estimate(
                "thd", None, reason=refused or turns.refusal or "no law holds that tells what the load explains"
            )
        found.append(parameter(thd, {"run": turns.run}, "", _HARMONICS))
        found += _harmonics(turns, refused)
    return found


def _coefficients(group: LoadGroup, refused: str) -> list[Parameter]:
    trusted = group.trusted or group
    fit = trusted.selected
    estimates = fit.estimates
    doubt = refused or ("" if group.trusted else _no_law(group))
    found = []
    for name in COEFFICIENTS:
        own = Estimate(name, None, reason=doubt) if doubt else estimates[name]
        told = []
        if own.determined:
            told += [f"Model {fit.name}.", _only_lower(group), _gain_text(group.runs[0], name)]
        elif not doubt:
            told += [
                f"Determined: {c.text} = {c.value:.4g} ± {1.96 * c.std_error:.2g} {_SPECS[name].unit}."
                for c in fit.combinations
                if name in c.members
            ]
        elif not refused and not group.apart and estimates[name].determined:
            told.append(f"{fit.name} fits this ratio best with {estimates[name].value:.4g} {_SPECS[name].unit}.")
        description = " ".join(part for part in told if part)
        method = f"{_FIT}, {counted(len(trusted.runs), 'run')}"
        found.append(_calibrated(parameter(own, dict(group.at), description, method), group.runs[0]))
    return found


def _calibrated(found: Parameter, turns: Turns) -> Parameter:
    """Return a parameter whose interval holds the stated gains of the sensors too."""
    share = gains_of([turns.record.conditions]).share(*_POWERS[found.name])
    return with_type_b(found, share * abs(found.value or 0.0))


def _gain_text(turns: Turns, name: str) -> str:
    text = gains_of([turns.record.conditions]).text(*_POWERS[name])
    return f"{text[:1].upper()}{text[1:]}."


def _no_law(group: LoadGroup) -> str:
    if group.apart:
        return group.apart
    return (
        f"no quadratic law holds (the best misses by {times_noise(group.selected.chi2_reduced)}): a coefficient would depend "
        "on the load ratio"
    )


def _only_lower(group: LoadGroup) -> str:
    """Say which ratios were left out because no law holds with them."""
    if group.lower is None:
        return ""
    left = [turns.run for turns in group.runs if turns.run not in group.lower.index]
    return f"Without {listing(left)}: with it no quadratic law holds."


def _limit(group: LoadGroup, refused: str) -> Parameter:
    trusted = group.trusted
    limit = trusted.limit if trusted else None
    if refused or trusted is None:
        reason = refused or _no_law(group)
    elif limit is None:
        reason = "the static load is not known, so a load ratio has no meaning"
    else:
        reason = limit.reason
    if limit is None or limit.ratio is None or limit.displacement is None or refused:
        return parameter(Estimate("linear_limit", None, reason=reason), dict(group.at))
    own = Estimate("linear_limit", limit.ratio, limit.std_error, limit.ci95)
    beyond = " No run went as far." if limit.extrapolated else ""
    description = (
        f"The orbit then reaches {1e6 * limit.displacement:.3g} um{of_clearance(group, limit.displacement)}.{beyond} "
        f"{_only_lower(group)}"
    ).strip()
    name = trusted.selected.name if trusted else ""
    found = parameter(own, dict(group.at), description, f"simulation of {name}, draws of its coefficients")
    return _calibrated(found, group.runs[0])


def of_clearance(group: LoadGroup, displacement: float) -> str:
    """Return ", 0.05 of the clearance" where the clearance is known."""
    c = clearance_of(group)
    return f", {displacement / c:.2g} of the clearance" if c else ""


def clearance_of(group: LoadGroup) -> float | None:
    """Return the nominal clearance of a group's bearing, m."""
    value = group.runs[0].record.conditions.get("clearance_nominal")
    return float(value) if isinstance(value, int | float) and value > 0 else None


def _harmonics(turns: Turns, refused: str) -> list[Parameter]:
    found = []
    for axis in ("x", "y"):
        for order in (1, 2, 3):
            name = f"orbit_harmonic_{axis}"
            at: OperatingPoint = {"run": turns.run, "order": float(order)}
            if turns.motion is None or refused:
                found.append(parameter(Estimate(name, None, reason=refused or turns.refusal), at))
                continue
            own = amplitude(turns.motion, turns.noise, axis, order)
            estimated = Estimate(name, own.value, own.std_error, own.ci95)
            told = _calibrated(parameter(estimated, at, "", _HARMONICS), turns)
            low, high = told.ci95 or (0.0, 0.0)
            found.append(told.model_copy(update={"ci95": (max(low, 0.0), high)}))
    return found


def models_of(groups: Sequence[LoadGroup], main: LoadGroup | None) -> list[ModelResult]:
    """Return every model of every static load; the one chosen at the load of the largest ratio is selected."""
    found = []
    for group in groups:
        for fit in (*group.fits, *group.dependent):
            chosen = fit is group.selected
            own = candidate_of(group, fit)
            found.append(
                ModelResult(
                    name=fit.name,
                    family=group.label if len(groups) > 1 else "",
                    selected=chosen and group is main,
                    n_parameters=fit.size,
                    n_data=fit.n_data,
                    rms_residual=fit.rms,
                    unit="m",
                    nrmse=fit.nrmse,
                    chi2_reduced=fit.chi2_reduced,
                    aicc=own.aicc,
                    bic=own.bic,
                    cv_error=group.prediction if chosen else None,
                    description=_model_text(group, fit, chosen),
                )
            )
    return found


def candidate_of(group: LoadGroup, fit: LawFit) -> Candidate:
    """Return the criteria of a model; those of a load-dependent form count correlated samples as its rivals do."""
    if fit.name in group.comparison.fits:
        return group.comparison.candidate(fit.name)
    rival = group.comparison.candidate(group.selected.name)
    return Candidate(fit.name, fit.chi2 * rival.chi2 / group.selected.chi2, rival.n_data, fit.size)


def _model_text(group: LoadGroup, fit: LawFit, chosen: bool) -> str:
    text = fit.law.text
    runs = f"joint fit to {len(group.runs)} ratios" if len(group.runs) > 1 else "fit to one run"
    return f"{text}; {runs}" + ("; chosen at this static load" if chosen else "")
