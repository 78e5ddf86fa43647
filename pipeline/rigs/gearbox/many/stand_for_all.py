"""Which runs of many are drawn: one that stands for each end of the speeds and the paper's, and the oddest ones. Always the same."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers
from pipeline.rigs.gearbox.outcome.paper import RPM, SPEEDS
from pipeline.rigs.number_over_runs import OverRuns

# A run stands for one of the paper's speeds within this share of it.
_NEAR = 0.03
_ODD = 4


def shown_of(campaign: CampaignNumbers) -> list[str]:
    """Return the runs that are drawn: those that stand for the others, then the oddest."""
    return [*typical_of(campaign), *odd_of(campaign)]


def typical_of(campaign: CampaignNumbers) -> list[str]:
    """Return a run that stands for each of the paper's speeds, else for the lowest and the highest speed.

    It is the one whose watched numbers lie nearest to what is expected of it, the first of several such.
    """
    far = _distances(campaign)
    speeds = campaign.speeds
    near = [speed for rpm in SPEEDS for speed in speeds if abs(speed / RPM / rpm - 1.0) < _NEAR]
    chosen = near or [*list(speeds)[:1], *list(speeds)[-1:]]
    names = [min(speeds[speed], key=lambda name: far.get(name, np.inf)) for speed in chosen]
    return list(dict.fromkeys(names)) or [run.name for run in campaign.runs[:1]]


def odd_of(campaign: CampaignNumbers) -> list[str]:
    """Return the oddest runs, the oddest first."""
    worst: dict[str, float] = {}
    for number in campaign.watched:
        for one in number.course.odd:
            name = number.runs[one.place]
            worst[name] = max(worst.get(name, 0.0), abs(one.deviations))
    order = {run.name: place for place, run in enumerate(campaign.runs)}
    return sorted(worst, key=lambda name: (-worst[name], order[name]))[:_ODD]


def _distances(campaign: CampaignNumbers) -> dict[str, float]:
    """Return how far a run's watched numbers are from what is expected of it, the mean square in standard deviations."""
    squares: dict[str, list[float]] = {}
    for number in campaign.watched:
        for name, square in zip(number.runs, _squares(number), strict=True):
            squares.setdefault(name, []).append(square)
    return {
        name: float(np.mean(found))
        for name, found in squares.items()
        if np.all(np.isfinite(found)) and name not in campaign.exceptions
    }


def _squares(number: OverRuns) -> list[float]:
    told = number.course
    return [float(one) for one in ((told.values - told.expected) / told.spread) ** 2]
