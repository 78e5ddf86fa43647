"""The verdict on a campaign of pressures, its reasons in plain words, what to measure next (rap.md, 7).

rejected  neither agreement nor hydraulics give a number.
warning   runs left out, an ambiguous clock, a gain or offset not surely within its tolerance, core numbers without a value, or any
          other warning.
ok        none of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Parameter
from pipeline.recording import QualityFinding
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures.declaration import MMHG, PARAMETERS, PressuresSettings
from pipeline.rigs.rap.pressures.judgements import judged
from pipeline.rigs.rap.pressures.resistances import NO_EFFECT, TURNED
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers

_TOLD = 4
_WORDS = {spec.name: spec.name.replace("_", " ") for spec in PARAMETERS}


def judge(
    runs: Sequence[RunNumbers],
    parameters: Sequence[Parameter],
    left_out: Mapping[str, str],
    quality: Sequence[QualityFinding],
    settings: PressuresSettings,
) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    _anything(said, runs, parameters)
    _answers(said, runs, settings)
    if runs:
        _missing(said, parameters)
    for run, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {run} is left out: {ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{counted(len(left_out) - _TOLD, 'more run')} are left out, see the quality findings.")
    told = " ".join(said.reasons)
    grave = [
        q for q in quality if q.level != "note" and q.run not in left_out and q.message.rstrip(".")[:60] not in told
    ]
    for finding in grave[:_TOLD]:
        said.warn(ended(f"Run {finding.run}: {finding.message}" if finding.run else finding.message))
    if len(grave) > _TOLD:
        said.warn(f"{counted(len(grave) - _TOLD, 'more warning')} stand among the quality findings.")
    if runs:
        _next(said, runs, parameters)
    said.reasons = list(dict.fromkeys(said.reasons))
    return said


def _anything(said: Judgement, runs: Sequence[RunNumbers], parameters: Sequence[Parameter]) -> None:
    if any(p.value is not None for p in parameters):
        return
    if not runs:
        said.reject(
            "No run can be used: its channels contradict what a running pump does. Mend what is named below, and nothing else is needed."
        )
        return
    reasons = listing(list(dict.fromkeys(p.description.rstrip(".") for p in parameters)), 3)
    said.reject(f"Neither agreement nor hydraulics give a number: {ended(reasons)}")


def _answers(said: Judgement, runs: Sequence[RunNumbers], settings: PressuresSettings) -> None:
    """Turn the answers of section 7 into reasons: those that are good together, the others one by one."""
    several = len(runs) > 1
    answers = judged(runs, settings)
    for answer in answers:
        where = f"Run {answer.run}: " if several else ""
        what = f"{answer.tap} {answer.question}" if answer.tap else answer.question
        if answer.mood == "rejected":
            said.warn(ended(f"{where}{what}: no, {answer.answer}"))
            if answer.tap:
                said.advise(
                    f"Recalibrate the device's {answer.tap} sensor against the bench, or enter its gain and offset."
                )
        elif answer.mood == "warning":
            said.warn(ended(f"{where}{what}: cannot be decided, {answer.answer}"))
    clocks = [answer for answer in answers if not answer.tap and answer.mood == "ok"]
    if clocks:
        said.reasons.append(ended(f"The clock's alignment is unambiguous: {clocks[0].answer}"))
    good: dict[str, list[str]] = {}
    for answer in answers:
        if answer.tap and answer.mood == "ok":
            good.setdefault(answer.question, []).append(answer.tap)
    for question, taps in good.items():
        said.reasons.append(f"{question[0].upper()}{question[1:]}: {listing(list(dict.fromkeys(taps)), 4)}.")
    for run in runs:
        widths = {tap: numbers.half_width for tap, numbers in run.taps.items() if numbers.half_width is not None}
        if widths:
            where = f" in run {run.name}" if several else ""
            told = ", ".join(f"{TAP_NAMES[tap]} {half / MMHG:.2f}" for tap, half in widths.items())
            said.reasons.append(f"Half widths of the limits of agreement{where}, aligned and equalised: {told} mmHg.")


def _missing(said: Judgement, parameters: Sequence[Parameter]) -> None:
    """Warn of core numbers without a value, once for each reason."""
    reasons: dict[str, list[str]] = {}
    for p in parameters:
        if p.value is None:
            tap = p.at.get("channel")
            name = f"{_WORDS[p.name]} of {TAP_NAMES.get(str(tap), str(tap))}" if tap else _WORDS[p.name]
            reasons.setdefault(p.description.rstrip("."), []).append(name)
    for reason, names in reasons.items():
        said.warn(f"Not told: {listing(list(dict.fromkeys(names)), 10)}: {ended(reason)}")


def _next(said: Judgement, runs: Sequence[RunNumbers], parameters: Sequence[Parameter]) -> None:
    """Say what to measure next."""
    names = {p.name for p in parameters if p.value is None}
    if any(run.alignment is None for run in runs):
        said.advise(
            "Log the bench's pressures at the same taps, on any clock: without them nothing tells how far the device's agree."
        )
    if any(run.alignment is not None and run.alignment.lag.value is None for run in runs):
        said.advise(
            "Start and stop the pump within the log, and change its speed: a constant pulsation looks alike after every stroke."
        )
    if names & {"r_access", "r_filter", "r_return"}:
        said.advise(
            "Run at three speeds with the pump stopped for 20 s at both ends, and log the flow meter or the flow as set."
        )
    seen = any(p.name == "k_uf" and p.description.startswith((NO_EFFECT, TURNED)) for p in parameters)
    if names & {"k_uf", "c_uf"} and not seen:
        said.advise(
            "Switch ultrafiltration on and off at each speed, and log its rate as set: the membrane shows only then."
        )
    if any("flowmeter_gain_u" not in run.record.conditions for run in runs):
        said.advise(
            "State flowmeter_gain_u, the uncertainty of the flow meter's gain: all resistances, compliances and the inertance carry it."
        )


def ended(sentence: str) -> str:
    """Return a sentence with a full stop."""
    sentence = sentence.rstrip()
    return sentence if sentence.endswith((".", "?", "!")) else f"{sentence}."
