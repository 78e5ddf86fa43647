"""Steady cycles of a run -> its loop, or why there is none; what is odd about the loop's form is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.errors import counted
from pipeline.rigs.mre.model.loop import Loop, curve, drift_degree, fit_loop
from pipeline.rigs.mre.shear.backward_loops import runs_backward
from pipeline.rigs.mre.shear.cycles import wander_of
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.shear.samples import Series, UnfitError, clipping
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun
from pipeline.signals.periodicity import Excitation

# Standard errors that the fundamental of the force must exceed.
_FOLLOWS = 10.0
_SHOWN = 400  # samples
_OFFSET_SAID, _ASYMMETRY_SAID, _DRIFT_SAID = 0.05, 0.02, 0.1


def add_loop(usable: UsableRun, settings: ShearSettings, runs: SortedRuns) -> None:
    """Fit the loop of a run with steady cycles and put it where it belongs.

    Raises
    ------
    UnfitError
        If the displacement is clipped, or the force does not follow it.
    InputError
        If the harmonics cannot be fitted.
    """
    assert usable.excitation.steady is not None
    run = usable.run
    clipped = clipping(usable.series.x)
    if clipped is not None:
        level, share = clipped
        raise UnfitError(
            f"the displacement is clipped: {100 * share:.1f} % of its samples are flat at {1e3 * level:.5g} mm",
            "displacement",
        )
    series = usable.series.between(*usable.excitation.steady).measured()
    frequency = usable.excitation.frequency
    assert frequency is not None
    late = _settled(series, frequency)
    if late > 0:
        series = series.between(series.time[0] + late / frequency, series.time[-1])
        runs.say(
            "note", run, f"the force of the first {counted(late, 'cycle')} is not settled; they do not enter.", "force"
        )
    loop = fit_loop(
        run,
        series.time,
        series.x,
        series.F,
        frequency=frequency,
        current=usable.current,
        preload=usable.preload,
        mains=settings.mains_frequency,
    )
    if abs(loop.F[0]) < _FOLLOWS * loop.sd_f[0]:
        raise UnfitError(
            f"the force does not follow the displacement: at {loop.frequency:.4g} Hz it holds {abs(loop.F[0]):.2g} N, no "
            "more than its noise. A loose cable, or the wrong channel",
            "force",
        )
    wrong = _clipped_force(usable.series)
    if wrong:
        runs.leave_out(run, wrong, "force")
        runs.faulty.append(replace(usable, series=shown(series, loop), loop=loop))
        return
    known_lag = settings.force_lag if settings.force_lag != "fit" else usable.told_lag
    if runs_backward(loop, known_lag or 0.0):
        runs.backward.append(replace(usable, series=shown(series, loop), loop=loop))
        return
    _say_shape(loop, usable.excitation, runs)
    runs.loops.append(replace(usable, series=shown(series, loop), loop=loop, wander=wander_of(series, loop)))


def shown(series: Series, loop: Loop) -> Series:
    """Return some hundred samples less the slow drift that the regression of the loop takes out as well."""
    step = max(series.time.size // _SHOWN, 1)
    motion, force = (
        _without_drift(series.time, values, harmonics, loop)[::step]
        for values, harmonics in ((series.x, loop.X), (series.F, loop.F))
    )
    return Series(series.time[::step], motion, force, series.counts[::step])


def _without_drift(time: np.ndarray, values: np.ndarray, harmonics: np.ndarray, loop: Loop) -> np.ndarray:
    turn = np.exp(1j * loop.omega * time)
    steady, power = np.zeros(time.size), np.ones(time.size, dtype=complex)
    for coefficient in harmonics[: int(np.flatnonzero(harmonics).max(initial=-1)) + 1]:
        power *= turn
        steady += (coefficient * power).real
    drift = np.polynomial.Polynomial.fit(time, values - steady, drift_degree(loop.frequency * loop.duration))
    return np.asarray(values - drift(time))


def _clipped_force(series: Series) -> str:
    """Say by how much the force is clipped; an empty text where it is not."""
    clipped = clipping(series.F)
    if clipped is None:
        return ""
    return f"the force is clipped: {100 * clipped[1]:.1f} % of its samples are flat at {clipped[0]:.5g} N"


def _settled(series: Series, frequency: float) -> int:
    """Return how many leading cycles have a force that differs from that of the later ones.

    The loop memory decays from cycle to cycle (mre.md design rule 5); each cycle's F_1/X_1 is held
    against the later half of the record.
    """
    cycle = np.floor((series.time - series.time[0]) * frequency + 1e-9).astype(int)
    whole = int((series.time[-1] - series.time[0]) * frequency + 0.02)
    if whole < 6:
        return 0
    turn = np.exp(-2j * np.pi * frequency * series.time)
    inside = cycle < whole
    number = np.bincount(cycle[inside], minlength=whole)
    full = number > 0.8 * np.median(number)  # a gap leaves too little of a cycle to judge it
    number = np.maximum(number, 1)

    def first(values: np.ndarray) -> np.ndarray:
        centred = values - values.mean()
        parts = [np.bincount(cycle[inside], (centred * part)[inside], whole) for part in (turn.real, turn.imag)]
        return np.asarray((parts[0] + 1j * parts[1]) / number)

    motion = first(series.x)
    stiffness = first(series.F) / np.where(full, motion, 1.0)
    later = stiffness[whole // 2 :][full[whole // 2 :]]
    if later.size < 3:
        return 0
    middle = np.median(later.real) + 1j * np.median(later.imag)
    spread = 1.4826 * float(np.median(np.abs(later - middle)))
    apart = full & (np.abs(stiffness - middle) > max(5 * spread, 2e-3 * abs(middle)))
    leading = int(np.argmin(apart)) if not apart.all() else 0
    return leading if leading <= whole // 2 else 0


def _say_shape(loop: Loop, excitation: Excitation, runs: SortedRuns) -> None:
    """Name offset, asymmetry and drift of a loop that is used."""
    run = loop.run
    force = curve(loop.F)
    size = 0.5 * float(np.ptp(force))
    push, pull = loop.f_mean + float(force.max()), -loop.f_mean - float(force.min())
    even_f, odd_f = loop.F[1::2][loop.kept[1::2]], abs(loop.F[0])
    even = float(np.sqrt((np.abs(even_f) ** 2).sum()) / odd_f)
    noise = float(np.sqrt((loop.sd_f[1::2][loop.kept[1::2]] ** 2).sum()) / odd_f)
    even_x = float(np.sqrt((np.abs(loop.X[1::2]) ** 2).sum()) / abs(loop.X[0]))
    if abs(loop.f_mean) > _OFFSET_SAID * size:
        runs.say(
            "note",
            run,
            f"force offset of {loop.f_mean:.3g} N, {100 * abs(loop.f_mean) / size:.0f} % of the amplitude (peaks {push:.4g} N "
            f"in push, {pull:.4g} N in pull); it does not enter.",
            "force",
        )
    if even > max(_ASYMMETRY_SAID, 3 * even_x, 5 * noise):
        runs.say(
            "warning",
            run,
            f"asymmetric force: even harmonics hold {100 * even:.2g} % of the fundamental (displacement "
            f"{100 * even_x:.2g} %), peaks {push:.4g} N in push and {pull:.4g} N in pull; the model is symmetric.",
            "force",
        )
    if excitation.mean_drift > _DRIFT_SAID:
        runs.say(
            "warning",
            run,
            f"the mean displacement drifts by {100 * excitation.mean_drift:.0f} % of the amplitude; a slow drift is "
            "taken out, its effect on the loop is not.",
            "displacement",
        )
    if (loop.F[0] / loop.X[0]).real < 0:
        runs.say("warning", run, "negative in-phase stiffness: inertia of an untared mass, or a wrong sign.", "force")
