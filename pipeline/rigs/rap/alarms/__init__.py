"""Alarms re-derived from a log, and the two units held against each other (rap.md, 3.9 and 3.10)."""

from pipeline.rigs.rap.alarms.limits import AlarmLimits, MismatchLimits
from pipeline.rigs.rap.alarms.results import AlarmNumbers
from pipeline.rigs.rap.alarms.run_alarms import alarm_numbers

__all__ = ["AlarmLimits", "AlarmNumbers", "MismatchLimits", "alarm_numbers"]
