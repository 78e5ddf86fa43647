"""Where a counter froze, fell silent or lost pulses while the shaft turned on.

A shaft with a flywheel slows down before it stands: a counter that stops, or goes on, at full tilt tells of
the encoder and not of the shaft. Arrays in counts only; what the torques say is not looked at.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.gearbox.stages.counter_jumps import jumps
from pipeline.rigs.gearbox.stages.stage import Problem

# The speed at a pause is that of a straight line through this many counts and updates on one side of it, twice.
_COUNTS, _UPDATES = 8, 4
# It is no stop where that speed is so large a share of the mean speed beside it, and so many counts in that time.
_ABRUPT, _CLEAR = 0.6, 4.5
# A pause is worth a look from so many usual updates, so long (s) and so many missing counts on.
_PAUSE, _LEAST, _MISSING = 2.5, 0.02, 6.0
# Counts are lost where they differ by that share, or number, from what the speeds beside the pause give.
_SHARE, _FEW = 0.15, 3.0
# A mean speed beside a pause is that of so many counts where it agrees with the edge's by a tenth.
_LONG, _STEADY = 60, 0.1
# Speeds read over longer than that (s) cannot tell a frozen counter from a quick stop or a quick start. Then one
# side tells nothing (nor does it with fewer counts than `_ALONE`), and both must run at this share of top speed unless the pause is shorter than a stop is held.
_QUICK, _ALONE, _SHARP, _HELD = 0.045, 6.0, 0.7, 1.0
# A pause that is shorter is unknown as a whole where one side shows that the counter froze, s.
_SHORT = 0.5
# Where the shaft comes to rest unseen, s at the most.
_UNSEEN = 1.0
# A shaft that slows down may stand within so many updates.
_SOON = 5.0
# So short a pause (s) without a lost count harms nothing.
_HARMLESS = 0.08
# More losses than these are told together.
_SINGLY = 5


@dataclass(frozen=True)
class EdgeSpeed:
    """Speed right at a pause and its slope, counts/s and counts/s^2, whether a shaft could not stand there.

    `wide` is how long the counts were looked at, s; `nearest` the speed over the nearest half of it.
    """

    speed: float = 0.0
    slope: float = 0.0
    abrupt: bool = False
    wide: float = 0.0
    nearest: float = 0.0


def bridged(
    time: np.ndarray, counts: np.ndarray, turn: float
) -> tuple[np.ndarray, np.ndarray, list[tuple[float, float]], list[Problem]]:
    """Return the counts without samples of a counter that froze or jumped, moved on by what it lost.

    Parameters
    ----------
    time, counts
        s and counts that grow, shape (n,).
    turn
        Counts a turn.

    Returns
    -------
    time, counts
        Shape (m,).
    gaps
        Where the counter told nothing or lost counts, s: the angle on both sides hangs together by the
        speeds beside it only.
    problems
        One a loss.
    """
    usual, top = usual_update(time, counts), _top(time, counts)
    kept, counts = np.full(time.size, True), counts.astype(float)
    gaps: list[tuple[float, float]] = []
    told: list[Problem] = []
    pauses = _pauses(time, counts, usual)
    for k, (first, resumed) in enumerate(pauses):
        # Beside another pause there is no speed to be read.
        reach = (pauses[k - 1][1] if k else 0, pauses[k + 1][0] if k + 1 < len(pauses) else time.size - 1)
        found = _loss(time, counts, (first, resumed), reach, (usual, top), turn)
        if found is None:
            continue
        gap, lost, text = found
        counts[resumed:] += lost
        inside = (time > gap[0]) & (time < gap[1])
        inside[0] |= first == 0 and gap[0] <= time[0]
        inside[-1] |= resumed == time.size - 1 and gap[1] >= time[-1]
        kept &= ~inside
        # A line from one side to the other is as good as a curve where nothing is lost over a short while.
        if lost or gap[1] - gap[0] > _HARMLESS:
            gaps.append(gap)
        told.append(Problem(gap, text))
    time, counts = time[kept], counts[kept]
    for at, size in jumps(time, counts, gaps):
        counts[at + 1 :] -= size
        gap = (float(time[max(at - 1, 0)]), float(time[min(at + 2, time.size - 1)]))
        gaps.append(gap)
        verb, undone = ("gains", "taken out") if size > 0 else ("loses", "given back")
        text = f"the encoder {verb} some {abs(size):.0f} counts at once while the shaft turns on; they are {undone}"
        told.append(Problem(gap, text))
    return time, counts, sorted(gaps), _together(sorted(told, key=lambda problem: problem.span))


def usual_update(time: np.ndarray, counts: np.ndarray) -> float:
    """Return how long the counter usually stands between updates while the shaft runs fast, s."""
    step = float(np.median(np.diff(time)))
    moved = np.flatnonzero(np.diff(counts) != 0) + 1
    if moved.size < 20:
        return step
    between = np.diff(time[moved])
    rate = np.abs(np.diff(counts[moved])) / between
    fast = rate > 0.5 * np.percentile(rate, 90)
    return max(float(np.percentile(between[fast], 90)), step)


def _top(time: np.ndarray, counts: np.ndarray) -> float:
    """Return the 98th percentile of the speed over a quarter of a second, counts/s."""
    many = max(round(0.25 / float(np.median(np.diff(time)))), 1)
    if time.size <= many:
        return 0.0
    return float(np.percentile((counts[many:] - counts[:-many]) / (time[many:] - time[:-many]), 98))


def edge_speed(
    time: np.ndarray, counts: np.ndarray, index: int, side: int, usual: float, reach: tuple[int, int] | None = None
) -> EdgeSpeed:
    """Return the speed right at sample `index`, from the counts before (`side` -1) or behind it, inside `reach`.

    Two windows of equal length: a shaft that comes to rest at a constant rate has a third of the speed in the
    nearer one, and so none at the pause; one that turns on has the same in both.
    """
    least, most = reach or (0, time.size - 1)
    goal = counts[index] + side * 2 * _COUNTS
    far = int(np.searchsorted(counts, goal, side="right")) - 1 if side < 0 else int(np.searchsorted(counts, goal))
    wide = 0.5 * abs(float(time[min(max(far, 0), time.size - 1)] - time[index]))
    wide = min(max(wide, _UPDATES * usual), 0.5 * abs(float(time[least if side < 0 else most] - time[index])))
    near, next_ = (_index(time, time[index] + k * side * wide, side) for k in (1, 2))
    t0, t1, t2 = (float(time[i]) for i in (index, near, next_))
    if t1 == t0 or t2 == t1:
        return EdgeSpeed()
    v1 = float(counts[near] - counts[index]) / (t1 - t0)
    v2 = float(counts[next_] - counts[near]) / (t2 - t1)
    slope = (v1 - v2) / (0.5 * (t0 - t2))
    speed = v1 + slope * 0.5 * (t0 - t1)
    abrupt = speed * abs(t1 - t0) > _CLEAR and speed > _ABRUPT * v1
    close = _index(time, time[index] + side * max(usual, 0.5 * wide), side)
    nearest = float(counts[close] - counts[index]) / float(time[close] - time[index]) if close != index else 0.0
    return EdgeSpeed(max(speed, 0.0), slope, abrupt, abs(t1 - t0), nearest)


def _usual_speed(time: np.ndarray, counts: np.ndarray, index: int, side: int, reach: tuple[int, int]) -> float:
    """Return the mean speed over many counts beside sample `index`, counts/s; NaN where they reach beyond `reach`."""
    goal = counts[index] + side * _LONG
    far = int(np.searchsorted(counts, goal, side="right")) - 1 if side < 0 else int(np.searchsorted(counts, goal))
    if not reach[0] <= far <= reach[1] or far == index:
        return math.nan
    return float((counts[far] - counts[index]) / (time[far] - time[index]))


def _index(time: np.ndarray, at: float, side: int) -> int:
    found = int(np.searchsorted(time, at - 1e-9)) if side > 0 else int(np.searchsorted(time, at + 1e-9, "right")) - 1
    return min(max(found, 0), time.size - 1)


def _pauses(time: np.ndarray, counts: np.ndarray, usual: float) -> list[tuple[int, int]]:
    """Return the last sample before and the first behind every pause between counts, the ends of the record included."""
    moved = np.flatnonzero(np.diff(counts) != 0) + 1
    if not moved.size:
        return []
    marks = np.concatenate([[0], moved, [time.size - 1]])
    long = np.flatnonzero(np.diff(time[marks]) > max(_PAUSE * usual, _LEAST))
    return [(int(marks[i]), int(marks[i + 1])) for i in long]


def _loss(
    time: np.ndarray,
    counts: np.ndarray,
    pause: tuple[int, int],
    reach: tuple[int, int],
    pace: tuple[float, float],
    turn: float,
) -> tuple[tuple[float, float], float, str] | None:
    """Return the gap, the lost counts and what to say of a pause that is no stand; None where it may be one.

    `pace` is the usual update (s) and the top speed (counts/s).
    """
    (first, resumed), (usual, top) = pause, pace
    lasted, counted = float(time[resumed] - time[first]), float(counts[resumed] - counts[first])
    # At the ends of a record one side has to do.
    before = edge_speed(time, counts, first, -1, usual, reach) if first else None
    ends = resumed == time.size - 1
    after = None if ends else edge_speed(time, counts, resumed, 1, usual, reach)
    sides = [side for side in (before, after) if side is not None]
    silent = float(np.diff(time[first : resumed + 1]).max()) > 0.7 * lasted
    gap = (float(time[first]), float(time[resumed]))
    alone = len(sides) == 1 or lasted > _HELD
    clear = [
        side.speed * lasted > _MISSING
        and (
            side.abrupt
            if side.wide < _QUICK or not alone
            else side.nearest > _SHARP * top and side.speed > _SHARP * top
        )
        for side in sides
    ]
    text = f"the encoder {'told nothing' if silent else 'stood still'} for {lasted:.2f} s"
    fine = not silent and any(
        c and s.wide < _QUICK and s.speed * s.wide > _ALONE for c, s in zip(clear, sides, strict=True)
    )
    if clear and (all(clear) or (any(clear) and fine and lasted < _SHORT)):
        text += (
            " while the shaft turned on: a dropout, not a stop" if all(clear) else " while the shaft turned: a dropout"
        )
        if before is None or after is None:
            return gap, 0.0, text
        missing = _missing(time, counts, pause, (before, after), reach)
        alike = min(before.speed, after.speed) > 0.7 * max(before.speed, after.speed)
        right = abs(missing) <= max(_SHARE * abs(missing + counted), _FEW)
        if right and silent and lasted <= _HARMLESS:
            return None
        if silent and lasted > _HELD and not right:
            # So long a shaft may have stopped unseen, and a counter that goes on counting knows it.
            text = (
                f"the encoder told nothing for {lasted:.2f} s, and its counter went on by {missing:.0f} counts less than the speeds "
                "beside it give: the shaft slowed down unseen, or counts are lost"
            )
            return gap, 0.0, text
        if right or not all(clear) or (silent and not alike):
            return gap, 0.0, text
        return gap, float(np.round(missing)), f"{text}; about {missing:.0f} counts are lost"
    if silent and counted:
        return (gap, 0.0, text) if lasted > _HARMLESS else None
    if _caught_up(time, counts, pause, sides):
        fastest = max(side.speed for side in sides)
        return (max(gap[0], gap[1] - 2 * counted / fastest), gap[1]), 0.0, text + " and then caught up: a dropout"
    if not fine or before is None or after is None or not any(clear):
        return None
    # The shaft came to rest, or began to turn, while the counter was frozen.
    stops = clear[0]
    side, at = (before, gap[0]) if stops else (after, gap[1])
    slowing = -side.slope if stops else side.slope
    if slowing > 0.0 and side.speed < _SOON * usual * slowing:
        # So hard a brake stops a light load between two updates.
        return None
    length = min(2 * side.speed / slowing + 2 * usual if slowing > 0 else _UNSEEN, _UNSEEN, 0.5 * lasted)
    text = (
        f"the encoder {'stopped counting' if stops else 'began to count'} at {at:.2f} s while the shaft turned at "
        f"{side.speed * 2 * math.pi / turn:.3g} rad/s: a dropout; when the shaft {'came to rest' if stops else 'began to turn'} "
        f"is known to some {length:.2f} s only"
    )
    return ((at, at + length) if stops else (at - length, at)), 0.0, text


def _caught_up(time: np.ndarray, counts: np.ndarray, pause: tuple[int, int], sides: Sequence[EdgeSpeed]) -> bool:
    """Tell whether the first sample behind a pause shows more counts than its own time can hold."""
    first, resumed = pause
    fastest = max((side.speed for side in sides), default=0.0)
    return (
        float(counts[resumed] - counts[first])
        > _MISSING + 2 * fastest * float(time[resumed] - time[resumed - 1])
        > _MISSING
    )


def _missing(
    time: np.ndarray,
    counts: np.ndarray,
    pause: tuple[int, int],
    sides: tuple[EdgeSpeed, EdgeSpeed],
    reach: tuple[int, int],
) -> float:
    """Return how many counts more than were counted the speeds beside a pause give (a cubic through both)."""
    first, resumed = pause
    lasted, counted = float(time[resumed] - time[first]), float(counts[resumed] - counts[first])
    speeds = []
    for index, sense, side in ((first, -1, sides[0]), (resumed, 1, sides[1])):
        long = _usual_speed(time, counts, index, sense, reach)
        speeds.append(long if abs(long - side.speed) < _STEADY * side.speed else side.speed)
    bend = lasted**2 / 12 * (sides[0].slope - sides[1].slope) if lasted < 0.1 else 0.0
    return 0.5 * lasted * sum(speeds) + bend - counted


def _together(problems: list[Problem]) -> list[Problem]:
    """Return the losses one by one, or as one where they are many."""
    if len(problems) <= _SINGLY:
        return problems
    lasted = sum(problem.span[1] - problem.span[0] for problem in problems)
    first = problems[0].span
    text = (
        f"the encoder dropped out {len(problems)} times, {lasted:.2f} s in all, while the shaft turned (first at {first[0]:.2f} to "
        f"{first[1]:.2f} s): dropouts, not stops"
    )
    return [Problem((first[0], problems[-1].span[1]), text)]
