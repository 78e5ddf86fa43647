"""Temperatures of one run: each sensor's warming by its own clock, and the device's error where the clocks allow it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.record import Record
from pipeline.rigs.rap.therapy.temperature_error import TemperatureError, compare_temperatures
from pipeline.rigs.rap.therapy.temperature_fit import TemperatureFit, fit_temperature

SOURCES = {"rap": "temperature_air_rap", "bench": "temperature_air_bench"}
# A clock that shows more at the first sample did not begin with the run, s.
_UPTIME = 6.0 * 3600.0
# Clocks that stand further apart change what temperatures are compared, s.
_APART = 300.0


@dataclass(frozen=True, eq=False)
class TemperatureNumbers:
    """Fits by source, the device's error; `reasons` by ``temperature <source>`` and ``temperature error`` where there is none."""

    fits: Mapping[str, TemperatureFit]
    error: TemperatureError | None
    reasons: Mapping[str, str]
    problems: tuple[QualityFinding, ...]


def temperatures_of(record: Record, lag: float | None) -> TemperatureNumbers:
    """Return what the thermometers of a run tell; `lag` is what the bench's clock shows more, s, None where not known."""
    sensors: dict[str, Signal] = {}
    fits: dict[str, TemperatureFit] = {}
    reasons: dict[str, str] = {}
    for source, channel in SOURCES.items():
        sensor = record.signal(channel)
        if sensor is None:
            reasons[f"temperature {source}"] = record.removed.get(channel, f"the run has no {channel}")
            continue
        sensors[source] = sensor
        try:
            fits[source] = fit_temperature(sensor, source, _switched_on(sensor, _end(record)))
        except InputError as error:
            reasons[f"temperature {source}"] = str(error)
    compared, reason = _compared(sensors, lag, reasons)
    if reason:
        reasons["temperature error"] = reason
    problems = [problem for fit in fits.values() for problem in fit.problems]
    return TemperatureNumbers(fits, compared, reasons, (*problems, *(compared.problems if compared else ())))


def _compared(
    sensors: Mapping[str, Signal], lag: float | None, reasons: Mapping[str, str]
) -> tuple[TemperatureError | None, str]:
    """Return the device's error against the bench, or why there is none."""
    if len(sensors) < len(SOURCES):
        missing = (reasons[f"temperature {source}"] for source in SOURCES if source not in sensors)
        return None, "; ".join(dict.fromkeys(reason.rstrip(".") for reason in missing))
    doubt = _stamped_apart(sensors["rap"], sensors["bench"]) if lag is None else ""
    if doubt:
        return None, doubt
    try:
        return compare_temperatures(sensors["rap"], sensors["bench"], lag or 0.0), ""
    except InputError as error:
        return None, str(error)


def _stamped_apart(rap: Signal, bench: Signal) -> str:
    """Say that the two tables begin and end apart by their stamps, '' where they do not."""
    if rap.time.size < 2 or bench.time.size < 2:
        return ""
    begins, ends = float(bench.time[0] - rap.time[0]), float(bench.time[-1] - rap.time[-1])
    step = max(float(np.median(np.diff(rap.time))), float(np.median(np.diff(bench.time))))
    if min(abs(begins), abs(ends)) < _APART or begins * ends < 0.0 or abs(begins - ends) > 1.5 * step:
        return ""
    return (
        f"the bench's temperatures begin {begins:+.0f} s and end {ends:+.0f} s after the device's by their stamps: their clocks stand apart, and "
        "nothing else in the run tells by how much. Set the stamps of one of them right, or log a pressure on both"
    )


def _end(record: Record) -> float:
    """Return when the run ends by the tables that are no temperatures and no events, s; infinite without any."""
    recording = record.recording
    slow = {"events", *(recording.stream_of(name).name for name in SOURCES.values() if name in recording)}
    ends = [stream.span[1] for name, stream in recording.streams.items() if stream.size and name not in slow]
    return max(ends, default=float("inf"))


def _switched_on(sensor: Signal, end: float) -> float:
    """Return when the device was switched on by the clock of a sensor, s.

    Clocks of a log begin with it or near it; one that began hours before, or that goes on past the run's `end`, shows the first
    sample there instead.
    """
    first, last = float(sensor.time[0]), float(sensor.time[-1])
    late = first > _APART and last > end + _APART
    return first if late or first >= _UPTIME else 0.0
