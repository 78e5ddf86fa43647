"""What the report of `tire.bench` shows, drawn from parameters and arrays only (tire.md, section 7)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Section
from pipeline.rigs.tire.bench.sections_calibration import of_calibration, of_speed
from pipeline.rigs.tire.bench.sections_film import of_film
from pipeline.rigs.tire.bench.sections_quality import of_energy, of_quality
from pipeline.rigs.tire.bench.sections_ring import of_ring
from pipeline.rigs.tire.bench.sections_waveform import of_lengths, of_revolutions, of_waveforms


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    if "runs" not in findings.arrays:
        return []
    chapters = [
        Section("waveforms", "Averaged waveforms and ring fit", of_waveforms(findings)),
        Section("lengths", "Contact length and deformation length", of_lengths(findings)),
        Section("calibration", "Load calibration", of_calibration(findings)),
        Section("speed", "Rolling radius", of_speed(findings)),
        Section("ring", "Ring and sensor", of_ring(findings)),
        Section("film", "PVDF against flex", of_film(findings)),
        Section("revolutions", "Revolution by revolution", of_revolutions(findings)),
        Section("data", "Quality of the passages", of_quality(findings)),
        Section("energy", "Energy", of_energy(findings)),
    ]
    return [chapter for chapter in chapters if chapter.blocks]
