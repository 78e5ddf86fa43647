"""What the report of `rap.flow` shows, drawn from parameters and arrays only (rap.md, section 7 item 4)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Section
from pipeline.rigs.rap.flow.sections_calibration import of_calibration, of_left_out, of_trap
from pipeline.rigs.rap.flow.sections_data import of_runs, of_set_points, of_windows
from pipeline.rigs.rap.flow.sections_errors import of_errors


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    if "windows" not in findings.arrays:
        return []
    chapters = [
        Section("errors", "Estimate against meter", of_errors(findings)),
        Section("calibration", "What the calibration rests on", of_calibration(findings)),
        Section("left_out", "Set-points left out", of_left_out(findings)),
        Section("trap", "What 60, 80 and 100 mL/min alone would have said", of_trap(findings)),
        Section("set_points", "Set-points and flow meter", of_set_points(findings)),
        Section("windows", "Roller passages, window by window", of_windows(findings)),
        Section("runs", "Runs, zeros and clocks", of_runs(findings)),
    ]
    return [chapter for chapter in chapters if chapter.blocks]
