"""All that one run gives: each part by what its channels allow, or the reason why there is none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms import alarm_numbers
from pipeline.rigs.rap.alarms.results import AlarmNumbers
from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.pair import pairs_of
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.pressures.spans import Span
from pipeline.rigs.rap.therapy.battery_account import Battery, account
from pipeline.rigs.rap.therapy.command import command_of
from pipeline.rigs.rap.therapy.declaration import TherapySettings
from pipeline.rigs.rap.therapy.faults import cut_short, events_apart
from pipeline.rigs.rap.therapy.membrane_decline import Decline, decline
from pipeline.rigs.rap.therapy.record import ALARMS, BATTERY, MEMBRANE, REDUNDANCY, TEMPERATURE, VOLUME, Record
from pipeline.rigs.rap.therapy.temperature_error import TemperatureError
from pipeline.rigs.rap.therapy.temperature_fit import TemperatureFit
from pipeline.rigs.rap.therapy.temperature_numbers import temperatures_of
from pipeline.rigs.rap.therapy.transmembrane import Transmembrane, transmembrane
from pipeline.rigs.rap.therapy.uf_sign import turned
from pipeline.rigs.rap.therapy.volume_numbers import VolumeNumbers, stops, volume_of

_MEMBRANE_TAPS = ("prefilter", "return", "uf")
# Device over bench at a tap beyond that is no gain: another tap, a clamp, air.
_GAINS = (0.8, 1.25)


@dataclass(eq=False)
class RunNumbers:
    """One run's numbers by part; `reasons` by part (or part and source) say why there is none of those asked for.

    `clock` is how the device's clock stands to the bench's, None where no pressure is read by both. `set_points` are the usual
    ones while the pump runs, SI, None where not logged.
    """

    record: Record
    clock: Alignment | None = None
    temperatures: dict[str, TemperatureFit] = field(default_factory=dict)
    temperature_error: TemperatureError | None = None
    volume: VolumeNumbers | None = None
    transmembrane: Transmembrane | None = None
    membrane: Decline | None = None
    battery: Battery | None = None
    alarms: AlarmNumbers | None = None
    set_points: Mapping[str, float | None] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    findings: list[QualityFinding] = field(default_factory=list)

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.record.run

    @property
    def tells(self) -> Mapping[str, bool]:
        """Tell of each part whether the run gives anything of it."""
        volume, alarms = self.volume, self.alarms
        return {
            TEMPERATURE: bool(self.temperatures),
            VOLUME: volume is not None and (volume.course is not None or volume.by_levels is not None),
            MEMBRANE: self.membrane is not None and self.membrane.initial.determined,
            BATTERY: self.battery is not None,
            ALARMS: alarms is not None and (not alarms.undetermined or bool(alarms.alarms)),
            REDUNDANCY: alarms is not None and bool(alarms.redundancy),
        }


def numbers_of(record: Record, settings: TherapySettings, clocks: bool = True) -> RunNumbers:
    """Return what a run gives; without `clocks`, which take longest, those of the tables are taken to agree."""
    found = RunNumbers(record, set_points=_set_points(record))
    asked = record.asked
    if clocks:
        _clock(found)
    if ALARMS in asked or REDUNDANCY in asked:
        _alarms(found, settings)
    if TEMPERATURE in asked:
        _temperature(found)
    if VOLUME in asked:
        found.volume = volume_of(record, found.set_points.get("uf_flow_set"))
        found.reasons |= {f"volume: {name}": reason for name, reason in found.volume.reasons.items()}
        _noticed(found, found.volume.problems)
    if MEMBRANE in asked:
        _membrane(found)
    if BATTERY in asked:
        _battery(found, settings)
    return found


def _noticed(found: RunNumbers, problems: tuple[QualityFinding, ...]) -> None:
    found.findings += [replace(problem, run=found.run) for problem in problems]


def _clock(found: RunNumbers) -> None:
    """Find how the device's clock stands to the bench's where both read the same pressures."""
    record = found.record
    pairs = [pair for pair in pairs_of(record.recording) if pair.alike]
    if not pairs:
        return
    try:
        found.clock = align(pairs, record.number("bench_sensor_time_constant"))
    except InputError as error:
        found.reasons["clock"] = str(error)
        return
    # What a doubtful clock leaves open changes no number here: temperatures move too slowly.
    _noticed(found, tuple(replace(problem, level="note") for problem in found.clock.problems))


def _set_points(record: Record) -> dict[str, float | None]:
    """Return the usual set-points while there is one."""
    usual: dict[str, float | None] = {}
    for name in ("blood_flow_set", "uf_flow_set", "heparin_flow_set"):
        one = record.signal(name)
        on = one.values[one.values > 0.0] if one is not None else np.zeros(0)
        usual[name] = float(np.median(on)) if on.size else None
    return usual


def _alarms(found: RunNumbers, settings: TherapySettings) -> None:
    try:
        alarms = alarm_numbers(found.record.as_logged or found.record.recording, settings.alarms, settings.mismatches)
    except InputError as error:
        found.reasons[ALARMS] = str(error)
        return
    found.alarms = alarms
    _noticed(found, alarms.problems)
    if alarms.undetermined:
        found.reasons[ALARMS] = alarms.undetermined
    states = [(row.time, row.text) for row in alarms.log.states]
    ends = [
        stream.span[1] for name, stream in found.record.recording.streams.items() if stream.size and name != "events"
    ]
    told = cut_short(states, max(ends, default=0.0))
    if told:
        found.findings.append(QualityFinding("note", told, found.run, "therapy_state"))
    if apart := events_apart(states, found.record.runs):
        found.findings.append(QualityFinding("warning", apart, found.run, "therapy_state"))


def _temperature(found: RunNumbers) -> None:
    told = temperatures_of(found.record, _lag(found))
    found.temperatures, found.temperature_error = dict(told.fits), told.error
    found.reasons |= told.reasons
    _noticed(found, told.problems)


def _lag(found: RunNumbers) -> float | None:
    """Return what the bench's clock shows more than the device's, s; None where that is not known."""
    return found.clock.lag.value if found.clock is not None and found.clock.sure else None


def _membrane(found: RunNumbers) -> None:
    record, volume = found.record, found.volume
    taps = {tap: record.signal(f"pressure_{tap}_rap") for tap in _MEMBRANE_TAPS}
    missing = [f"pressure_{tap}_rap" for tap, one in taps.items() if one is None]
    if missing:
        told = next((record.removed[name] for name in missing if name in record.removed), "")
        found.reasons[MEMBRANE] = (
            told or f"the transmembrane pressure needs {', '.join(missing)}, which the run has not"
        )
        return
    prefilter, back, uf = (one for one in taps.values() if one is not None)
    heads = {tap: head for tap, head in record.heads.items() if tap in _MEMBRANE_TAPS}
    if why := turned(prefilter, back, uf, record.runs):
        found.reasons[MEMBRANE] = why
        found.findings.append(QualityFinding("error", why, found.run, "pressure_uf_rap"))
        return
    try:
        gains = _gains(record)
        found.transmembrane = transmembrane(
            prefilter,
            back,
            uf,
            zero_spans=_zero_spans(record),
            gains=gains,
            heads=heads or None,
            gain_u=record.number("bench_gain_u") if gains else None,
        )
        _noticed(found, found.transmembrane.problems)
        command = volume.command if volume is not None else None
        if command is None:
            command = command_of(record.signal("uf_pump_command"), record.signal("uf_flow_set"), stopped=stops(record))
        posterior = volume.gain.posterior if volume is not None and volume.gain is not None else None
        apart = volume.disagreement if volume is not None else None
        found.membrane = decline(
            found.transmembrane,
            posterior,
            command,
            fluid=str(record.conditions.get("fluid", "saline")),
            rate_error=(apart.time, apart.share) if apart is not None else None,
        )
    except InputError as error:
        found.reasons[MEMBRANE] = str(error)
        return
    _noticed(found, found.membrane.problems)


def _zero_spans(record: Record) -> list[Span]:
    """Return the rests that show the zero: before the first start and after the last stop, else all.

    In a rest under way the clamp may be closed and pressure trapped behind it.
    """
    if not record.runs:
        return list(record.rests)
    begin, end = record.runs[0][0], record.runs[-1][1]
    return [span for span in record.rests if span[1] <= begin or span[0] >= end] or list(record.rests)


def _gains(record: Record) -> dict[str, float] | None:
    """Return the device's gain over the bench's by tap, from levels with the pump on over those at rest; None without a full bench."""
    rises = {(level.reader, level.tap): level for level in record.levels if level.zeroed}
    gains = {}
    for tap in _MEMBRANE_TAPS:
        own, other = rises.get(("rap", tap)), rises.get(("bench", tap))
        if own is not None and other is not None and other.rise != 0.0:
            gain = own.rise / other.rise
            if gain < -_GAINS[0]:
                raise InputError(
                    f"pressure_{tap}_rap changes by {own.rise:+.0f} Pa when the pumps start and the bench's by {other.rise:+.0f} Pa: the sign of one "
                    "of them is turned, and no transmembrane pressure can be formed. Turn it in the recipe ('sign: -1')."
                )
            if _GAINS[0] < gain < _GAINS[1]:
                gains[tap] = gain
    return gains if len(gains) == len(_MEMBRANE_TAPS) else None


def _battery(found: RunNumbers, settings: TherapySettings) -> None:
    record = found.record
    try:
        found.battery = account(
            record.signal("battery_voltage"),
            record.signal("battery_current"),
            record.signal("battery_level"),
            energy=record.number("battery_energy"),
            efficiency=record.number("battery_efficiency"),
            duration=settings.therapy_duration,
        )
    except InputError as error:
        told = next(
            (record.removed[name] for name in ("battery_current", "battery_voltage") if name in record.removed), ""
        )
        found.reasons[BATTERY] = told or str(error)
        return
    _noticed(found, found.battery.problems)
