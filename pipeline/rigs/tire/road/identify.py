"""`tire.road`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.tire.passages.passage_faults import passage_findings
from pipeline.rigs.tire.road.arrays import arrays_of
from pipeline.rigs.tire.road.declaration import RoadSettings
from pipeline.rigs.tire.road.faults import faults_of
from pipeline.rigs.tire.road.handed_over import Chosen, chosen
from pipeline.rigs.tire.road.models import models_of
from pipeline.rigs.tire.road.parameters import parameters_of
from pipeline.rigs.tire.road.published import published
from pipeline.rigs.tire.road.revolution_fit import REASONS
from pipeline.rigs.tire.road.run_numbers import Libraries, RunNumbers, numbers_of
from pipeline.rigs.tire.road.verdict import judge

# So many revolutions before the ink broke are worth keeping.
_ENOUGH = 20


@dataclass
class _Sorted:
    """Numbers of the drives that can be used, why others are left out, and what was noticed."""

    numbers: list[RunNumbers] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)

    def leave_out(self, run: str, reason: str) -> None:
        """Leave a run out and say why."""
        self.left_out[run] = reason
        self.quality.append(QualityFinding("error", f"left out: {reason}", run))


def identify(recordings: Sequence[Recording], settings: RoadSettings, context: Context) -> Findings:
    """Identify a campaign of drives.

    Raises
    ------
    InputError
        If no drive can be used at all.
    """
    choice = chosen(context.uses)
    runs = _Sorted(quality=list(choice.findings))
    libraries = Libraries()
    sizes = [max(1, max((stream.size for stream in r.streams.values()), default=1)) for r in recordings]
    done = 0
    for recording, size in zip(recordings, sizes, strict=True):
        before, share = done / sum(sizes), size / sum(sizes)
        _sort(recording, runs, choice, settings, libraries, _within(context, recording.run, before, share))
        done += size
    if not runs.numbers:
        raise InputError(nothing_usable(runs.left_out, recordings, "drive"))
    runs.quality = list(dict.fromkeys(runs.quality))
    said = judge(runs.numbers, choice, runs.left_out, runs.quality)
    return Findings(
        campaign=context.campaign,
        experiment="tire.road",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters_of(runs.numbers),
        models=models_of(runs.numbers),
        published=published(runs.numbers),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in runs.quality
        ],
        runs=[
            Run(
                run=r.run,
                used=r.run not in runs.left_out,
                reason=runs.left_out.get(r.run, ""),
                conditions=dict(r.conditions),
            )
            for r in recordings
        ],
        advice=said.advice,
        arrays=arrays_of(runs.numbers),
    )


def _within(context: Context, run: str, before: float, share: float) -> Callable[[float], None]:
    """Return what turns the share of one log that is done into that of the campaign."""
    return lambda done: context.progress(before + share * done, f"run {run}")


def _sort(
    recording: Recording,
    runs: _Sorted,
    choice: Chosen,
    settings: RoadSettings,
    libraries: Libraries,
    progress: Callable[[float], None],
) -> None:
    """Find the numbers of one drive, or why it has none."""
    try:
        numbers = numbers_of(recording, choice, settings, libraries, progress)
    except InputError as error:
        runs.leave_out(recording.run, str(error))
        return
    found = [*numbers.findings, *_of_the_log(numbers)]
    errors = [q.message for q in found if q.level == "error"]
    if errors or not numbers.usable.any():
        runs.quality += found
        runs.leave_out(recording.run, errors[0] if errors else _none_usable(numbers, found))
        return
    runs.quality += [*found, *faults_of(numbers)]
    runs.numbers.append(numbers)


def _of_the_log(numbers: RunNumbers) -> list[QualityFinding]:
    """Return what the log tells; ink that breaks on the way ends a drive, what lies before it stands."""
    found = list(passage_findings(numbers.device, numbers.course, None))
    if np.count_nonzero(numbers.usable) < _ENOUGH:
        return found
    told = "Load and force from then on are withheld, what lies before stands; glue a new sensor and calibrate it."
    return [
        replace(q, level="warning", message=f"{q.message} {told}")
        if q.level == "error" and q.span in numbers.course.open
        else q
        for q in found
    ]


def _none_usable(numbers: RunNumbers, found: Sequence[QualityFinding]) -> str:
    """Say why no revolution of a drive gives a number."""
    counts = np.bincount(numbers.forces.reason, minlength=len(REASONS))
    commonest = REASONS[int(np.argmax(counts[1:])) + 1] if counts[1:].any() else ""
    why = f" ({commonest})" if commonest else ""
    warned = next((q.message for q in found if q.level == "warning"), "")
    return f"none of its {len(numbers.forces)} revolutions can be used{why}." + (f" {warned}" if warned else "")
