"""What to measure next in words: how a proposed run is made, and what it does to the standard errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Table
from pipeline.report.numbers import plain
from pipeline.report.parameters import condition_text, unit_of_condition
from pipeline.report.reading_units import reading_unit
from pipeline.report.table import TableView, table_view
from pipeline.report.words import clean
from pipeline.rigs.advice import Proposal, Shrinkage, caveat
from pipeline.rigs.experiment import Experiment

_WORTH_TELLING = 1.05  # times smaller
_TOLD = 8  # intervals of one proposal
_ROWS = 3


def made_with(proposal: Proposal, experiment: Experiment) -> str:
    """Return how the runs are made: ``1 run with frequency 27 Hz, coil current 2 A``."""
    parts = (
        f"{clean(name).replace('_', ' ')} {_value(name, v, experiment)}" for name, v in proposal.conditions.items()
    )
    return f"{counted(proposal.runs, 'run')} with {', '.join(parts)}"


def told(proposal: Proposal) -> list[Shrinkage]:
    """Return what of a proposal is worth telling: what it newly determines, and what shrinks by more than 5 %."""
    return [one for one in proposal.shrinks if one.factor is None or one.factor >= _WORTH_TELLING][:_TOLD]


def shared_place(shown: Sequence[Shrinkage], experiment: Experiment) -> str:
    """Return the part of the operating point that all of them have in common."""
    return _place(_common(shown), experiment)


def name_of(one: Shrinkage, shown: Sequence[Shrinkage], experiment: Experiment) -> str:
    """Return the parameter with what of its operating point is not common to all that are `shown`."""
    own = _place({key: value for key, value in one.at.items() if key not in _common(shown)}, experiment)
    return f"{clean(one.name)} at {own}" if own else clean(one.name)


def _common(shown: Sequence[Shrinkage]) -> dict[str, float | str | bool]:
    first = shown[0].at if len(shown) > 1 else {}
    return {key: value for key, value in first.items() if all(one.at.get(key) == value for one in shown)}


def _place(at: Mapping[str, float | str | bool], experiment: Experiment) -> str:
    return ", ".join(f"{clean(key).replace('_', ' ')} {_value(key, value, experiment)}" for key, value in at.items())


def shrunk(one: Shrinkage) -> str:
    """Return the standard error now and then: ``374 -> 280 mN·s/m``."""
    unit = reading_unit(one.unit, one.now or one.then or 0.0)
    now, then = ("not determined" if v is None else plain(v / unit.size, 2) for v in (one.now, one.then))
    return f"{now} -> {then} {unit.name}".rstrip()


def proposals_table(findings: Findings, experiment: Experiment) -> TableView | None:
    """List the most telling runs; None where the experiment proposes none."""
    if experiment.advise is None:
        return None
    proposals = experiment.advise(findings).proposals[:_ROWS]
    rows: list[list[Cell]] = [[made_with(p, experiment), clean(p.why), _errors(told(p), experiment)] for p in proposals]
    caption = (
        "From the Fisher information of the fitted model: what tells most of all parameters together comes first. "
        f"{caveat(findings)} More with: rigfit advise {clean(findings.campaign)}."
    )
    columns = [Column("Run to add"), Column("Why"), Column("Standard errors, now → then")]
    return table_view(Table("proposals", "Runs that would tell most", caption, columns, rows)) if rows else None


def _errors(shown: Sequence[Shrinkage], experiment: Experiment) -> str:
    place = shared_place(shown, experiment)
    names = listing((f"{name_of(one, shown, experiment)}: {shrunk(one)}".replace("->", "→") for one in shown), 4)
    return f"At {place}: {names}" if place else names


def _value(name: str, value: float | str | bool, experiment: Experiment) -> str:
    return condition_text(value, unit_of_condition(experiment, name))
