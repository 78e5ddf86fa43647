"""R2 and R3: set-points of blood flow times settings of the access clamp, read by device and meter (rap.md, section 6)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.pump import speed_for
from pipeline.rigs.rap.synthetic.bench_run import device_clock, marched, pump_columns, recording
from pipeline.rigs.rap.synthetic.drives import Change, Step, drive_of
from pipeline.rigs.rap.synthetic.events import Event, events_table
from pipeline.rigs.rap.synthetic.readings import stream
from pipeline.rigs.rap.synthetic.truth import FlowTruth, circuit_of, pump_of
from pipeline.rigs.rap.synthetic.truth_check import RIG

# Name of the run, which set it belongs to, which tube.
_SETS = {
    "calibration": ("rap_flow_cal", "calibration", "A"),
    "holdout": ("rap_flow_val", "holdout", "A"),
    "tube": ("rap_flow_val_tube", "holdout", "B"),
}


def flow_runs(truth: FlowTruth, seed: int) -> Iterator[Recording]:
    """Yield the runs of R2 and R3."""
    for number, name in enumerate(truth.sets):
        if name not in _SETS:
            raise InputError(f"the {RIG} has no set '{name}' of flow runs; it has {listing(_SETS)}.")
        run, belongs, tube = _SETS[name]
        clamps = truth.calibration_clamps if belongs == "calibration" else truth.holdout_clamps
        own = replace(truth, V_g=truth.V_g * (1.0 + truth.tube_change)) if tube == "B" else truth
        for group in [[clamp] for clamp in clamps] if truth.split else [list(clamps)]:
            suffix = f"_x{group[0]:g}" if truth.split else ""
            rng = np.random.default_rng((seed, 2, number, round(1e3 * group[0])))
            yield _run(own, f"{run}{suffix}", belongs, tube, group, rng, speeds_from=truth)


def _run(
    truth: FlowTruth,
    run: str,
    belongs: str,
    tube: str,
    clamps: Sequence[float],
    rng: np.random.Generator,
    speeds_from: FlowTruth,
) -> Recording:
    """Return one run; the device sets its speeds as for the tube that it knows, of `speeds_from`."""
    circuit, pump = circuit_of(truth), pump_of(speeds_from)
    steps: list[Step] = []
    flow_set = [(0.0, 0.0)]
    changes: list[Change] = []
    events: list[Event] = []
    now = truth.zero_time
    for clamp in clamps:
        for flow in truth.flows:
            steps.append(Step(now, speed_for(pump, circuit, float(flow)), truth.uf_flow))
            flow_set.append((now, float(flow)))
            now += truth.hold
        begin = now - truth.hold * len(truth.flows)
        changes.append(Change(begin, now, {"R_a": float(clamp)}))
        events.append(Event(begin, "clamp", f"x{clamp:g}"))
    steps.append(Step(now, 0.0, 0.0))
    flow_set.append((now, 0.0))
    scatter = (truth.speed_scatter, truth.speed_memory)
    drive = drive_of(steps, changes, circuit, truth.V_g, now + truth.stop_time, scatter, rng, truth.heparin_flow)
    made = marched(truth, run, drive, rng)
    tables = [
        made.device,
        stream("device_status", made.status, pump_columns(truth, made, flow_set, steps, rng)),
        made.bench,
    ]
    own = {"set": belongs, "tube_set_id": tube, "clamp": f"x{clamps[0]:g}" if truth.split else None}
    if not truth.split:
        tables.append(events_table(events, device_clock(truth)))
    return recording(truth, run, tables, own)
