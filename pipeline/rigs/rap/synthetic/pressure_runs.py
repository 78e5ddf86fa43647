"""R1: steps of blood flow and ultrafiltration, read by device and bench (rap.md, section 6)."""

from __future__ import annotations

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.pump import speed_for
from pipeline.rigs.rap.synthetic.bench_run import marched, pump_columns, recording
from pipeline.rigs.rap.synthetic.drives import Step, drive_of
from pipeline.rigs.rap.synthetic.readings import stream
from pipeline.rigs.rap.synthetic.truth import PressuresTruth, circuit_of, pump_of


def pressure_steps(truth: PressuresTruth, seed: int) -> Recording:
    """Return the logs of R1."""
    rng = np.random.default_rng((seed, 1))
    each = (truth.duration - truth.zero_time - truth.stop_time) / (2.0 * len(truth.flows))
    steps, flow_set = [], [(0.0, 0.0)]
    for i, flow in enumerate(truth.flows):
        speed = speed_for(pump_of(truth), circuit_of(truth), float(flow))
        start = truth.zero_time + 2.0 * i * each
        steps += [Step(start, speed, 0.0), Step(start + each, speed, truth.uf_flow)]
        flow_set.append((start, float(flow)))
    end = truth.duration - truth.stop_time
    steps.append(Step(end, 0.0, 0.0))
    scatter = (truth.speed_scatter, truth.speed_memory)
    drive = drive_of(steps, [], circuit_of(truth), truth.V_g, truth.duration, scatter, rng, truth.heparin_flow)
    run = marched(truth, truth.run, drive, rng)
    status = stream("device_status", run.status, pump_columns(truth, run, [*flow_set, (end, 0.0)], steps, rng))
    return recording(truth, truth.run, [run.device, status, run.bench], {})
