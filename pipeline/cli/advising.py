"""`rigfit advise`: the runs that would tell most beside those a campaign has, and what they would do to its intervals."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from dataclasses import asdict

from pipeline.cli.findings_of import findings_of
from pipeline.cli.saying import say
from pipeline.errors import InputError, listing
from pipeline.report.advice import made_with, name_of, shared_place, shrunk, told
from pipeline.report.words import clean
from pipeline.rigs.advice import Advice, advice_with_caveat
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import all_experiments
from pipeline.rigs.registry import experiment as find_experiment

_WIDTH = 96


def advise(campaign: str, as_json: bool) -> None:
    """Print what to measure next for a campaign, or a findings.json."""
    findings, _ = findings_of(campaign)
    experiment = find_experiment(findings.experiment)
    if experiment.advise is None:
        able = [one.id for one in all_experiments().values() if one.advise is not None]
        said = f" Its report says what it lacks: {' '.join(findings.advice)}" if findings.advice else ""
        raise InputError(f"{experiment.id} proposes no runs; {listing(able)} can.{said}")
    advice = advice_with_caveat(experiment.advise, findings)
    if as_json:
        say(json.dumps(asdict(advice), indent=1, ensure_ascii=False))
        return
    for line in _lines(clean(findings.campaign), advice, experiment):
        say(line)


def _lines(campaign: str, advice: Advice, experiment: Experiment) -> Iterator[str]:
    if not advice.proposals:
        why = "" if advice.remarks else " None that this rig can make would shrink an interval by much."
        yield f"{campaign} ({experiment.id}): no run is proposed.{why}"
    else:
        yield f"{campaign} ({experiment.id}): what to measure next, what tells most of all parameters together first."
        yield "Below each run the standard errors that it shrinks: now -> with it."
    for number, proposal in enumerate(advice.proposals, 1):
        yield ""
        yield from _wrapped(f"{number}. {made_with(proposal, experiment)}", "   ")
        yield from _wrapped(f"   {clean(proposal.why)}", "   ")
        shown = told(proposal)
        if place := shared_place(shown, experiment):
            yield f"   At {place}:"
        names = [name_of(one, shown, experiment) for one in shown]
        width = max(map(len, names), default=0)
        for name, one in zip(names, shown, strict=True):
            factor = f"   {one.factor:.1f} times smaller" if one.factor is not None else ""
            yield f"     {name:{width}}  {shrunk(one)}{factor}"
    for remark in advice.remarks:
        yield ""
        yield from _wrapped(clean(remark), "")


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, subsequent_indent=indent)
