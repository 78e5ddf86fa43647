"""What `rigfit check` tells of one flow log: faults in the words of `identify`, no numbers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.record import run_of
from pipeline.rigs.rap.flow.run_faults import inspected, run_faults
from pipeline.rigs.rap.flow.run_windows import run_numbers
from pipeline.rigs.rap.flow.shared_zeros import with_zeros


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for wrong units and signs, exchanged or frozen channels, clocks that cannot be aligned, a meter whose line is unknown.

    Raises
    ------
    InputError
        If this run alone leaves nothing to identify.
    """
    looked = inspected(recording)
    if looked.refused:
        return looked.findings
    run = run_of(looked.sound)
    (numbers,) = with_zeros([run_numbers(run, FlowSettings())])
    found = [*looked.findings, *run_faults(numbers)]
    if run.meter is not None and not run.location:
        text = (
            "flowmeter_location is not stated, and it is mandatory: a meter on the return line reads the blood flow less the UF rate. Give it in runs.csv, in the log, by "
            "the file name's pattern or in the recipe, as access or return"
        )
        found.append(QualityFinding("warning", text, run.name, run.meter.name))
    if run.meter is None:
        found.append(
            QualityFinding(
                "warning", "no blood_flow_bench: this run can neither calibrate nor judge the estimators", run.name
            )
        )
    return list(dict.fromkeys(found))
