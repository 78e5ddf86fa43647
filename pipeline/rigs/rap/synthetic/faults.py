"""What can be wrong with the synthetic rig and its logs (rap.md, sections 6 and 8), each by a name of `FAULTS`.

Those of the circuit and the tank happen before anything is read, see `in_circuit` and `at_tank`; those of sensors and
logs are done to the finished tables, see `spoilt`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.errors import InputError, listing, nearest
from pipeline.rigs.rap.circuit.hydraulics import Circuit
from pipeline.rigs.rap.synthetic.plant import TICK, Drive
from pipeline.rigs.rap.synthetic.tank_course import Drain, Surroundings
from pipeline.rigs.rap.synthetic.truth import RigTruth
from pipeline.rigs.rap.synthetic.truth_check import RIG


@dataclass(frozen=True)
class Fault:
    """One fault: what, from `start` to `end` (s), of which channel and table, how large (the unit depends on the kind).

    Attributes
    ----------
    other
        The channel with which `channel` is swapped.
    order
        Of a line: so many times the strokes.
    left
        What stays in the tank that is drained, m^3.
    key
        Whether the key for draining was pressed.
    run
        The only run that has it; all if empty.
    """

    kind: str
    start: float = 0.0
    end: float = math.inf
    channel: str = ""
    other: str = ""
    table: str = "device"
    size: float = 0.0
    order: float = 8.0
    left: float = 5e-6
    key: bool = True
    run: str = ""


FAULTS: Mapping[str, Fault] = {
    fault.kind: fault
    for fault in (
        # In the circuit: C_1 so many times larger; blood pump standing while ultrafiltrate is taken.
        Fault("air_bubble", size=1.5),
        Fault("uf_without_blood", start=100.0, end=130.0),
        # A real line above half the sampling rate in the device's pressures, Pa.
        Fault("aliasing", size=300.0),
        # At the tank.
        Fault("drain", start=3600.0, end=3640.0),
        Fault("echo_lost", start=3600.0, end=4200.0),
        Fault("tilt", start=3600.0, end=3900.0, size=math.radians(15.0)),
        # Sensors and units.
        Fault("swapped", channel="pressure_prefilter_rap", other="pressure_return_rap"),
        Fault("sign", channel="pressure_access_rap"),
        Fault("mmhg", channel="pressure_*_rap", size=1.0 / 133.322),
        Fault("kpa", channel="pressure_*_rap", size=1e-3),
        Fault("unit", channel="blood_flow_bench", size=6e7),
        Fault("stuck", channel="pressure_uf_rap", start=100.0),
        Fault("saturated", channel="pressure_prefilter_rap", size=3500.0),
        Fault("zero_not_taken", channel="pressure_*_rap", size=300.0),
        Fault("air_at_sensor", channel="pressure_prefilter_rap", size=0.15, start=200.0),
        # Logs.
        Fault("dropout", start=150.0, end=152.0),
        Fault("duplicated", start=150.0, end=152.0),
        Fault("truncated", start=300.0, table=""),
        Fault("missing", channel="blood_flow_bench"),
        # The scale: touched, kg; drifting, kg/h.
        Fault("scale_touched", channel="uf_mass_scale", start=3000.0, end=3030.0, size=0.2),
        Fault("scale_drift", channel="uf_mass_scale", size=0.02),
    )
}


def faults_of(truth: RigTruth, run: str) -> list[Fault]:
    """Return the faults of a run.

    Raises
    ------
    InputError
        If a kind or an entry is unknown; the nearest is named.
    """
    found = []
    for entry in truth.faults:
        given: dict[str, Any] = {"kind": entry} if isinstance(entry, str) else dict(entry)
        kind = given.pop("kind", "")
        if kind not in FAULTS:
            raise InputError(
                f"the {RIG} has no fault '{kind}'.{nearest(str(kind), FAULTS)} It has {listing(FAULTS, 30)}."
            )
        known = [field.name for field in fields(Fault)]
        for name in given:
            if name not in known:
                raise InputError(f"the fault '{kind}' of the {RIG} has no '{name}'.{nearest(name, known)}")
        found.append(replace(FAULTS[kind], **given))
    return [fault for fault in found if fault.run in ("", run)]


def in_circuit(drive: Drive, faults: Sequence[Fault]) -> Drive:
    """Return `drive` with the faults of circuit and blood pump."""
    time = np.arange(drive.uf.size) * TICK
    for fault in faults:
        during = (time >= fault.start) & (time < fault.end)
        if fault.kind == "uf_without_blood":
            drive = replace(drive, speed=np.where(np.append(during, during[-1:]), 0.0, drive.speed))
        if fault.kind == "air_bubble":
            count = len(drive.circuits)
            soft: list[Circuit] = [replace(c, C_1=c.C_1 * fault.size) for c in drive.circuits]
            which = drive.circuit + np.where(during, count, 0)
            drive = replace(drive, circuit=which, circuits=[*drive.circuits, *soft])
    return drive


def at_tank(around: Surroundings, faults: Sequence[Fault]) -> Surroundings:
    """Return what the tank meets with its faults."""
    for fault in faults:
        during = (around.moments >= fault.start) & (around.moments < fault.end)
        if fault.kind == "drain":
            drain = Drain(fault.start, fault.end - fault.start, fault.left, fault.key)
            around = replace(around, drains=[*around.drains, drain])
        if fault.kind == "echo_lost":
            around = replace(around, lost=around.lost | during)
        if fault.kind == "tilt":
            around = replace(around, pitch=around.pitch + np.where(during, fault.size, 0.0))
    return around


def folded(faults: Sequence[Fault], phases: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return what lines above half the sampling rate add to the device's readings, Pa, shape (n,)."""
    added = np.zeros(moments.size)
    for fault in faults:
        if fault.kind == "aliasing":
            moving = np.diff(phases, append=phases[-1:]) > 0.0
            added += np.where(moving, fault.size * np.sin(2.0 * math.pi * fault.order * phases), 0.0)
    return added
