"""Recordings + settings -> findings.json, arrays, and what `dvc metrics` and `dvc plots` show."""

from __future__ import annotations

import csv
import json
import platform
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from pipeline import __version__
from pipeline.campaign.code_digest import code_digest
from pipeline.campaign.conditions import SYNTHETIC
from pipeline.campaign.ingested import Ingested
from pipeline.campaign.parallel import in_parallel
from pipeline.campaign.recipe import Recipe
from pipeline.errors import counted, listing
from pipeline.findings import Findings, Parameter, Quality, Run
from pipeline.findings.storage import write
from pipeline.findings.together import together
from pipeline.recording import QualityFinding, Recording
from pipeline.recording.storage import sha256_of, whole_or_not
from pipeline.rigs.calibration import identify_calibrated
from pipeline.rigs.experiment import Context

LIBRARIES = ("numpy", "scipy", "numba", "lmfit", "pandas", "pyarrow")
_NO_MARKUP = str.maketrans("<>&", "‹›+")
_TOLD = 3  # logs left out that are told with their reasons
_ORDER = {"error": 0, "warning": 1, "note": 2}


class Used(NamedTuple):
    """Findings of another campaign that one builds on, and the file that they were read from."""

    findings: Findings
    path: str
    sha256: str


def identify(
    campaign: str,
    recipe: Recipe,
    ingested: Ingested,
    uses: Mapping[str, Used],
    folder: Path,
    progress: Callable[[float, str], None] = lambda _share, _what: None,
) -> Findings:
    """Identify one campaign and write its findings into `folder`.

    Parameters
    ----------
    progress
        Is told how much is done, from 0 to 1, and what is being done; see `Context`.

    Raises
    ------
    InputError
        If nothing can be identified; earlier findings stay as they are then.
    """
    recordings = ingested.recordings()
    told = [_told(recording) for recording in recordings]
    context = Context(campaign, {name: used.findings for name, used in uses.items()}, progress, in_parallel)
    found = identify_calibrated(recipe.experiment, recordings, recipe.settings, context, recipe.calibration)
    noticed = [*ingested.quality, *(finding for entry in told for finding in entry.quality)]
    quality = _merged([*(_quality(finding) for finding in noticed), *found.quality])
    runs = _runs(told, found, ingested)
    verdict, reasons = _with_quality(found, quality, ingested)
    made_up = sum(entry.run.conditions.get(SYNTHETIC.name) is True for entry in told)
    if made_up:
        which = "All" if made_up == len(runs) else f"{made_up} of the {len(runs)}"
        reasons = [f"{which} logs come from a synthetic rig: nothing in them was measured.", *reasons]
    findings = found.model_copy(
        update={
            "campaign": campaign,
            "verdict": verdict,
            "reasons": reasons,
            "quality": quality,
            "runs": runs,
            "settings": recipe.settings.model_dump(mode="json"),
            "provenance": _provenance(recipe, runs, uses),
        }
    )
    undeclared = {p.name for p in findings.parameters} - {spec.name for spec in recipe.experiment.parameters}
    if undeclared:
        raise LookupError(f"{recipe.experiment.id} yields parameters that it does not declare: {sorted(undeclared)}")
    with together(folder) as fresh:
        write_plots(findings, fresh / "plots")
        write_metrics(findings, fresh / "metrics.json")
        write(findings, fresh)
    return findings


class _Told(NamedTuple):
    """What a recording tells of itself besides its samples."""

    run: Run
    quality: list[QualityFinding]


def _told(recording: Recording) -> _Told:
    run = Run(
        run=recording.run,
        conditions=dict(recording.conditions),
        files=[source.path for source in recording.provenance.files],
        sha256=[source.sha256 for source in recording.provenance.files],
        duration=max((stream.duration for stream in recording.streams.values()), default=0.0),
        n_samples=sum(stream.size for stream in recording.streams.values()),
        begins=recording.provenance.begins,
        repairs=list(recording.provenance.repairs),
    )
    return _Told(run, _of_run(recording))


def _of_run(recording: Recording) -> list[QualityFinding]:
    return [QualityFinding(f.level, f.message, recording.run, f.channel, f.span) for f in recording.quality]


def _quality(finding: QualityFinding) -> Quality:
    return Quality(
        level=finding.level, run=finding.run, channel=finding.channel, span=finding.span, message=finding.message
    )


def _merged(quality: list[Quality]) -> list[Quality]:
    """Drop repetitions and put the gravest first; the order is stable otherwise."""
    unique = {(q.level, q.run, q.channel, q.span, q.message): q for q in quality}
    return sorted(unique.values(), key=lambda q: _ORDER[q.level])


def _with_quality(found: Findings, quality: list[Quality], ingested: Ingested) -> tuple[str, list[str]]:
    """Let no campaign pass as ok whose data carry a warning, and name every log that ingest left out."""
    left_out = {q.run: q.message for q in ingested.quality if q.level == "error" and q.run is not None}
    grave = [q for q in quality if q.level != "note" and q not in found.quality and q.run not in left_out]
    reasons = [*found.reasons, *_left_out(left_out)]
    if grave and found.verdict == "ok":
        first = f"run {grave[0].run}: {grave[0].message}" if grave[0].run else grave[0].message
        more = f" ({len(grave) - 1} more among the quality findings)" if len(grave) > 1 else ""
        reasons.append(f"The data carry warnings: {first}{more}")
    verdict = "warning" if found.verdict == "ok" and (grave or left_out) else found.verdict
    return verdict, reasons


def _left_out(messages: Mapping[str, str]) -> list[str]:
    """Name the logs that could not be read: few with their reasons, of many only the first with it."""
    runs = list(messages)
    shown = runs if len(runs) <= _TOLD else runs[:1]
    said = [f"Run {run} is {messages[run]}" for run in shown]
    if len(runs) > len(shown):
        others = listing(runs[1:], 8)
        said.append(f"{counted(len(runs) - 1, 'more log')} cannot be read either, see the quality findings: {others}.")
    return said


def _runs(told: list[_Told], found: Findings, ingested: Ingested) -> list[Run]:
    opinions = {run.run: run for run in found.runs}
    runs = []
    for entry in told:
        opinion = opinions.get(entry.run.run)
        update = {"used": opinion.used, "reason": opinion.reason} if opinion else {}
        runs.append(entry.run.model_copy(update=update))
    return runs + [
        Run(
            run=entry.run,
            used=False,
            reason=entry.reason,
            files=list(entry.files),
            sha256=list(entry.files.values()),
        )
        for entry in ingested.left_out
    ]


def _provenance(recipe: Recipe, runs: list[Run], uses: Mapping[str, Used]) -> dict[str, Any]:
    return {
        "rigfit": __version__,
        "code_sha256": code_digest(),
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
        "recipe": recipe.path,
        "recipe_sha256": recipe.digest,
        "logs": {path: digest for run in runs for path, digest in zip(run.files, run.sha256, strict=True)},
        "uses": {used.path: used.sha256 for used in uses.values()},
    }


def label(parameter: Parameter) -> str:
    """Return a short name that tells parameters of one name apart: ``k_mr[coil_current=6]``."""
    at = ",".join(
        f"{key}={value:.4g}" if isinstance(value, float) else f"{key}={value}" for key, value in parameter.at.items()
    )
    return f"{parameter.name}[{at}]" if at else parameter.name


def write_metrics(findings: Findings, path: Path) -> None:
    """Write the numbers that `dvc metrics` compares: campaign-wide parameters, the selected model, counts."""
    selected = next((model for model in findings.models if model.selected), None)
    numbers: dict[str, Any] = {
        "verdict": findings.verdict,
        "runs_used": sum(run.used for run in findings.runs),
        "quality": {level: sum(q.level == level for q in findings.quality) for level in ("error", "warning", "note")},
        "parameters": {
            label(p): {"value": p.value, "std_error": p.std_error}
            for p in findings.parameters
            if p.value is not None and "run" not in p.at
        },
    }
    if selected is not None:
        fit = {"nrmse": selected.nrmse, "chi2_reduced": selected.chi2_reduced, "cv_error": selected.cv_error}
        numbers["model"] = {"name": selected.name, **{key: value for key, value in fit.items() if value is not None}}
    with whole_or_not(path) as partial:
        partial.write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def write_plots(findings: Findings, folder: Path) -> None:
    """Write the table that `dvc plots` draws: half width of each 95 % interval relative to its value, in %."""
    rows = [
        (label(p), 100 * (p.ci95[1] - p.ci95[0]) / 2 / abs(p.value))
        for p in findings.parameters
        if p.value and p.ci95 is not None and "run" not in p.at
    ]
    with whole_or_not(folder / "intervals.csv") as partial, partial.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["parameter", "half_width_percent"])
        # DVC puts the names into a page as they stand.
        writer.writerows((name.translate(_NO_MARKUP), f"{width:.6g}") for name, width in rows)


def used(path: Path, shown: str) -> Used:
    """Read findings that a campaign builds on, from their file or its folder; the provenance will name it as `shown`.

    Raises
    ------
    InputError
        If they cannot be read.
    """
    from pipeline.findings.storage import read

    findings = read(path)
    inside = "/findings.json" if path.is_dir() else ""
    return Used(findings, f"{shown}{inside}", sha256_of(Path(f"{path}{inside}")))
