"""The time in which all that a stage is told by was logged: where a file ends early, nothing is read out of the others alone."""

from __future__ import annotations

from pipeline.rigs.gearbox.record import COUNT, SPEED, Record
from pipeline.rigs.gearbox.stages.stage import Problem

# Boards that are stopped by hand end within this time of each other, and their clocks differ by less than that, s.
_BY_HAND, _CLOCKS = 0.5, 3.0
# Clocks that have nothing to do with each other share less of the torques' time than that.
_SHARED = 0.8


def break_off(record: Record) -> tuple[Record, tuple[Problem, ...]]:
    """Return the record without an encoder that outlasts the torques by more than clocks may differ, and what to tell.

    Before the clocks are compared: an end of the run that the torques lack would be taken for a shift.
    """
    (start, end), (first, last) = record.torque.span, record.encoder.span
    shared = min(end, last) - max(start, first)
    if shared < _SHARED * (end - start) or last < end + _CLOCKS:
        return record, ()
    return common_time(record)


def common_time(record: Record) -> tuple[Record, tuple[Problem, ...]]:
    """Return the record without what the encoder and the vibration tell outside of the torques' time, and what to tell.

    Parameters
    ----------
    record
        With all boards on one clock.

    Notes
    -----
    A shaft that turns after the last torque may stand, slip or be locked: none of it can be told.
    """
    start, end = record.torque.span
    first, last = record.encoder.span
    problems = []
    counter = COUNT if COUNT in record.encoder else SPEED
    if last > end + _BY_HAND:
        text = (
            f"the torques end at {end:.2f} s while {counter} goes on to {last:.2f} s: the log of the torques breaks off, and what comes after "
            "tells no stage. Look whether its file is whole"
        )
        problems.append(Problem((end, last), text))
    if end > last + _BY_HAND:
        text = (
            f"{counter} ends at {last:.2f} s while the torques go on to {end:.2f} s: the log of the encoder breaks off, and what comes after "
            "tells no stage. Look whether its file is whole"
        )
        problems.append(Problem((last, end), text))
    if first < start - _BY_HAND or last > end + _BY_HAND:
        record = record.aligned(record.encoder.part(start, end), record.vibration)
    return record, tuple(problems)
