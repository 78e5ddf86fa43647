"""R1: steps of blood flow and ultrafiltration, read by device and bench (rap.md, section 6)."""

from __future__ import annotations

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.pump import speed_for
from pipeline.rigs.rap.synthetic.bench_run import recorded
from pipeline.rigs.rap.synthetic.drives import Step, drive_of
from pipeline.rigs.rap.synthetic.truth import PressuresTruth, circuit_of, pump_of


def steps_of(truth: PressuresTruth) -> list[Step]:
    """Return what the pumps do."""
    each = (truth.duration - truth.zero_time - truth.stop_time) / (2.0 * len(truth.flows))
    steps = []
    for i, flow in enumerate(truth.flows):
        speed = speed_for(pump_of(truth), circuit_of(truth), float(flow))
        start = truth.zero_time + 2.0 * i * each
        steps += [Step(start, speed, 0.0), Step(start + each, speed, truth.uf_flow)]
    return [*steps, Step(truth.duration - truth.stop_time, 0.0, 0.0)]


def pressure_steps(truth: PressuresTruth, seed: int) -> Recording:
    """Return the logs of R1."""
    rng = np.random.default_rng((seed, 1))
    steps = steps_of(truth)
    drive = drive_of(
        steps, [], circuit_of(truth), truth.V_g, truth.duration, (truth.speed_scatter, truth.speed_memory), rng
    )
    nominal = [(0.0, 0.0), *((truth.zero_time + 2 * i * _each(truth), float(q)) for i, q in enumerate(truth.flows))]
    return recorded(truth, truth.run, drive, steps, [*nominal, (steps[-1].time, 0.0)], rng)


def _each(truth: PressuresTruth) -> float:
    return (truth.duration - truth.zero_time - truth.stop_time) / (2.0 * len(truth.flows))
