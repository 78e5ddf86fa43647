"""Which runs of a campaign can be used, and how: steady loops, half cycles, records without a period.

A run that cannot be used is left out with the reason; what is odd about one that can is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.loop import Loop, Pads, curve, fit_loop, loop_metrics
from pipeline.rigs.mre.shear import ShearSettings
from pipeline.rigs.mre.shear_samples import Series, UnfitError, clipping, number_of, pads_of, samples_of
from pipeline.signals.periodicity import Excitation, classify

# Measured against set current: what counts as another level.
_CURRENT_APART = 0.1
_FREQUENCY_APART = 0.03
# Standard errors that the fundamental of the force must exceed.
_FOLLOWS = 10.0
# A stiffness this many times that of the other runs is no gain error: a unit is wrong.
_UNIT_FACTOR = 100.0
_OFFSET_SAID, _ASYMMETRY_SAID, _DRIFT_SAID = 0.05, 0.02, 0.1


@dataclass(frozen=True, eq=False)
class UsableRun:
    """A run with what it may be used for; `loop` is there for steady loops only."""

    run: str
    series: Series
    excitation: Excitation
    current: float | None
    preload: float | None
    pads: Pads | None
    sequence: float | None
    test: str
    label_frequency: float | None = None
    loop: Loop | None = None


@dataclass
class SortedRuns:
    """Runs by what they are, those left out with reasons, and findings on the way.

    `faulty` are loops among those left out: they can be shown, not used.
    """

    loops: list[UsableRun] = field(default_factory=list)
    half_cycles: list[UsableRun] = field(default_factory=list)
    records: list[UsableRun] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    faulty: list[UsableRun] = field(default_factory=list)
    quality: list[QualityFinding] = field(default_factory=list)

    def say(self, level: str, run: str | None, message: str, channel: str | None = None) -> None:
        """Add a finding."""
        assert level in ("note", "warning", "error")
        self.quality.append(QualityFinding(level, message, run, channel))  # type: ignore[arg-type]

    def leave_out(self, run: str, reason: str, channel: str | None = None) -> None:
        """Leave a run out, and say so."""
        self.left_out[run] = reason
        self.say("error", run, f"left out: {reason}", channel)

    def set_aside(self, run: str, reason: str, channel: str | None = None) -> None:
        """Leave out a run that was held for usable."""
        self.loops = [usable for usable in self.loops if usable.run != run]
        self.records = [usable for usable in self.records if usable.run != run]
        self.leave_out(run, reason, channel)

    @property
    def usable(self) -> list[UsableRun]:
        """All runs that yield something."""
        return [*self.loops, *self.half_cycles, *self.records]


def sort_runs(recordings: Sequence[Recording], settings: ShearSettings) -> SortedRuns:
    """Look at every run and put it where it belongs."""
    runs = SortedRuns()
    seen: dict[tuple[str, ...], str] = {}
    for recording in recordings:
        hashes = tuple(source.sha256 for source in recording.provenance.files)
        if hashes and hashes in seen:
            runs.left_out[recording.run] = f"the same file as run '{seen[hashes]}'"
            runs.say("warning", recording.run, f"holds the same bytes as run '{seen[hashes]}'; it is counted once.")
            continue
        if hashes:
            seen[hashes] = recording.run
        try:
            series = samples_of(recording, runs.quality.append)
            _sort_one(recording, series, settings, runs)
        except UnfitError as error:
            runs.leave_out(recording.run, str(error), error.channel)
            if error.series is not None:
                _keep_to_show(recording, error.series, settings, runs)
        except InputError as error:
            runs.leave_out(recording.run, str(error))
    _other_units(runs)
    if settings.mains_frequency > 0:
        _on_the_mains(runs, settings.mains_frequency)
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
        current=_current(recording, runs),
        preload=number_of(recording, "preload"),
        pads=pads_of(recording),
        sequence=number_of(recording, "sequence_index"),
        test=str(recording.conditions.get("test", "")),
        label_frequency=number_of(recording, "frequency"),
    )


def _keep_to_show(recording: Recording, series: Series, settings: ShearSettings, runs: SortedRuns) -> None:
    """Keep the loop of a run that is left out, if it has one."""
    aside = SortedRuns()
    try:
        _sort_one(recording, series, settings, aside)
    except (UnfitError, InputError):
        return
    runs.faulty += [*aside.loops, *aside.faulty]


def _sort_one(recording: Recording, series: Series, settings: ShearSettings, runs: SortedRuns) -> None:
    usable = _usable(recording, series, runs)
    run, excitation = usable.run, usable.excitation
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
        runs.half_cycles.append(_moving(usable))
    elif excitation.kind == "periodic" and excitation.steady is not None:
        _as_loop(usable, settings, runs)
    else:
        if excitation.kind == "periodic":
            runs.say("warning", run, f"periodic, but no cycle is steady ({excitation.reason}): fitted in time.")
        runs.records.append(_moving(usable))


def _moving(usable: UsableRun) -> UsableRun:
    return _replaced(usable, usable.series.between(*usable.excitation.moving), None)


def _replaced(usable: UsableRun, series: Series, loop: Loop | None) -> UsableRun:
    return replace(usable, series=series, loop=loop)


def _as_loop(usable: UsableRun, settings: ShearSettings, runs: SortedRuns) -> None:
    assert usable.excitation.steady is not None
    run = usable.run
    clipped = clipping(usable.series.x)
    if clipped is not None:
        level, share = clipped
        raise UnfitError(
            f"the displacement is clipped: {100 * share:.1f} % of its samples are flat at {level:.5g} m", "displacement"
        )
    series = usable.series.between(*usable.excitation.steady)
    frequency = usable.excitation.frequency
    assert frequency is not None
    late = _settled(series, frequency)
    if late > 0:
        series = series.between(series.time[0] + late / frequency, series.time[-1])
        runs.say("note", run, f"the force of the first {late} cycles is not settled; they do not enter.", "force")
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
    wrong = _wrong_way_round(loop)
    if wrong:
        runs.leave_out(run, wrong, "force")
        runs.faulty.append(_replaced(usable, series, loop))
        return
    _say_shape(loop, usable.excitation, runs)
    if usable.label_frequency and abs(loop.frequency / usable.label_frequency - 1) > _FREQUENCY_APART:
        runs.say(
            "warning",
            run,
            f"the displacement runs at {loop.frequency:.4g} Hz but the label says {usable.label_frequency:.4g} Hz: a wrong "
            "label, or a wrong time base. The measured one is used.",
            "displacement",
        )
    runs.loops.append(_replaced(usable, series, loop))


def _wrong_way_round(loop: Loop) -> str:
    """Say why a loop that would give energy does so; an empty text for one that takes it."""
    area = next(e for e in loop_metrics(loop) if e.name == "loop_area")
    assert area.value is not None
    if area.value >= -2 * (area.std_error or 0.0):
        return ""
    falls = (loop.F[0] / loop.X[0]).real < 0
    seen = "the force falls as the displacement rises" if falls else "though the force rises with the displacement"
    likely = "the sign of one of them is wrong" if falls else "they are swapped, or the force leads by a wrong clock"
    return (
        f"the loop runs the wrong way round (area {area.value:.3g} J: the sample would give energy), {seen}: most likely "
        f"{likely}. Mend the recipe ('sign: -1', or the channels' names)"
    )


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


def _current(recording: Recording, runs: SortedRuns) -> float | None:
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
