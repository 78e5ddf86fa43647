"""The verdict on a campaign of therapy runs, its reasons in plain words, what to measure next (rap.md, section 7).

rejected  no run gives a number.
warning   a check that is not green, a number that the channels ask for and the data do not give, runs left out, any other
          warning on the data.
ok        none of these.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Parameter
from pipeline.recording import QualityFinding
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.rap.therapy.outcome.checks import Check

_TOLD = 4
_ADVICE = {
    "temperature": "Log temperature_air_rap and temperature_air_bench every 10 min from switching on, for an hour at least.",
    "uf_volume": "Log uf_level_distance, uf_echo_valid, uf_pump_command and the scale, and state the tank's geometry.",
    "k_uf": "Log pre-filter, return and ultrafiltrate pressure with 20 s of pump stop at the start (the zero), for 5 h.",
    "runtime": "State battery_energy and battery_efficiency, and log battery voltage and current.",
    "energy": "Log battery voltage and current.",
    "alarm": "Log pressures, set-points and the list of events on one clock, with a minute of steady running before the first fault.",
}


def judge(
    checks: Sequence[Check],
    parameters: Sequence[Parameter],
    left_out: Mapping[str, str],
    quality: Sequence[QualityFinding],
    untold: Collection[tuple[str, str]] = (),
) -> Judgement:
    """Weigh what was found; `untold` are runs and names of parameters of which the run should tell something and tells nothing."""
    said = Judgement()
    determined = [one for one in parameters if one.value is not None]
    if not determined and not any(check.mood == "ok" for check in checks):
        said.reject("No number could be told; the reasons stand with the parameters and the findings on the data.")
    runs = {check.run for check in checks}
    for check in checks:
        place = f"Run {check.run}: " if len(runs) > 1 else ""
        sentence = place + check.sentence
        if check.mood in ("warning", "rejected"):
            said.warn(sentence)
        elif check.mood == "unsaid":
            said.reasons.append(sentence)
    _missing(said, parameters, untold)
    for run, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {run} is left out: {_ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{counted(len(left_out) - _TOLD, 'more run')} are left out, see the findings on the data.")
    said_already = " ".join(said.reasons)
    grave = [
        q for q in quality if q.level != "note" and q.run not in left_out and q.message.rstrip(".") not in said_already
    ]
    for finding in grave[:_TOLD]:
        said.warn(_ended(f"Run {finding.run}: {finding.message}" if finding.run else finding.message))
    if len(grave) > _TOLD:
        said.warn(f"{counted(len(grave) - _TOLD, 'more warning')} stand among the findings on the data.")
    if said.verdict == "warning":
        _advise(said, checks, parameters)
    met = [check for check in checks if check.mood == "ok"]
    if len(met) > _TOLD:
        said.reasons.append(f"{len(met)} of {counted(len(checks), 'check')} are met, see the table of verdicts.")
    else:
        said.reasons += [(f"Run {check.run}: " if len(runs) > 1 else "") + check.sentence for check in met]
    return said


def _missing(said: Judgement, parameters: Sequence[Parameter], untold: Collection[tuple[str, str]]) -> None:
    """Warn of numbers that the channels ask for and no run gives, those of one reason together.

    A run may be too short for what another one gives; of a part that it tells nothing of at all it is warned.
    """
    by: dict[tuple[str, str], list[str]] = {}
    told = {(one.name, one.at.get("source")) for one in parameters if one.value is not None}
    for one in parameters:
        missed = (one.name, one.at.get("source")) not in told or (one.at.get("run"), one.name) in untold
        if one.value is None and missed:
            name = f"{one.name} ({one.at['source']})" if "source" in one.at else one.name
            by.setdefault((str(one.at.get("run", "")), one.description), []).append(name)
    for (run, description), names in list(by.items())[: 2 * _TOLD]:
        reason = description.removeprefix("not determined: ")
        said.warn(_ended(f"Run {run}: {listing(names, 6)} not determined: {reason}"))


def _advise(said: Judgement, checks: Sequence[Check], parameters: Sequence[Parameter]) -> None:
    told = {one.name for one in parameters if one.value is not None}
    for one in parameters:
        if one.value is None and one.name not in told:
            for stem, text in _ADVICE.items():
                if one.name.startswith(stem):
                    said.advise(text)
    by = {check.criterion: check for check in checks if check.mood in ("warning", "rejected")}
    if any("temperature" in name for name in by):
        said.advise(
            "Calibrate the device's air temperature sensor against the bench: a constant offset can be taken off."
        )
    if any("volume" in name for name in by):
        said.advise(
            "Calibrate the tank's geometry once with the scale: fill it by known masses; 2 mm of level are 17 mL in the paper's tank."
        )
    if any("membrane" in name for name in by):
        said.advise(
            "Repeat with the pump stopped at the end as well (zero of the pressures), fluid temperature logged, and the circuit vented."
        )
    if any("alarms" in name for name in by):
        said.advise("Go through the alarms that do not match, with the pressures of that minute beside them.")
    if any("battery" in name for name in by):
        said.advise("Plan a battery change or the mains for the hours that the battery does not last.")
    if any("protective" in name for name in by):
        said.advise("Check the sensor, wiring and converter of the taps at which the two units disagree.")


def _ended(text: str) -> str:
    text = text.strip()
    return text if text.endswith((".", "!", "?")) else f"{text}."
