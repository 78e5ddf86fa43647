"""The chapters of a report, in the order of reading: the numbers, the evidence, the data, how it was done."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, ClassVar

from markupsafe import Markup

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Figure, Section, Table
from pipeline.report.accounts import (
    logs_table,
    paper_table,
    published_table,
    quality_table,
    repairs_table,
    runs_tables,
)
from pipeline.report.advice import proposals_table
from pipeline.report.budget import budget_table
from pipeline.report.citation import bibtex, citation
from pipeline.report.equations import Equations, equations
from pipeline.report.figure import FigureView, figure_view
from pipeline.report.gathered import MOST_TOLD, told
from pipeline.report.models import models_table
from pipeline.report.naming import Naming, naming_of
from pipeline.report.parameters import key_table, parameter_tables
from pipeline.report.repeating import check, steps, versions
from pipeline.report.table import TableView, table_view
from pipeline.report.uncertainty import stated
from pipeline.report.words import clean, typeset
from pipeline.rigs.experiment import Experiment


@dataclass(frozen=True)
class Paragraphs:
    """Running text."""

    kind: ClassVar[str] = "paragraphs"
    texts: Sequence[str]


@dataclass(frozen=True)
class Listed:
    """Short texts one below the other, numbered where they are cited."""

    kind: ClassVar[str] = "listed"
    texts: Sequence[str]
    numbered: bool = False


@dataclass(frozen=True)
class Code:
    """Text to copy as it stands."""

    kind: ClassVar[str] = "code"
    title: str
    text: str


@dataclass(frozen=True)
class Facts:
    """Names and what they are."""

    kind: ClassVar[str] = "facts"
    pairs: Sequence[tuple[str, str]]


Block = Paragraphs | Listed | Code | Facts | Equations | FigureView | TableView


@dataclass(frozen=True)
class Chapter:
    """A part of the page: its anchor, heading and what stands in it."""

    anchor: str
    title: str
    blocks: Sequence[Block]


def chapters(findings: Findings, experiment: Experiment, command: str, revision: str = "") -> list[Chapter]:
    """Return all chapters of a report; empty ones are left out.

    Parameters
    ----------
    findings, experiment
        What was identified, and the declaration that says what is shown of it.
    command, revision
        What the user typed and Git's name of the code, for whoever repeats it.
    """
    numbers = Numbers(naming_of(findings, experiment))
    made = [
        Chapter("key", "The numbers that matter", list(numbers.given(_key(findings, experiment)))),
        Chapter("advice", "What to do next", list(numbers.given(_next(findings, experiment)))),
    ]
    for place, section in enumerate(experiment.sections(findings), 1):
        made.append(Chapter(_anchor(section, place), clean(section.title), list(numbers.given(_section(section)))))
    tail: list[tuple[str, str, list[Block | Figure]]] = [
        ("models", "Models compared", [models_table(findings.models)] if findings.models else []),
        ("published", "Published values", _some(published_table(findings.published))),
        ("quality", "Quality of the data", _quality(findings)),
        ("parameters", "All parameters", [*parameter_tables(findings, experiment)]),
        ("uncertainty", "Scatter and calibration", _some(budget_table(findings, experiment))),
        ("runs", "Runs", _runs(findings, experiment)),
        ("paper", "Checks of the paper, without these logs", _some(paper_table(findings.published))),
        ("methods", "How it was done", _methods(findings, experiment)),
        ("repeat", "To repeat this", _repeat(findings, experiment, command, revision)),
    ]
    made += [Chapter(anchor, title, list(numbers.given(blocks))) for anchor, title, blocks in tail]
    return [chapter for chapter in made if chapter.blocks]


def _next(findings: Findings, experiment: Experiment) -> list[Block | Figure]:
    said = told(findings.advice, (run.run for run in findings.runs))
    return [*([Listed(said)] if said else []), *_some(proposals_table(findings, experiment))]


def _some(*tables: TableView | None) -> list[Block | Figure]:
    return [table for table in tables if table]


class Numbers:
    """Numbers figures and tables through the page, and sets names of parameters in them as symbols."""

    def __init__(self, naming: Naming) -> None:
        self.figures, self.tables, self.naming = count(1), count(1), naming

    def given(self, blocks: Iterable[Block | Figure]) -> Iterator[Block]:
        """Yield the blocks with their numbers; figures are drawn."""
        for block in blocks:
            if isinstance(block, Figure):
                yield self.naming.view(figure_view(self.naming.drawn(block), next(self.figures)))
            elif isinstance(block, TableView):
                yield self.naming.view(block.numbered(next(self.tables)))
            elif isinstance(block, Paragraphs | Listed):
                yield replace(block, texts=[self.naming.text(text) for text in block.texts])
            else:
                yield block


def _anchor(section: Section, place: int) -> str:
    return f"evidence-{place}-" + re.sub(r"[^a-z0-9]+", "-", section.name.lower()).strip("-")


def _key(findings: Findings, experiment: Experiment) -> list[Block | Figure]:
    view = key_table(findings, experiment)
    return [view if view.rows else Paragraphs(["No number was identified."])]


def _section(section: Section) -> Iterator[Block | Figure]:
    for block in section.blocks:
        if isinstance(block, Figure):
            if block.panels:
                yield block
        elif isinstance(block, Table):
            yield table_view(block)
        else:
            yield Paragraphs([typeset(text) for text in block.paragraphs])


def _quality(findings: Findings) -> list[Block | Figure]:
    tables = _some(
        quality_table(findings.quality, findings.runs) if findings.quality else None, repairs_table(findings.runs)
    )
    return tables or [Paragraphs(["Nothing was noticed, and nothing was repaired."])]


def _runs(findings: Findings, experiment: Experiment) -> list[Block | Figure]:
    if not findings.runs:
        return []
    tables, same = runs_tables(findings.runs, experiment)
    return [*tables, Paragraphs([same])] if same else [*tables]


def _methods(findings: Findings, experiment: Experiment) -> list[Block | Figure]:
    blocks: list[Block | Figure] = [
        Paragraphs([typeset(text) for text in (*experiment.methods(findings), stated(findings, experiment))])
    ]
    if experiment.equations:
        blocks.append(equations(experiment.equations))
    if experiment.references:
        blocks.append(Listed([citation(reference) for reference in experiment.references], numbered=True))
        blocks.append(Code("The same as BibTeX", bibtex(experiment.references)))
    return blocks


def _repeat(findings: Findings, experiment: Experiment, command: str, revision: str) -> list[Block | Figure]:
    blocks: list[Block | Figure] = [Code("Command", _abridged(command))]
    by_hand, known, exact = steps(findings), check(findings), versions(findings, revision)
    if by_hand:
        needed = (
            "the recipe, the logs and the findings used"
            if findings.provenance.get("uses")
            else "the recipe and the logs"
        )
        blocks.append(Code(f"The same step by step, in a folder that holds {needed}", by_hand))
    elif known:
        blocks.append(Code("Are the files those that were read?", known))
    if exact:
        blocks.append(Code("The same versions", exact))
        blocks.append(
            Paragraphs(
                [
                    "With the same code and libraries the findings are the same, bit for bit; rigfit compare tells what differs."
                ]
            )
        )
    facts = list(_facts(findings.provenance))
    if facts:
        blocks.append(Facts(facts))
    if findings.settings:
        blocks.append(_settings_table(findings.settings, experiment))
    return [*blocks, *_some(logs_table(findings))]


def _abridged(command: str) -> str:
    """Return a command that names very many logs by its beginning and its end."""
    words = command.split(" ")
    more = len(words) - 2 * MOST_TOLD
    if more <= 0:
        return command
    return " ".join([*words[:MOST_TOLD], f"… {more} more words …", *words[-MOST_TOLD:]])


_FACTS = {
    "recipe_sha256": "recipe's content, sha256 without comments and order",
    "code_sha256": "code that made the numbers, sha256",
}


def _facts(provenance: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Put provenance into words; the hashes of files stand elsewhere."""
    for name, value in provenance.items():
        if name in ("logs", "uses") and isinstance(value, Mapping):
            continue
        if isinstance(value, Mapping):
            entries = [f"{key} {_told(entry)}" for key, entry in value.items()]
        else:
            entries = [_told(entry) for entry in value] if isinstance(value, list | tuple) else [_told(value)]
        words = listing(entries, MOST_TOLD) if entries else ""
        if words:
            yield _FACTS.get(name) or clean(str(name)).replace("_", " "), clean(words)


def _told(value: Any) -> str:
    if value is None:
        return "none"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)


def _settings_table(settings: Mapping[str, Any], experiment: Experiment) -> TableView:
    declared = experiment.settings.model_fields
    rows: list[list[Cell]] = [
        [
            Markup("<code>{}</code>").format(clean(name)),
            _told(value),
            (declared[name].description or "") if name in declared else "",
        ]
        for name, value in settings.items()
    ]
    columns = [Column("Setting"), Column("Value"), Column("What it sets")]
    shown = 3 if any(row[2] for row in rows) else 2
    return table_view(Table("settings", "Settings", "", columns[:shown], rows))
