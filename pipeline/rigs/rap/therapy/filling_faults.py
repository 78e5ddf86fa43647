"""Level and scale that move otherwise than what is pumped into the tank lets them: unit, sign, another tank (rap.md, section 8).

Errors of some percent are no matter of this file: they are judged against each other once both are volumes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.tank import LARGEST_TILT, Tank, rise_at_sensor, tilt_of
from pipeline.rigs.rap.tables import Signal, signal
from pipeline.rigs.rap.therapy.attitude import attitude
from pipeline.rigs.rap.therapy.channel_fault import ChannelFault
from pipeline.rigs.rap.therapy.record import ACCELERATIONS

# Blocks over which slopes of slow channels are taken, s, and how many it takes.
_BLOCK, _LEAST = 600.0, 3
# A slope that far from what the set-points ask is another unit or geometry and no pump's gain.
_FACTOR = 1.6
# Level and scale within that factor of each other mean the same; below minus that share a slope is turned.
_AGREE, _TURNED = 1.25, 0.3
# What moves by less than that share of what is asked for stands still.
_STANDS = 0.05
_FEW = 10
_SALINE = 1004.0
_UNITS = ((1e3, "1000"), (1e-3, "1/1000"), (1e2, "100"), (1e-2, "1/100"), (10.0, "10"), (0.1, "1/10"), (60.0, "60"),
          (1.0 / 60.0, "1/60"))  # fmt: skip


def filling_faults(recording: Recording) -> Iterator[ChannelFault]:
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
