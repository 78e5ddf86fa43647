"""The methods paragraphs of `mre.shear`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.rigs.mre.shear.parameters import VARIANT_TEXTS
from pipeline.rigs.mre.shear.sections_many import is_many


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    kinds = findings.arrays["runs"]["kind"].value_counts() if "runs" in findings.arrays else {}
    paragraphs = [_selection(findings)]
    if kinds.get("periodic"):
        paragraphs.append(_loops(findings, int(kinds["periodic"])))
    if any(model.name in VARIANT_TEXTS for model in findings.models):
        paragraphs.append(_dynamic(findings))
        paragraphs.append(_errors(findings))
    if "preload_states" in findings.arrays:
        paragraphs.append(_preload())
    if any(model.name.startswith("time_domain") for model in findings.models):
        paragraphs.append(_time(findings))
    if kinds.get("half_cycle"):
        paragraphs.append(
            f"{_runs_hold(int(kinds['half_cycle']))} one loading and unloading only. The secant stiffness of a run is the force at "
            "the turn over the displacement there, its loss the work between both branches over the displacements that "
            "the unloading covers again."
        )
    return paragraphs


def _runs_hold(count: int) -> str:
    return f"{counted(count, 'run')} {'holds' if count == 1 else 'hold'}"


def _selection(findings: Findings) -> str:
    left = [run.run for run in findings.runs if not run.used]
    told = (
        f" {len(left)} of {counted(len(findings.runs), 'run')} {'was' if len(left) == 1 else 'were'} left out ({listing(left, 8)}), each for the reason given."
        if left
        else ""
    )
    return (
        "Each run was sorted by its displacement: still, one load and unload, steady cycles, or neither. Runs with a dead, "
        "stuck or clipped channel, or with a loop that would give energy, were left out; still stretches, cycles before "
        f"the steady state and lone wild samples do not enter. {_contradicting(findings)}{told}"
    )


def _contradicting(findings: Findings) -> str:
    if not is_many(findings):
        return (
            "A run that contradicts the others was set aside where these agree without it (chi2 per degree of freedom below 2, or "
            "less than half the scatter) and without no other."
        )
    return (
        "The dynamic model was first fitted to all loops with the sum of the runs' relative misfits least, which odd runs hardly "
        "bend. A run was set aside whose gain is more than 1 % off the others', or what no gain explains more than 0.5 % of the "
        "force, where chance would bring about such a run in less than 3 of 1000 campaigns, judged by the median of all runs; not so "
        "where most runs of its condition are off."
    )


def _preload() -> str:
    return (
        "Stiffness against preload is compared per preload and frequency. At equal force the measured secant stiffnesses "
        "are compared as they are; at equal amplitude each is multiplied by the ratio that the dynamic model gives between "
        "its own amplitude and that of the run with the least current, where runs of another preload keep the shape of the "
        "model and get a stiffness and a viscous coefficient of their own."
    )


def _loops(findings: Findings, count: int) -> str:
    mains = findings.settings.get("mains_frequency", 50.0)
    spared = f" Harmonics within 2/T of a multiple of {mains:g} Hz were left out." if mains else ""
    return (
        f"{_runs_hold(count)} steady cycles. The fundamental frequency was fitted to the displacement, and harmonics 1 to 5 of "
        "the displacement and 1 to 15 of the force were regressed at the recorded time stamps, together with a slow "
        f"drift.{spared} Secant stiffness is the ratio of the half peak-to-peak values of the fitted curves, storage "
        "stiffness and loss factor come from the first harmonics, and damping is the loop area over π ω X^2 "
        "(Brancati et al. 2019). Standard errors come from the level of the residual around each harmonic."
    )


def _dynamic(findings: Findings) -> str:
    selected = next(model for model in findings.models if model.selected)
    others = [model.name for model in findings.models if not model.selected]
    lag = findings.settings.get("force_lag", "fit")
    told = "was fitted along" if lag == "fit" else f"was held at {1e6 * float(lag):.3g} us"
    compared = (
        f" It was chosen by BIC (Schwarz 1978) among {', '.join(sorted([selected.name, *others]))}." if others else ""
    )
    return (
        "The dynamic model is a Maxwell branch, a spring, the field's stiffness and damping, and a Bouc-Wen term (Brancati "
        "et al. 2019, eqs 10 to 12; the dashpot of eq. 11 acts to ground, since the printed form does not depend on the "
        "displacement; the Bouc-Wen model is surveyed by Ismail et al. 2009). It was evaluated in the periodic steady state "
        "of the fitted displacement and compared with the force harmonics, weighted by their standard deviations, with the "
        "noise of the displacement added as effective variance. The force is linear in all but four shape parameters and "
        "the lag, so variable projection (Golub and Pereyra 1973, Kaufman 1975) with analytic derivatives was used, from "
        f"{findings.settings.get('starts', 6)} starts. A constant lag of the force {told}. Variant '{selected.name}' "
        f"({VARIANT_TEXTS.get(selected.name, '')}) was taken.{compared}"
    )


def _errors(findings: Findings) -> str:
    scatter = next((p for p in findings.parameters if p.name == "run_scatter" and p.value), None)
    found = f" It is {100 * (scatter.value or 0.0):.2g} % here." if scatter else " The data ask for none here."
    if findings.verdict == "rejected":
        found = " It does not explain the misfit here; the errors told are those of plain least squares, by the runs."
    allowed = findings.settings.get("run_scatter", True)
    text = (
        "A gain error of the force that changes from run to run, up to 2 %, was estimated by maximum marginal likelihood "
        f"with the model's prediction as its direction.{found} "
        if allowed
        else "No gain error from run to run was allowed. "
    )
    together = (
        "Because noise averages out over many runs and what they share does not, standard errors are no smaller than those by the "
        "scatter between runs, between conditions and between stretches of the campaign (sandwich of Bell and McCaffrey 2002). "
        if is_many(findings)
        else ""
    )
    return (
        f"{text}{together}Intervals hold 95 %; they are Student's with the degrees of freedom of the scatter. "
        "A parameter is called undetermined where the Jacobian's condition and its own error say so."
    )


def _time(findings: Findings) -> str:
    cutoff = findings.settings.get("cutoff")
    told = f"{cutoff:g} Hz" if cutoff else "a cut-off taken from the spectrum of the displacement"
    return (
        "Records without a period were fitted in time: displacement and force through the same zero-phase low-pass "
        f"({told}), the model integrated along the filtered displacement, linear coefficients and an offset projected out. "
        "Standard errors allow for residuals that are correlated in time (Newey and West 1987). The model was fitted to the first "
        "half and its error in predicting the second half is given; the parameters come from the whole record."
    )
