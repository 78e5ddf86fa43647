"""What the report of `tpjb.rotating` shows, drawn from parameters and arrays only (tpjb.md, section 7)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Section
from pipeline.rigs.tpjb.rotating.sections_laws import of_consistency, of_laws, of_limit
from pipeline.rigs.tpjb.rotating.sections_orbits import of_orbits
from pipeline.rigs.tpjb.rotating.sections_spectra import of_spectra


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    if "runs" not in findings.arrays:
        return []
    shown = [
        Section("orbits", "Load and orbits", of_orbits(findings)),
        Section("harmonics", "Harmonics", of_spectra(findings)),
    ]
    laws = [
        Section("laws", "Which law holds", of_laws(findings)),
        Section("linear", "How far the bearing is linear", of_limit(findings)),
        Section("consistency", "Do the tests agree", of_consistency(findings)),
    ]
    # Of a rejected campaign orbits and harmonics are evidence; laws would be numbers that are not to be used.
    chapters = shown if findings.verdict == "rejected" else [*shown, *laws]
    return [chapter for chapter in chapters if chapter.blocks]
