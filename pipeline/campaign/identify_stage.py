"""Recordings + settings -> findings.json, arrays, and what `dvc metrics` and `dvc plots` show."""

from __future__ import annotations

import csv
import json
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.campaign.conditions import SYNTHETIC
from pipeline.campaign.ingest_stage import Ingested
from pipeline.campaign.recipe import Recipe
from pipeline.errors import InputError
from pipeline.findings import Findings, Parameter, Quality, Run
from pipeline.findings.storage import write
from pipeline.recording import QualityFinding, Recording
from pipeline.recording.storage import whole_or_not
from pipeline.rigs.experiment import Context

LIBRARIES = ("numpy", "scipy", "numba", "lmfit", "pandas", "pyarrow")
_ORDER = {"error": 0, "warning": 1, "note": 2}


def identify(campaign: str, recipe: Recipe, ingested: Ingested, uses: Mapping[str, Findings], folder: Path) -> Findings:
    """Identify one campaign and write its findings into `folder`.

    Raises
    ------
    InputError
        If nothing can be identified; earlier findings stay as they are then.
    """
    recordings = ingested.recordings()
    context = Context(campaign, uses)
    found = recipe.experiment.identify(recordings, recipe.settings, context)
    noticed = [*ingested.quality, *(finding for recording in recordings for finding in _of_run(recording))]
    quality = _merged([*(_quality(finding) for finding in noticed), *found.quality])
    verdict, reasons = _with_quality(found, quality)
    made_up = sum(recording.conditions.get(SYNTHETIC.name) is True for recording in recordings)
    if made_up:
        which = "All" if made_up == len(recordings) else f"{made_up} of the {len(recordings)}"
        reasons = [f"{which} logs come from a synthetic rig: nothing in them was measured.", *reasons]
    findings = found.model_copy(
        update={
            "campaign": campaign,
            "verdict": verdict,
            "reasons": reasons,
            "quality": quality,
            "runs": _runs(recordings, found, ingested),
            "settings": recipe.settings.model_dump(mode="json"),
            "provenance": _provenance(recipe, recordings),
        }
    )
    undeclared = {p.name for p in findings.parameters} - {spec.name for spec in recipe.experiment.parameters}
    if undeclared:
        raise LookupError(f"{recipe.experiment.id} yields parameters that it does not declare: {sorted(undeclared)}")
    write_plots(findings, folder / "plots")
    write_metrics(findings, folder / "metrics.json")
    write(findings, folder)
    return findings


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


def _with_quality(found: Findings, quality: list[Quality]) -> tuple[str, list[str]]:
    """Let no campaign pass as ok whose data carry a warning."""
    grave = [q for q in quality if q.level != "note" and q not in found.quality]
    if not grave or found.verdict != "ok":
        return found.verdict, found.reasons
    first = f"run {grave[0].run}: {grave[0].message}" if grave[0].run else grave[0].message
    more = f" ({len(grave) - 1} more below)" if len(grave) > 1 else ""
    return "warning", [*found.reasons, f"The data carry warnings: {first}{more}"]


def _runs(recordings: list[Recording], found: Findings, ingested: Ingested) -> list[Run]:
    told = {run.run: run for run in found.runs}
    runs = []
    for recording in recordings:
        opinion = told.get(recording.run)
        runs.append(
            Run(
                run=recording.run,
                used=opinion.used if opinion else True,
                reason=opinion.reason if opinion else "",
                conditions=dict(recording.conditions),
                files=[source.path for source in recording.provenance.files],
                sha256=[source.sha256 for source in recording.provenance.files],
                duration=max((stream.duration for stream in recording.streams.values()), default=0.0),
                n_samples=sum(stream.time.size for stream in recording.streams.values()),
                repairs=list(recording.provenance.repairs),
            )
        )
    known = {run.run for run in runs}
    left_out = [q for q in ingested.quality if q.run is not None and q.run not in known]
    return runs + [Run(run=q.run, used=False, reason=q.message) for q in left_out if q.run]


def _provenance(recipe: Recipe, recordings: list[Recording]) -> dict[str, Any]:
    return {
        "rigfit": __version__,
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
        "recipe": recipe.path,
        "recipe_sha256": recipe.digest,
        "logs": {source.path: source.sha256 for r in recordings for source in r.provenance.files},
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
        writer.writerows((name, f"{width:.6g}") for name, width in rows)


def used_findings(names: Mapping[str, Path]) -> dict[str, Findings]:
    """Read the findings of the campaigns that a recipe uses.

    Raises
    ------
    InputError
        If one has none yet.
    """
    from pipeline.findings.storage import read

    found = {}
    for name, path in names.items():
        if not path.exists():
            raise InputError(
                f"the recipe uses the campaign '{name}', which has no findings yet ({path}); identify it first."
            )
        found[name] = read(path)
    return found
