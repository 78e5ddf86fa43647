"""Channels of a therapy run that cannot be what they are called: units, signs, exchanged names (rap.md, section 8).

Only what the samples and the set-points contradict by a factor or a sign; errors of some percent are judged with the
numbers. A channel that fails here does not enter them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.circuit.tank import LARGEST_TILT, Tank, rise_at_sensor, tilt_of
from pipeline.rigs.rap.conditions import channels
from pipeline.rigs.rap.tables import Signal, signal
from pipeline.rigs.rap.therapy.attitude import attitude
from pipeline.rigs.rap.therapy.record import ACCELERATIONS, without

# Air in a housing, K; the same in degrees Celsius and Fahrenheit.
_AIR, _CELSIUS, _FAHRENHEIT = (260.0, 340.0), (-13.0, 67.0), (67.0, 153.0)
_ZERO_CELSIUS = 273.15
# Blocks over which slopes of slow channels are taken, s, and how many it takes.
_BLOCK, _LEAST = 600.0, 3
# A slope that far from what the set-points ask is another unit or geometry and no pump's gain.
_FACTOR = 1.6
# Level and scale within that factor of each other mean the same; below minus that share a slope is turned.
_AGREE, _TURNED = 1.25, 0.3
# A level that moves by less than that share of what is asked for stands still.
_STANDS = 0.05
_FEW = 10
_SALINE = 1004.0
_UNITS = ((1e3, "1000"), (1e-3, "1/1000"), (1e2, "100"), (1e-2, "1/100"), (10.0, "10"), (0.1, "1/10"), (60.0, "60"),
          (1.0 / 60.0, "1/60"))  # fmt: skip
# A share between 0 and 1 above that is given in percent.
_SHARE = 1.5
# Less than that of an accelerometer at rest is no gravity in any unit, m/s^2.
_STILL = 0.3
_SILENT = (
    "{} reads 0 throughout: not connected, or not logged. It is not used; look at its cable and its place in the log."
)


@dataclass(frozen=True)
class ChannelFault:
    """A channel that is not what its name says, and why; it is left out where `unusable`."""

    channel: str
    message: str
    unusable: bool = True

    def finding(self, run: str) -> QualityFinding:
        """Return the fault as a finding on the data."""
        return QualityFinding("error" if self.unusable else "warning", self.message, run, self.channel)


def channel_faults(recording: Recording) -> list[ChannelFault]:
    """Return the channels of a run that are not what they are called, the first fault of each."""
    found = [*_beyond(recording), *_exchanged_rates(recording), *_temperatures(recording), *_gravity(recording)]
    sound = without(recording, {fault.channel: fault.message for fault in found})
    found += [*_filling(sound), *_battery(sound)]
    first: dict[str, ChannelFault] = {}
    for fault in found:
        first.setdefault(fault.channel, fault)
    return list(first.values())


def _beyond(recording: Recording) -> Iterator[ChannelFault]:
    """Find channels whose usual magnitude is beyond anything plausible."""
    for spec in channels():
        one = signal(recording, spec.name) if spec.limit is not None else None
        if one is None or spec.limit is None:
            continue
        size = float(np.quantile(np.abs(one.values), 0.9))
        unit = "" if spec.unit == "1" else f" {spec.unit}"
        if size > spec.limit:
            yield ChannelFault(
                spec.name,
                f"{spec.name} is mostly about {size:.3g}{unit}, more than the plausible {spec.limit:g}{unit}: declared in "
                "another unit than logged. It is not used; give its unit in the recipe.",
            )


def _exchanged_rates(recording: Recording) -> Iterator[ChannelFault]:
    blood, uf = signal(recording, "blood_flow_set"), signal(recording, "uf_flow_set")
    if blood is None or uf is None:
        return
    most, removed = float(np.max(blood.values)), float(np.max(uf.values))
    if 0.0 < most < removed:
        text = (
            f"more is to be removed ({removed:.3g} m^3/s) than flows ({most:.3g} m^3/s): are blood_flow_set and uf_flow_set exchanged, "
            "or one of them in another unit? Neither is used; mend them in the recipe."
        )
        yield from (ChannelFault(name, text) for name in (blood.name, uf.name))


def _temperatures(recording: Recording) -> Iterator[ChannelFault]:
    for name in ("temperature_air_rap", "temperature_air_bench"):
        one = signal(recording, name)
        if one is None:
            continue
        usual = float(np.median(one.values))
        if _AIR[0] < usual < _AIR[1]:
            continue
        if not one.values.any():
            yield ChannelFault(name, _SILENT.format(name))
            continue
        unit = next(
            (word for (low, high), word in ((_CELSIUS, "degC"), (_FAHRENHEIT, "degF")) if low < usual < high), ""
        )
        if usual > _AIR[1]:
            read = usual - _ZERO_CELSIUS
            unit = "K" if _AIR[0] < read < _AIR[1] else "degF" if _FAHRENHEIT[0] < read < _FAHRENHEIT[1] else ""
        guess = f": logged in {unit}, declared otherwise" if unit else ""
        yield ChannelFault(
            name,
            f"{name} is about {usual:.4g} K, which is no air in a housing{guess}. It is not used; give its unit in the recipe, as "
            f"'{name}: {{unit: {unit or 'degC'}}}'.",
        )


def _gravity(recording: Recording) -> Iterator[ChannelFault]:
    """Find a tank whose axis is not the vertical one."""
    found = [signal(recording, name) for name in ACCELERATIONS]
    usual = np.array([np.median(one.values) for one in found if one is not None])
    if usual.size < len(ACCELERATIONS):
        return
    if float(np.linalg.norm(usual)) < _STILL:
        text = "the tank's accelerometer reads nothing, not even gravity: the tilt is not corrected; look at its cable and unit."
        yield from (ChannelFault(name, text) for name in ACCELERATIONS)
        return
    if np.abs(usual[:2]).max() <= 0.7 * float(np.linalg.norm(usual)):
        return
    text = (
        f"gravity lies along {ACCELERATIONS[int(np.argmax(np.abs(usual)))]} and not along tank_accel_z: axes exchanged, or the tank lay "
        "on its side. The tilt is not corrected; mend the channels in the recipe."
    )
    yield from (ChannelFault(name, text) for name in ACCELERATIONS)


def _filling(recording: Recording) -> Iterator[ChannelFault]:
    """Hold level and scale against what is pumped into the tank; where both say the same it is the pump that is off."""
    level, mass = _level(recording), _mass(recording)
    if level and mass and _alike(level.share, mass.share):
        return
    yield from (one for one in (level, mass) if one is not None)


def _alike(one: float, other: float) -> bool:
    """Tell whether two shares say the same: both fill at that pace, or both stand still."""
    if max(abs(one), abs(other)) < _STANDS:
        return True
    return one * other > 0.0 and 1.0 / _AGREE < one / other < _AGREE


@dataclass(frozen=True)
class _Filling(ChannelFault):
    """`share` is how fast the tank fills over how fast it should; NaN where that is not what is wrong."""

    share: float = math.nan


def _level(recording: Recording) -> _Filling | None:
    """Hold the course of the level against what is pumped into the tank."""
    distance, valid = signal(recording, "uf_level_distance"), signal(recording, "uf_echo_valid")
    if distance is None:
        return None
    good = distance.values > 0.0
    if valid is not None and valid.time.size == distance.time.size:
        good &= valid.values > 0.5
    one = Signal(distance.name, distance.time[good], distance.values[good])
    if one.time.size < _FEW:
        return None
    sensor = recording.conditions.get("level_sensor_z")
    usual = float(np.median(one.values))
    if isinstance(sensor, float) and usual > 1.1 * sensor + 0.02:
        return _Filling(
            one.name,
            f"uf_level_distance is about {usual:.3g} m although the sensor sits {sensor:.3g} m over the floor: another unit, or the "
            "geometry of another tank. It is not used; mend the unit in the recipe or level_sensor_z.",
        )
    lx, ly = recording.conditions.get("tank_lx"), recording.conditions.get("tank_ly")
    upright = _upright(recording, one)
    if not isinstance(lx, float) or not isinstance(ly, float):
        return None
    ratio = _slope_over_asked(recording, upright, 1.0 / (lx * ly))
    if ratio is None:
        return None
    share = -ratio * lx * ly
    if share < -_TURNED:
        return _Filling(
            one.name,
            "uf_level_distance grows while ultrafiltrate is pumped into the tank: it seems to be the level over the floor, or its sign is "
            "turned. It is not used; map the distance from the sensor to the liquid.",
        )
    if 1.0 / _FACTOR < share < _FACTOR:
        return None
    if abs(share) < _STANDS:
        return _Filling(
            one.name,
            "the level does not move while ultrafiltrate is asked for: the sensor is frozen, or the pump does not pump. The level is not "
            "used; look at the sensor and at the scale.",
            share=share,
        )
    return _Filling(
        one.name,
        f"the level rises {share:.2g} times as fast as the ultrafiltrate that is asked for fills the tank: {_unit(share)}, tank_lx "
        "and tank_ly of another tank, or a pump that does not pump. The level is not used; mend the unit or the conditions.",
        share=share,
    )


def _upright(recording: Recording, one: Signal) -> Signal:
    """Return the distance without what the tilt adds at the sensor, and without what eq. 8 does not hold for."""
    axes = [signal(recording, name) for name in ACCELERATIONS]
    dx, dy = (float(recording.conditions.get(name) or 0.0) for name in ("level_sensor_dx", "level_sensor_dy"))
    if any(axis is None or axis.time.size < _FEW for axis in axes):
        return one
    n, _ = attitude(one.time, axes, [])
    holds = tilt_of(n) < LARGEST_TILT
    return Signal(one.name, one.time[holds], (one.values - rise_at_sensor(Tank(dx=dx, dy=dy), n))[holds])


def _mass(recording: Recording) -> _Filling | None:
    """Hold the course of the scale against what is pumped."""
    scale = signal(recording, "uf_mass_scale")
    stated = recording.conditions.get("fluid_density")
    density = stated if isinstance(stated, float) else _SALINE
    ratio = _slope_over_asked(recording, scale, density) if scale is not None else None
    if scale is None or ratio is None:
        return None
    share = ratio / density
    if share < -_TURNED:
        return _Filling(
            scale.name,
            "uf_mass_scale falls while ultrafiltrate is removed: its sign is turned, or the reservoir stands on the scale. It is not used; "
            "set 'sign: -1' in the recipe where that is right.",
        )
    if 1.0 / _FACTOR < share < _FACTOR:
        return None
    if abs(share) < _STANDS:
        return _Filling(
            scale.name,
            "uf_mass_scale does not move while ultrafiltrate is asked for: nothing drips onto it, or the pump does not pump. It is not used.",
            share=share,
        )
    return _Filling(
        scale.name,
        f"uf_mass_scale grows {share:.3g} times as fast as the ultrafiltration that is set: {_unit_of_mass(share)}, or it weighs something "
        "else. It is not used; give its unit in the recipe.",
        share=share,
    )


def _unit(share: float) -> str:
    named = next((word for factor, word in _UNITS if 0.75 < share / factor < 1.35), "")
    return f"a wrong unit (factor {named})" if named else "a wrong unit"


def _unit_of_mass(share: float) -> str:
    pounds = any(0.9 < share / factor < 1.1 for factor in (0.45359, 2.2046))
    return "pounds and kilograms mixed up" if pounds else _unit(share)


def _slope_over_asked(recording: Recording, one: Signal, expected: float) -> float | None:
    """Return the usual slope of a slow channel over the rate asked of the ultrafiltrate pump; None where that cannot be told.

    It is told where it stands out of its scatter, or where that is small against what is `expected`.

    Slopes are taken over blocks of ten minutes; their median bears drained tanks, touched scales and a tank on the move.
    """
    asked = signal(recording, "uf_pump_command") or signal(recording, "uf_flow_set")
    if asked is None or asked.time.size < 2 or one.time.size < 2:
        return None
    edges = np.arange(one.time[0], one.time[-1], _BLOCK)
    places = np.searchsorted(one.time, edges)
    ratios = []
    for i, k in pairwise(places):
        if k - i < 5:
            continue
        t, x = one.time[i:k], one.values[i:k]
        near = (asked.time >= t[0] - 30.0) & (asked.time <= t[-1] + 30.0)
        rate = (
            float(np.mean(asked.values[near])) if near.any() else float(np.interp(t.mean(), asked.time, asked.values))
        )
        if rate > 0.0:
            middle = slice(0, t.size // 2), slice(t.size // 2, None)
            first, second = ((np.median(t[part]), np.median(x[part])) for part in middle)
            ratios.append((second[1] - first[1]) / (second[0] - first[0]) / rate)
    if len(ratios) < _LEAST:
        return None
    usual = float(np.median(ratios))
    spread = 1.4826 * float(np.median(np.abs(np.array(ratios) - usual))) / np.sqrt(len(ratios))
    return usual if abs(usual) > 4.0 * spread or 4.0 * spread < _STANDS * expected else None


def _battery(recording: Recording) -> Iterator[ChannelFault]:
    voltage = signal(recording, "battery_voltage")
    if voltage is not None and not voltage.values.any():
        yield ChannelFault(voltage.name, _SILENT.format(voltage.name))
    level = signal(recording, "battery_level")
    if level is not None and float(np.median(level.values)) > _SHARE:
        yield ChannelFault(
            level.name,
            f"battery_level is about {np.median(level.values):.3g}, more than all: give its unit, percent for choice.",
        )
