"""Ultrafiltrate of one run: level to volume, filter, scale, the device's own estimate, regulation, put together."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.tank import Tank
from pipeline.rigs.rap.tables import Signal, entries
from pipeline.rigs.rap.therapy.command import Command, command_of
from pipeline.rigs.rap.therapy.disagreement import Disagreement, disagreement
from pipeline.rigs.rap.therapy.drains import Emptying, drain_times, emptied
from pipeline.rigs.rap.therapy.final_level import final_by_levels
from pipeline.rigs.rap.therapy.levels import Levels, level_course, tank_of
from pipeline.rigs.rap.therapy.outcome.thinning import spans
from pipeline.rigs.rap.therapy.pump_gain import PumpGain, mean_gain
from pipeline.rigs.rap.therapy.record import ACCELERATIONS, Record
from pipeline.rigs.rap.therapy.regulation import Regulation, regulate
from pipeline.rigs.rap.therapy.scale_clock import ScaleLag, scale_lag
from pipeline.rigs.rap.therapy.scale_record import Weighed, weighed
from pipeline.rigs.rap.therapy.tank_filter import TankCourse, track_volume
from pipeline.rigs.rap.therapy.temperature_fit import air_temperature
from pipeline.rigs.rap.therapy.volume_against_scale import VolumeError, against_scale

Result = TypeVar("Result")
SALINE_DENSITY = 1004.0
# Stretches without a level from that on are told, s.
_LONG_BLIND = 60.0
# A scale that starts below that is taken for an empty one, kg: its first readings; else it is set over so many seconds.
_EMPTY, _FIRST, _SETTING = 0.02, 30, 300.0


@dataclass(frozen=True, eq=False)
class VolumeNumbers:
    """What is known of the ultrafiltrate of one run; what could not be told is None, `reasons` by name say why.

    Attributes
    ----------
    levels, command, course
        Levels in the tank, what the pump was asked for, the filter's course; the last two None without a pump.
    by_levels, place_u
        Volume at the end from the last levels alone, where the command is not known; what an unstated place of the level
        sensor leaves open in the volume, m^3.
    gain, regulation
        Delivered over asked; how well the set volume was kept.
    weighed, lag, error, device_error
        Volume by the scale, its clock, the filter and the device's own estimate against it.
    """

    tank: Tank | None = None
    levels: Levels | None = None
    command: Command | None = None
    course: TankCourse | None = None
    by_levels: Estimate | None = None
    place_u: float = 0.0
    emptyings: tuple[Emptying, ...] = ()
    gain: PumpGain | None = None
    regulation: Regulation | None = None
    weighed: Weighed | None = None
    lag: ScaleLag | None = None
    error: VolumeError | None = None
    device_error: VolumeError | None = None
    reasons: dict[str, str] = field(default_factory=dict)
    problems: tuple[QualityFinding, ...] = ()

    @cached_property
    def disagreement(self) -> Disagreement | None:
        """What level and scale disagree by beyond their errors; None where they agree or there is no scale."""
        return disagreement(self.error) if self.error is not None else None

    @property
    def final_share(self) -> float:
        """Final error over what was removed in the run; NaN where there is no scale."""
        if self.error is None or self.course is None or self.error.final.value is None:
            return math.nan
        removed = abs(self.course.total)
        return self.error.final.value / removed if removed > 0.0 else math.nan


class _Steps:
    """Collects what the steps noticed and why some of them could not be done."""

    def __init__(self) -> None:
        self.problems: list[QualityFinding] = []
        self.reasons: dict[str, str] = {}

    def done(self, name: str, step: Callable[[], Result], told: bool = False) -> Result | None:
        """Do a step and keep its problems, as notes where they are `told` already; None, with the reason under `name`, where it cannot be done."""
        try:
            result = step()
        except InputError as error:
            self.reasons[name] = str(error)
            return None
        problems = getattr(result, "problems", ())
        self.problems += [replace(one, level="note") for one in problems] if told else problems
        return result


def volume_of(record: Record, set_rate: float | None) -> VolumeNumbers:
    """Return the ultrafiltrate's numbers of a run; `set_rate` is the usual set-point while the pump runs, m^3/s."""
    steps = _Steps()
    command = steps.done(
        "command",
        lambda: command_of(record.signal("uf_pump_command"), record.signal("uf_flow_set"), stopped=stops(record)),
    )
    found = VolumeNumbers(command=command)
    found = _followed(record, found, steps)
    found = _weighed(record, found, set_rate, steps)
    return replace(found, reasons=steps.reasons, problems=tuple(steps.problems))


def stops(record: Record) -> list[tuple[float, float]]:
    """Return when the device's own states say that the ultrafiltrate pump stood, s."""
    rows = entries(record.recording, "therapy_state")
    pumping = [row.text.upper().startswith("THERAPY") for row in rows]
    if not any(pumping):
        return []
    ends = [*(row.time for row in rows[1:]), math.inf]
    return [(row.time, end) for row, end, on in zip(rows, ends, pumping, strict=True) if not on]


def _followed(record: Record, found: VolumeNumbers, steps: _Steps) -> VolumeNumbers:
    """Follow the level through the filter."""
    distance = record.signal("uf_level_distance")
    if distance is None:
        steps.reasons["levels"] = record.removed.get("uf_level_distance", "the run has no uf_level_distance")
        return found
    described = steps.done("levels", lambda: tank_of(record.conditions))
    if described is None:
        return found
    tank, assumed = described
    steps.problems += [QualityFinding("warning", f"{text}.", channel="uf_level_distance") for text in assumed]
    air = air_temperature(record.signal("temperature_air_rap"), record.signal("temperature_air_bench"))
    axes = tuple(record.signal(name) for name in ACCELERATIONS)
    valid = record.signal("uf_echo_valid")
    levels = steps.done(
        "levels", lambda: level_course(distance, tank, valid=valid, accelerations=axes, temperature=air)
    )
    found = replace(found, tank=tank, levels=levels, place_u=_place_u(record, tank, levels))
    if levels is None:
        return found
    if found.command is None:
        return replace(found, by_levels=steps.done("course", lambda: final_by_levels(levels, tank)))
    command = found.command
    emptyings, empty_at_start, odd = emptied(levels, tank, command, drain_times(record.signal("drain_pressed")))
    steps.problems += odd
    course = steps.done(
        "course", lambda: track_volume(levels, tank, command, emptied=emptyings, empty_at_start=empty_at_start)
    )
    found = replace(found, emptyings=emptyings, course=course)
    if course is None:
        return found
    steps.problems += _blind(levels, course)
    gain = steps.done("gain", lambda: mean_gain(course, command))
    set_point = record.signal("uf_flow_set")
    regulation = steps.done(
        "regulation", lambda: regulate(command, set_point, course, device_volume=record.signal("uf_volume_rap"))
    )
    return replace(found, gain=gain, regulation=regulation)


def _place_u(record: Record, tank: Tank, levels: Levels | None) -> float:
    """Return what an unstated place of the level sensor leaves open in the volume: it sits anywhere over the tank, m^3."""
    if levels is None or not levels.usable.any():
        return 0.0
    sides = {"level_sensor_dx": tank.Lx, "level_sensor_dy": tank.Ly}
    open_side = math.hypot(*(side for name, side in sides.items() if record.number(name) is None))
    tilt = float(np.nanmedian(levels.tilt[levels.usable]))
    return tank.area * math.tan(tilt) * open_side / math.sqrt(12.0) if math.isfinite(tilt) else 0.0


def _blind(levels: Levels, course: TankCourse) -> list[QualityFinding]:
    """Tell long stretches without a level after the first one, and what dead reckoning leaves open there."""
    found: list[QualityFinding] = []
    if levels.first is None:
        return found
    for start, end in spans(levels.time, ~levels.usable & (levels.time > levels.first)):
        if end - start < _LONG_BLIND:
            continue
        inside = (course.time >= start) & (course.time <= end)
        doubt = 1e6 * float(course.volume_sd[inside].max()) if inside.any() else math.nan
        text = f"level-blind for {(end - start) / 60:.0f} min, dead reckoning ± {2.0 * doubt:.2g} mL there (2 standard deviations)."
        found.append(QualityFinding("note", text, channel="uf_level_distance", span=(start, end)))
    return found


def _set_to_level(
    by_scale: Weighed, course: TankCourse, lag: ScaleLag, scale: Signal
) -> tuple[Weighed, list[QualityFinding]]:
    """Return the scale with the level's volume at the first echo where neither its tare nor an empty start is known."""
    first = float(np.median(scale.values[:_FIRST]))
    if by_scale.tare_known or abs(first) < _EMPTY or course.first_echo is None:
        return by_scale, []
    time = by_scale.time - lag.value
    known = (course.time >= course.first_echo) & (course.time <= course.first_echo + _SETTING)
    there = by_scale.good & (time >= course.first_echo) & (time <= course.first_echo + _SETTING)
    if not known.any() or not there.any():
        return by_scale, []
    offset = float(np.median(course.volume[known]) - np.median(by_scale.volume[there]))
    text = (
        f"mass_tare is not stated and the scale starts at {1e3 * first:.0f} g: it is set to the level's volume at the first echo, so that only "
        "what came since is compared. State mass_tare, what the scale reads with an empty tank."
    )
    return replace(by_scale, volume=by_scale.volume + offset), [
        QualityFinding("warning", text, channel="uf_mass_scale")
    ]


def _weighed(record: Record, found: VolumeNumbers, set_rate: float | None, steps: _Steps) -> VolumeNumbers:
    """Hold the filter and the device's own estimate against the scale."""
    scale = record.signal("uf_mass_scale")
    if scale is None:
        steps.reasons["scale"] = record.removed.get("uf_mass_scale", "no scale in this run (uf_mass_scale)")
        return found
    density = record.number("fluid_density")
    if density is None:
        density = SALINE_DENSITY
        steps.problems.append(
            QualityFinding(
                "note",
                f"fluid_density is not stated: {SALINE_DENSITY:g} kg/m^3 (saline) taken; 1 % of it is 1 % of the weighed volume.",
                channel="uf_mass_scale",
            )
        )
    known = density
    by_scale = steps.done("scale", lambda: weighed(scale, known, record.number("mass_tare")))
    found = replace(found, weighed=by_scale)
    course = found.course
    if by_scale is None or course is None:
        return found
    lag = steps.done("error", lambda: scale_lag(by_scale, course))
    found = replace(found, lag=lag)
    if lag is None:
        return found
    weighing, moved = _set_to_level(by_scale, course, lag, scale)
    steps.problems += moved
    found = replace(found, weighed=weighing)
    gain_u = record.number("scale_gain_u") or 0.0
    drained = tuple(one.time for one in found.emptyings)
    error = steps.done(
        "error",
        lambda: against_scale(
            course.time,
            course.volume,
            course.volume_sd,
            weighing,
            lag,
            first_echo=course.first_echo,
            gain_u=gain_u,
            emptied=drained,
            set_rate=set_rate,
        ),
    )
    own = record.signal("uf_volume_rap")
    device = None
    if own is not None:
        device = steps.done(
            "device_error",
            lambda: against_scale(
                own.time,
                own.values,
                None,
                weighing,
                lag,
                what="the device's own volume",
                first_echo=course.first_echo,
                gain_u=gain_u,
                emptied=drained,
                set_rate=set_rate,
            ),
            told=True,
        )
    if error is not None and not error.problems and device is not None and device.problems:
        text = (
            f"the device's own volume ends {1e6 * float(device.final.value or 0.0):+.1f} mL off the scale, and the volume from its levels does not: "
            "the device's own estimate is off (its area, level offset or count), not the tank nor the scale."
        )
        steps.problems.append(QualityFinding("warning", text, channel="uf_volume_rap"))
    return replace(found, error=error, device_error=device)
