"""Alarms re-derived from the log beside those that the device logged."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.rigs.rap.alarms.codes import onsets, understood
from pipeline.rigs.rap.alarms.limits import AlarmLimits
from pipeline.rigs.rap.alarms.results import Alarm, Comparison, ComparisonRow, Verdict
from pipeline.rigs.rap.tables import Entry

# A code may be logged this long before the alarm was due (the device's own means are not ours) or behind its end, s.
_EARLY = 5.0
_BEHIND = 60.0


def compare(alarms: Sequence[Alarm], codes: Sequence[Entry], lists_codes: bool, limits: AlarmLimits) -> Comparison:
    """Return each alarm with the logged code that belongs to it.

    The nearest code of the same name from 5 s before the cause until a minute behind its end is its own. Without a column of codes
    there is nothing to compare, and no row.
    """
    begun = onsets(codes)
    unknown = tuple(entry for entry in begun if understood(entry.text) is None)
    if not lists_codes:
        return Comparison((), (), False)
    logged = [(entry.time, code) for entry in begun if (code := understood(entry.text)) is not None]
    own = _assigned(alarms, logged)
    rows = []
    for i, alarm in enumerate(alarms):
        # One code stands for all that is wrong at its time: two taps whose units disagree are one mismatch to the device.
        time = own.get(i, next((t for t, code in logged if code == alarm.code and _within(t, alarm, 0.0)), None))
        delay = time - alarm.time if time is not None else None
        verdict: Verdict = "missed" if delay is None else "late" if delay > limits.late else "match"
        rows.append(ComparisonRow(alarm.code, alarm.time, time, delay, verdict))
    taken = set(own.values())
    for time, code in logged:
        # A code written again while its alarm lasts is the same alarm.
        if time not in taken and not any(alarm.code == code and _within(time, alarm, 0.0) for alarm in alarms):
            rows.append(ComparisonRow(code, None, time, None, "extra"))
    rows.sort(key=lambda row: row.derived if row.derived is not None else row.logged or 0.0)
    return Comparison(tuple(rows), unknown, True)


def _within(time: float, alarm: Alarm, behind: float) -> bool:
    return alarm.began - _EARLY <= time <= (alarm.ended if alarm.ended is not None else float("inf")) + behind


def _assigned(alarms: Sequence[Alarm], logged: Sequence[tuple[float, str]]) -> dict[int, float]:
    """Return the logged time of each alarm that has one of its own, the closest pairs first."""
    pairs = sorted(
        (abs(time - alarm.time), i, k)
        for i, alarm in enumerate(alarms)
        for k, (time, code) in enumerate(logged)
        if code == alarm.code and _within(time, alarm, _BEHIND)
    )
    own: dict[int, float] = {}
    taken: set[int] = set()
    for _, i, k in pairs:
        if i not in own and k not in taken:
            own[i] = logged[k][0]
            taken.add(k)
    return own
