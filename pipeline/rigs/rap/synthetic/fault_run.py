"""R6: clots, clamps, disconnections, pauses and readings that go astray, one after the other (rap.md, section 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.pump import speed_for
from pipeline.rigs.rap.synthetic.bench_run import device_clock, marched, pump_columns, recording
from pipeline.rigs.rap.synthetic.drives import Change, Step, drive_of
from pipeline.rigs.rap.synthetic.events import Event, events_table
from pipeline.rigs.rap.synthetic.housing import scale_table, temperature_tables
from pipeline.rigs.rap.synthetic.readings import stream
from pipeline.rigs.rap.synthetic.tank_course import followed
from pipeline.rigs.rap.synthetic.therapy_runs import at_rest, begun, conditions, pumped_by, whole_seconds
from pipeline.rigs.rap.synthetic.therapy_truth import EPISODES, INJECTIONS, RUNS, TherapyTruth
from pipeline.rigs.rap.synthetic.truth import circuit_of, pump_of

RUN = RUNS[2]
_STAGNATION = 120.0
_MISMATCH_DELAY = 1.0
# The ultrafiltrate side takes its time to show a clot.
_LATER = {"MEMBRANE_COAGULATION": 2.6}
_AT_ONCE = 0.1
_RESET = 5.0


def faulty_therapy(truth: TherapyTruth, seed: int) -> Recording:
    """Return the logs of R6."""
    rng = np.random.default_rng((seed, 6))
    truth = replace(truth, mismatches=[*truth.mismatches, *truth.fault_mismatches])
    circuit, end = circuit_of(truth), truth.faults_duration
    stops, events = _stops(truth)
    speed = speed_for(pump_of(truth), circuit, truth.blood_flow)
    steps = _around(stops, truth.zero_time, end, Step(truth.zero_time, speed, truth.uf_flow))
    changes = [Change(float(start), float(stop), dict([EPISODES[code]])) for code, start, stop in truth.episodes]
    moments = whole_seconds(truth, end)
    warmth = temperature_tables(truth, end, rng)
    tank = followed(truth, at_rest(truth, moments, steps, warmth[0]), rng)
    scatter = (truth.speed_scatter, truth.speed_memory)
    drive = drive_of(steps, changes, circuit, truth.V_g, end, scatter, rng, truth.heparin_flow)
    run = marched(truth, RUN, pumped_by(drive, tank), rng)
    flow_set = [(step.time, truth.blood_flow if step.speed else 0.0) for step in steps]
    status = {**pump_columns(truth, run, flow_set, steps, rng), **tank.columns()}
    fast = device_clock(truth).true(run.device.time)
    flags = {
        channel: (_during(fast, [(s, e) for code, s, e in truth.injections if code == alarm]), "1")
        for alarm, channel in INJECTIONS.items()
    }
    closed = {"clamp_closed": (_during(fast, stops), "1"), "watchdog_ok": (np.ones(fast.size), "1")}
    more = stream("device", run.device.time, {**flags, **closed})
    tables = [
        replace(run.device, channels={**run.device.channels, **more.channels}),
        stream("device_status", run.status, status),
        *warmth,
        run.bench,
        scale_table(truth, moments, tank.volume, end, rng),
        events_table(begun(truth.zero_time, events), device_clock(truth)),
    ]
    return recording(truth, RUN, tables, conditions(truth))


def _stops(truth: TherapyTruth) -> tuple[list[tuple[float, float]], list[Event]]:
    """Return when the pumps stand (start, end), and the events of states and alarms."""
    stops: list[tuple[float, float]] = []
    events: list[Event] = []
    for start, end in truth.pauses:
        stops.append((float(start), float(end)))
        events.append(Event(start, "therapy_state", "PAUSE"))
        if end - start > _STAGNATION:
            events += _alarm(start + _STAGNATION + 0.05, "PROLONGED_STAGNATION", True)
        events.append(Event(end, "therapy_state", "THERAPY"))
    late = [
        (code, start + truth.alarm_delay + _LATER.get(code, 0.0), end, truth.alarm_reaction)
        for code, start, end in truth.episodes
    ]
    late += [("SENSOR_MISMATCH", m[1] + _MISMATCH_DELAY, m[2], truth.alarm_reaction) for m in truth.mismatches]
    late += [(code, start + _AT_ONCE, end, True) for code, start, end in truth.injections]
    for code, seen, end, reacts in late:
        events += _alarm(seen, code, reacts)
        if reacts:
            stops.append((seen, end + _RESET))
            events.append(Event(end + _RESET, "therapy_state", "THERAPY"))
    return sorted(stops), events


def _alarm(time: float, code: str, reacts: bool) -> list[Event]:
    state = [Event(time, "therapy_state", "ALARM")] if reacts else []
    return [*state, Event(time, "alarm_code", code)]


def _around(stops: Sequence[tuple[float, float]], on: float, end: float, running: Step) -> list[Step]:
    """Return the steps of pumps that run from `on` (s) but for the `stops`."""
    steps = [running]
    for start, stop in stops:
        steps.append(Step(start, 0.0, 0.0))
        if stop < end:
            steps.append(replace(running, time=max(stop, on)))
    return steps


def _during(moments: np.ndarray, spans: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return 1 at the `moments` within one of the `spans` (s), else 0."""
    inside = np.zeros(moments.size)
    for start, end in spans:
        inside[(moments >= start) & (moments < end)] = 1.0
    return inside
