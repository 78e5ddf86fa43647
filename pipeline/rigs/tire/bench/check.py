"""What `rigfit check` tells of one bench log: faults in the words of `identify`, no numbers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tire.bench.bench_run import bench_run
from pipeline.rigs.tire.bench.declaration import BenchSettings
from pipeline.rigs.tire.bench.faults import errors_of, run_faults
from pipeline.rigs.tire.bench.same_tire import one_tire
from pipeline.rigs.tire.bench.together import campaign_of


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for lost packets, bad passages, swapped or inverted sensors, wrong units of load and speed, missing conditions.

    Raises
    ------
    InputError
        If this run alone leaves nothing to identify.
    """
    run = bench_run(recording)
    found = run_faults(run)
    if errors_of(found):
        return found
    alone = one_tire([run], BenchSettings())
    return [*found, *alone.findings, *campaign_of(alone.tire, alone.runs).findings]
