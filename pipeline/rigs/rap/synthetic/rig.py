"""Logs of the synthetic device and its bench: runs of `rap.pressures`, `rap.flow`, `rap.therapy`, `rap.cytotoxicity`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.recording import Recording
from pipeline.rigs.rap.synthetic.cells import cytotoxicity_run
from pipeline.rigs.rap.synthetic.fault_run import faulty_therapy
from pipeline.rigs.rap.synthetic.flow_runs import flow_runs
from pipeline.rigs.rap.synthetic.pressure_runs import pressure_steps
from pipeline.rigs.rap.synthetic.therapy_runs import long_therapy, moving_tank
from pipeline.rigs.rap.synthetic.therapy_truth import therapy_truth
from pipeline.rigs.rap.synthetic.truth import FlowTruth, PressuresTruth, truth_of


def synthesize_pressures(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the run of `rap.pressures` (R1); `truth` overrides any field of `PressuresTruth`."""
    return [pressure_steps(truth_of(PressuresTruth(), truth), seed)]


def synthesize_flow(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the runs of `rap.flow` (R2, R3); `truth` overrides any field of `FlowTruth`."""
    return list(flow_runs(truth_of(FlowTruth(), truth), seed))


def synthesize_therapy(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the runs of `rap.therapy` (R4, R5, R6); `truth` overrides any field of `TherapyTruth`."""
    made = {"rap_therapy_312": long_therapy, "rap_tank_motion": moving_tank, "rap_faults": faulty_therapy}
    known = therapy_truth(truth)
    return [made[run](known, seed) for run in known.runs]


def synthesize_cytotoxicity(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the run of `rap.cytotoxicity` (R7); `truth` overrides any field of `CytotoxicityTruth`."""
    return [cytotoxicity_run(truth, seed)]
