"""Faults of rich records that identification shows (mre.md section 8): named with run, size and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import listing
from pipeline.recording import Recording
from pipeline.rigs.mre.rich.fits import RichFit
from pipeline.rigs.mre.rich.online_verdict import CONVERGED
from pipeline.rigs.mre.shear.check import MODULUS_RANGE
from pipeline.rigs.mre.shear.faults import say_preload_by_field, say_remanence, say_varying
from pipeline.rigs.mre.shear.runs import apart
from pipeline.rigs.mre.shear.samples import number_of
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.mre.shear.unsteady import say_faults_of_records

# The residual against the white noise of the force, and the share of the force, from which on the model misses something.
_MISSES, _MISSES_SHARE = 1.5, 0.004
_LARGE_NOISE = 0.1


def say_faults(runs: SortedRuns, recordings: Sequence[Recording], fits: Sequence[RichFit]) -> list[str]:
    """Add what records and fits show to the quality of `runs`; return what casts doubt on the numbers."""
    doubts = [
        _modulus(runs, fits),
        _labels(runs, recordings),
        say_varying(recordings, runs),
        say_preload_by_field(runs, recordings),
        say_remanence(runs, recordings),
        *(doubt for fit in fits for doubt in _unsteady(runs, fit)),
        *(_mass(runs, fit) for fit in fits),
        *(_late(fit) for fit in fits),
        *_sensors(runs),
        *(_residual(runs, fit) for fit in fits),
    ]
    for fit in fits:
        _online(runs, fit)
    return [doubt for doubt in doubts if doubt]


def _unsteady(runs: SortedRuns, fit: RichFit) -> list[str]:
    """Say what drifts, fades or lags in a record, under its name."""
    before = len(runs.quality)
    doubts = say_faults_of_records(runs, [fit.batch])
    runs.quality[before:] = [q if q.run else replace(q, run=fit.run) for q in runs.quality[before:]]
    return doubts


def _modulus(runs: SortedRuns, fits: Sequence[RichFit]) -> str:
    """Doubt records whose shear modulus no elastomer has: a wrong unit."""
    for fit in fits:
        pads, series = fit.usable.pads, fit.usable.series
        if pads is None:
            continue
        x, F = series.x[series.counts], series.F[series.counts]
        stiffness = float(np.cov(x, F)[0, 1] / np.var(x))
        modulus = stiffness * pads.modulus_per_stiffness
        if MODULUS_RANGE[0] <= modulus <= MODULUS_RANGE[1]:
            continue
        likely = "displacement looks like mm taken as m, or force like kN taken as N"
        if modulus > MODULUS_RANGE[1]:
            likely = "displacement looks like m taken as mm, or force like N taken as kN"
        doubt = (
            f"Run {fit.run} means a shear modulus of {modulus / 1e6:.2g} MPa, and elastomers have {MODULUS_RANGE[0] / 1e6:g} to "
            f"{MODULUS_RANGE[1] / 1e6:g} MPa: {likely} (factor 1000), or the pad size has a wrong unit."
        )
        runs.say("warning", fit.run, doubt, "displacement")
        return doubt
    return ""


def _labels(runs: SortedRuns, recordings: Sequence[Recording]) -> str:
    used = {usable.run: usable for usable in runs.records}
    wrong = []
    for recording in recordings:
        label = number_of(recording, "coil_current")
        usable = used.get(recording.run)
        if usable is not None and label is not None and usable.current is not None and apart(usable.current, label):
            wrong.append(recording.run)
    if not wrong:
        return ""
    return f"The measured coil current contradicts the label of {listing(wrong, 6)}; the measured one was used."


def _mass(runs: SortedRuns, fit: RichFit) -> str:
    mass = next((e for e in fit.batch.estimates if e.name == "moving_mass"), None)
    if mass is None or mass.value is None:
        return ""
    told = f"the force of run {fit.run} holds the inertia of an untared mass of {mass.value:.3g} kg; it is fitted along"
    runs.say("warning", fit.run, f"{told}. Weigh platelet and rod and set 'moving_mass' in the recipe.", "force")
    return f"{told[0].upper()}{told[1:]}."


def _late(fit: RichFit) -> str:
    """Doubt stiffness that a filter's lag would bias and a shift of clocks does not: it lowers its signal as well."""
    lag, k1 = (next((e for e in fit.batch.estimates if e.name == name), None) for name in ("force_lag", "k1"))
    reach = fit.reach
    if lag is None or lag.value is None or k1 is None or not k1.std_error or reach is None:
        return ""
    droop = 0.5 * (2 * np.pi * reach.frequencies[1] * lag.value) ** 2
    off = droop * float(np.std(fit.usable.series.F) / np.std(fit.usable.series.x))
    if off < 2 * k1.std_error:
        return ""
    late, filtered = ("late", "force") if lag.value > 0 else ("early", "displacement")
    return (
        f"That the force of run {fit.run} is {abs(lag.value) * 1e6:.0f} us {late} is taken for a shift of the clocks. If it is that of a filter "
        f"of the {filtered}, stiffness at {reach.frequencies[1]:.3g} Hz is off by {100 * droop:.2g} %, {off:.2g} N/m, which is more than the error of k1: "
        "calibrate it with a rigid link and set 'force_lag'."
    )


def _sensors(runs: SortedRuns) -> list[str]:
    """Doubt records of which a part was lost to a clipped or stuck sensor: what else it did then is not known."""
    return [
        f"Run {q.run}: {q.message}"
        for q in runs.quality
        if q.level == "warning" and any(word in q.message for word in (" is clipped ", " is stuck "))
    ]


def _residual(runs: SortedRuns, fit: RichFit) -> str:
    """Doubt a model that leaves more than the force's noise, and say where noise drowns the force."""
    F = fit.usable.series.F
    noise = float(np.median(np.abs(np.diff(F, 3))) / 0.6745 / np.sqrt(20))
    left, nrmse = fit.batch.rms_residual, fit.batch.nrmse
    if left > _MISSES * noise and nrmse > _MISSES_SHARE:
        return (
            f"The model leaves {left:.3g} N of run {fit.run}, {left / max(noise, 1e-12):.2g} times the noise between samples and "
            f"{100 * nrmse:.2g} % of the force: something in the record is not in the model. Intervals allow for its colour only."
        )
    if noise > _LARGE_NOISE * float(np.std(F)):
        runs.say(
            "warning",
            fit.run,
            f"the force's noise of {noise:.3g} N is {100 * noise / float(np.std(F)):.2g} % of the force; mend cable or range.",
            "force",
        )
    return ""


def _online(runs: SortedRuns, fit: RichFit) -> None:
    """Say what the filter's numbers are worth; the parameters do not come from it."""
    if fit.online is None or fit.verdict is None:
        return
    if fit.batch.cutoff > 1.5 * fit.online.ahead.wanted:
        runs.say(
            "note",
            fit.run,
            f"the motion reaches {fit.batch.cutoff / 3:.3g} Hz, too near the {fit.online.ahead.wanted:g} Hz low-pass of the online "
            f"filter; set 'online_cutoff: {fit.batch.cutoff:.3g}' in the recipe.",
        )
    if fit.verdict.word != CONVERGED:
        runs.say("note", fit.run, f"online filter {fit.verdict.word}: {fit.verdict.reason}. The batch fit stands.")
