"""The verdict on a rotating-load campaign, its reasons in plain words, and what to measure next.

rejected  units or probes that cannot be: no coefficient is given.
warning   a fault that could not be mended for sure, a run left out, no model that passes, a coefficient of
          the chosen model that is not determined, or T2 that contradicts T3.
ok        none of these.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.tpjb.rotating.consistency import Consistency
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.harmonics import openness
from pipeline.rigs.tpjb.rotating.parameters import of_clearance

_TOLD = 4
_NEAR_FOLD = 0.15


def judge(
    groups: Sequence[LoadGroup],
    consistency: Sequence[Consistency],
    left_out: dict[str, str],
    quality: Sequence[QualityFinding],
    refused: str,
    settings: RotatingSettings,
) -> Judgement:
    """Weigh what was found; `refused` says why no coefficient is given, and is empty where they are."""
    said = Judgement()
    if refused:
        said.verdict = "rejected"
        said.reasons.append(f"No coefficient is given: {ended(refused)}")
    for group in groups:
        if not refused:
            said.reasons += summary(group, settings)
            _doubts(said, group, quality)
    if not refused:
        _dynamic_test(said, consistency)
    _left_out(said, left_out)
    grave = [q for q in quality if q.level != "note" and q.run not in left_out and q.message.rstrip(".") != refused]
    for finding in grave[:_TOLD]:
        where = f"Run {finding.run}: " if finding.run else ""
        said.warn(f"{where}{finding.message}" if where else finding.message[:1].upper() + finding.message[1:])
    if len(grave) > _TOLD:
        said.warn(f"{len(grave) - _TOLD} more warnings stand among the quality findings.")
    return said


def summary(group: LoadGroup, settings: RotatingSettings) -> list[str]:
    """Return the verdict lines of one static load."""
    trusted = group.trusted
    parts = []
    limit = trusted.limit if trusted else None
    if limit is not None and limit.ratio is not None and limit.displacement is not None:
        parts.append(
            f"linear up to rho* = {limit.ratio:.3g} (THD {100 * settings.thd_nonlinear:g} %), |d| = "
            f"{1e6 * limit.displacement:.3g} um{_clearance(group, limit.displacement)}"
        )
    highest = group.highest
    at = _highest(group)
    distortion = group.distortions.get(highest.run)
    if distortion is not None:
        parts.append(f"at {at} the orbit is {word_of(distortion.value, settings)} (THD {100 * distortion.value:.2g} %)")
    if trusted is not None:
        parts.append(_law(trusted))
    lines = [f"{group.label}: {'; '.join(parts)}."] if parts else []
    if highest.motion is not None and not group.selected.model.is_linear and not group.apart:
        lines.append(f"{group.label}: {_second_order(group, at)}")
    return lines


def _law(group: LoadGroup) -> str:
    fit = group.selected
    kind = "linear" if fit.model.is_linear else "quadratic"
    richer = [f.name for f in group.fits if f.size > fit.size and f.model.holds(fit.model)]
    needed = f"; {richer[0]} is not needed" if richer else ""
    if fit.model.is_linear:
        needed = "; no quadratic term is needed"
    return f"the {kind} law {fit.name} fits to {1e6 * fit.rms:.2g} um{needed}"


def _second_order(group: LoadGroup, at: str) -> str:
    """Say what the 2X orbit of the largest load means for the form of the law."""
    assert group.highest.motion is not None
    value, sd, is_open = openness(group.highest.motion)
    if is_open:
        return (
            f"the 2X orbit at {at} is open ({100 * value:.2g} ± {196 * sd:.1g} %): eqs (3) and (4) are not enough, mixed "
            "terms are needed."
        )
    enough = ": eqs (3) and (4) are enough" if group.comparison.passes else ", and yet no quadratic law holds"
    return f"the 2X orbit at {at} is a line within its error{enough}."


def _clearance(group: LoadGroup, displacement: float) -> str:
    told = of_clearance(group, displacement)
    return f" = {told[2:].replace(' of the clearance', ' c')}" if told else ""


def word_of(thd: float, settings: RotatingSettings) -> str:
    """Return what a THD means."""
    if thd < settings.thd_linear:
        return "linear"
    return "marginal" if thd <= settings.thd_nonlinear else "nonlinear"


def _doubts(said: Judgement, group: LoadGroup, quality: Sequence[QualityFinding]) -> None:
    fit = group.selected
    rubs = any(q.message.startswith(f"{group.label}: ") and "friction" in q.message for q in quality)
    if group.apart:
        said.warn(f"{group.label}: {group.apart} No coefficient is given.")
        said.advise("Give each run the static load, speed and bearing that it was measured at.")
        return
    if not group.comparison.passes:
        lower = f" The coefficients come from the ratios up to {_highest(group.lower)}." if group.lower else ""
        said.warn(
            f"{group.label}: a quadratic law is not enough up to {_highest(group)}: {fit.name}, the best, leaves "
            f"{1e6 * fit.rms:.2g} um rms, {times_noise(fit.chi2_reduced)}: "
            f"{'what friction leaves over (see below), or ' if rubs else ''}cubic content.{_past_fold(group)}{lower}"
        )
        if group.lower is None:
            said.advise("Lower the load ratio until a quadratic law fits, then add ratios upwards.")
            return
        fit = group.lower.selected
    free = [name for name, row in zip(fit.estimates, fit.model.matrix, strict=True) if row.any()]
    lost = [name for name in free if not fit.estimates[name].determined]
    if lost:
        said.warn(f"{group.label}: not determined: {listing(lost)}; {fit.estimates[lost[0]].reason}.")
        if not fit.mean_shift_seen:
            said.advise(
                "Hold 60 s at zero dynamic force before and after the turns, with ramps between: this shows the static "
                "equilibrium, on which kxx2 + kxy2 and kyx2 + kyy2 depend. Another load ratio does too."
            )
    if fit.model.is_linear:
        said.advise(
            "Add a run at a higher load ratio, 15 % or more: an orbit that bends tells the quadratic terms and the linear limit."
        )
    margin = fit.fold_margin
    if not margin > _NEAR_FOLD:
        said.warn(
            f"{group.label}: on the orbit det J falls to {margin:.2g} of det K: the quadratic law is close to its fold, "
            "beyond which it has no equilibrium, and is not to be used at higher ratios."
        )
    noises = group.selected.noises
    weakest = min(t.amplitude / float(np.mean(n.sigma)) for t, n in zip(group.runs, noises, strict=True))
    if weakest < 5.0:
        said.warn(f"{group.label}: the smallest orbit is only {weakest:.2g} times the noise of the displacement.")
    if group.static_load is None:
        said.warn("The static load is not known (neither static_load nor force_static): load ratios have no meaning.")
        said.advise("Give static_load for each run: in the log, in runs.csv or in the recipe.")


def _past_fold(group: LoadGroup) -> str:
    """Say which laws have no equilibrium under the largest load."""
    past = [name for name, why in group.comparison.failed.items() if "fold" in why]
    return f" {listing(past)}: invalid at this ratio, the load lies past the fold of the law." if past else ""


def _dynamic_test(said: Judgement, consistency: Sequence[Consistency]) -> None:
    """Say whether the dynamic test gives the same stiffness."""
    compared = [entry for entry in consistency if entry.grave and entry.z is not None]
    for entry in compared:
        if entry.contradicts:
            said.warn(entry.sentence)
    if compared and not any(entry.contradicts for entry in compared):
        largest = max(abs(entry.z or 0.0) for entry in compared)
        said.reasons.append(
            f"The dynamic test gives the same stiffness: {len(compared)} coefficients differ by at most {largest:.1f} standard "
            "errors."
        )


def _highest(group: LoadGroup) -> str:
    record = group.highest.record
    return f"{100 * record.ratio:.2g} %" if record.ratio else f"{record.rotation.size / 1e3:.4g} kN of load"


def ended(sentence: str) -> str:
    """Return a sentence with its full stop, if it has no other end."""
    sentence = sentence.rstrip()
    return sentence if sentence.endswith((".", "?", "!")) else f"{sentence}."


def _left_out(said: Judgement, left_out: dict[str, str]) -> None:
    for run, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {run} is left out: {ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{len(left_out) - _TOLD} more runs are left out, see the quality findings.")
