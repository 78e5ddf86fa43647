"""The verdict on a flow campaign, its reasons in plain words, what to measure next (rap.md, 5.3 and 7).

rejected  neither E2 nor E3 could be calibrated, or no run is left: nothing for which the bench is run stands.
warning   a core number without a value, an error above the limit, a doubt, runs left out, no hold-out.
ok        none of these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pipeline.errors import counted
from pipeline.findings import Parameter
from pipeline.recording import QualityFinding
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.rap.flow.calibration import speeds_of
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.determined import CLAMP_ADVICE
from pipeline.rigs.rap.flow.results import Campaign, ErrorRow
from pipeline.rigs.rap.flow.sets import CALIBRATION, HOLDOUT
from pipeline.rigs.rap.flow.trap import unclamped

_TOLD = 5
# Speeds of which one can be left out to try the others.
_SPEEDS = 3
CORE = ("stroke_volume", "y0", "y1", "stroke_volume_mean", "pump_compliance")


def judge(
    found: Campaign,
    parameters: Sequence[Parameter],
    left_out: Mapping[str, str],
    quality: Sequence[QualityFinding],
    settings: FlowSettings,
) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    _calibrated(said, found)
    _against_the_limit(said, found, settings)
    missing = [p.name for p in parameters if p.name in CORE and p.value is None]
    if missing and not any("calibrated:" in reason for reason in said.reasons):
        said.warn(f"Not told: {', '.join(missing)}.")
    for run, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {run} is left out: {ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{counted(len(left_out) - _TOLD, 'more run')} are left out, see the quality findings.")
    grave = list(dict.fromkeys(
        ended(f"Run {q.run}: {q.message}" if q.run else _begun(q.message))
        for q in quality if q.level != "note" and q.run not in left_out
    ))  # fmt: skip
    for sentence in grave[:_TOLD]:
        said.warn(sentence)
    if len(grave) > _TOLD:
        said.warn(f"{counted(len(grave) - _TOLD, 'more warning')} stand among the quality findings.")
    _next(said, found)
    said.reasons = list(dict.fromkeys(said.reasons))
    return said


def _calibrated(said: Judgement, found: Campaign) -> None:
    missing = [name for name in ("E2", "E3") if name not in found.laws]
    if len(missing) == 2:
        reasons = list(dict.fromkeys(found.refused[name] for name in missing))
        said.reject(f"Neither E2 nor E3 is calibrated: {ended('; '.join(reasons))}")
        return
    for name in missing:
        said.warn(f"{name} is not calibrated: {ended(found.refused[name])}")
    if "E3" in found.laws and "E2" not in found.laws:
        said.warn(
            "E3 stands on set-points that nobody clamped: back pressure rises with speed there, and whether it is the pressure that costs volume these logs do "
            "not tell."
            if not (~unclamped(found.calibration)).any()
            else "E3 stands alone, with no second estimator to hold it against."
        )


def _against_the_limit(said: Judgement, found: Campaign, settings: FlowSettings) -> None:
    held_out = [row for row in found.errors if row.set == HOLDOUT]
    limit = f"{100 * settings.error_limit:.2f} %"
    if not held_out and found.laws:
        said.warn(
            "No hold-out run has a blood flow of the meter to be held against: how well the estimators predict is told by left-out set-points alone."
        )
    for row in held_out or [row for row in found.errors if row.set == CALIBRATION]:
        if row.estimator not in ("E2", "E3"):
            continue
        told = _told(row)
        if row.worst < settings.error_limit:
            said.reasons.append(f"{told}, below {limit}.")
        else:
            said.warn(f"{told}, not below {limit}, the paper's worst.")
    for name, rest in found.left_out.items():
        worst = max((one.worst for one in rest if math.isfinite(one.worst)), default=math.nan)
        if name in ("E2", "E3") and math.isfinite(worst):
            tell = said.reasons.append if worst < settings.error_limit else said.warn
            tell(f"Set-points that {name} was not calibrated on are predicted within {100 * worst:.2g} %.")
    if "E2" in found.laws and len(found.left_out["E2"]) < 3:
        said.warn(
            "E2 rests on two speeds: no set-point can be left out to see whether its coefficients hold between and beyond them."
        )


def _told(row: ErrorRow) -> str:
    return f"{row.estimator}, {row.group}: largest error {100 * row.worst:.2f} % ({row.where}; rms {100 * row.rms:.2f} %, {row.count} windows)"


def _next(said: Judgement, found: Campaign) -> None:
    """Say what to measure next."""
    metered = any(run.run.meter is not None for run in found.runs)
    if found.calibration.size and not (~unclamped(found.calibration)).any():
        said.advise(CLAMP_ADVICE)
    if found.calibration.size and speeds_of(found.calibration) < _SPEEDS:
        said.advise(
            "Calibrate at three set-points or more, 60, 80 and 100 mL/min say, with the same clamps at each: how the pulsation answers to speed (y0, y1) "
            "shows between them, and one of them can be left out to try the others."
        )
    if not any(row.set == HOLDOUT for row in found.errors):
        said.advise(
            "Hold out runs at other clamp settings and with another tube, and state the condition set: holdout."
        )
    if not metered:
        said.advise(
            "Put a flow meter into the circuit and log it as blood_flow_bench: only it can calibrate the estimators."
        )
    elif found.location.silent or not found.location.stated:
        said.advise(
            "State flowmeter_location (access or return) in every run: without it a flow error of 5 to 8 % cannot be told from ultrafiltration."
        )
    if metered and not found.gain_stated:
        said.advise(
            f"Weigh the flow into a beaker for ten minutes and state flowmeter_gain_u: the meter's gain goes one to one into every volume, and {100 * found.gain_u:.2g} % "
            "is only assumed."
        )
    if found.zero_u > 0.0:
        said.advise(
            "Log 10 s with the pump stopped before and after each run: the sensors' zeros go into E3's stroke volume."
        )
    if not any(run.run.tube for run in found.runs):
        said.advise("State tube_set_id: another tube has another stroke volume, 2 % of which are 3 % of flow.")


def _begun(sentence: str) -> str:
    """Return a sentence with a capital letter, unless it begins with the name of a channel or condition."""
    return sentence if "_" in sentence.split()[0] else sentence[0].upper() + sentence[1:]


def ended(sentence: str) -> str:
    """Return a sentence with a full stop."""
    sentence = sentence.rstrip()
    return sentence if sentence.endswith((".", "?", "!")) else f"{sentence}."
