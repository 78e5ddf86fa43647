"""One run's alarms from its recording: the call that the outcome of a therapy run makes."""

from __future__ import annotations

from dataclasses import replace

from pipeline.errors import counted
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.alarms.causes import RULES, causes
from pipeline.rigs.rap.alarms.circulation import uf_alone
from pipeline.rigs.rap.alarms.comparison import compare
from pipeline.rigs.rap.alarms.limits import AlarmLimits, MismatchLimits
from pipeline.rigs.rap.alarms.log_faults import log_faults
from pipeline.rigs.rap.alarms.rates import rate
from pipeline.rigs.rap.alarms.ratios import pressure_ratios
from pipeline.rigs.rap.alarms.record import device_log
from pipeline.rigs.rap.alarms.rederive import rederive
from pipeline.rigs.rap.alarms.redundancy import redundancy
from pipeline.rigs.rap.alarms.results import AlarmNumbers, Comparison, DeviceLog
from pipeline.rigs.rap.alarms.unit_faults import exchanged_taps
from pipeline.rigs.rap.conditions import TAPS


def alarm_numbers(
    recording: Recording, limits: AlarmLimits | None = None, mismatch: MismatchLimits | None = None
) -> AlarmNumbers:
    """Return states, alarms, comparison with the logged codes and redundancy of one run (rap.md, 3.9 and 3.10).

    Nothing is refused: what cannot be told stands in `undetermined` and `problems`.
    """
    limits, mismatch = limits or AlarmLimits(), mismatch or MismatchLimits()
    log = device_log(recording)
    pairs = (
        redundancy(log.run, tap, log.control[tap], log.protective[tap], mismatch)
        for tap in TAPS
        if tap in log.control and tap in log.protective
    )
    units = tuple(pair for pair in pairs if pair is not None)
    found = pressure_ratios(log, limits)
    problems: list[QualityFinding] = [
        *found.problems,
        *(problem for unit in units for problem in unit.problems),
        *exchanged_taps(log),
    ]
    if found.pump is None:
        nothing = Comparison((), (), log.lists_codes)
        return AlarmNumbers(log, None, (), (), units, nothing, rate(0, 0.0), (), tuple(problems), found.undetermined)
    causes_found = causes(log, found, [m for unit in units for m in unit.mismatches], limits)
    knows_uf = log.uf_command is not None or log.uf_set is not None
    uf = found.ratios.uf if found.ratios is not None and knows_uf else None
    states, alarms = rederive(log, found.pump, found.grid, causes_found, limits, uf)
    comparison = compare(alarms, log.codes, log.lists_codes, limits)
    if not log.control and not log.protective:
        comparison, told = _checkable(log, comparison)
        problems += told
    confirmed = sum(row.derived is not None and row.logged is not None for row in comparison.rows)
    running = sum(end - start for start, end in found.pump.running)
    problems += log_faults(log, comparison)
    return AlarmNumbers(
        log,
        found.ratios,
        states,
        alarms,
        units,
        comparison,
        rate(len(alarms) - confirmed, running),
        uf_alone(log, found),
        tuple(problems),
        found.undetermined,
    )


def _checkable(log: DeviceLog, found: Comparison) -> tuple[Comparison, list[QualityFinding]]:
    """Return the comparison without codes that only pressures could confirm, and say so."""
    of_pressure = {*(code for _, _, code in RULES), "SENSOR_MISMATCH", "PRESSURE_OUT_OF_RANGE"}
    left = [row for row in found.rows if row.verdict == "extra" and row.code in of_pressure]
    if not left:
        return found, []
    text = (
        f"{counted(len(left), 'logged alarm')} of pressures cannot be checked: the run holds no pressure of the device."
    )
    rows = tuple(row for row in found.rows if row not in left)
    return replace(found, rows=rows), [QualityFinding("note", text, log.run, "alarm_code")]
