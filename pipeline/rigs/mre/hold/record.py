"""One log of a hold test -> one row per hold: force, its creep, flux density and the rest, transients left out.

What makes a whole log unusable raises `UnusableError` with the reason. Fitting is elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipeline.errors import counted, listing
from pipeline.recording import Level, QualityFinding, Recording
from pipeline.rigs.mre.current_levels import HOLD_DRIFT, Hold, Staircase, finest_holds_of, levels_told, without_ramps
from pipeline.rigs.mre.hold.repeats import clipped_or_stuck
from pipeline.rigs.mre.hold.samples import FEWEST, Creep, Means, creep_of, log_times, means_of, still_settling

_FEWEST_HOLDS = 4
_SWEPT = 0.8  # share of the log that no hold covers: it was swept through
_BLOCKS = 60  # stretches that a continuous sweep is cut into
_LARGEST = 200.0  # A, of any such coil
_USUAL = 20.0  # A, of a usual one


class UnusableError(Exception):
    """A log from which nothing can be identified; the text is the reason."""

    def __init__(self, reason: str, channel: str | None = None) -> None:
        super().__init__(reason)
        self.channel = channel


@dataclass(frozen=True, eq=False)
class Record:
    """The holds of one run, shape (H,): level (A), +1 up or -1 down, time since the log began (s) and mean of log10(t/t0).

    `age` is how long the gap had been closed when the log began, s: relaxation counts from then. `windows` are the stretches that count, `lost`
    tells the holds whose force does not.
    """

    run: str
    recording: Recording
    stairs: Staircase
    swept: bool
    holds: tuple[Hold, ...]
    level: np.ndarray
    level_error: np.ndarray
    direction: np.ndarray
    time: np.ndarray
    log_time: np.ndarray
    settle: np.ndarray
    channels: dict[str, Means]
    creep: Creep | None
    samples: dict[str, tuple[np.ndarray, np.ndarray]]
    late: np.ndarray
    age: float
    windows: tuple[tuple[float, float], ...]
    lost: np.ndarray
    findings: tuple[QualityFinding, ...] = ()

    def __len__(self) -> int:
        return len(self.holds)

    @property
    def both_ways(self) -> bool:
        """Tell whether the current was swept up and down, each over half of the range."""
        spans = [np.ptp(self.level[self.direction == way]) if (self.direction == way).any() else 0.0 for way in (1, -1)]
        return bool(min(spans) >= 0.5 * np.ptp(self.level))

    def of(self, channel: str) -> Means | None:
        """Return the means of a channel, None where the log has none of it."""
        return self.channels.get(channel)

    def aged(self, age: float) -> Record:
        """Return the same log with the gap closed `age` seconds before it began; counts as told by the conditions."""
        signal = self.samples["force_axial"]
        logs = [log_times(signal, window, age) for window in self.windows]
        conditions = {**self.recording.conditions, "gap_closed_for": age}
        return replace(
            self,
            recording=replace(self.recording, conditions=conditions),
            age=age,
            log_time=np.array([float(log.mean()) if log.size else np.nan for log in logs]),
            creep=creep_of(signal, self.windows, self.holds, self.lost, age),
        )


def record_of(recording: Recording, settle: float) -> Record:
    """Return the holds of a log.

    Raises
    ------
    UnusableError
        If the current does not move, no hold is found, or force and flux are both missing or dead.
    """
    findings: list[QualityFinding] = []

    def say(level: Level, channel: str | None, message: str) -> None:
        findings.append(QualityFinding(level, message, recording.run, channel))

    start = min(float(stream.time[0]) for stream in recording.streams.values() if stream.time.size)
    time, current = recording.signal("current")
    usual = _current(recording, current, say)
    turned, time, current = usual is not current, time - start, usual
    stairs = finest_holds_of(time, current)
    _refuse_one_level(current, stairs)
    holds, swept = _holds(time, current, stairs, say)
    waits = np.array([0.0 if swept else min(settle, 0.5 * hold.duration) for hold in holds])
    windows = [(hold.start + wait, hold.stop) for hold, wait in zip(holds, waits, strict=True)]
    currents = means_of(time, current, windows)
    # Of the samples that count, as force and field: the first of a hold still come from the level before.
    level = np.where(np.isfinite(currents.mean), currents.mean, [hold.level for hold in holds])
    samples = {}
    channels = {}
    for name in ("force_axial", "flux_density", "displacement_axial", "voltage", "temperature"):
        if name not in recording:
            continue
        own_time, values = recording.signal(name)
        if not np.isfinite(values).any():
            say("warning", name, f"{name} holds no number; it is not used.")
            continue
        if name == "flux_density" and turned and _falls_with(time, current, own_time - start, values):
            say("note", name, "flux_density is negative with the current: both are taken as positive.")
            values = -values
        samples[name] = (own_time - start, values)
        channels[name] = means_of(own_time - start, values, windows)
    lost = np.zeros(len(holds), dtype=bool)
    for name in ("force_axial", "flux_density"):
        if name in channels:
            lost_here = _refuse_dead(name, channels, samples[name], windows, say)
            lost |= lost_here if name == "force_axial" else False
    if "force_axial" not in channels and "flux_density" not in channels:
        raise UnusableError(
            findings[-1].message.rstrip(".") if findings else "it holds neither force_axial nor flux_density"
        )
    main = "force_axial" if "force_axial" in channels else "flux_density"
    age = recording.conditions.get("gap_closed_for")
    age = float(age) if isinstance(age, float | int) else 0.0
    logs = [log_times(samples[main], window, age) for window in windows]
    return Record(
        recording.run,
        recording,
        stairs,
        swept,
        holds,
        level,
        np.array([hold.level_error for hold in holds]),
        _directions(level),
        np.array([0.5 * (a + b) for a, b in windows]),
        np.array([float(log.mean()) if log.size else np.nan for log in logs]),
        waits,
        channels,
        creep_of(samples["force_axial"], windows, holds, lost, age) if "force_axial" in channels else None,
        samples,
        still_settling(samples["force_axial"], windows) if "force_axial" in channels else np.full(len(holds), np.nan),
        age,
        tuple(windows),
        lost,
        tuple(findings),
    )


def _falls_with(time: np.ndarray, current: np.ndarray, own_time: np.ndarray, values: np.ndarray) -> bool:
    """Tell whether a channel falls as the current rises."""
    there, own = np.isfinite(current), np.isfinite(values)
    seen = np.interp(own_time[own], time[there], current[there])
    return bool(((seen - seen.mean()) * (values[own] - values[own].mean())).sum() < 0)


def _refuse_one_level(current: np.ndarray, stairs: Staircase) -> None:
    """Refuse a current that stands still but for its noise.

    Raises
    ------
    UnusableError
        If it does.
    """
    low, high = np.quantile(current[np.isfinite(current)], [0.01, 0.99])
    if high - low < max(8 * stairs.noise, 0.02) and high - low < HOLD_DRIFT:
        raise UnusableError(
            f"the current stands at {0.5 * (low + high):.4g} A throughout, but for its noise: nothing is swept, and one level tells no increment",
            "current",
        )


def _current(recording: Recording, values: np.ndarray, say: Callable[[Level, str | None, str], None]) -> np.ndarray:
    """Return the current with its usual sign positive; the same array where it is.

    Raises
    ------
    UnusableError
        If it is missing, dead or does not move.
    """
    valid = values[np.isfinite(values)]
    if valid.size < 20:
        raise UnusableError(f"the current has only {counted(int(valid.size), 'sample')}", "current")
    low, high = np.quantile(valid, [0.005, 0.995])
    if np.ptp(valid) == 0:
        raise UnusableError(f"the current is {valid[0]:.4g} A throughout: nothing is swept", "current")
    if high - low < 0.05:
        raise UnusableError(
            f"the current moves between {low:.4g} and {high:.4g} A only: no sweep, or A taken as mA (factor 1000)",
            "current",
        )
    if max(abs(low), abs(high)) > _LARGEST:
        raise UnusableError(
            f"the current reaches {max(abs(low), abs(high)):.4g} A, which no such coil takes: {_mistaken(recording)}",
            "current",
        )
    if -low > 5 * max(high, 0.0):
        say("warning", "current", f"the current is negative (to {low:.4g} A): taken as positive; check its sign.")
        return np.asarray(-values)
    if -low > 0.05 * high:
        say(
            "warning",
            "current",
            f"the current has both signs ({low:.4g} to {high:.4g} A): force is fitted against its magnitude, remanence and "
            "hysteresis about 0 A are not in the law.",
        )
    return values


def _mistaken(recording: Recording) -> str:
    """Say what a current may be that is far too large."""
    if "force_axial" in recording:
        force = recording.values("force_axial")
        force = force[np.isfinite(force)]
        if force.size and float(np.abs(np.quantile(force, [0.01, 0.99])).max()) < _USUAL:
            return "current and force_axial swapped, since the force never exceeds a usual current, or mA taken as A (factor 1000)"
    return "mA taken as A (factor 1000)"


def _holds(
    time: np.ndarray, current: np.ndarray, stairs: Staircase, say: Callable[[Level, str | None, str], None]
) -> tuple[tuple[Hold, ...], bool]:
    """Return the holds, or the blocks of a continuous sweep and True."""
    still = _without_frozen(time, current, without_ramps(stairs.holds), say)
    covered = sum(hold.duration for hold in still) / max(float(time[-1] - time[0]), 1e-9)
    distinct = levels_told(still)
    if covered >= 1 - _SWEPT and distinct >= 2:
        if distinct < _FEWEST_HOLDS - 1:
            raise UnusableError(
                f"the current is held at {counted(distinct, 'level')} only ({listing(f'{h.level:.2f} A' for h in still[:6])}); "
                "a hold sweep needs at least 3. A single step belongs to mre.step",
                "current",
            )
        return still, False
    valid = np.isfinite(current)
    t, x = time[valid], current[valid]
    if t.size < 8 * _BLOCKS // 2:
        raise UnusableError("no current level is held and too few samples were taken for a continuous sweep", "current")
    say(
        "warning",
        "current",
        "the current is swept and not held in steps: force and field lag behind it, which the law does not hold.",
    )
    edges = np.linspace(t[0], t[-1], _BLOCKS + 1)
    blocks = []
    for a, b in pairwise(edges.tolist()):
        part = x[(t >= a) & (t < b)]
        if part.size >= FEWEST:
            blocks.append(Hold(float(a), float(b), float(part.mean()), stairs.noise / math.sqrt(part.size), 0.0))
    return tuple(blocks), True


def _without_frozen(
    time: np.ndarray, current: np.ndarray, holds: Sequence[Hold], say: Callable[[Level, str | None, str], None]
) -> tuple[Hold, ...]:
    """Return the holds in which the measured current was alive: where it varies elsewhere, none repeats one value."""
    inside = [current[(time >= hold.start) & (time < hold.stop) & np.isfinite(current)] for hold in holds]
    clipped, stuck = clipped_or_stuck(inside, current[np.isfinite(current)])
    frozen = clipped | stuck
    for hold, dead in zip(holds, frozen, strict=True):
        if dead:
            say(
                "warning",
                "current",
                f"the current is frozen at {hold.level:.4g} A from {hold.start:.4g} to {hold.stop:.4g} s; that stretch does not enter.",
            )
    return tuple(hold for hold, dead in zip(holds, frozen, strict=True) if not dead)


def _directions(level: np.ndarray) -> np.ndarray:
    """Return +1 where a level was reached from below, -1 from above; the first goes with the second."""
    if level.size < 2:
        return np.ones(level.size)
    way = np.sign(np.diff(level))
    way = np.r_[way[0] if level[0] > 0.5 * level.max() else 1.0, way]
    return np.asarray(np.where(way == 0, 1.0, way))


def _refuse_dead(
    name: str,
    channels: dict[str, Means],
    signal: tuple[np.ndarray, np.ndarray],
    windows: Sequence[tuple[float, float]],
    say: Callable[[Level, str | None, str], None],
) -> np.ndarray:
    """Drop a dead channel and the holds in which one is clipped or stuck; return the latter, shape (H,)."""
    time, values = signal
    none = np.zeros(len(windows), dtype=bool)
    valid = values[np.isfinite(values)]
    if np.ptp(valid) == 0:
        say("error" if name == "force_axial" else "warning", name, f"{name} is dead: every sample is {valid[0]:.4g}.")
        del channels[name]
        return none
    inside = [values[(time >= a) & (time < b) & np.isfinite(values)] for a, b in windows]
    clipped, stuck = clipped_or_stuck(inside, valid)
    lost = np.asarray(clipped | stuck)
    if lost.all() or (~lost).sum() < _FEWEST_HOLDS:
        if lost.any():
            say("error", name, f"{name} is clipped or stuck in {int(lost.sum())} of {lost.size} holds.")
            del channels[name]
        return none
    for which, word in ((clipped, "clipped"), (stuck, "stuck")):
        if which.any():
            first = int(np.flatnonzero(which)[0])
            value = float(np.median(inside[first]))
            say(
                "warning",
                name,
                f"{name} is {word} at {value:.4g} in {counted(int(which.sum()), 'hold')}, first at {windows[first][0]:.4g} s; "
                "these do not enter.",
            )
    channels[name] = channels[name].without(lost)
    return lost
