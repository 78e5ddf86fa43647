"""`tpjb.rotating`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.findings.findings import OperatingPoint
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.tpjb.conditions import run_groups
from pipeline.rigs.tpjb.rotating.arrays import arrays_of
from pipeline.rigs.tpjb.rotating.clearance import clearances_of
from pipeline.rigs.tpjb.rotating.consistency import consistency_of, stiffness_of_load
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.designs import design_tables
from pipeline.rigs.tpjb.rotating.faults import faults_of
from pipeline.rigs.tpjb.rotating.fit_faults import faults_of_fit
from pipeline.rigs.tpjb.rotating.group import LoadGroup, with_load_models
from pipeline.rigs.tpjb.rotating.handed_over import fitting
from pipeline.rigs.tpjb.rotating.mending import mended
from pipeline.rigs.tpjb.rotating.orientation import orientation_of, unit_findings
from pipeline.rigs.tpjb.rotating.parameters import models_of, parameters_of
from pipeline.rigs.tpjb.rotating.published import published
from pipeline.rigs.tpjb.rotating.record import record_of
from pipeline.rigs.tpjb.rotating.turns import Turns, turns_of
from pipeline.rigs.tpjb.rotating.verdict import ended, judge


@dataclass
class _Sorted:
    """The runs that can be used, those whose numbers cannot be, why others are left out, and what was noticed."""

    turns: dict[str, Turns] = field(default_factory=dict)
    faulty: dict[str, Turns] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)

    def leave_out(self, run: str, reason: str) -> None:
        """Leave a run out and say why."""
        self.left_out[run] = reason
        self.quality.append(QualityFinding("error", ended(f"left out: {reason}"), run))


def identify(recordings: Sequence[Recording], settings: RotatingSettings, context: Context) -> Findings:
    """Identify a campaign of rotating loads.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    runs = _sort(recordings, settings)
    refused = ""
    if not runs.turns and runs.faulty:
        runs.turns = runs.faulty
        refused = next(q.message for q in runs.quality if q.level == "error" and q.run in runs.faulty).rstrip(".")
    for run in runs.faulty if not refused else ():
        runs.leave_out(run, next(q.message for q in runs.quality if q.level == "error" and q.run == run))
    groups: list[LoadGroup] = []
    for at, members in run_groups([r for r in recordings if r.run in runs.turns]):
        groups += _fitted(at, [runs.turns[r.run] for r in members], settings, runs)
    if not groups:
        raise InputError(nothing_usable(runs.left_out, recordings))
    uses, notes = fitting(groups, context.uses)
    runs.quality += notes
    stiffness = stiffness_of_load(groups, uses)
    groups = [with_load_models(g, stiffness[g.bearing][0]) if g.bearing in stiffness else g for g in groups]
    if not refused:
        for group in groups:
            runs.quality += faults_of_fit(group)
    consistency = consistency_of(groups, uses, stiffness)
    clearances = clearances_of(uses, recordings)
    main = max(groups, key=lambda group: (group.highest.record.ratio or 0.0, group.highest.record.rotation.size))
    judgement = judge(groups, consistency, runs.left_out, runs.quality, refused, settings)
    used = {turns.run for group in groups for turns in group.runs}
    return Findings(
        campaign=context.campaign,
        experiment="tpjb.rotating",
        verdict=judgement.verdict,
        reasons=judgement.reasons,
        advice=judgement.advice,
        parameters=parameters_of(groups, [turns for group in groups for turns in group.runs], refused),
        models=models_of(groups, None if refused else main),
        published=published(groups, uses, refused),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in runs.quality
        ],
        runs=[
            Run(run=r.run, used=r.run in used, reason=runs.left_out.get(r.run, ""), conditions=dict(r.conditions))
            for r in recordings
        ],
        arrays=arrays_of(groups, clearances, consistency) | ({} if refused else design_tables(groups)),
    )


def _sort(recordings: Sequence[Recording], settings: RotatingSettings) -> _Sorted:
    """Bring each run into shape, mend its axes, and say what is wrong with it."""
    runs = _Sorted()
    for recording in recordings:
        try:
            record = record_of(recording, settings)
        except InputError as error:
            runs.leave_out(recording.run, str(error))
            continue
        mend = orientation_of(record)
        runs.quality += [*record.findings, *mend.findings]
        record = record if mend.mend is None else record.mapped(mend.mend)
        turns = turns_of(record, settings)
        found = [*unit_findings(record), *faults_of(turns)]
        runs.quality += found
        errors = [q for q in (*record.findings, *found) if q.level == "error"]
        (runs.faulty if errors else runs.turns)[record.run] = turns
    return runs


def _fitted(at: OperatingPoint, members: list[Turns], settings: RotatingSettings, runs: _Sorted) -> list[LoadGroup]:
    """Fit one static load, with what stands in its forces beside the film's taken off."""
    try:
        group, told = mended(at, members, settings)
    except InputError as error:
        for turns in members:
            runs.leave_out(turns.run, str(error))
        return []
    runs.quality += told
    return [group]
