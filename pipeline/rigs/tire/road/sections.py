"""The chapters of the report on `tire.road` (tire.md, 7.7 and 7.8): the drive over time, its forces, its data."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Section
from pipeline.rigs.tire.road.sections_data import bench_table, data, drives_table
from pipeline.rigs.tire.road.sections_force import bonding, dips, residuals, spectra
from pipeline.rigs.tire.road.sections_tracks import event_table, tracks


def sections(findings: Findings) -> Sequence[Section]:
    """Return the evidence; it draws on parameters and arrays only."""
    if "drives" not in findings.arrays:
        return []
    runs = [str(run) for run in findings.arrays["drives"]["run"]]
    return [
        Section(
            "drive", "The drive, revolution by revolution", [block for run in runs for block in tracks(findings, run)]
        ),
        Section("events", "Events", [block for run in runs for block in event_table(findings, run)]),
        Section(
            "force", "The waveform, and what driving and braking do to it", [*residuals(findings), *dips(findings)]
        ),
        Section("bonding", "Is the sensor still bonded?", bonding(findings)),
        Section("bench", "What the bench gives, and how far it is carried", bench_table(findings)),
        Section("data", "The data", [*drives_table(findings), *data(findings), *spectra(findings)]),
    ]
