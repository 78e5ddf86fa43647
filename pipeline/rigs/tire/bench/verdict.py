"""The verdict on a bench campaign, its reasons in plain words, what to measure next (tire.md, 7).

rejected  the ring model does not fit, or there is neither a ring nor a calibration: nothing for which the bench is run stands.
warning   runs left out, a core number without a value, doubts of the fit, or any other warning.
ok        none of these.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.errors import counted, listing
from pipeline.findings import Parameter
from pipeline.recording import QualityFinding
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.declaration import PARAMETERS
from pipeline.rigs.tire.bench.identifiability import statements
from pipeline.rigs.tire.bench.parameters import FILM, lawless

_TOLD = 4
_FEW_LOADS = 5
# The campaign is made for these; without one of them it is not whole.
CORE = (
    "rolling_radius", "bending_stiffness", "belt_width", "foundation_radial", "foundation_tangential", "tread_stiffness",
    "loss_factor", "sensor_gain", "sensor_lag", "contact_length", "load_sensitivity", "calibration_0", "calibration_1",
    "calibration_2",
)  # fmt: skip
_WORDS = {spec.name: spec.name.replace("_", " ") for spec in PARAMETERS}


def judge(
    found: Campaign, parameters: Sequence[Parameter], left_out: Mapping[str, str], quality: Sequence[QualityFinding]
) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    _ring(said, found)
    _speed(said, found)
    _calibration(said, found)
    _film(said, found, bool(left_out))
    _missing(said, parameters)
    for run, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {run} is left out: {ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{counted(len(left_out) - _TOLD, 'more run')} are left out, see the quality findings.")
    grave = _together([q for q in quality if q.level != "note" and q.run not in left_out])
    for sentence in grave[:_TOLD]:
        said.warn(sentence)
    if len(grave) > _TOLD:
        said.warn(f"{counted(len(grave) - _TOLD, 'more warning')} stand among the quality findings.")
    _next(said, found)
    said.reasons = list(dict.fromkeys(said.reasons))
    said.advice = list(dict.fromkeys(said.advice))
    return said


def _together(findings: Sequence[QualityFinding]) -> list[str]:
    """Return sentences; findings that differ by their numbers only are told once, with the runs that they are of."""
    groups: dict[str, list[QualityFinding]] = {}
    for finding in findings:
        groups.setdefault(re.sub(r"[-+]?\d[\d.e+-]*", "#", finding.message), []).append(finding)
    told = []
    for same in groups.values():
        first = same[0]
        also = listing(list(dict.fromkeys(q.run for q in same[1:] if q.run and q.run != first.run)), 4)
        text = ended(f"Run {first.run}: {first.message}" if first.run else first.message)
        told.append(f"{text} The like of {also}." if len(same) > 1 and also != "none" else text)
    return told


def _ring(said: Judgement, found: Campaign) -> None:
    ring, verdict = found.ring, found.verdict
    if found.untared:
        said.reject(ended(found.untared))
        return
    if ring is None or verdict is None:
        tell = said.reject if found.calibration is None or found.calibration.curve is None else said.warn
        tell(f"The ring was not fitted: {ended(found.no_ring)}")
        return
    if not verdict.fits:
        said.reject(
            " ".join(ended(one[0].upper() + one[1:]) for one in (verdict.statement, found.circuit_doubt) if one)
        )
        said.advice.append(
            "Find out what the ring lacks: repeat one run after an hour (creep, temperature), measure pressure before and after, the sensor's "
            "length with a rule, and the load under the tire."
        )
        return
    if verdict.level == "ok":
        said.reasons.append(ended(verdict.statement))
    else:
        said.warn(ended(verdict.statement))
    for sentence in statements(ring, verdict):
        if sentence.startswith(("Not determined", "The fit wants")):
            said.warn(ended(sentence))


def _speed(said: Judgement, found: Campaign) -> None:
    if found.line is None:
        return
    if found.clock_u and not found.line.suspicion:
        said.warn(
            f"Re = {found.radius:.4f} m, {100.0 * found.radius_u:.1f} % uncertain (standard error): speed, clock or tire size are in doubt, see there."
        )
        return
    off = np.isfinite(found.line.p_value) and found.line.p_value < 0.01
    tell = said.warn if found.line.suspicion or off else said.reasons.append
    tell(ended(found.line.statement))


def _calibration(said: Judgement, found: Campaign) -> None:
    fit = found.calibration
    if found.untared:
        return
    if fit is None or fit.curve is None:
        said.warn(
            f"There is no load calibration: {ended(fit.reason if fit is not None else 'no run has a load and a peak that can be used')}"
        )
        return
    pressure = (
        f"p0 = {1e-3 * found.tire.pressure:.0f} kPa" if found.tire.pressure is not None else "an unknown pressure"
    )
    said.reasons.append(
        f"The calibration holds from {fit.curve.least:.0f} to {fit.curve.most:.0f} N at {pressure}; a load beyond is extrapolated."
    )
    for remark in fit.remarks:
        grave = "friction" in remark or "off by that" in remark
        (said.warn if grave else said.reasons.append)(ended(remark))


def _film(said: Judgement, found: Campaign, some_left_out: bool) -> None:
    if found.film is None:
        said.reasons.append(f"Whether both sensors are bonded alike is not checked: {ended(found.no_film)}")
        return
    where = " in the runs that are used" if some_left_out else ""
    suspects = [one.run for one in found.odd if one.cause in ("sensor", "film", "unknown")]
    suspects += sorted({*found.misfit, *found.unbonded} - set(suspects))
    if suspects:
        said.warn(
            ended(f"Bonding suspect in {listing(suspects, 6)}, see there. In the other runs: {found.film.statement}")
        )
    else:
        word = {"good": "ok", "bad": "suspect"}.get(found.film.verdict, "fair")
        if word != "suspect" and lawless(found):
            word = "doubtful"
        (said.warn if word in ("suspect", "doubtful") else said.reasons.append)(
            ended(f"Bonding {word}{where}: {found.film.statement}")
        )
    for name in FILM:
        if found.film.estimates[name].value is None and found.film.verdict != "bad":
            said.warn(f"{_WORDS[name]} is not determined: {ended(found.film.estimates[name].reason)}")


def _missing(said: Judgement, parameters: Sequence[Parameter]) -> None:
    """Warn of core numbers without a value, once for each reason."""
    reasons: dict[str, list[str]] = {}
    for p in parameters:
        if p.name in CORE and p.value is None:
            reasons.setdefault(p.description, []).append(_WORDS[p.name])
    for name in CORE:
        if not any(p.name == name for p in parameters):
            reasons.setdefault("no run gives it", []).append(_WORDS[name])
    for reason, names in reasons.items():
        if not any(reason.rstrip(".")[:60] in told for told in said.reasons):
            said.warn(f"Not told: {listing(list(dict.fromkeys(names)), 12)}: {ended(reason)}")
    said.verdict = "warning" if reasons and said.verdict == "ok" else said.verdict


def _next(said: Judgement, found: Campaign) -> None:
    """Say what to measure next."""
    loads = {round(run.nominal_load, -1) for run in found.runs if math.isfinite(run.nominal_load)}
    ring = found.ring
    if len(loads) < _FEW_LOADS:
        said.advice.append(
            f"Measure at five loads or more, up and down, at one speed and pressure (now {counted(len(loads), 'load')}): scale of the stiffnesses and "
            "interval of the calibration rest on them."
        )
    if ring is not None and ring.speeds < 2:
        said.advice.append(
            "Repeat one load at two speeds or more: loss factor, sensor lag and the PVDF's time constant are told apart by speed only."
        )
    if not any("hub_height" in run.reference.means for run in found.runs):
        said.advice.append(
            "Log the hub's height: it fixes the scale of the stiffnesses independently of the load cell."
        )
    if found.tire.sensor_length_u > 0.02:
        said.advice.append(
            "Measure the flex sensor's active length to 1 % and state it with sensor_length_u: length and contact length trade against each other."
        )
    if len({run.told("inflation_pressure") for run in found.runs}) < 2:
        said.advice.append(
            "Repeat one load at ±20 % pressure: the calibration holds at one pressure only, and 10 % less reads as about 7 % more load."
        )


def ended(sentence: str) -> str:
    """Return a sentence with a full stop."""
    sentence = sentence.rstrip()
    return sentence if sentence.endswith((".", "?", "!")) else f"{sentence}."
