"""One run of the device on its bench: from a drive to tables, each on its own clock, with the conditions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.recording import Condition, Recording, Stream
from pipeline.rigs.rap.conditions import TAPS
from pipeline.rigs.rap.synthetic.clocks import Clock
from pipeline.rigs.rap.synthetic.drives import Step
from pipeline.rigs.rap.synthetic.plant import TICK, Course, Drive, Poles, march
from pipeline.rigs.rap.synthetic.readings import bench_table, device_pressures, device_table, stream
from pipeline.rigs.rap.synthetic.truth import RigTruth, per_tap, pump_of


def recorded(
    truth: RigTruth,
    run: str,
    drive: Drive,
    steps: Sequence[Step],
    flow_set: Sequence[tuple[float, float]],
    rng: np.random.Generator,
) -> Recording:
    """Return the logs of a run that is driven so; `flow_set` lists (s, m^3/s) of the set blood flow."""
    duration = drive.uf.size * TICK
    clock = device_clock(truth)
    stamps, moments = clock.ticks(truth.device_rate, duration, rng)
    bench_stamps, bench_moments = bench_clock(truth).ticks(truth.bench_rate, duration, rng)
    wanted = {"ctrl": ("device", moments), "prot": ("device", moments + truth.skew), "bench": ("bench", bench_moments)}
    course = march(drive, pump_of(truth), poles_of(truth), wanted)
    pressures = device_pressures(truth, course.readings["ctrl"][:, :4], course.readings["prot"][:, :4], moments, rng)
    streams = {
        "device": device_table(stamps, pressures, truth),
        "device_status": _status(truth, clock, duration, steps, flow_set, rng),
        "bench": bench_table(truth, bench_stamps, course.readings["bench"], rng),
    }
    kept = {name: table for name, table in streams.items() if not truth.tables or name in truth.tables}
    return Recording(run, kept, conditions_of(truth))


def device_clock(truth: RigTruth) -> Clock:
    """Return the clock of all of the device's tables."""
    return Clock(truth.device_lag, 1e-6 * truth.device_ppm, truth.device_jitter)


def bench_clock(truth: RigTruth) -> Clock:
    """Return the clock of the bench."""
    return Clock(0.0, 1e-6 * truth.bench_ppm, truth.bench_jitter)


def poles_of(truth: RigTruth) -> Poles:
    """Return the time constants of all sensors."""
    return Poles(per_tap(truth, "pole"), (truth.bench_pole,) * 4, truth.meter_time, truth.flowmeter_location)


def _status(
    truth: RigTruth,
    clock: Clock,
    duration: float,
    steps: Sequence[Step],
    flow_set: Sequence[tuple[float, float]],
    rng: np.random.Generator,
) -> Stream:
    stamps, moments = clock.ticks(1.0, duration, rng)
    uf = held(moments, [(step.time, step.uf) for step in steps])
    columns = {
        "blood_flow_set": (held(moments, flow_set), "m^3/s"),
        "uf_flow_set": (uf, "m^3/s"),
        "uf_pump_command": (uf.copy(), "m^3/s"),
    }
    return stream("device_status", stamps, columns)


def held(moments: np.ndarray, settings: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return at each of `moments` the last of `settings`, (s, value) each in order of time; 0 before the first."""
    times, values = (np.array(column, dtype=float) for column in zip(*[(-np.inf, 0.0), *settings], strict=True))
    return np.asarray(values[np.searchsorted(times, moments, side="right") - 1])


def conditions_of(truth: RigTruth) -> dict[str, Condition]:
    """Return what the logs state of the rig."""
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
        **(truth.told or {}),
    }
    return {name: value for name, value in stated.items() if value is not None}


__all__ = ["Course", "bench_clock", "conditions_of", "device_clock", "held", "poles_of", "recorded"]
