"""The page over all campaigns: what each is, its verdict, age and numbers, the way to its report; what goes from one to the next.

Without script everything is shown; with it the list can be searched, and ages are told.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from markupsafe import Markup

from pipeline.findings import Findings
from pipeline.findings.figures import Figure
from pipeline.report.accounts import quality_counts
from pipeline.report.figure import FigureView, figure_view, thumbnail
from pipeline.report.index_trend import day, followed, trend
from pipeline.report.numbers import range_of, reading
from pipeline.report.page import VERDICTS, page
from pipeline.report.parameters import common_unit, key_parameters, place_of
from pipeline.report.symbols import symbol_html
from pipeline.rigs.experiment import Experiment

_MOST_KEY_NUMBERS = 4


@dataclass(frozen=True)
class IndexEntry:
    """What the index shows of one campaign, made of texts and numbers so that it can be kept as JSON.

    `key_numbers` hold ``symbol`` (LaTeX), ``name``, ``at``, ``text`` and ``unit``; `picture` is SVG made by
    `index_entry`, or empty. `recorded` is when the first and the last dated run began (s since 1970), empty where
    none bears a date; `undated` counts those that bear none. `followed` are numbers for `trend`.
    """

    name: str
    experiment: str
    title: str
    verdict: str
    runs: int
    runs_used: int
    key_numbers: Sequence[Mapping[str, str]]
    quality: Mapping[str, int]
    link: str
    picture: str = ""
    recorded: Sequence[float] = ()
    undated: int = 0
    followed: Sequence[Mapping[str, Any]] = ()


@dataclass(frozen=True)
class Trend:
    """How the numbers of one experiment go; `several` where it is more than one campaign after another."""

    figure: FigureView
    several: bool


@dataclass(frozen=True)
class Group:
    """The campaigns of one rig, and how the numbers of its experiments go from one to the next."""

    rig: str
    entries: Sequence[IndexEntry]
    trends: Sequence[Trend]


def index_entry(findings: Findings, experiment: Experiment, title: str, link: str) -> IndexEntry:
    """Return the entry of a campaign; its picture is the first panel of the report's first figure."""
    figures = (block for section in experiment.sections(findings) for block in section.blocks)
    begins = [run.begins for run in findings.runs if run.begins is not None]
    first = next((block for block in figures if isinstance(block, Figure) and block.panels), None)
    return IndexEntry(
        name=findings.campaign,
        experiment=experiment.id,
        title=title or experiment.title,
        verdict=findings.verdict,
        runs=len(findings.runs),
        runs_used=sum(run.used for run in findings.runs),
        key_numbers=_key_numbers(findings, experiment),
        quality=quality_counts(findings.quality),
        link=link,
        picture=thumbnail(first, findings.campaign) if first else "",
        recorded=[min(begins), max(begins)] if begins else [],
        undated=len(findings.runs) - len(begins),
        followed=followed(findings, experiment),
    )


def _key_numbers(findings: Findings, experiment: Experiment) -> list[dict[str, str]]:
    """Return the first few key numbers; one that varies is shown by its range."""
    shown = []
    for parameters in key_parameters(findings, experiment)[:_MOST_KEY_NUMBERS]:
        known = [parameter for parameter in parameters if parameter.value is not None]
        unit = common_unit(parameters, experiment)
        values = [unit.read(parameter.value or 0.0) for parameter in known]
        text, first = "not determined", parameters[0]
        if len(known) == 1:
            text = str(reading(known[0].value or 0.0, known[0].std_error, None, unit.size, unit.zero))
            first = known[0]
        elif known:
            text = range_of(values)
        place = place_of(first, experiment) if len(known) == 1 else ""
        shown.append(
            {"symbol": first.symbol, "name": first.name, "at": place, "text": text, "unit": unit.name if known else ""}
        )
    return shown


def render_index(entries: Sequence[IndexEntry]) -> str:
    """Return the index page: one card a campaign, by rigs in the order in which they come."""
    verdicts = Counter(entry.verdict for entry in entries)
    dated = any(entry.recorded for entry in entries)
    return page(
        "index.html.j2",
        scripts=[_script()] if len(entries) > 1 or dated else [],
        entries=entries,
        groups=_groups(entries),
        counts=[(VERDICTS[verdict][0], verdict, verdicts[verdict]) for verdict in VERDICTS if verdicts[verdict]],
        verdicts=VERDICTS,
        symbol_html=symbol_html,
        drawn=Markup,
        day=day,
    )


@cache
def _script() -> str:
    return Path(__file__).with_name("index.js").read_text(encoding="utf-8")


def _groups(entries: Sequence[IndexEntry]) -> list[Group]:
    rigs = dict.fromkeys(entry.experiment.split(".")[0] for entry in entries)
    groups, number = [], 0
    for rig in rigs:
        own = [entry for entry in entries if entry.experiment.split(".")[0] == rig]
        views = []
        for experiment in dict.fromkeys(entry.experiment for entry in own):
            same = [entry for entry in own if entry.experiment == experiment]
            told = [(entry.name, entry.recorded[0] if entry.recorded else None, entry.followed) for entry in same]
            if figure := trend(experiment, f"{experiment}, campaign by campaign", told):
                number += 1
                views.append(Trend(figure_view(figure, number), len(same) > 2))
        groups.append(Group(rig, own, views))
    return groups
