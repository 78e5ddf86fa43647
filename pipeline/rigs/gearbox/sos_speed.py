"""Input speed in SOS: measured, else from the mesh lines of the vibration, else the nominal one as an assumption (gearbox.md, 4.4, 5.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.rigs.gearbox.aligned_run import AlignedRun
from pipeline.rigs.gearbox.kinematics import mesh_orders
from pipeline.rigs.gearbox.mesh import input_speed
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.teeth import TABLE_1, Teeth, teeth_of

Source = Literal["measured", "mesh lines", "nominal"]
# An input sensor settles, and the output stops, within this time of the stage's ends, s.
_GUARD = 0.3


@dataclass(frozen=True)
class InputSpeed:
    """Input speed in SOS, rad/s, its standard error (NaN where it is assumed), where it came from and that in words."""

    value: float
    std_error: float
    source: Source
    told: str


def teeth_in(record: Record) -> Teeth:
    """Return the teeth of the run's gearbox, Table 1 where the run does not say; InputError where they make none."""
    text = record.conditions.get("teeth")
    return TABLE_1 if not isinstance(text, str) or not text.strip() else teeth_of(text, f"run '{record.run}', teeth")


def line_orders(teeth: Teeth) -> tuple[float, ...]:
    """Return the mesh orders and their doubles, per turn of slip."""
    first, second = (float(order) for order in mesh_orders(teeth))
    return tuple(sorted((second, 2 * second, first, 2 * first)))


def input_speed_of(record: Record, run: AlignedRun) -> InputSpeed | None:
    """Return the input speed in SOS, None where there is no SOS."""
    if "sos" not in run.stages:
        return None
    start, end = run.stages["sos"]
    if record.speed_in is not None:
        part = record.speed_in.part(start + _GUARD, end - _GUARD)["speed_in"]
        if part.size > 10:
            error = float(part.std() / math.sqrt(max((end - start) / 0.5, 1.0)))
            return InputSpeed(float(np.mean(part)), error, "measured", "input speed measured")
    # What the output shaft does while locked is the input's speed too: surer than a condition.
    nominal = run.speed_nominal if math.isfinite(run.speed_nominal) else record.speed_nominal or math.nan
    if record.vibration is not None and math.isfinite(nominal):
        found = input_speed(
            record.vibration.time, record.vibration.values, (start, end), nominal, line_orders(teeth_in(record))
        )
        if found is not None:
            told = f"input speed from the mesh lines ({', '.join(f'{order:g}' for order in found.orders)} per turn)"
            return InputSpeed(found.speed, found.std_error, "mesh lines", told)
    if not math.isfinite(nominal):
        return None
    why = "no vibration log" if record.vibration is None else "no mesh line stands out of the noise"
    return InputSpeed(
        nominal, math.nan, "nominal", f"input speed assumed nominal ({why}): a drive slows down under load"
    )
