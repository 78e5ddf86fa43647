"""A drive against the vehicle's channels, and whether forward is forward: what of the log and the bench goes into that."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.tire.passages.device import Device
from pipeline.rigs.tire.road.handed_over import Carried
from pipeline.rigs.tire.road.record import References
from pipeline.rigs.tire.road.reference import Comparison, ReferenceTable, compare, own_direction
from pipeline.rigs.tire.road.revolution_fit import Forces

# So many revolutions tell a direction.
_FEWEST = 20
# Accelerations (m/s^2) at which a wheel neither drives nor brakes, and the share of the load that rolling resistance
# and wind never reach: half of what hysteresis makes of a mirrored waveform (2 r/s = 0.15, tire.md 3.5).
_STEADY, _ROLLING = 0.3, 0.07


def _braked_at_constant_speed(forces: Forces, radius: float) -> bool:
    """Whether the wheel seems to brake hard at constant speed: hysteresis does that to a waveform that runs backward."""
    known = forces.fits & np.isfinite(forces.speed)
    if known.sum() < _FEWEST or not math.isfinite(radius):
        return False
    acceleration = np.gradient(radius * forces.speed[known], forces.time[known])
    steady = np.abs(acceleration) < _STEADY
    share = forces.force[known][steady] / forces.load[known][steady]
    return bool(steady.sum() >= _FEWEST and np.median(share) < -_ROLLING)


def direction_of(forces: Forces, compared: Comparison | None, radius: float) -> str:
    """Return "right", "wrong" or "untold": by the vehicle's channels, by the wheel's own acceleration without them."""
    told = compared.direction if compared is not None else own_direction(forces, radius)[0]
    return "wrong" if _braked_at_constant_speed(forces, radius) else told


def compared_with(forces: Forces, references: References, held: Carried, device: Device) -> Comparison | None:
    """Hold the drive against its reference channels."""
    channels = {
        name: channel
        for name, channel in (
            ("load", references.get("vertical_load")),
            ("force", references.get("longitudinal_force")),
            ("speed", references.speed),
            ("acceleration", references.get("longitudinal_acceleration")),
        )
        if channel is not None and channel.time.size > 1
    }
    if not channels:
        return None
    time = max((channel.time for channel in channels.values()), key=len)
    on = {
        name: np.interp(time, channel.time, channel.values, left=math.nan, right=math.nan)
        for name, channel in channels.items()
    }
    table = ReferenceTable(time, on.get("load"), on.get("force"), on.get("speed"), on.get("acceleration"))
    return compare(forces, table, held.radius.value, device.span[1] - device.span[0])
