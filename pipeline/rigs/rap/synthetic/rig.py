"""Logs of the synthetic device and its bench: runs of `rap.pressures`, `rap.flow`, `rap.therapy`, `rap.cytotoxicity`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.recording import Recording
from pipeline.rigs.rap.synthetic.flow_runs import flow_runs
from pipeline.rigs.rap.synthetic.pressure_runs import pressure_steps
from pipeline.rigs.rap.synthetic.truth import FlowTruth, PressuresTruth, truth_of


def synthesize_pressures(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the run of `rap.pressures` (R1); `truth` overrides any field of `PressuresTruth`."""
    return [pressure_steps(truth_of(PressuresTruth(), truth), seed)]


def synthesize_flow(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the runs of `rap.flow` (R2, R3); `truth` overrides any field of `FlowTruth`."""
    return list(flow_runs(truth_of(FlowTruth(), truth), seed))
