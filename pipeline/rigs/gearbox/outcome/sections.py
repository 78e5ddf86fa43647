"""What the report of `gearbox.load_exchange` shows, drawn from parameters and arrays only (gearbox.md, section 7)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Section
from pipeline.rigs.gearbox.outcome.sections_many import is_many, of_campaign
from pipeline.rigs.gearbox.outcome.sections_runs import of_stages, of_values
from pipeline.rigs.gearbox.outcome.sections_torque import of_friction, of_inertia, of_map, of_power
from pipeline.rigs.gearbox.outcome.sections_vibration import of_speeds, of_vibration


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    if "runs" not in findings.arrays:
        return []
    over = [Section("campaign", "Over the campaign", of_campaign(findings))] if is_many(findings) else []
    chapters = [
        *over,
        Section("stages", "Stages and events", of_stages(findings)),
        Section("torques", "Nominal and peak torques", of_values(findings)),
        Section("map", "Torque map", of_map(findings)),
        Section("power", "Efficiency and heat", of_power(findings)),
        Section("inertia", "Inertia of the load", of_inertia(findings)),
        Section("friction", "Friction over speed", of_friction(findings)),
        Section("speeds", "Speeds of all members", of_speeds(findings)),
        Section("vibration", "Vibration", of_vibration(findings)),
    ]
    return [chapter for chapter in chapters if chapter.blocks]
