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
        Where it came from, and that in words; `why`, where it is assumed: why nothing else tells it.
    teeth_assumed
        Whether it rests on teeth that nobody stated.
    """

    value: float
    std_error: float
    source: Source
    told: str
    dof: float = math.inf
    why: str = ""
    teeth_assumed: bool = False


def teeth_stated(record: Record) -> bool:
    """Tell whether the run says what teeth its gears have."""
    text = record.conditions.get("teeth")
    return isinstance(text, str) and bool(text.strip())


def teeth_in(record: Record) -> Teeth:
    """Return the teeth of the run's gearbox, Table 1 where the run does not say; InputError where they make none."""
    if not teeth_stated(record):
        return TABLE_1
    return teeth_of(str(record.conditions["teeth"]), f"run '{record.run}', teeth")


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
    if not math.isfinite(nominal):
        return None
    why = "no vibration log"
    if record.vibration is not None:
        log, orders, stated = record.vibration, line_orders(teeth_in(record)), teeth_stated(record)
        rest = run.stages.get("standstill")
        found = input_speed(log.time, log.values, (start, end), nominal, orders, rest=rest)
        why = "no mesh line stands out of the noise" if found is None else _doubt(found, stated)
        if found is not None and not why:
            return _from_lines(found, run.rate_sd.get("vibration", 0.0), stated)
    told = f"input speed assumed nominal ({why}): a drive slows down under load"
    return InputSpeed(nominal, math.nan, "nominal", told, why=why)


def _doubt(found: MeshSpeed, stated: bool) -> str:
    """Say why the mesh lines tell no speed, empty where they do."""
    support = found.support
    if support is None:
        return ""
    whose = "as stated" if stated else "of Table 1, which were assumed since the run states none"
    if support.doubt:
        return f"{support.doubt} (teeth {whose}): {found.speed:.4g} rad/s, which they would tell, is not believed"
    if support.weak and not stated:
        return (
            f"lines of one train only stand in the vibration, and the teeth are those {whose}: {found.speed:.4g} rad/s, which they "
            "would tell, is not believed"
        )
    return ""


def _from_lines(found: MeshSpeed, rate_sd: float, stated: bool) -> InputSpeed:
    """Return the speed of the mesh lines; a clock whose rate is off shifts all of them alike."""
    lines = found.support.lines if found.support else found.orders
    told = f"input speed from the mesh lines ({', '.join(f'{order:g}' for order in lines)} per turn), mean over SOS"
    if found.support is not None and found.support.trains < 2:
        told += "; lines of one train only, so it hangs on that train's teeth"
    if not stated:
        told += "; the teeth are those of Table 1, which were assumed since the run states none"
    if found.wander > 3 * found.std_error:
        told += f", in which it wanders by {found.wander:.2g} rad/s (standard deviation)"
    clock = rate_sd * found.speed
    if clock > found.std_error:
        told += (
            f"; the lines alone tell it to {1e3 * found.std_error:.1g} mrad/s, the rest of the error is the rate of the vibration "
            f"board's clock against that of the torques ({1e6 * rate_sd:.0f} ppm)"
        )
    total = math.hypot(found.std_error, clock)
    dof = found.dof * (total / found.std_error) ** 4 if found.std_error > 0 else math.inf
    return InputSpeed(found.speed, total, "mesh lines", told, dof, teeth_assumed=not stated)
