"""R4 and R5: a therapy of 312 min, and a tank in motion (rap.md, section 6)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.recording import Condition, Recording, Stream
from pipeline.rigs.rap.circuit.membrane import T_REF
from pipeline.rigs.rap.circuit.pump import speed_for
from pipeline.rigs.rap.synthetic.bench_run import device_clock, held, marched, pump_columns, recording
from pipeline.rigs.rap.synthetic.drives import Change, Step, drive_of, wander
from pipeline.rigs.rap.synthetic.events import Event, events_table
from pipeline.rigs.rap.synthetic.faults import Fault, at_tank, faults_of
from pipeline.rigs.rap.synthetic.housing import air, battery_columns, scale_table, temperature_tables
from pipeline.rigs.rap.synthetic.plant import TICK, Drive
from pipeline.rigs.rap.synthetic.readings import stream
from pipeline.rigs.rap.synthetic.tank_course import Surroundings, TankCourse, followed
from pipeline.rigs.rap.synthetic.therapy_truth import RUNS, TANK_CONDITIONS, TherapyTruth
from pipeline.rigs.rap.synthetic.truth import circuit_of, pump_of

LONG, MOTION = RUNS[:2]
_FOULING_STEP = 300.0
_STEP = 5e-3
_KEY_BEFORE = 5.0


def long_therapy(truth: TherapyTruth, seed: int) -> Recording:
    """Return the logs of R4."""
    rng, faults = np.random.default_rng((seed, 4)), faults_of(truth, LONG)
    on, off = truth.zero_time, truth.zero_time + truth.duration
    end = off + truth.stop_time
    circuit = circuit_of(truth)
    steps = [Step(on, speed_for(pump_of(truth), circuit, truth.blood_flow), truth.uf_flow), Step(off, 0.0, 0.0)]
    moments = whole_seconds(truth, end)
    warmth = temperature_tables(truth, end, rng)
    tank = followed(truth, at_tank(at_rest(truth, moments, steps, warmth[0]), faults), rng)
    drive = drive_of(
        steps,
        _fouling(truth, on, off),
        circuit,
        truth.V_g,
        end,
        (truth.speed_scatter, truth.speed_memory),
        rng,
        truth.heparin_flow,
    )
    drive = pumped_by(worn(drive, truth, on), tank)
    run = marched(truth, LONG, drive, rng, _STEP)
    flow_set = [(0.0, 0.0), (on, truth.blood_flow), (off, 0.0)]
    status = {
        **pump_columns(truth, run, flow_set, steps, rng),
        "heparin_flow_set": (held(run.moments, [(on, truth.heparin_flow), (off, 0.0)]), "m^3/s"),
        **tank.columns(),
        **battery_columns(truth, run.moments, rng),
    }
    tables = [
        run.device,
        stream("device_status", run.status, status),
        *warmth,
        run.bench,
        scale_table(truth, moments, tank.volume, end, rng),
        events_table(begun(on, [*_keys(faults), Event(off, "therapy_state", "TERMINATION")]), device_clock(truth)),
    ]
    return recording(truth, LONG, tables, conditions(truth))


def moving_tank(truth: TherapyTruth, seed: int) -> Recording:
    """Return the logs of R5: the device's status, scale and events; no pressures."""
    rng, faults = np.random.default_rng((seed, 5)), faults_of(truth, MOTION)
    duration = truth.motion_duration
    stamps, moments = device_clock(truth).ticks(1.0, duration, rng)
    n = moments.size
    wave = truth.motion_pitch * np.sin(2.0 * math.pi * moments / truth.motion_period)
    pitch = wave + wander(rng, n, 1.0, truth.motion_pitch_scatter, truth.motion_memory)
    roll = wander(rng, n, 1.0, truth.motion_roll_scatter, truth.motion_memory)
    walking = np.mod(moments, truth.walking_every) >= truth.walking_every - truth.walking_time
    steps = [Step(-math.inf, 0.0, truth.uf_flow)]
    warmth = temperature_tables(truth, duration, rng)
    around = replace(
        at_rest(truth, moments, steps, warmth[0]), pitch=pitch, roll=roll, walking=walking, volume=truth.motion_volume
    )
    tank = followed(truth, at_tank(around, faults), rng)
    status = {"uf_flow_set": (np.full(n, truth.uf_flow), "m^3/s"), **tank.columns()}
    tables = [
        stream("device_status", stamps, status),
        *warmth,
        scale_table(truth, moments, tank.volume, duration, rng),
        events_table([Event(0.0, "therapy_state", "THERAPY"), *_keys(faults)], device_clock(truth)),
    ]
    return recording(truth, MOTION, tables, conditions(truth))


def whole_seconds(truth: TherapyTruth, end: float) -> np.ndarray:
    """Return the true moments of the device's status rows up to `end` (s)."""
    clock = device_clock(truth)
    return clock.true(np.arange(max(math.ceil(float(clock.stamp(np.array([end]))[0])), 0), dtype=float))


def at_rest(truth: TherapyTruth, moments: np.ndarray, steps: Sequence[Step], logged: Stream) -> Surroundings:
    """Return what a tank meets that stands still, as in R4; the device takes the air to be as warm as it has `logged`."""
    taken = np.interp(moments, device_clock(truth).true(logged.time), logged.channels["temperature_air_rap"].values)
    still = np.zeros(moments.size)
    return Surroundings(
        moments,
        held(moments, [(step.time, step.uf) for step in steps]),
        still + truth.pitch,
        still + truth.roll,
        still > 0.0,
        air(truth, moments),
        taken,
        still > 0.0,
        truth.initial_volume,
    )


def pumped_by(drive: Drive, tank: TankCourse) -> Drive:
    """Return `drive` with what the ultrafiltrate pump truly takes; a command holds for the second before its row."""
    time = np.arange(drive.uf.size) * TICK
    row = np.searchsorted(tank.moments, time, side="left")
    return replace(drive, uf=np.append(tank.rate, 0.0)[row])


def worn(drive: Drive, truth: TherapyTruth, since: float) -> Drive:
    """Return `drive` with a tube that wears from `since` (s) on."""
    hours = np.maximum(np.arange(drive.uf.size) * TICK - since, 0.0) / T_REF
    return replace(drive, V_g=drive.V_g * (1.0 - truth.wear * hours))


def _fouling(truth: TherapyTruth, on: float, off: float) -> list[Change]:
    if not truth.fouling:
        return []
    starts = np.arange(on, off, _FOULING_STEP)
    middles = starts + 0.5 * _FOULING_STEP - on
    return [
        Change(float(start), float(start) + _FOULING_STEP, {"K_uf": 1.0 / (1.0 + truth.fouling * float(t) / T_REF)})
        for start, t in zip(starts, middles, strict=True)
    ]


def _keys(faults: Sequence[Fault]) -> list[Event]:
    """Return the presses of the key for draining, a few seconds before the tank is emptied."""
    return [Event(f.start - _KEY_BEFORE, "drain_pressed", 1.0) for f in faults if f.kind == "drain" and f.key]


def begun(on: float, later: Sequence[Event]) -> list[Event]:
    """Return the events from switching on to the start of the pumps at `on` (s), and those that come `later`."""
    states = ("OFF", "SETUP", "PRIMING", "READY")
    first = [Event(on * i / len(states), "therapy_state", state) for i, state in enumerate(states)]
    return [*first, Event(on, "therapy_state", "THERAPY"), *later]


def conditions(truth: TherapyTruth) -> dict[str, Condition | None]:
    """Return what the logs state of tank, scale and battery."""
    return {
        **{name: getattr(truth, name) for name in TANK_CONDITIONS},
        "mass_tare": truth.scale_tare,
        "battery_energy": truth.battery_energy,
        "battery_efficiency": truth.battery_efficiency,
    }
