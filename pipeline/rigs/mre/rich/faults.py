"""Faults of rich records that identification shows (mre.md section 8): named with run, size and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import listing
from pipeline.recording import Recording
from pipeline.rigs.in_words import chance
from pipeline.rigs.mre.rich.fits import DASHPOT_SURE, RichFit
from pipeline.rigs.mre.rich.noise import white
from pipeline.rigs.mre.rich.online_verdict import CONVERGED
from pipeline.rigs.mre.rich.unmodelled import causes, curved
from pipeline.rigs.mre.shear.check import MODULUS_RANGE
from pipeline.rigs.mre.shear.faults import say_preload_by_field, say_remanence, say_varying
from pipeline.rigs.mre.shear.operating import held_of
from pipeline.rigs.mre.shear.runs import apart
from pipeline.rigs.mre.shear.samples import number_of
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.mre.shear.unsteady import say_faults_of_records

# By which chance noise may hang together with the motion, and the share of the force, from which on the model misses something.
_MISSES_CHANCE, _MISSES_SHARE = 1e-4, 0.001
_UNNAMED = 1.5  # times what a cause that is named explains, rms, from which on there is more
_LARGE_NOISE = 0.1
_STEP_SURE, _STEP_SHARE = 6.0, 0.1  # standard errors, and share of the squared residual, of a step of the zero
# Amplitudes beyond which a unit is doubted that nothing else tells of: N, m.
_LEAST_FORCE, _LARGEST_DISPLACEMENT = 1.0, 0.1


def say_faults(runs: SortedRuns, recordings: Sequence[Recording], fits: Sequence[RichFit]) -> list[str]:
    """Add what records and fits show to the quality of `runs`; return what casts doubt on the numbers."""
    held = [held_of(recording) for recording in recordings]
    doubts = [
        _modulus(runs, fits),
        _labels(runs, recordings),
        say_varying(held, runs),
        say_preload_by_field(runs, held),
        say_remanence(runs, held),
        *(doubt for fit in fits for doubt in _unsteady(runs, fit)),
        *(_mass(runs, fit) for fit in fits),
        *(_late(fit) for fit in fits),
        *(_damped(fit) for fit in fits),
        *(_zero(runs, fit) for fit in fits),
        *_sensors(runs),
        *(_curved(runs, fit) for fit in fits),
        *(_residual(runs, fit) for fit in fits),
    ]
    for fit in fits:
        _online(runs, fit)
    return [doubt for doubt in doubts if doubt]


def _unsteady(runs: SortedRuns, fit: RichFit) -> list[str]:
    """Say what drifts, fades or lags in a record, under its name."""
    before = len(runs.quality)
    seen = {run: found for run, found in fit.batch.gain_change.items() if run in causes(fit.batch)}
    doubts = say_faults_of_records(
        runs, [replace(fit.batch, gain_change=seen)], "Intervals are widened by what a steady change would shift"
    )
    runs.quality[before:] = [q if q.run else replace(q, run=fit.run) for q in runs.quality[before:]]
    return doubts


def _modulus(runs: SortedRuns, fits: Sequence[RichFit]) -> str:
    """Doubt records whose shear modulus no elastomer has: a wrong unit."""
    for fit in fits:
        pads, series = fit.usable.pads, fit.usable.series
        x, F = series.x[series.counts], series.F[series.counts]
        if pads is None:
            doubt = _size(fit.run, 0.5 * float(np.ptp(x)), 0.5 * float(np.ptp(F)))
            if doubt:
                runs.say("warning", fit.run, doubt, "force")
                return doubt
            continue
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


def _size(run: str, displacement: float, force: float) -> str:
    """Doubt amplitudes (m, N) that no shaker test has: a wrong unit, where no size of pads tells."""
    if force < _LEAST_FORCE:
        return (
            f"The force of run {run} swings by only {force:.2g} N: hardly a load cell of a shaker. Is it in kN? Set its unit, "
            "or pad_diameter and pad_height if it is right: then the shear modulus is held against elastomers'."
        )
    if displacement > _LARGEST_DISPLACEMENT:
        return f"The displacement of run {run} swings by {displacement:.2g} m. Is it in mm? Set its unit."
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


def _damped(fit: RichFit) -> str:
    """Doubt a record with viscous damping where no field is known of."""
    batch = fit.batch
    if fit.linear or fit.current:
        return ""
    if "s_mr" in batch.names:
        return (
            f"No current is known of run {fit.run}, and its force holds viscous damping of {batch.one('s_mr').value or 0:.3g} N s/m "
            "as a field gives it; it is fitted along. Set 'coil_current'; if the field was off, the displacement may be late."
        )
    if batch.viscous.times_error > DASHPOT_SURE:
        return (
            f"Run {fit.run} is told to be without a field, and its force is early as viscous damping would make it ({batch.viscous.times_error:.2g} "
            "times the error): is the coil's current right, or the displacement late? Without that damping k1, C and the lag are off; their intervals are widened by it."
        )
    return ""


def _zero(runs: SortedRuns, fit: RichFit) -> str:
    """Doubt a record in which the zero of the force steps."""
    when, found = fit.batch.zero_step
    gains = max((e.share for e in fit.batch.gain_change.values() if e.times_error > _STEP_SURE), default=0.0)
    if fit.linear or found.times_error < _STEP_SURE or found.share < max(_STEP_SHARE, gains):
        return ""
    doubt = (
        f"The zero of the force steps by {found.size:+.3g} N near {when:.3g} s of run {fit.run}: a load cell that was touched, "
        "reset or overloaded. Cut the record there."
    )
    runs.say("warning", fit.run, doubt, "force")
    return doubt


def _sensors(runs: SortedRuns) -> list[str]:
    """Doubt records of which a part was lost to a clipped or stuck sensor: what else it did then is not known."""
    return [
        f"Run {q.run}: {q.message}"
        for q in runs.quality
        if q.level == "warning" and any(word in q.message for word in (" is clipped ", " is stuck "))
    ]


def _curved(runs: SortedRuns, fit: RichFit) -> str:
    """Doubt a record whose residual shows a curved sensor or a pad that hardens."""
    told = "" if fit.linear else curved(fit.batch)
    if not told:
        return ""
    runs.say("warning", fit.run, told)
    return f"Run {fit.run}: {told}"


def _residual(runs: SortedRuns, fit: RichFit) -> str:
    """Doubt a model that leaves what hangs together with the motion or drifts, and say where noise drowns the force."""
    F = fit.usable.series.F
    noise, force = white(F), float(np.std(F))
    found = {
        "hangs together with the motion": fit.batch.with_motion,
        "wanders in the course of the record": fit.batch.with_time,
    }
    named = [e.share for e in (*causes(fit.batch).values(), fit.batch.zero_step[1]) if e.times_error > _STEP_SURE]
    least = max(_MISSES_SHARE * force, _UNNAMED * max(named, default=0.0) ** 0.5 * fit.batch.rms_residual)
    seen = {how: part for how, part in found.items() if part.p_value < _MISSES_CHANCE and part.rms > least}
    if seen and not fit.linear:
        how = max(seen, key=lambda name: seen[name].rms)
        part = seen[how]
        return (
            f"Of the {fit.batch.rms_residual:.3g} N that the model leaves of run {fit.run}, {part.rms:.2g} N (rms; {100 * part.rms / force:.2g} % of "
            f"the force) {how}, as noise of no colour does (by chance: {chance(part.p_value)}): something in the record is not in the model. "
            "Intervals do not allow for what it shifts."
        )
    if noise > _LARGE_NOISE * force:
        runs.say(
            "warning",
            fit.run,
            f"the force's noise of {noise:.3g} N is {100 * noise / force:.2g} % of the force; mend cable or range.",
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
