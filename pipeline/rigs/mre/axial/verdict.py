"""The verdict on a compression campaign, with its reasons and what to measure next.

rejected  a loop contradicts the model: it would give energy, has no positive stiffness, or is missed by 8 %.
warning   a run left out or doubted, a number not determined, no run at 0 A, labels that the current contradicts.
ok        none of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.estimation.estimate import Estimate
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.mre.axial.levels import Current, Level
from pipeline.rigs.mre.axial.run_fit import RunFit

_FEW_TOLD = 4
_SCATTERED = 0.01


def judge(
    levels: Sequence[Level],
    currents: Mapping[str, Current],
    left_out: Mapping[str, str],
    estimates: Sequence[Estimate],
) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    fits = [fit for level in levels for fit in level.runs]
    for fit in fits:
        for reason in fit.rejected:
            said.reject(f"Run '{fit.run}': {reason}")
    for i, (run, reason) in enumerate(left_out.items()):
        if i < _FEW_TOLD:
            said.warn(f"Run '{run}' was left out: {reason}.")
    if len(left_out) > _FEW_TOLD:
        said.warn(f"{counted(len(left_out) - _FEW_TOLD, 'more run')} left out, see the quality findings.")
    for fit in fits:
        for doubt in [*fit.doubts, *([currents[fit.run].doubt] if currents[fit.run].doubt else [])]:
            said.warn(f"Run '{fit.run}': {doubt.rstrip('.')}.")
    _open(said, estimates)
    _currents(said, levels, currents)
    for level in levels:
        if level.scatter is not None and level.scatter > _SCATTERED:
            said.warn(
                f"Runs at {level.current:g} A scatter by {100 * level.scatter:.2g} % in their secant stiffness (Mullins effect, heating, another seat of the pad)."
                if level.current is not None
                else f"Runs scatter by {100 * level.scatter:.2g} % in their secant stiffness."
            )
            said.advice.append("Repeat runs at 0 A before and after the others, and give 'sequence_index'.")
    _design(said, levels)
    if said.verdict == "ok":
        said.reasons.append("The loop model describes every run; all its numbers are determined.")
    said.reasons.append(_at_these_rates(fits))
    said.advice = list(dict.fromkeys(said.advice))
    return said


def _at_these_rates(fits: Sequence[RunFit]) -> str:
    """Return what the numbers mean: a loop at one rate does not tell hysteresis from relaxation and viscosity."""
    rates = sorted({float(f"{1e3 * abs(fit.rate):.2g}") for fit in fits})
    at = f"{rates[0]:g} mm/s" if len(rates) == 1 else f"{rates[0]:g} to {rates[-1]:g} mm/s"
    return (
        f"All numbers hold at the rate of the test, {at}: loops at one rate cannot tell hysteresis from relaxation and viscosity, so stiffness, alpha, rho and loss contain both."
        + (" Another loop at a fifth of the rate would show it." if rates[-1] < 3 * rates[0] else "")
    )


def _open(said: Judgement, estimates: Sequence[Estimate]) -> None:
    reasons: dict[str, list[str]] = {}
    for e in estimates:
        if e.value is None:
            reasons.setdefault(e.reason, []).append(e.name)
    for reason, names in reasons.items():
        said.warn(f"Not determined: {listing(dict.fromkeys(names))} ({reason}).")


def _currents(said: Judgement, levels: Sequence[Level], currents: Mapping[str, Current]) -> None:
    unknown = [run for run, current in currents.items() if current.value is None]
    if unknown and len(currents) == 1:
        said.warn(
            "No coil current is known, neither by the channel 'current' nor by 'coil_current': the numbers are of an unnamed state."
        )
    if unknown and len(currents) > 1:
        said.warn(f"No coil current is known of {listing(unknown, 6)}: no stiffening is told; give 'coil_current'.")
    known = [level for level in levels if level.current is not None]
    if known and all(level.current != 0 for level in known):
        said.advice.append("Add a run at 0 A: the stiffening is relative to it.")
    elif len(known) == 1 and known[0].current == 0:
        said.advice.append("Add runs with current: the stiffening needs them.")


def _design(said: Judgement, levels: Sequence[Level]) -> None:
    fits = [fit for level in levels for fit in level.runs]
    if any(len(fit.fit.data.motion.strokes) < 2 for fit in fits):
        said.advice.append("Log the release too, down to zero: hysteresis shows only there.")
    open_rho = [
        fit
        for fit in fits
        if fit.numbers.estimates["rho"].value is None and "too small" in fit.numbers.estimates["rho"].reason
    ]
    if open_rho:
        said.advice.append(
            "For rho, turn more slowly or log faster and read the displacement more finely near the turn."
        )
    if any("as large as the stroke" in fit.numbers.estimates["rho"].reason for fit in fits):
        said.advice.append("For rho and alpha, use a longer stroke.")
    if any("gauge stands" in d or "force at zero" in d for fit in fits for d in fit.doubts):
        said.advice.append("Zero gauge and load cell before first contact.")
    if any("screw backlash" in d for fit in fits for d in fit.doubts):
        said.advice.append("Measure the displacement at the pad, not at the screw.")
