"""One log of a step test -> force over time, the measured current on a fine grid, and where it steps.

What makes a whole log unusable raises `UnusableError` with the reason. Fitting is elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import counted
from pipeline.recording import Level, QualityFinding, Recording
from pipeline.rigs.mre.current_levels import Hold, Staircase, holds_of
from pipeline.rigs.mre.hold.record import UnusableError
from pipeline.rigs.mre.hold.repeats import clipped_or_stuck, lone_spikes
from pipeline.rigs.mre.step.breaks import Break, breaks_of
from pipeline.rigs.mre.step.lags import passes
from pipeline.rigs.mre.step.mains import LONGEST, hum_of

_LEAST_STEP, _SAME = 0.15, 0.03  # of the range of the current: a step; levels that are one
_FINEST = 2e-3  # s
# Rows of the force that enter, means of neighbours beyond; points of the grid of the current.
_MOST_ROWS, _MOST_POINTS = 20_000, 60_000
_FEWEST = 30
_LARGEST = 200.0  # A, of any such coil
_RIPPLE = 0.01  # of the range of the current
_SMOOTH = 1e-7  # of the range: the bend from sample to sample of a log without noise
_BOTH = 0.1  # of the largest current: what is negative beyond is no noise
_HOLE = 1.5  # periods of the samples: some are lost
_QUICK = 6e-3  # s, samples that are closer show how a coil's current rises
DIRECTIONS = ("rise", "fall")


@dataclass(frozen=True)
class Step:
    """One change of the current: levels before and after (A), its onset, and until when the level is held (s).

    `spread` is the standard error of the onset where the change is not resolved by the samples (s), `resolved` how many samples lie in it.
    """

    direction: str
    before: float
    after: float
    start: float
    onset: float
    end: float
    spread: float
    resolved: int

    @property
    def size(self) -> float:
        """Change of the magnitude of the current, A."""
        return self.after - self.before


@dataclass(frozen=True, eq=False)
class Record:
    """A usable log. `time`, `force` shape (n,); `grid` and `current`, shape (m,), uniform with step `dt`; `period` of the current's samples."""

    run: str
    recording: Recording
    time: np.ndarray
    force: np.ndarray
    grid: np.ndarray
    current: np.ndarray
    dt: float
    period: float
    steps: tuple[Step, ...]
    stairs: Staircase
    findings: tuple[QualityFinding, ...]
    breaks: tuple[Break, ...]

    @property
    def filter_lag(self) -> float:
        """Time constant of the filter that the force channel is told to have, s; 0 where none is told."""
        corner = self.recording.conditions.get("force_filter")
        return 1 / (2 * math.pi * corner) if isinstance(corner, float) and corner > 0 else 0.0

    @property
    def looks_set(self) -> bool:
        """Whether the current looks like the set-point: it changes at once where samples would show the rise of a coil."""
        fast = self.period < _QUICK and all(step.resolved == 0 for step in self.steps)
        return self.stairs.is_set_point or fast

    def of(self, direction: str) -> list[Step]:
        """Return the steps of a direction."""
        return [step for step in self.steps if step.direction == direction]


def record_of(recording: Recording) -> Record:
    """Return force, current and steps of a log.

    Raises
    ------
    UnusableError
        If a channel is missing, dead, clipped or negative, or the current does not step.
    """
    findings: list[QualityFinding] = []

    def say(level: Level, channel: str | None, message: str) -> None:
        findings.append(QualityFinding(level, message, recording.run, channel))

    begin = min(float(stream.time[0]) for stream in recording.streams.values() if stream.time.size)
    time, force = _force(recording, begin, say)
    breaks, frozen = breaks_of("force_axial", time, force)
    own, raw = recording.signal("current")
    valid = np.isfinite(raw)
    own, raw = own[valid] - begin, raw[valid]
    if raw.size < _FEWEST:
        raise UnusableError(f"the current has only {counted(int(raw.size), 'sample')}", "current")
    low, high = np.quantile(raw, [0.005, 0.995])
    if np.ptp(raw) == 0 or max(abs(low), abs(high)) < 0.05 or high - low < 0.05:
        raise UnusableError(
            f"the current lies between {low:.4g} and {high:.4g} A throughout: no step, or A taken as mA (factor 1000)",
            "current",
        )
    if max(abs(low), abs(high)) > _LARGEST:
        raise UnusableError(
            f"the current reaches {max(abs(low), abs(high)):.4g} A, which no such coil takes: mA taken as A (factor 1000)?",
            "current",
        )
    if -low > 5 * max(high, 0.0):
        say("warning", "current", f"the current is negative (to {low:.4g} A): taken as positive; check its sign.")
        raw = -raw
    elif -low > _BOTH * high:
        say(
            "warning",
            "current",
            f"the current has both signs ({low:.4g} to {high:.4g} A): the force is taken to follow its magnitude, and remanence, which does not, is in the times.",
        )
        raw = np.abs(raw)
    wild = lone_spikes(raw)
    if wild.any():
        say("note", "current", f"{counted(int(wild.sum()), 'lone wild sample')} of the current left out.")
        own, raw = own[~wild], raw[~wild]
    stairs = holds_of(own, raw)
    breaks += breaks_of("current", own, raw)[0]
    steps = _steps(own, raw, stairs)
    if not steps:
        raise UnusableError(
            "the current has no step: no two levels held for half a second, one after the other (or s taken as ms, factor 1000)",
            "current",
        )
    period = float(np.median(np.diff(own)))
    first, last = min(own[0], time[0]), max(own[-1], time[-1])
    dt = max(min(period, _FINEST), float(last - first) / _MOST_POINTS)
    grid = np.arange(first, last + dt, dt)
    _refuse_clipped(time, force, own, raw, stairs)
    # The second half of a level is all but settled.
    spans = [(0.5 * (hold.start + hold.stop), hold.stop) for hold in stairs.holds]
    hum = hum_of(time, force, spans)
    if hum is not None:
        short = float(time[-1] - time[0]) <= LONGEST
        force = force - hum.wave(time) if short else force
        say(
            "warning",
            "force_axial",
            f"hum of {hum.amplitude:.3g} N at {hum.frequency:.4g} Hz in the force: the mains. It was {'taken off' if short else 'left in, as the mains wander over so long a log'}; "
            "mend shield and ground.",
        )
    ripple = hum_of(own, raw, spans)
    if ripple is not None and ripple.amplitude > _RIPPLE * (high - low):
        say(
            "warning",
            "current",
            f"ripple of {ripple.amplitude:.3g} A at {ripple.frequency:.4g} Hz on the current: the mains, from the supply or picked up. Left as it is: onsets are less sure.",
        )
    # What the force does before the first level and after the last is not of any step that was found.
    inside = (time >= stairs.holds[0].start) & (time <= stairs.holds[-1].stop)
    inside &= ~frozen
    time, force = time[inside], force[inside]
    time, force = _thinned(time, force)
    current = np.interp(grid, *_with_onsets(own, raw, steps, period))
    return Record(
        recording.run,
        recording,
        time,
        force,
        grid,
        current,
        dt,
        period,
        steps,
        stairs,
        tuple(findings),
        tuple(breaks),
    )


def _force(
    recording: Recording, begin: float, say: Callable[[Level, str | None, str], None]
) -> tuple[np.ndarray, np.ndarray]:
    time, F = recording.signal("force_axial")
    valid = np.isfinite(F)
    time, F = time[valid] - begin, F[valid]
    if F.size < _FEWEST:
        raise UnusableError(f"force_axial has only {counted(int(F.size), 'sample')} with a number", "force_axial")
    if np.ptp(F) == 0:
        raise UnusableError(f"force_axial is dead: every sample is {F[0]:.4g}", "force_axial")
    if float(np.median(F)) < 0:
        raise UnusableError(
            "force_axial is negative, but compression counts positive: mend it in the recipe with 'sign: -1' under 'channels'",
            "force_axial",
        )
    wild = lone_spikes(F)
    if wild.any():
        say("note", "force_axial", f"{counted(int(wild.sum()), 'lone wild sample')} of force_axial left out.")
    return time[~wild], F[~wild]


def _steps(time: np.ndarray, current: np.ndarray, stairs: Staircase) -> tuple[Step, ...]:
    holds = _plateaus(stairs.holds)
    found = []
    for number in range(1, len(holds)):
        before, after = holds[number - 1], holds[number]
        size = abs(after.level) - abs(before.level)
        if abs(after.level - before.level) < _LEAST_STEP * float(np.ptp([h.level for h in holds])):
            continue
        end = after.stop
        onset, spread, resolved = _onset(time, current, before, after, stairs)
        start = min(onset, before.stop) - stairs.step
        found.append(
            Step("rise" if size > 0 else "fall", before.level, after.level, start, onset, end, spread, resolved)
        )
    return tuple(found)


def _plateaus(holds: Sequence[Hold]) -> list[Hold]:
    """Join neighbours that differ by a trifle of the range, as ripple and the last approach to a level make them."""
    near = _SAME * float(np.ptp([h.level for h in holds])) if holds else 0.0
    joined: list[Hold] = []
    for hold in holds:
        if joined and abs(hold.level - joined[-1].level) < near:
            longer = max(joined[-1], hold, key=lambda h: h.duration)
            joined[-1] = replace(longer, start=joined[-1].start, stop=hold.stop)
        else:
            joined.append(hold)
    return joined


def _onset(
    time: np.ndarray, current: np.ndarray, before: Hold, after: Hold, stairs: Staircase
) -> tuple[float, float, int]:
    """Return when the current begins to change, its standard error where the samples do not resolve it, samples in the change.

    The exponential of a coil through the passage of 5 and of 25 % is carried back to 0; where samples are lost there, that through
    the first ones after them.
    """
    rows = (time > before.stop - 6 * stairs.step) & (time < after.start + 6 * stairs.step)
    t = time[rows]
    share = (current[rows] - before.level) / (after.level - before.level)
    resolved = int(np.count_nonzero((share > 0.05) & (share < 0.95)))
    floor = max(0.05, 4 * stairs.noise / abs(after.level - before.level))
    floor = min(floor, 0.3)
    if resolved < 2:
        k = int(np.flatnonzero(share > 0.5)[0]) if (share > 0.5).any() else 0
        last, first = float(t[max(k - 1, 0)]), float(t[k])
        if k and share[k - 1] > 0.05:  # the sample on the way tells that it had begun before
            last -= stairs.step
            first -= stairs.step
        return 0.5 * (last + first), (first - last) / math.sqrt(12), resolved
    first = int(np.flatnonzero(share >= floor)[0])
    hidden = first > 0 and bool(t[first] - t[first - 1] > _HOLE * stairs.step)
    one = float(share[first]) if hidden and share[first] < 0.9 else floor  # a passage that a sample saw
    other = min(one + 0.2, 0.5 * (1 + one))
    low, high = passes(t, share, one), passes(t, share, other)
    onset = low + (high - low) * math.log(1 - one) / math.log((1 - one) / (1 - other))
    return max(onset, float(t[first - 1])) if hidden else onset, 0.0, resolved


def _with_onsets(time: np.ndarray, current: np.ndarray, steps: Sequence[Step], period: float) -> np.ndarray:
    """Return times and currents, shape (2, n), with the onsets that lie in a hole put in: until then the level before holds."""
    known = np.vstack([time, current])
    for step in steps:
        k = int(np.searchsorted(known[0], step.onset))
        if 0 < k < known.shape[1] and step.spread == 0 and known[0, k] - known[0, k - 1] > _HOLE * period:
            known = np.insert(known, k, [step.onset, step.before], axis=1)
    return known


def _refuse_clipped(
    time: np.ndarray, force: np.ndarray, own: np.ndarray, current: np.ndarray, stairs: Staircase
) -> None:
    for name, unit, t, x in (("force_axial", "N", time, force), ("the current", "A", own, current)):
        holds = [x[(t >= h.start) & (t < h.stop)] for h in stairs.holds]
        bends = [float(np.median(np.abs(np.diff(values, 2)))) for values in holds if values.size > 8]
        if bends and max(bends) < _SMOOTH * float(np.ptp(x)):  # no noise in any hold: equal samples mean nothing
            continue
        clipped, stuck = clipped_or_stuck(holds, x)
        if unit == "A":  # a sensor that reads 0 where no current flows has lost nothing
            flows = np.array([abs(h.level) > _SAME * float(np.ptp(x)) for h in stairs.holds])
            clipped, stuck = clipped & flows, stuck & flows
        for which, word in ((clipped, "clipped"), (stuck, "stuck")):
            if which.any():
                value = float(np.median(holds[int(np.flatnonzero(which)[0])]))
                raise UnusableError(
                    f"{name} is {word} at {value:.4g} {unit} while a level is held: what it did then, and with it all times, is lost",
                    "force_axial" if unit == "N" else "current",
                )


def _thinned(time: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return means of neighbours where there are more samples than a fit needs."""
    group = -(-time.size // _MOST_ROWS)
    if group == 1:
        return time, force
    n = time.size // group * group
    return time[:n].reshape(-1, group).mean(axis=1), force[:n].reshape(-1, group).mean(axis=1)
