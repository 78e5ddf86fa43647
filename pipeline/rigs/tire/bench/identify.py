"""`tire.bench`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError, counted
from pipeline.findings import Findings, ModelResult, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.tire.bench.arrays import arrays_of
from pipeline.rigs.tire.bench.bench_run import BenchRun, FreeSpinError, bench_run
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.declaration import BenchSettings
from pipeline.rigs.tire.bench.faults import errors_of, run_faults
from pipeline.rigs.tire.bench.parameters import parameters_of
from pipeline.rigs.tire.bench.published import published
from pipeline.rigs.tire.bench.same_tire import one_tire
from pipeline.rigs.tire.bench.together import campaign_of
from pipeline.rigs.tire.bench.verdict import judge


@dataclass
class _Sorted:
    """Runs as they were looked at: usable, left out with the reason, what was noticed."""

    runs: list[BenchRun] = field(default_factory=list)
    others: list[BenchRun] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    aside: dict[str, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)


def identify(recordings: Sequence[Recording], settings: BenchSettings, context: Context) -> Findings:
    """Identify a bench campaign of one tire.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    runs = _Sorted()
    count = max(len(recordings), 1)
    for number, recording in enumerate(recordings):
        context.progress(0.6 * number / count, f"passages of {recording.run}")
        _sort(recording, runs)
    if not runs.runs:
        raise InputError(nothing_usable({**runs.left_out, **runs.aside}, recordings))
    context.progress(0.6, "ring, calibration and PVDF")
    tire = one_tire(runs.runs, settings)
    for run in list(runs.runs):
        if run.name in tire.left_out:
            runs.left_out[run.name] = tire.left_out[run.name]
            runs.quality.append(QualityFinding("error", f"left out: {tire.left_out[run.name]}", run.name))
            runs.others.append(run)
    found = campaign_of(tire.tire, tire.runs)
    quality = list(dict.fromkeys([*runs.quality, *tire.findings, *found.findings]))
    parameters = parameters_of(found, runs.others)
    said = judge(found, parameters, runs.left_out, quality)
    context.progress(0.9, "tables")
    for campaign, other in context.uses.items():
        text = f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: the bench uses no other findings"
        quality.append(QualityFinding("note", text))
    not_used = {**runs.aside, **runs.left_out}
    return Findings(
        campaign=context.campaign,
        experiment="tire.bench",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters,
        models=_models(found),
        published=published(parameters, found.runs, found.tire),
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[
            Run(run=r.run, used=r.run not in not_used, reason=not_used.get(r.run, ""), conditions=dict(r.conditions))
            for r in recordings
        ],
        advice=said.advice,
        arrays=arrays_of(found, runs.others, parameters),
    )  # fmt: skip


def _sort(recording: Recording, runs: _Sorted) -> None:
    """Find the numbers of one run, or why it has none."""
    try:
        run = bench_run(recording)
    except FreeSpinError as error:
        runs.aside[recording.run] = str(error)
        runs.quality.append(QualityFinding("note", str(error), recording.run))
        return
    except InputError as error:
        runs.left_out[recording.run] = str(error)
        runs.quality.append(QualityFinding("error", f"left out: {error}", recording.run))
        return
    findings = run_faults(run)
    runs.quality += findings
    errors = errors_of(findings)
    if errors:
        runs.left_out[run.name] = errors[0]
        runs.others.append(run)
        return
    runs.runs.append(run)


def _models(found: Campaign) -> list[ModelResult]:
    import numpy as np

    rows = []
    ring = found.ring
    if ring is not None and found.verdict is not None:
        residual = np.concatenate([run.residual[np.isfinite(run.residual)] for run in ring.runs])
        spread = np.concatenate([run.model - run.model.mean() for run in ring.runs])
        rows.append(
            ModelResult(
                name="ring on springs, flat road", family="averaged waveforms", selected=True, n_parameters=len(ring.names) + 4 * len(ring.runs),
                n_data=int(residual.size), rms_residual=float(np.sqrt(np.mean(residual**2))), unit="ohm",
                nrmse=float(np.sqrt(np.mean(residual**2)) / np.std(spread)), chi2_reduced=ring.chi2_reduced,
                description=f"joint fit of {counted(len(ring.runs), 'run')}, contact solved; angle, R0, its drift and error of the load for each run; "
                + ("fits" if found.verdict.fits else "does not fit"),
            )
        )  # fmt: skip
    curve = found.calibration.curve if found.calibration is not None else None
    if found.calibration is not None and curve is not None:
        residual = found.calibration.residuals
        peaks = np.array([p.peak for p in found.calibration.points])
        rms = float(np.sqrt(np.mean(residual**2)))
        rows.append(
            ModelResult(
                name="quadratic" if curve.degree == 2 else "straight line", family="peak over load", selected=True, n_parameters=curve.degree + 1,
                n_data=int(residual.size), rms_residual=rms, unit="ohm", nrmse=rms / float(np.std(peaks)), description="peak of averaged R2 over load",
            )
        )  # fmt: skip
    return rows
