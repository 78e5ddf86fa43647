"""What a coverage study is: complete campaigns with known truth, and how one of them becomes rows of the table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from pipeline.errors import InputError
from pipeline.findings import Findings, Parameter
from pipeline.recording import Recording
from pipeline.rigs.calibration import Calibration, identify_calibrated
from pipeline.rigs.experiment import Context, Experiment, Settings


class OverSeeds:
    """Stands for the truth of a statistic of the noise itself: its mean over the campaigns."""


OVER_SEEDS: Final = OverSeeds()


@dataclass(frozen=True)
class Case:
    """One kind of campaign: what noise, scatter, jitter, gain errors, in one sentence for the documentation."""

    about: str


def _by_name(parameter: Parameter) -> str:
    return parameter.name


def _no_bound(_parameter: Parameter) -> float | None:
    return None


@dataclass(frozen=True)
class Campaign:
    """Logs as they come home, and what is true of them.

    Attributes
    ----------
    truth
        ``truth(parameter)`` is its true value, SI; None where there is nothing to hold it against, OVER_SEEDS where it is a
        statistic of the noise.
    settings
        Those of the experiment by default.
    calibration
        What the recipe would say of the channels' calibration (type B).
    bound
        ``bound(parameter)`` is the Cramér-Rao bound on its standard error, SI; None where there is no likelihood.
    label
        Under which name it counts; those of all operating points together by default.
    """

    recordings: Sequence[Recording]
    truth: Callable[[Parameter], float | OverSeeds | None]
    settings: Settings | None = None
    uses: Mapping[str, Findings] = field(default_factory=dict)
    calibration: Mapping[str, Calibration] = field(default_factory=dict)
    bound: Callable[[Parameter], float | None] = _no_bound
    label: Callable[[Parameter], str] = _by_name


@dataclass(frozen=True)
class Study:
    """The campaigns of one experiment, ``campaign(case, seed)``; the first case is the one that counts."""

    experiment: Experiment
    cases: Mapping[str, Case]
    campaign: Callable[[str, int], Campaign]


class Row(NamedTuple):
    """One parameter of one campaign. `truth` is None for OVER_SEEDS, `place` its operating point as text."""

    label: str
    place: str
    value: float | None
    std_error: float | None
    ci95: tuple[float, float] | None
    truth: float | None
    bound: float | None


class Outcome(NamedTuple):
    """What one campaign gave; `refused` is the message where nothing could be identified."""

    seed: int
    verdict: str
    rows: tuple[Row, ...]
    refused: str = ""


def outcome(study: Study, case: str, seed: int) -> Outcome:
    """Return what the campaign of that seed gives."""
    campaign = study.campaign(case, seed)
    settings = campaign.settings or study.experiment.settings()
    try:
        findings = identify_calibrated(
            study.experiment, campaign.recordings, settings, Context("coverage", campaign.uses), campaign.calibration
        )
    except InputError as error:
        return Outcome(seed, "refused", (), str(error))
    rows = []
    for p in findings.parameters:
        truth = campaign.truth(p)
        if truth is None:
            continue
        place = ", ".join(f"{key} {value}" for key, value in sorted(p.at.items()))
        true = None if isinstance(truth, OverSeeds) else float(truth)
        rows.append(Row(campaign.label(p), place, p.value, p.std_error, p.ci95, true, campaign.bound(p)))
    return Outcome(seed, findings.verdict, tuple(rows))
