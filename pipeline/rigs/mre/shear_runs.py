"""Which runs of a campaign can be used, and how: steady loops, half cycles, records without a period.

A run that cannot be used is left out with the reason; what is odd about one that can is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.loop import Loop, Pads, curve, fit_loop, loop_metrics
from pipeline.rigs.mre.shear import ShearSettings
from pipeline.signals.periodicity import Excitation, classify

_FEWEST = 20  # samples of both channels
# A flat top of clipping lasts longer than the roundest sine stays within one step of its peak.
_FLAT_SHARE, _FLAT_SAMPLES = 0.02, 6
_STUCK_SHARE = 0.1
# Measured against set current: what counts as another level.
_CURRENT_APART = 0.1
_FREQUENCY_APART = 0.03
_OFFSET_SAID, _ASYMMETRY_SAID, _DRIFT_SAID = 0.05, 0.05, 0.05


@dataclass(frozen=True, eq=False)
class Series:
    """Valid samples of one run: time (s), displacement (m), force (N), shape (n,) each."""

    time: np.ndarray
    x: np.ndarray
    F: np.ndarray

    def between(self, start: float, end: float) -> Series:
        """Return the samples from `start` to `end` (s)."""
        inside = (self.time >= start) & (self.time <= end)
        return Series(self.time[inside], self.x[inside], self.F[inside])


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
    """Runs by what they are, those left out with reasons, and findings on the way."""

    loops: list[UsableRun] = field(default_factory=list)
    half_cycles: list[UsableRun] = field(default_factory=list)
    records: list[UsableRun] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)

    def say(self, level: str, run: str | None, message: str, channel: str | None = None) -> None:
        """Add a finding."""
        assert level in ("note", "warning", "error")
        self.quality.append(QualityFinding(level, message, run, channel))  # type: ignore[arg-type]

    def leave_out(self, run: str, reason: str, channel: str | None = None) -> None:
        """Leave a run out, and say so."""
        self.left_out[run] = reason
        self.say("error", run, f"left out: {reason}", channel)

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
        _sort_one(recording, settings, runs)
    return runs


def _sort_one(recording: Recording, settings: ShearSettings, runs: SortedRuns) -> None:
    run = recording.run
    series = _series(recording, runs)
    if series is None:
        return
    try:
        excitation = classify(series.time, series.x)
    except InputError as error:
        runs.leave_out(run, str(error))
        return
    usable = UsableRun(
        run=run,
        series=series,
        excitation=excitation,
        current=_current(recording, runs),
        preload=_number(recording, "preload"),
        pads=_pads(recording),
        sequence=_number(recording, "sequence_index"),
        test=str(recording.conditions.get("test", "")),
        label_frequency=_number(recording, "frequency"),
    )
    for remark in excitation.remarks:
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


def _series(recording: Recording, runs: SortedRuns) -> Series | None:
    """Return the samples where both channels have a value; None where the run must be left out."""
    run = recording.run
    time, x = recording.signal("displacement")
    force_time, F = recording.signal("force")
    if recording.stream_of("displacement") is not recording.stream_of("force"):
        inside = (time >= force_time[0]) & (time <= force_time[-1]) if force_time.size else np.zeros(time.size, bool)
        time, x = time[inside], x[inside]
        F = np.interp(time, force_time, F) if force_time.size else F[:0]
        runs.say("note", run, "force and displacement have clocks of their own; force was interpolated.", "force")
    valid = np.isfinite(x) & np.isfinite(F)
    if valid.sum() < _FEWEST:
        runs.leave_out(run, f"{int(valid.sum())} samples with displacement and force; {_FEWEST} are needed")
        return None
    time, x, F = time[valid], x[valid], F[valid]
    for name, values in (("displacement", x), ("force", F)):
        if np.ptp(values) == 0:
            runs.leave_out(run, f"the channel {name} is dead: every sample is {values[0]:.6g}", name)
            return None
    stuck = _longest_constant(F)
    if stuck > max(_STUCK_SHARE * F.size, 50) and np.ptp(x) > 0:
        runs.leave_out(run, f"the force is stuck for {100 * stuck / F.size:.0f} % of the record", "force")
        return None
    flat = max(_longest_at(F, F.max()), _longest_at(F, F.min()))
    share = (np.count_nonzero(F.max() == F) + np.count_nonzero(F.min() == F)) / F.size
    if flat >= _FLAT_SAMPLES and share > _FLAT_SHARE:
        side = F.max() if np.count_nonzero(F.max() == F) >= np.count_nonzero(F.min() == F) else F.min()
        runs.leave_out(
            run, f"the force is clipped: {100 * share:.1f} % of its samples are flat at {side:.5g} N", "force"
        )
        return None
    return Series(time, x, F)


def _longest_constant(values: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(values) != 0)
    return int(np.max(np.diff(np.r_[-1, edges, values.size - 1])))


def _longest_at(values: np.ndarray, level: float) -> int:
    there = np.r_[False, values == level, False].astype(int)
    edges = np.flatnonzero(np.diff(there))
    return int(np.max(edges[1::2] - edges[::2])) if edges.size else 0


def _as_loop(usable: UsableRun, settings: ShearSettings, runs: SortedRuns) -> None:
    assert usable.excitation.steady is not None
    run = usable.run
    series = usable.series.between(*usable.excitation.steady)
    frequency = usable.excitation.frequency
    assert frequency is not None
    late = _settled(series, frequency)
    if late > 0:
        series = series.between(series.time[0] + late / frequency, series.time[-1])
        runs.say("note", run, f"the force of the first {late} cycles is not settled; they do not enter.", "force")
    try:
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
    except InputError as error:
        runs.leave_out(run, str(error))
        return
    area = next(e for e in loop_metrics(loop) if e.name == "loop_area")
    assert area.value is not None
    if area.value < -2 * (area.std_error or 0.0):
        rise = "and it falls as x rises" if (loop.F[0] / loop.X[0]).real < 0 else "though it rises with x"
        which = (
            "the sign of force or displacement is wrong" if "falls" in rise else "force and displacement are swapped"
        )
        runs.leave_out(
            run,
            f"the loop runs the wrong way round (area {area.value:.3g} J: it would give energy), {rise}: most likely "
            f"{which}. Mend the recipe ('sign: -1', or the channels' names)",
            "force",
        )
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
    """Name offset, asymmetry, drift and the mains of a loop that is used."""
    run = loop.run
    force = curve(loop.F)
    push, pull = float(force.max()), float(-force.min())
    size = 0.5 * (push + pull)
    even = float(np.sqrt((np.abs(loop.F[1::2]) ** 2).sum()) / abs(loop.F[0]))
    even_x = float(np.sqrt((np.abs(loop.X[1::2]) ** 2).sum()) / abs(loop.X[0]))
    if abs(loop.f_mean) > _OFFSET_SAID * size:
        runs.say("note", run, f"force offset of {loop.f_mean:.3g} N, {100 * abs(loop.f_mean) / size:.0f} % of the "
                 "amplitude; it does not enter.", "force")  # fmt: skip
    if even > max(_ASYMMETRY_SAID, 3 * even_x):
        runs.say(
            "warning",
            run,
            f"asymmetric force: even harmonics hold {100 * even:.0f} % of the fundamental (displacement "
            f"{100 * even_x:.0f} %), peaks {push:.4g} N in push and {pull:.4g} N in pull; the model is symmetric.",
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
    lost = [h + 1 for h in range(loop.kept.size) if not loop.kept[h] and loop.F[h] != 0]
    if lost:
        orders = ", ".join(str(h) for h in lost)
        runs.say(
            "note",
            run,
            f"harmonics {orders} of {loop.frequency:.4g} Hz lie on the mains and do not enter; a frequency that does "
            "not divide it keeps them.",
            "force",
        )
    if (loop.F[0] / loop.X[0]).real < 0:
        runs.say("warning", run, "negative in-phase stiffness: inertia of an untared mass, or a wrong sign.", "force")


def _current(recording: Recording, runs: SortedRuns) -> float | None:
    """Return the coil current (A): the measured one where there is a channel, else the label."""
    label = _number(recording, "coil_current")
    if "current" not in recording:
        return label
    values = recording.values("current")
    values = values[np.isfinite(values)]
    if not values.size:
        return label
    measured, noise = float(values.mean()), max(float(values.std()), 0.01)
    if label is not None and abs(measured - label) > max(_CURRENT_APART, 0.05 * abs(label), 3 * noise):
        runs.say(
            "warning",
            recording.run,
            f"the measured current is {measured:.2f} A but the label says {label:.2f} A; the measured one is used.",
            "current",
        )
    return 0.0 if abs(measured) <= 1.96 * noise else measured


def _number(recording: Recording, name: str) -> float | None:
    value = recording.conditions.get(name)
    return float(value) if isinstance(value, float | int) and not isinstance(value, bool) else None


def _pads(recording: Recording) -> Pads | None:
    diameter, height = _number(recording, "pad_diameter"), _number(recording, "pad_height")
    if diameter is None or height is None or not (diameter > 0 and height > 0):
        return None
    count = _number(recording, "n_pads")
    return Pads(diameter, height, 2.0 if count is None or not count > 0 else count)
