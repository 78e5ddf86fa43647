"""Which runs of a campaign can be used, and how: steady loops, half cycles, records without a period.

A run that cannot be used is left out with the reason; what is odd about one that can is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import Recording
from pipeline.rigs.experiment import Each, in_turn
from pipeline.rigs.mre.shear.backward_loops import say_backward
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.shear.loops import add_loop
from pipeline.rigs.mre.shear.operating import held_of
from pipeline.rigs.mre.shear.samples import Series, UnfitError, flat_tops, number_of, pads_of, samples_of
from pipeline.rigs.mre.shear.sampling import said_alias
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun
from pipeline.signals.periodicity import classify

# Measured against set current: what counts as another level.
_CURRENT_APART = 0.1
# A stiffness this many times that of the other runs is no gain error: a unit is wrong.
_UNIT_FACTOR = 100.0
_SECONDS_A_SAMPLE = 4e-6  # that one core needs


def sort_runs(recordings: Sequence[Recording], settings: ShearSettings, each: Each = in_turn) -> SortedRuns:
    """Look at every run and put it where it belongs."""
    runs = SortedRuns()
    tasks = [(recording, settings) for recording in recordings]
    samples = sum(stream.size for recording, _ in tasks for stream in recording.streams.values())
    for alone in each(_sorted, tasks, _SECONDS_A_SAMPLE * samples):
        runs.add(alone)
    _other_units(runs)
    say_backward(runs)
    if settings.mains_frequency > 0:
        _on_the_mains(runs, settings.mains_frequency)
    return runs


def _sorted(recording: Recording, settings: ShearSettings) -> SortedRuns:
    """Look at one run."""
    runs = SortedRuns()
    try:
        runs.held.append(held_of(recording))
        series = samples_of(recording, runs.quality.append)
        _sort_one(recording, series, settings, runs)
    except UnfitError as error:
        runs.leave_out(recording.run, str(error), error.channel)
    except InputError as error:
        runs.leave_out(recording.run, str(error))
    return runs


def _on_the_mains(runs: SortedRuns, mains: float) -> None:
    """Say once which harmonics do not enter because they lie on the mains."""
    by_orders: dict[str, list[str]] = {}
    for usable in runs.loops:
        assert usable.loop is not None
        lost = np.flatnonzero(~usable.loop.kept & (usable.loop.F != 0)) + 1
        if lost.size:
            by_orders.setdefault(", ".join(map(str, lost)), []).append(usable.run)
    if by_orders:
        told = "; ".join(f"{orders} of {listing(names, 4)}" for orders, names in by_orders.items())
        runs.say(
            "note",
            None,
            f"harmonics on a multiple of the mains frequency, {mains:g} Hz, do not enter: {told}. Frequencies that do not "
            "divide it keep all harmonics.",
            "force",
        )


def _other_units(runs: SortedRuns) -> None:
    """Leave out loops whose stiffness is a power of ten or more away from that of the others."""
    stiffness = {u.run: abs(u.loop.F[0] / u.loop.X[0]) for u in runs.loops if u.loop is not None}
    if len(stiffness) < 3:
        return
    middle = float(np.median(list(stiffness.values())))
    for usable in [u for u in runs.loops if not 1 / _UNIT_FACTOR < stiffness[u.run] / middle < _UNIT_FACTOR]:
        assert usable.loop is not None
        ratio = stiffness[usable.run] / middle
        theirs = [u.loop.amplitude for u in runs.loops if u.loop is not None and u.run != usable.run]
        moved = usable.loop.amplitude / float(np.median(theirs))
        channel = "displacement" if not 1 / 30 < moved < 30 else "force"
        factor = moved if channel == "displacement" else ratio
        likely = {("displacement", True): "mm taken as m", ("displacement", False): "m taken as mm",
                  ("force", True): "N taken as kN", ("force", False): "kN taken as N"}[channel, factor > 1]  # fmt: skip
        runs.set_aside(
            usable.run,
            f"its stiffness is {ratio:.2g} times that of the other runs and its {channel} about "
            f"{10.0 ** round(math.log10(factor)):g} times theirs: most likely {likely}. Nothing is corrected "
            "silently: give the unit in the recipe or in the log",
            channel,
        )


def _usable(recording: Recording, series: Series, runs: SortedRuns) -> UsableRun:
    return UsableRun(
        run=recording.run,
        series=series,
        excitation=classify(series.time, series.x),
        current=current_of(recording, runs),
        preload=number_of(recording, "preload"),
        pads=pads_of(recording),
        sequence=number_of(recording, "sequence_index"),
        test=str(recording.conditions.get("test", "")),
        label_frequency=number_of(recording, "frequency"),
        begins=recording.provenance.begins,
        rate=float(1 / np.median(np.diff(series.time))),
        told_lag=number_of(recording, "force_lag"),
    )


def _sort_one(recording: Recording, series: Series, settings: ShearSettings, runs: SortedRuns) -> None:
    usable = _usable(recording, series, runs)
    run, excitation = usable.run, usable.excitation
    alias = said_alias(usable)
    if alias:
        raise UnfitError(alias, "displacement")
    for remark in excitation.remarks:
        if excitation.kind == "periodic" and remark.startswith("the mean drifts"):
            continue  # told with what it means for the loop
        runs.say("note", run, f"{remark}.", "displacement")
    if excitation.kind == "still":
        runs.leave_out(run, f"the displacement does not move: {excitation.reason}", "displacement")
    elif excitation.kind == "ramp":
        runs.leave_out(run, "one stroke without unloading: neither stiffness after return nor loss can be told")
    elif excitation.kind == "half_cycle":
        runs.say(
            "warning", run, "one half cycle only (load and unload): loop stiffness and loss, no damping, no model."
        )
        moving = moving_part(usable)
        runs.half_cycles.append(replace(moving, series=moving.series.measured()))
    elif excitation.kind == "periodic" and excitation.steady is not None:
        add_loop(usable, settings, runs)
    else:
        if excitation.kind == "periodic":
            runs.say("warning", run, f"periodic, but no cycle is steady ({excitation.reason}): fitted in time.")
        runs.records.append(without_flat_tops(moving_part(usable), runs))


def moving_part(usable: UsableRun) -> UsableRun:
    """Return the run from where its displacement begins to move to where it ends."""
    return replace(usable, series=usable.series.between(*usable.excitation.moving), loop=None)


def without_flat_tops(usable: UsableRun, runs: SortedRuns) -> UsableRun:
    """Leave out where a record without a period is clipped: rows where the displacement is, else the force alone."""
    series = usable.series
    tops = {"displacement": flat_tops(series.x), "force": flat_tops(series.F)}
    for name, there in tops.items():
        if there.any():
            runs.say(
                "warning",
                usable.run,
                f"the {name} is clipped in {100 * float(there.mean()):.2g} % of its samples; they do not enter.",
                name,
            )
    return replace(usable, series=series.without(force=tops["force"], rows=tops["displacement"]))


def current_of(recording: Recording, runs: SortedRuns) -> float | None:
    """Return the coil current (A): the measured one where there is a channel, else the label."""
    label = number_of(recording, "coil_current")
    if "current" not in recording:
        return label
    values = recording.values("current")
    values = values[np.isfinite(values)]
    if not values.size:
        return label
    measured, noise = float(values.mean()), max(float(values.std()), 0.01)
    if label is not None and apart(measured, label, noise):
        runs.say(
            "warning",
            recording.run,
            f"the measured current is {measured:.2f} A but the label says {label:.2f} A; the measured one is used.",
            "current",
        )
    return 0.0 if abs(measured) <= 1.96 * noise else measured


def apart(measured: float, label: float, noise: float = 0.01) -> bool:
    """Tell whether a measured current (A) is another one than its label says."""
    return abs(measured - label) > max(_CURRENT_APART, 0.05 * abs(label), 3 * noise)
