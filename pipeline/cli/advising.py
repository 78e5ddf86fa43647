"""`rigfit advise`: the runs that would tell most beside those a campaign has, and what they would do to its intervals."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from dataclasses import asdict

import click

from pipeline.cli.findings_of import findings_of
from pipeline.errors import InputError, counted, listing
from pipeline.report.numbers import plain
from pipeline.report.parameters import condition_text, unit_of_condition
from pipeline.report.reading_units import reading_unit
from pipeline.report.words import clean
from pipeline.rigs.advice import Advice, Proposal, Shrinkage
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import all_experiments
from pipeline.rigs.registry import experiment as find_experiment

_WIDTH = 96
_TOLD = 8  # intervals of one proposal
_WORTH_TELLING = 1.05  # times smaller


def advise(campaign: str, as_json: bool) -> None:
    """Print what to measure next for a campaign, or a findings.json."""
    findings, _ = findings_of(campaign)
    experiment = find_experiment(findings.experiment)
    if experiment.advise is None:
        able = [one.id for one in all_experiments().values() if one.advise is not None]
        said = f" Its report says what it lacks: {' '.join(findings.advice)}" if findings.advice else ""
        raise InputError(f"{experiment.id} proposes no runs; {listing(able)} can.{said}")
    advice = experiment.advise(findings)
    if as_json:
        click.echo(json.dumps(asdict(advice), indent=1, ensure_ascii=False))
        return
    for line in _lines(clean(findings.campaign), advice, experiment):
        click.echo(line)


def _lines(campaign: str, advice: Advice, experiment: Experiment) -> Iterator[str]:
    if not advice.proposals:
        yield f"{campaign} ({experiment.id}): no run that this rig can make would shrink an interval by much."
    else:
        yield f"{campaign} ({experiment.id}): what to measure next, what tells most of all parameters together first."
        yield "Below each run the standard errors that it shrinks: now -> with it."
    for number, proposal in enumerate(advice.proposals, 1):
        yield ""
        yield from _wrapped(f"{number}. {_how(proposal, experiment)}", "   ")
        yield from _wrapped(f"   {clean(proposal.why)}", "   ")
        told = [one for one in proposal.shrinks if one.factor is None or one.factor >= _WORTH_TELLING][:_TOLD]
        width = max((len(_name(one, experiment)) for one in told), default=0)
        yield from (f"     {_name(one, experiment):{width}}  {_shrunk(one)}" for one in told)
    for remark in advice.remarks:
        yield ""
        yield from _wrapped(clean(remark), "")


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, subsequent_indent=indent)


def _how(proposal: Proposal, experiment: Experiment) -> str:
    parts = (
        f"{clean(name).replace('_', ' ')} {_condition(name, value, experiment)}"
        for name, value in proposal.conditions.items()
    )
    return f"{counted(proposal.runs, 'run')} with {', '.join(parts)}"


def _condition(name: str, value: float | str, experiment: Experiment) -> str:
    return condition_text(value, unit_of_condition(experiment, name))


def _name(one: Shrinkage, experiment: Experiment) -> str:
    at = ", ".join(f"{key.replace('_', ' ')} {_condition(key, value, experiment)}" for key, value in one.at.items())
    return clean(f"{one.name} at {at}" if at else one.name)


def _shrunk(one: Shrinkage) -> str:
    unit = reading_unit(one.unit, one.now or one.then or 0.0)
    now, then = ("not determined" if v is None else plain(v / unit.size, 2) for v in (one.now, one.then))
    factor = f"   {one.factor:.1f} times smaller" if one.factor is not None else ""
    return f"{now} -> {then} {unit.name}".rstrip() + factor
