"""One run of the device on its bench: from a drive to tables, each on its own clock, with the conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import Condition, Recording, Stream
from pipeline.rigs.rap.circuit.pump import speed_for
from pipeline.rigs.rap.conditions import TAPS
from pipeline.rigs.rap.synthetic.clocks import Clock
from pipeline.rigs.rap.synthetic.drives import Step
from pipeline.rigs.rap.synthetic.faults import faults_of, folded, in_circuit
from pipeline.rigs.rap.synthetic.plant import TICK, Course, Drive, Poles, march
from pipeline.rigs.rap.synthetic.readings import Columns, bench_table, device_pressures, device_table
from pipeline.rigs.rap.synthetic.spoilt import spoilt
from pipeline.rigs.rap.synthetic.truth import ML_MIN, RigTruth, circuit_of, per_tap, pump_of

_ESTIMATE_MEMORY = 1.0


@dataclass(frozen=True, eq=False)
class Marched:
    """The fast tables of a run, and for its status table: stamps, true moments (s), strokes a second (Hz), (n,) each."""

    device: Stream
    bench: Stream
    status: np.ndarray
    moments: np.ndarray
    strokes: np.ndarray
    course: Course


def marched(truth: RigTruth, run: str, drive: Drive, rng: np.random.Generator, step: float = 1e-3) -> Marched:
    """Return what device and bench log of a run that is driven so; `step` of the integration in s."""
    faults = faults_of(truth, run)
    drive = in_circuit(drive, faults)
    duration = drive.uf.size * TICK
    stamps, moments = device_clock(truth).ticks(truth.device_rate, duration, rng)
    status, at_status = device_clock(truth).ticks(1.0, duration, rng)
    bench_stamps, at_bench = bench_clock(truth).ticks(truth.bench_rate, duration, rng)
    wanted = {
        "ctrl": ("device", moments),
        "prot": ("device", moments + truth.skew),
        "bench": ("bench", at_bench),
        "status": ("circuit", at_status),
        "before": ("circuit", at_status - _ESTIMATE_MEMORY),
    }
    if not truth.prot:
        del wanted["prot"]
    course = march(drive, pump_of(truth), poles_of(truth), wanted, step)
    at_ctrl = course.readings["ctrl"][:, :4]
    at_prot = course.readings["prot"][:, :4] if truth.prot else at_ctrl
    line = folded(faults, course.phases["ctrl"], moments)[:, None]
    pressures = device_pressures(truth, at_ctrl + line, at_prot + line, moments, rng)
    return Marched(
        device_table(stamps, pressures, truth),
        bench_table(truth, bench_stamps, course.readings["bench"], rng),
        status,
        at_status,
        (course.phases["status"] - course.phases["before"]) / _ESTIMATE_MEMORY,
        course,
    )


def device_clock(truth: RigTruth) -> Clock:
    """Return the clock of all of the device's tables."""
    return Clock(truth.device_lag, 1e-6 * truth.device_ppm, truth.device_jitter, truth.jitter_sampled)


def bench_clock(truth: RigTruth) -> Clock:
    """Return the clock of the bench."""
    return Clock(0.0, 1e-6 * truth.bench_ppm, truth.bench_jitter, truth.jitter_sampled)


def poles_of(truth: RigTruth) -> Poles:
    """Return the time constants of all sensors."""
    return Poles(per_tap(truth, "pole"), (truth.bench_pole,) * 4, truth.meter_time, truth.flowmeter_location)


def pump_columns(
    truth: RigTruth,
    run: Marched,
    flow_set: Sequence[tuple[float, float]],
    steps: Sequence[Step],
    rng: np.random.Generator,
) -> Columns:
    """Return what the status table says of the pumps; `flow_set` lists (s, m^3/s) of the set blood flow.

    The device takes the volume of a stroke at 60 mL/min for that at any speed (E0 of rap.md, 3.5).
    """
    sixty = 60.0 * ML_MIN
    taken = sixty / speed_for(pump_of(truth), circuit_of(truth), sixty)
    uf = held(run.moments, [(step.time, step.uf) for step in steps])
    columns: Columns = {
        "blood_flow_set": (held(run.moments, flow_set), "m^3/s"),
        "blood_flow_rap": (taken * run.strokes, "m^3/s"),
        "uf_flow_set": (uf, "m^3/s"),
        "uf_pump_command": (uf, "m^3/s"),
    }
    if truth.pump_encoder:
        read = run.strokes * (1.0 + 0.002 * rng.standard_normal(run.strokes.size))
        columns["blood_pump_speed"] = (read, "Hz")
    return columns


def held(moments: np.ndarray, settings: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return at each of `moments` the last of `settings`, (s, value) each in order of time; 0 before the first."""
    times, values = (np.array(column, dtype=float) for column in zip(*[(-np.inf, 0.0), *settings], strict=True))
    return np.asarray(values[np.searchsorted(times, moments, side="right") - 1])


def recording(truth: RigTruth, run: str, tables: Sequence[Stream], own: Mapping[str, Condition | None]) -> Recording:
    """Return the logs of a run, its conditions with those of its `own`."""
    stated: dict[str, Condition | None] = {
        "fluid": "saline",
        "fluid_density": truth.fluid_density,
        "fluid_temperature": truth.fluid_temperature,
        "room_temperature": truth.room_temperature,
        "tube_set_id": "A",
        "filter_id": "F1",
        "n_rollers": float(len(truth.eps)),
        "flowmeter_location": truth.flowmeter_location,
        "bench_sensor_time_constant": truth.bench_pole,
        **{f"sensor_height_{tap}": h for tap, h in zip(TAPS, per_tap(truth, "height"), strict=True)},
        **own,
        **(truth.told or {}),
    }
    kept = {table.name: table for table in tables if not truth.tables or table.name in truth.tables}
    known = {name: value for name, value in stated.items() if value is not None}
    return spoilt(Recording(run, kept, known), faults_of(truth, run))
