"""All that is wrong with one bench run: of its passages, its reference channels, its units. Errors leave the run out."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.load_faults import load_faults
from pipeline.rigs.tire.bench.speed_faults import exchanged, speed_faults
from pipeline.rigs.tire.tire_size import tire_size


def run_faults(run: BenchRun) -> list[QualityFinding]:
    """Return what is to be said of a run, nothing twice."""
    radius = free_radius(run)
    references = exchanged(run, radius) or [*speed_faults(run, radius), *load_faults(run)]
    return list(dict.fromkeys([*run.findings, *references]))


def free_radius(run: BenchRun) -> float | None:
    """Return half the nominal diameter of a run's tire, m; None where its size is not stated or cannot be read."""
    if "tire_size" not in run.conditions:
        return None
    try:
        return tire_size(run.conditions["tire_size"]).radius
    except InputError:
        return None


def errors_of(findings: Sequence[QualityFinding]) -> list[str]:
    """Return the messages of the errors among the findings."""
    return [finding.message for finding in findings if finding.level == "error"]
