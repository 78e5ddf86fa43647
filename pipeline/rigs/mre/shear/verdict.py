"""The verdict on a shear campaign, with its reasons and what to measure next.

rejected  the dynamic model is contradicted by the data (chi2 per degree of freedom above 2 with the
          largest admissible run scatter, an impossible sign, or a prediction that misses a fifth of the
          force), every run is unfit, or a unit is surely wrong. Loop metrics of the runs stand all the same.
warning   something is not determined, one run only, half cycles only, a run left out, a parameter at a
          bound, or a doubt: wrong units, labels that the channels contradict, sliding, an axial load or
          field that is not as set, an untared mass, a large scatter or a trend from run to run.
ok        none of these.
"""

from __future__ import annotations

import math
import re

from pipeline.errors import counted, listing
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.model.variants import REJECTED_BEYOND
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns

# Runs whose largest and smallest are closer than these ratios count as one amplitude, one frequency.
_ONE_AMPLITUDE, _ONE_FREQUENCY = 1.25, 1.1
_RUNS_TOLD, _CAUSES_TOLD = 4, 6  # left out, each with its reason; beyond it runs of one reason are told together
_NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?|[+-]?nan|earlier|later")
# Share of the force that the fit of the first half may miss in the second.
PREDICTION_REJECTED, PREDICTION_WARNED = 0.2, 0.05


def judge(
    runs: SortedRuns,
    fit: DynamicFit | None,
    times: list[TimeFit],
    doubts: list[str],
    remarks: list[str],
    condemned: bool,
    wrong_unit: str = "",
) -> Judgement:
    """Weigh what was found; `remarks` are told and weigh nothing; `condemned` data are shown, and nothing else.

    `wrong_unit` says why a unit is surely wrong, empty where none is.
    """
    said = Judgement()
    if wrong_unit:
        said.reject(f"{wrong_unit} All numbers are off by it: give the unit in the recipe or in the log.")
    if condemned:
        said.reject(
            "No run is fit for identification; the loops are shown as evidence, their numbers are not to be used."
        )
    if fit is not None:
        _loops(said, fit)
    elif runs.loops and not condemned:
        said.warn("Loop metrics only: the dynamic model was not fitted, see the quality findings.")
    for time_fit in times:
        _prediction(said, time_fit)
    if not runs.loops and not runs.records:
        said.warn("Half cycles only: stiffness and loss per run, no damping and no dynamic model.")
        said.advice.append("Cycle the sample several times at constant frequency and amplitude.")
    _left_out(said, runs)
    for doubt in doubts:
        said.warn(doubt)
    if not said.reasons:
        said.reasons.append(_nothing_wrong(fit))
    said.reasons += remarks
    return said


def _nothing_wrong(fit: DynamicFit | None) -> str:
    if fit is None or fit.run_scatter == 0:
        return "All parameters are determined and the residual is no more than the noise."
    return (
        f"All parameters are determined. Within a run the residual is no more than the noise; from run to run the force "
        f"scatters by {100 * fit.run_scatter:.2g} %, which the intervals allow for."
    )


def _left_out(said: Judgement, runs: SortedRuns) -> None:
    told = list(runs.left_out.items())
    if len(told) <= _RUNS_TOLD:
        for run, reason in told:
            said.warn(f"Run {run} is left out: {reason}.")
        return
    alike: dict[str, list[str]] = {}
    for run, reason in told:
        alike.setdefault(_NUMBER.sub("#", reason), []).append(run)
    ordered = sorted(alike.values(), key=len, reverse=True)
    for members in ordered[:_CAUSES_TOLD]:
        first, *others = members
        so = f"so {'is' if len(others) == 1 else 'are'} {listing(others, 6)}" if others else ""
        if len({runs.left_out[run] for run in members}) == 1:
            said.warn(f"Run {first} is left out{f', and {so}' if so else ''}: {runs.left_out[first]}.")
        else:
            said.warn(f"Run {first} is left out: {runs.left_out[first]}. And {so}, with other numbers.")
    rest = [run for members in ordered[_CAUSES_TOLD:] for run in members]
    if rest:
        said.warn(
            f"{counted(len(rest), 'more run')} {'is' if len(rest) == 1 else 'are'} left out for other reasons, see the quality findings: {listing(rest, 8)}."
        )


def _loops(said: Judgement, fit: DynamicFit) -> None:
    ratio = fit.chi2 / max(fit.dof, 1)
    if fit.rejected:
        said.reject(
            f"The dynamic model does not describe the data: by plain least squares it misses by {times_noise(ratio)}, "
            f"which no admissible gain error from run to run explains; rms misfit {100 * fit.nrmse:.2g} % of the force. The "
            "loop metrics of each run do not depend on it."
        )
        if fit.reference_current is None and len(fit.loops) > 1:
            said.advice.append(
                "If the runs were at different coil currents or preloads, give 'coil_current' and 'preload' for each."
            )
        return
    if ratio > REJECTED_BEYOND:
        said.warn(
            f"The residual is more than the noise ({ratio:.2g} times its variance) but only {100 * fit.nrmse:.1g} % of the "
            "force, less than sensors resolve: the errors are scaled to it."
        )
    if fit.inadmissible:
        said.reject(f"Impossible sign of {', '.join(fit.inadmissible)}: the model is no description of this device.")
    if len(fit.loops) == 1:
        said.warn("One run only: loop metrics, and of the model what one loop determines.")
        said.advice.append("Add runs at other frequencies and amplitudes; each alone leaves parameters open.")
    if fit.undetermined:
        said.warn(f"Not determined by these runs: {', '.join(fit.undetermined)}.")
        said.advice += _design_advice(fit)
    for name in fit.at_bound:
        said.warn(f"{name} lies at the edge of what is admissible.")
    if fit.reference_current:
        said.warn("No run is at 0 A: k_MR is not determined; k2 at each current holds it.")
        said.advice.append("Add runs at 0 A.")


def _design_advice(fit: DynamicFit) -> list[str]:
    """Say which runs would separate what is not separated (mre.md design rules)."""
    advice = []
    amplitudes = [loop.amplitude for loop in fit.loops]
    frequencies = [loop.frequency for loop in fit.loops]
    if max(amplitudes) < _ONE_AMPLITUDE * min(amplitudes):
        shown = 1e3 * sorted(amplitudes)[len(amplitudes) // 2]
        advice.append(
            f"Add runs at other amplitudes than {shown:.3g} mm, some {shown / 3:.2g} mm and some {shown * 2:.2g} mm: "
            "one amplitude does not separate k2 from a_BW rho, nor C and n."
        )
    else:
        rho = next((e.value for e in fit.estimates if e.name == "rho"), None)
        if rho is not None and min(amplitudes) * rho > 1:
            advice.append(f"Add a small amplitude, below {1e3 / rho:.2g} mm (1/rho).")
        if rho is not None and max(amplitudes) * rho < 1.5:
            advice.append(f"Add a large amplitude, above {1.5e3 / rho:.2g} mm (1.5/rho).")
    if max(frequencies) < _ONE_FREQUENCY * min(frequencies):
        f = sorted(frequencies)[len(frequencies) // 2]
        advice.append(
            f"Add a run at {f / 5:.2g} Hz and one at {f * 3:.2g} Hz: one frequency does not separate k1 from k2."
        )
    else:
        tau = next((e.value for e in fit.estimates if e.name == "tau"), None)
        corner = 1 / (2 * math.pi * tau) if tau else math.nan
        if min(frequencies) > corner:
            advice.append(
                f"Add a run at {corner / 3:.2g} Hz or less: all frequencies lie above 1/(2 pi tau) = {corner:.2g} Hz."
            )
        if max(frequencies) < corner:
            advice.append(
                f"Add a run at {corner * 2:.2g} Hz or more: all frequencies lie below 1/(2 pi tau) = {corner:.2g} Hz."
            )
    return advice or ["Add amplitudes and frequencies that are further apart."]


def _prediction(said: Judgement, fit: TimeFit) -> None:
    share = fit.nrmse_second_half
    sentence = (
        f"Fitted to the first half of the record the model predicts the second half to within {100 * share:.3g} % of "
        f"the force (rms); the first half itself is met to {100 * fit.nrmse_first_half:.3g} %."
    )
    if not share < PREDICTION_REJECTED:
        said.reject(f"{sentence} The model does not describe this device.")
        return
    if share > PREDICTION_WARNED or share > 2 * fit.nrmse_first_half:
        said.warn(sentence)
    else:
        said.reasons.append(sentence)
    if fit.undetermined:
        said.warn(f"Not determined by this record: {', '.join(fit.undetermined)}.")
    for name in fit.at_bound:
        said.warn(f"{name} lies at the edge of what is admissible.")
