"""Channels of a therapy run that cannot be what they are called: units, signs, exchanged names (rap.md, section 8).

Only what the samples and the set-points contradict by a factor or a sign; errors of some percent are judged with the
numbers. A channel that fails here does not enter them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.rap.conditions import channels
from pipeline.rigs.rap.tables import signal
from pipeline.rigs.rap.therapy.channel_fault import ChannelFault
from pipeline.rigs.rap.therapy.filling_faults import filling_faults
from pipeline.rigs.rap.therapy.record import ACCELERATIONS, without

# Air in a housing, K; the same in degrees Celsius and Fahrenheit.
_AIR, _CELSIUS, _FAHRENHEIT = (260.0, 340.0), (-13.0, 67.0), (67.0, 153.0)
_ZERO_CELSIUS = 273.15
# A share between 0 and 1 above that is given in percent.
_SHARE = 1.5
# Less than that of an accelerometer at rest is no gravity in any unit, m/s^2.
_STILL = 0.3
_SILENT = (
    "{} reads 0 throughout: not connected, or not logged. It is not used; look at its cable and its place in the log."
)


def channel_faults(recording: Recording) -> list[ChannelFault]:
    """Return the channels of a run that are not what they are called, the first fault of each."""
    found = [*_beyond(recording), *_exchanged_rates(recording), *_temperatures(recording), *_gravity(recording)]
    sound = without(recording, {fault.channel: fault.message for fault in found})
    found += [*filling_faults(sound), *_battery(sound)]
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
