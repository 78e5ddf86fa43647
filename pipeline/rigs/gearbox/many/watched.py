"""The numbers of each run that are watched over a campaign of many: equal runs have them equal, whatever they are.

None of them leans on what the runs share, so that a run that is unlike the others is seen before it spoils that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.torques.derived import Torque, ratio
from pipeline.rigs.number_over_runs import OverRuns, over_runs

# Measured speeds that differ by less than this share are one; set ones are one where they are equal to four digits.
_SAME = 0.03
_RPM = 2.0 * math.pi / 60.0
# What is off by less than this share is odd, but harmless to what the runs share.
_SLIGHT = 0.01
# A change moves runs away from the others where it is so many times their scatter: more than the weather does.
_FAR = 3.0
# A spell, or a stretch between two steps, with less than this share of the runs is an exception, like a single odd run.
_SHORT = 0.2
# Where a larger share of the runs is an exception, there are several kinds of runs and none is left out of what they share.
_MOST = 1.0 / 3.0


def watched_of(runs: Sequence[RunNumbers], begins: Mapping[str, float | None]) -> tuple[OverRuns, ...]:
    """Return what the watched numbers do over the runs; those that fewer than half of the runs tell are left out.

    Parameters
    ----------
    begins
        When the log of each run began, s since 1970, None where it does not say.
    """
    columns = {
        ("efficiency in FOS", "1"): [_efficiency(run) for run in runs],
        ("input torque in FOS", "N*m"): [_level(run, "torque_in", "fos") for run in runs],
        ("output torque in FOS", "N*m"): [_level(run, "torque_out", "fos") for run in runs],
        ("input torque in SOS", "N*m"): [_level(run, "torque_in", "sos") for run in runs],
        ("output torque in SOS", "N*m"): [_level(run, "torque_out", "sos") for run in runs],
        ("unlocking torque", "N*m"): [_of(run.unlocking) for run in runs],
        ("slope of the torque map", "1"): [_slope(run) for run in runs],
        ("inertia of the load", "kg*m^2"): [_inertia(run) for run in runs],
        ("input speed in SOS", "rad/s"): [_speed(run) for run in runs],
    }
    told = {heads: rows for heads, rows in columns.items() if sum(math.isfinite(v) for v, _ in rows) > 0.5 * len(runs)}
    group = {name: speed for speed, names in speed_groups(runs).items() for name in names}
    return tuple(
        over_runs(
            what, unit, [run.name for run in runs], *np.array(rows, dtype=float).T,
            groups=[words_of(group.get(run.name, math.nan)) for run in runs],
            begins=[begins[run.name] for run in runs], among=len(told),
        )
        for (what, unit), rows in told.items()
    )  # fmt: skip


def words_of(speed: float) -> str:
    """Return what tells runs of one speed (rad/s) apart from others."""
    return f"at {speed / _RPM:.4g} rpm" if math.isfinite(speed) else "at no known speed"


def exceptions(watched: Sequence[OverRuns]) -> dict[str, str]:
    """Return the runs on which what all share must not lean; none where a third of the runs would be exceptions."""
    found = unlike(watched)
    runs = max((len(number.runs) for number in watched), default=0)
    return found if len(found) <= _MOST * runs else {}


def unlike(watched: Sequence[OverRuns]) -> dict[str, str]:
    """Return the runs that are unlike the others, with the number in which they are off.

    Odd runs that are off by more than a little, and short stretches of them: a bad day.
    """
    found: dict[str, str] = {}
    for number in watched:
        odd = [one.place for one in number.course.odd if abs(one.off) > _SLIGHT * _usual(number, one.place)]
        for place in [*odd, *_short_stretches(number)]:
            found.setdefault(number.runs[place], number.what)
    return found


def _usual(number: OverRuns, place: int) -> float:
    """Return what a deviation is held against."""
    return 1.0 if number.share else abs(float(number.course.expected[place]))


def _short_stretches(number: OverRuns) -> list[int]:
    """Return the places of the runs of spells, and of those between two steps that are soon taken back."""
    known = np.flatnonzero(np.isfinite(number.values))
    spread = number.course.spread
    changes = [one for one in number.course.changes if abs(one.size) > _FAR * spread[one.first]]
    steps = sorted(one.first for one in changes if one.kind == "step")
    parts = np.split(known, np.searchsorted(known, steps))[1:-1]
    parts += [known[(known >= one.first) & (known <= one.last)] for one in changes if one.kind == "spell"]
    return [int(place) for part in parts if part.size < _SHORT * known.size for place in part]


def speed_groups(runs: Sequence[RunNumbers]) -> dict[float, list[str]]:
    """Return the names of the runs at each speed (rad/s, four digits), slow ones first; runs without a speed are left out."""
    by_set: dict[float, list[str]] = {}
    measured = []
    for run in runs:
        if run.record.speed_nominal is not None:
            by_set.setdefault(float(f"{run.speed:.4g}"), []).append(run.name)
        elif math.isfinite(run.speed):
            measured.append((run.speed, run.name))
    measured.sort()
    group: list[tuple[float, str]] = []
    for place, (speed, name) in enumerate(measured):
        group.append((speed, name))
        last = place + 1 == len(measured)
        if last or measured[place + 1][0] > (1.0 + _SAME) * speed:
            key = float(f"{sum(one for one, _ in group) / len(group):.4g}")
            order = {run.name: k for k, run in enumerate(runs)}
            by_set.setdefault(key, []).extend(sorted((name for _, name in group), key=order.__getitem__))
            group = []
    return dict(sorted(by_set.items()))


def _of(torque: Torque | None) -> tuple[float, float]:
    if torque is None or math.isnan(torque.zero):
        return math.nan, math.nan
    return torque.value, torque.std_error


def _level(run: RunNumbers, quantity: str, stage: str) -> tuple[float, float]:
    return _of(run.level(quantity, stage))


def _efficiency(run: RunNumbers) -> tuple[float, float]:
    one = ratio("efficiency_fos", run.level("torque_out", "fos"), run.level("torque_in", "fos"), "there is no FOS")
    return (math.nan, math.nan) if one.value is None or one.std_error is None else (one.value, one.std_error)


def _slope(run: RunNumbers) -> tuple[float, float]:
    one = run.transfers.get("brake")
    return (math.nan, math.nan) if one is None else (one.slope, one.slope_error)


def _inertia(run: RunNumbers) -> tuple[float, float]:
    if run.load is None or "inertia_load" in run.load.undetermined:
        return math.nan, math.nan
    return float(run.load.values[0]), float(run.load.covariance.std_error[0])


def _speed(run: RunNumbers) -> tuple[float, float]:
    one = run.speed_in
    return (math.nan, math.nan) if one is None or one.source == "nominal" else (one.value, one.std_error)
