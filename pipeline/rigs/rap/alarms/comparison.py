"""Alarms re-derived from the log beside those that the device logged."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.rigs.rap.alarms.codes import onsets, understood
from pipeline.rigs.rap.alarms.limits import AlarmLimits
from pipeline.rigs.rap.alarms.results import Alarm, Comparison, ComparisonRow
from pipeline.rigs.rap.tables import Entry

# A code may be logged this long before the alarm was due (the device's own means are not ours) or behind its end, s.
_EARLY = 5.0
_BEHIND = 60.0


def compare(alarms: Sequence[Alarm], codes: Sequence[Entry], lists_codes: bool, limits: AlarmLimits) -> Comparison:
    """Return each alarm with the logged code that belongs to it.

    The nearest code of the same name from 5 s before the cause until a minute behind its end is its own. Without a column of codes
    there is nothing to compare, and no row.
    """
    begun = onsets(tuple(codes))
    unknown = tuple(entry for entry in begun if understood(entry.text) is None)
    if not lists_codes:
        return Comparison((), (), False)
    logged = [(entry.time, understood(entry.text)) for entry in begun if understood(entry.text) is not None]
    free = list(logged)
    rows = []
    for alarm in alarms:
        last = (alarm.ended if alarm.ended is not None else float("inf")) + _BEHIND
        near = [row for row in free if row[1] == alarm.code and alarm.began - _EARLY <= row[0] <= last]
        if not near:
            rows.append(ComparisonRow(alarm.code, alarm.time, None, None, "missed"))
            continue
        own = min(near, key=lambda row: abs(row[0] - alarm.time))
        # A code written again while the alarm lasts is the same alarm.
        ended = alarm.ended if alarm.ended is not None else float("inf")
        free = [row for row in free if row != own and not (row in near and row[0] <= ended)]
        delay = own[0] - alarm.time
        rows.append(ComparisonRow(alarm.code, alarm.time, own[0], delay, "late" if delay > limits.late else "match"))
    rows += [ComparisonRow(str(code), None, time, None, "extra") for time, code in free]
    rows.sort(key=lambda row: row.derived if row.derived is not None else row.logged or 0.0)
    return Comparison(tuple(rows), unknown, True)
