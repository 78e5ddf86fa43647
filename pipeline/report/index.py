"""The page over all campaigns: what each is, its verdict, its numbers, the way to its report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pipeline.findings import Findings
from pipeline.findings.figures import Figure
from pipeline.report.accounts import quality_counts
from pipeline.report.figure import thumbnail
from pipeline.report.numbers import plain, reading
from pipeline.report.page import VERDICTS, page
from pipeline.report.parameters import common_unit, key_parameters, place_of
from pipeline.report.symbols import symbol_html
from pipeline.rigs.experiment import Experiment

_MOST_KEY_NUMBERS = 4


@dataclass(frozen=True)
class IndexEntry:
    """What the index shows of one campaign, made of texts and numbers so that it can be kept as JSON.

    `key_numbers` hold ``symbol`` (LaTeX), ``name``, ``at``, ``text`` and ``unit``; `picture` is SVG made by
    `index_entry`, or empty.
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


def index_entry(findings: Findings, experiment: Experiment, title: str, link: str) -> IndexEntry:
    """Return the entry of a campaign; its picture is the first panel of the report's first figure."""
    figures = (block for section in experiment.sections(findings) for block in section.blocks)
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
            text = f"{plain(min(values), 3)} … {plain(max(values), 3)}"
        place = place_of(first, experiment) if len(known) == 1 else ""
        shown.append(
            {"symbol": first.symbol, "name": first.name, "at": place, "text": text, "unit": unit.name if known else ""}
        )
    return shown


def render_index(entries: Sequence[IndexEntry]) -> str:
    """Return the index page, one card a campaign in the order given."""
    verdicts = Counter(entry.verdict for entry in entries)
    return page(
        "index.html.j2",
        entries=entries,
        counts=[(VERDICTS[verdict][0], verdict, verdicts[verdict]) for verdict in VERDICTS if verdicts[verdict]],
        verdicts=VERDICTS,
        symbol_html=symbol_html,
        drawn=Markup,
    )
