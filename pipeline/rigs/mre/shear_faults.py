"""Faults that only the whole campaign shows (mre.md section 8): each named with run, size and what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.mre.dynamic_fit import DynamicFit
from pipeline.rigs.mre.leave_one_out import LeaveOneOut
from pipeline.rigs.mre.loop import half_range
from pipeline.rigs.mre.shear_runs import SortedRuns

LAG_SAID = 50e-6  # s
_REMANENCE = 5e-3  # T
_PRELOAD_CHANGE = 0.1
# A run stands out whose gain is this much, and this many robust standard deviations, off the others.
_GAIN_SIZE, _GAIN_APART = 0.01, 6.0


def say_faults(
    runs: SortedRuns, recordings: Sequence[Recording], fit: DynamicFit | None, without: LeaveOneOut | None
) -> list[str]:
    """Add what is found to the quality of `runs`; return the runs that stand out from all others."""
    _slip(runs)
    _preload_by_field(runs, recordings)
    _remanence(runs, recordings)
    if fit is None:
        return []
    lag = fit.force_lag
    if lag.value is not None and abs(lag.value) > LAG_SAID and fit.held_lag is None and not fit.rejected:
        runs.say(
            "warning",
            None,
            f"the force is {abs(lag.value) * 1e6:.0f} us {'late' if lag.value > 0 else 'early'} against the "
            "displacement; the fit and the loops account for it. Calibrate it with a rigid link in place of the pads.",
            "force",
        )
    odd = _standing_out(fit, without)
    for run in odd:
        gain = 100 * fit.gain_by_run[run]
        runs.say(
            "warning",
            run,
            f"does not go with the other runs: its force is {gain:+.1f} % off what they predict (gain, current "
            f"label or preload?). Check it, or leave it out with 'exclude: [{run}]' in the recipe.",
            "force",
        )
    if not odd:
        _drift(runs, fit)
    return odd


def _standing_out(fit: DynamicFit, without: LeaveOneOut | None) -> list[str]:
    """Return the runs that no scatter of the others explains."""
    if len(fit.loops) < 4:
        return []
    names = list(fit.gain_by_run)
    gains = np.array([fit.gain_by_run[name] for name in names])
    odd = []
    for i, name in enumerate(names):
        others = np.delete(gains, i)
        middle = float(np.median(others))
        spread = max(1.4826 * float(np.median(np.abs(others - middle))), 1e-3)
        if abs(gains[i] - middle) > max(_GAIN_APART * spread, _GAIN_SIZE):
            odd.append(name)
    if without is not None and (fit.rejected or odd):
        chi2 = {run: value for run, value in without.chi2_without.items() if math.isfinite(value)}
        best = min(chi2, key=lambda run: chi2[run], default=None)
        rest = [value for run, value in chi2.items() if run != best]
        if best is not None and rest and chi2[best] < 0.2 * min(rest):
            return [best]
    return odd if len(odd) == 1 else []


def _slip(runs: SortedRuns) -> None:
    needed = {
        usable.run: half_range(usable.loop.F) / (2 * usable.preload)
        for usable in runs.loops
        if usable.loop is not None and usable.preload and usable.pads is not None
    }
    worst = max(needed, key=lambda run: needed[run], default=None)
    if worst is not None and needed[worst] > 0.5:
        count = sum(value > 0.5 for value in needed.values())
        runs.say(
            "warning",
            worst,
            f"without slip the pads need a friction coefficient of {needed[worst]:.2f} here (F_max/(2 N), above 0.5 in "
            f"{count} run{'s' if count > 1 else ''}): the loop may contain sliding, "
            "which the Bouc-Wen term would absorb.",
            "force",
        )


def _preload_by_field(runs: SortedRuns, recordings: Sequence[Recording]) -> None:
    """Say where the field changed the axial load that the label gives for 0 A."""
    worst, change, measured = None, 0.0, 0.0
    for recording in recordings:
        preload = recording.conditions.get("preload")
        if "force_axial" in recording and isinstance(preload, float) and preload > 0:
            load = float(np.nanmean(recording.values("force_axial")))
            if abs(load / preload - 1) > max(_PRELOAD_CHANGE, abs(change)):
                worst, change, measured = recording.run, load / preload - 1, load
    if worst is not None:
        runs.say(
            "warning",
            worst,
            f"the axial load is {measured:.0f} N, {100 * change:+.0f} % off the preload set at 0 A: at a held gap the "
            "field presses the pads. Stiffness increments contain that.",
            "force_axial",
        )


def _remanence(runs: SortedRuns, recordings: Sequence[Recording]) -> None:
    for recording in recordings:
        if "flux_density" not in recording or recording.conditions.get("coil_current") not in (0, 0.0):
            continue
        field = float(np.nanmean(recording.values("flux_density")))
        if abs(field) > _REMANENCE:
            runs.say(
                "warning",
                recording.run,
                f"{1e3 * field:.1f} mT remain at 0 A: demagnetise, and mind the order of the runs.",
                "flux_density",
            )


def _drift(runs: SortedRuns, fit: DynamicFit) -> None:
    """Say a trend of the runs' gain with their order: heating, Mullins effect, relaxation."""
    order = {u.run: u.sequence for u in runs.loops if u.sequence is not None and u.run in fit.gain_by_run}
    if len(order) < 6 or len(set(order.values())) < 6:
        return
    index = np.array([float(value) for value in order.values() if value is not None])
    gain = np.array([fit.gain_by_run[run] for run in order])
    centred = index - index.mean()
    slope = float(centred @ gain / (centred @ centred))
    rest = gain - gain.mean() - slope * centred
    sd = math.sqrt(float(rest @ rest) / (index.size - 2) / float(centred @ centred))
    total = slope * float(np.ptp(index))
    if sd > 0 and abs(slope) > 4 * sd and abs(total) > 2e-3:
        runs.say(
            "warning",
            None,
            f"stiffness changes by {100 * total:+.1f} % from the first to the last run of the sequence: heating, "
            "Mullins effect or relaxation. Bracket the campaign with repeated runs at 0 A.",
        )
