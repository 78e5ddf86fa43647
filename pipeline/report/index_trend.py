"""How key numbers go from campaign to campaign of one experiment, as figures of the index."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Axis, Figure, Panel, Points
from pipeline.report.parameters import key_parameters, place_of
from pipeline.report.words import clean
from pipeline.rigs.experiment import Experiment

_PLACES = 6  # operating points of one key parameter that are followed
_PANELS = 6
_NAMED = 20  # campaigns
_DAY = 86_400.0


class Told(NamedTuple):
    """A campaign's number of one quantity: SI, with its 95 % limits where it has them."""

    campaign: str
    recorded: float | None
    place: int
    value: float
    low: float | None
    high: float | None


def day(seconds: float) -> str:
    """Return the day of a moment (s since 1970, UTC) as ISO text."""
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d}"


def followed(findings: Findings, experiment: Experiment) -> list[dict[str, Any]]:
    """Return the key numbers that the index can hold against those of other campaigns, made to be kept as JSON.

    `key` is the name and operating point to two digits: what another campaign tells there is the same quantity.
    """
    shown = [
        p for same in key_parameters(findings, experiment) if len(same) <= _PLACES for p in same if "run" not in p.at
    ]
    return [_kept(p, experiment) for p in shown if p.value is not None]


def _kept(p: Parameter, experiment: Experiment) -> dict[str, Any]:
    rounded = {key: float(f"{v:.2g}") if isinstance(v, float) else v for key, v in sorted(p.at.items())}
    about = place_of(p.model_copy(update={"at": {key: rounded[key] for key in p.at}}), experiment)
    low, high = p.ci95 or (None, None)
    return {
        "key": f"{p.name} {about}", "label": f"{clean(p.name)} at {about}" if about else clean(p.name), "value": p.value, "low": low,
        "high": high, "unit": experiment.parameter_read_as(p.name, p.unit),
    }  # fmt: skip


def trend(
    experiment: str, title: str, campaigns: Sequence[tuple[str, float | None, Sequence[Mapping[str, Any]]]]
) -> Figure | None:
    """Return the figure of one experiment, None where no quantity is told by two of its campaigns.

    Parameters
    ----------
    campaigns
        Of each its name, when its first log began (s since 1970, None where unknown), and what `followed` returned; in
        the order of the project.
    """
    quantities: dict[str, list[Told]] = {}
    about: dict[str, Mapping[str, Any]] = {}
    for place, (name, recorded, numbers) in enumerate(campaigns, 1):
        for one in numbers:
            about.setdefault(one["key"], one)
            if one["unit"] == about[one["key"]]["unit"]:
                told = Told(name, recorded, place, one["value"], one["low"], one["high"])
                quantities.setdefault(one["key"], []).append(told)
    several = [key for key, told in quantities.items() if len(told) > 1]
    shown = sorted(several, key=lambda key: -len(quantities[key]))[:_PANELS]
    if not shown:
        return None
    dated = all(told.recorded is not None for key in shown for told in quantities[key])
    first = min((told.recorded or 0.0 for key in shown for told in quantities[key]), default=0.0)
    axis = Axis(f"days since {day(first)}") if dated else Axis("campaign, by its number below", whole=True)
    panels = [
        _panel(quantities[key], about[key], axis, None if not dated else first) for key in shown
    ]  # fmt: skip
    apart = [about[key]["label"] for key in shown if _apart(quantities[key])]
    answer = (
        f"Beyond their 95 % intervals: {listing(apart)}." if apart else "None by more than the 95 % intervals allow."
    )
    more = f" {len(several) - len(shown)} more numbers are not drawn." if len(several) > len(shown) else ""
    drawn = sorted(
        {(one.recorded if dated else None, one.place, one.campaign) for key in shown for one in quantities[key]}
    )
    names = [
        f"{clean(name)} {day(recorded)}" if recorded is not None else f"{place} {clean(name)}"
        for recorded, place, name in drawn
    ]
    order = "From left to right, with the day of the first log" if dated else "Their logs bear no dates; as listed"
    caption = (
        f"Do the numbers of {clean(experiment)} differ from campaign to campaign? {answer} Campaigns may be of different specimens. "
        f"{order}: {listing(names, _NAMED)}.{more}"
    )
    return Figure(f"trend-{experiment}", clean(title), caption, caption, panels, columns=min(len(panels), 3))


def _panel(told: Sequence[Told], about: Mapping[str, Any], axis: Axis, first: float | None) -> Panel:
    at = [float(one.place) if first is None else ((one.recorded or 0.0) - first) / _DAY for one in told]
    order = np.argsort(at, kind="stable")
    low, high = (
        np.array([np.nan if limit is None else limit for limit in limits], float)[order]
        for limits in ([one.low for one in told], [one.high for one in told])
    )
    value = np.array([one.value for one in told])[order]
    marks = [Points(np.array(at)[order], value, "measured", "", low, high)]
    name, _, place = str(about["label"]).partition(" at ")
    return Panel(marks, axis, Axis(name, str(about["unit"])), str(about["label"]) if place else "")


def _apart(told: Sequence[Told]) -> bool:
    """Tell whether two of the intervals have nothing in common."""
    return any(
        a.low is not None
        and a.high is not None
        and b.low is not None
        and b.high is not None
        and (a.high < b.low or b.high < a.low)
        for a, b in combinations(told, 2)
    )
