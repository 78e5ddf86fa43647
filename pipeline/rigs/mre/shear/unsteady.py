"""What changes in the course of the runs though it should not: mean force, stiffness (mre.md section 8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.errors import listing
from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.mre.model.loop import half_range
from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.shear.cycles import Wander
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.over_runs import MANY

LAG_SAID = 50e-6  # s
# Shares of the force amplitude: a drift that is told, one that is doubted though the fit takes it out, and the
# least that is left of a step or wander.
_DRIFT_SAID, _DRIFT_DOUBTED, _REST_SAID = 0.05, 0.2, 0.015
# The range of noise over tens of cycles stays within so many of its sigmas; slow noise is a little wider.
_REST_SURE = 7.0
_ZERO_SAID = 0.1
# A record that a fit misses by more than this share shows no faults but that of the model.
_HELD = 0.2
# Of the stiffness from the first to the last cycle, in standard errors, and by chance in a campaign of many runs.
_SOFTENING_SAID, _SOFTENING_SURE, _SOFTENING_CHANCE = 1e-3, 5.0, 0.02


def say_unsteady(runs: SortedRuns) -> list[str]:
    """Say how mean force and stiffness change in the runs; return what casts doubt on the numbers."""
    return [*_drift(runs), *_softening(runs)]


def _drift(runs: SortedRuns) -> list[str]:
    drifts: dict[str, tuple[float, Wander]] = {}
    jumps: dict[str, tuple[float, Wander]] = {}
    for usable in runs.loops:
        if usable.loop is None or usable.wander is None:
            continue
        size = half_range(usable.loop.F)
        if usable.wander.drift > _DRIFT_SAID * size:
            drifts[usable.run] = (usable.wander.drift / size, usable.wander)
        if usable.wander.rest > max(_REST_SAID * size, _REST_SURE * usable.wander.rest_noise):
            jumps[usable.run] = (usable.wander.rest / size, usable.wander)
    _zero(runs)
    doubts = []
    if drifts:
        worst = max(drifts, key=lambda run: drifts[run][0])
        share, wander = drifts[worst]
        told = (
            f"the mean force drifts by {wander.drift:.3g} N ({60 * wander.drift / wander.duration:.3g} N per minute), "
            f"{100 * share:.2g} % of its amplitude, during run {worst}"
        )
        told += _and_more(drifts, worst)
        runs.say("warning", None, f"{told}: a sensor's zero, or temperature. A slow drift is taken out.", "force")
        if share > _DRIFT_DOUBTED:
            doubts.append(f"{told[0].upper()}{told[1:]}. It is taken out, but what drifts may change its gain too.")
    if jumps:
        worst = max(jumps, key=lambda run: jumps[run][0])
        share, wander = jumps[worst]
        doubt = (
            f"The mean force steps or wanders by {wander.rest:.3g} N, {100 * share:.2g} % of its amplitude, near "
            f"{wander.jump_at:.3g} s of run {worst}{_and_more(jumps, worst)}: no slow drift, so that it is taken out in part only. "
            "Check the load cell's cable and mounting."
        )
        runs.say("warning", worst, doubt, "force")
        doubts.append(doubt)
    return doubts


def _and_more(found: Mapping[str, object], worst: str) -> str:
    others = [run for run in found if run != worst]
    return f", and in {listing(others, 4)}" if others else ""


def _zero(runs: SortedRuns) -> None:
    """Say that the force's zero wanders from run to run."""
    loops = [usable.loop for usable in runs.loops if usable.loop is not None]
    if len(loops) < 3:
        return
    offsets, size = [loop.f_mean for loop in loops], float(np.median([half_range(loop.F) for loop in loops]))
    if max(offsets) - min(offsets) > _ZERO_SAID * size:
        least, most = (loops[int(pick(offsets))] for pick in (np.argmin, np.argmax))
        runs.say(
            "warning",
            None,
            f"the force's mean is between {least.f_mean:.3g} N ({least.run}) and {most.f_mean:.3g} N ({most.run}), a range of "
            f"{100 * (most.f_mean - least.f_mean) / size:.2g} % of the amplitude: the load cell's zero wanders from run to run. "
            "The mean of each run does not enter.",
            "force",
        )


def _softening(runs: SortedRuns) -> list[str]:
    found = {}
    for usable in runs.loops:
        wander = usable.wander
        least = max(_SOFTENING_SAID, _sure(wander, len(runs.loops)) * wander.change_sd) if wander is not None else 0.0
        if wander is not None and abs(wander.softening) > least:
            found[usable.run] = wander
    if not found:
        return []
    worst = max(found, key=lambda run: abs(found[run].softening))
    wander = found[worst]
    doubt = (
        f"The force changes by {100 * wander.force_change:+.2g} % from the first to the last cycle of run {worst}"
        f"{_and_more(found, worst)} while the displacement's amplitude changes by {100 * wander.motion_change:+.2g} %: heating, "
        "softening, slip, or a gain that fades. Stiffness holds for the middle of the run; its interval does not hold this."
    )
    runs.say("warning", worst, doubt, "force")
    return [doubt]


def _sure(wander: Wander, runs: int) -> float:
    """Return the standard errors from which on a change is told: of many runs, some of few cycles, chance brings large ones."""
    if runs <= MANY:
        return _SOFTENING_SURE
    return max(_SOFTENING_SURE, t_quantile(wander.change_dof, 1 - _SOFTENING_CHANCE / 2 / runs))


def say_faults_of_records(
    runs: SortedRuns, fits: Sequence[TimeFit], intervals: str = "Intervals do not hold this"
) -> list[str]:
    """Say what the fits of records without a period show; return what casts doubt on the numbers."""
    doubts = []
    for fit in fits:
        if not fit.nrmse < _HELD:
            continue
        for run, drift in fit.drift.items():
            series = fit.series[run]
            size, minutes = 0.5 * float(np.ptp(series["force"])), float(series["time"][-1] - series["time"][0]) / 60
            told = (
                f"the mean force drifts by {drift:.3g} N ({drift / minutes:.3g} N per minute), {100 * drift / size:.2g} % of its "
                "amplitude"
            )
            if drift > _DRIFT_SAID * size:
                runs.say("warning", run, f"{told}: a sensor's zero, or temperature. It is taken out.", "force")
            if drift > _DRIFT_DOUBTED * size:
                doubts.append(f"In run {run} {told}. It is taken out, but what drifts may change its gain too.")
        for run, found in fit.gain_change.items():
            change = found.size
            if abs(change) > max(_SOFTENING_SAID, _SOFTENING_SURE * found.std_error):
                doubt = (
                    f"The force of run {run} changes by {100 * change:+.2g} % from start to end against the model: heating, "
                    f"softening, slip, or a gain that fades. {intervals}."
                )
                runs.say("warning", run, doubt, "force")
                doubts.append(doubt)
        lag = next((e.value for e in fit.estimates if e.name == "force_lag" and e.value is not None), 0.0)
        if abs(lag) > LAG_SAID:
            late = "late" if lag > 0 else "early"
            told = f"the force is {abs(lag) * 1e6:.0f} us {late} against the displacement; the fit accounts for it."
            runs.say("warning", None, f"{told} Calibrate it with a rigid link in place of the pads.", "force")
    return doubts
