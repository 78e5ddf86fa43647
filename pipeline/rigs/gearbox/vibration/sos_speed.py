"""Input speed in SOS: measured, else from the mesh lines of the vibration, else the nominal one as an assumption (gearbox.md, 4.4, 5.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.aligned_run import AlignedRun
from pipeline.rigs.gearbox.model.kinematics import mesh_orders
from pipeline.rigs.gearbox.model.teeth import TABLE_1, Teeth, teeth_of
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.vibration.mesh import MeshSpeed, input_speed

Source = Literal["measured", "mesh lines", "nominal"]
# An input sensor settles, and the output stops, within this time of the stage's ends, s.
_GUARD = 0.3


@dataclass(frozen=True)
class InputSpeed:
    """Input speed in SOS.

    Attributes
    ----------
    value
        rad/s: mean over the stage; where it is assumed, the speed in FOS, which is then an upper limit.
    std_error
        rad/s, the clock of the board included; NaN where the speed is assumed. `dof` its degrees of freedom.
    source, told
        Where it came from, and that in words.
    """

    value: float
    std_error: float
    source: Source
    told: str
    dof: float = math.inf


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
            error = float(part.std() / math.sqrt(max(effective_size(part) - 1.0, 1.0)))
            return InputSpeed(float(np.mean(part)), error, "measured", "input speed measured")
    # What the output shaft does while locked is the input's speed too: surer than a condition.
    nominal = run.speed_nominal if math.isfinite(run.speed_nominal) else record.speed_nominal or math.nan
    if record.vibration is not None and math.isfinite(nominal):
        log, orders = record.vibration, line_orders(teeth_in(record))
        rest = run.stages.get("standstill")
        found = input_speed(log.time, log.values, (start, end), nominal, orders, rest=rest)
        if found is not None:
            return _from_lines(found, run.rate_sd.get("vibration", 0.0))
    if not math.isfinite(nominal):
        return None
    why = "no vibration log" if record.vibration is None else "no mesh line stands out of the noise"
    return InputSpeed(
        nominal, math.nan, "nominal", f"input speed assumed nominal ({why}): a drive slows down under load"
    )


def _from_lines(found: MeshSpeed, rate_sd: float) -> InputSpeed:
    """Return the speed of the mesh lines; a clock whose rate is off shifts all of them alike."""
    told = (
        f"input speed from the mesh lines ({', '.join(f'{order:g}' for order in found.orders)} per turn), mean over SOS"
    )
    if found.wander > 3 * found.std_error:
        told += f", in which it wanders by {found.wander:.2g} rad/s (standard deviation)"
    clock = rate_sd * found.speed
    if clock > found.std_error:
        told += (
            f"; the lines alone tell it to {found.std_error:.1g} rad/s, the rest of the error is the rate of the vibration "
            f"board's clock against that of the torques ({1e6 * rate_sd:.0f} ppm)"
        )
    total = math.hypot(found.std_error, clock)
    dof = found.dof * (total / found.std_error) ** 4 if found.std_error > 0 else math.inf
    return InputSpeed(found.speed, total, "mesh lines", told, dof)
