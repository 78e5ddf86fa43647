"""What a verdict says of many runs: what changes over the campaign, runs unlike the others, faults by kind and not run by run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.estimation.course import Change
from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers
from pipeline.rigs.gearbox.many.watched import unlike
from pipeline.rigs.gearbox.outcome.core_numbers import kind_of
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.number_over_runs import OverRuns

# Kinds of faults, runs by name, and steps that are told.
_KINDS, _NAMES, _STEPS = 5, 6, 4
# Changes of less than this share are not told in the verdict.
_SLIGHT = 0.005
# Steps and spells of several numbers within so many runs are one event.
_ONE_EVENT = 3
# A number in which such a share of a spell's runs is odd, each by itself, shows that spell too.
_MOST_OF_SPELL = 2.0 / 3.0


def over_campaign(said: Judgement, campaign: CampaignNumbers) -> None:
    """Say what changes over the campaign, and which runs are unlike the others."""
    drifts = [
        _change(number, change)
        for number in campaign.watched
        for change in number.course.changes
        if change.kind == "drift" and _matters(number, change)
    ]
    if drifts:
        said.warn(
            f"Over the campaign drift, from the first run to the last: {listing(drifts, 12)}. Wear, warming or a sensor's gain; means over the "
            "runs are means over that."
        )
    _steps(said, campaign.watched)
    if campaign.exceptions:
        by_number: dict[str, list[str]] = {}
        for run, what in campaign.exceptions.items():
            by_number.setdefault(what, []).append(run)
        names = "; ".join(f"in {what} {listing(runs, _NAMES)}" for what, runs in by_number.items())
        verb = "is" if len(campaign.exceptions) == 1 else "are"
        said.warn(
            f"{counted(len(campaign.exceptions), 'run')} of {len(campaign.runs)} {verb} unlike the others, and what the runs share leaves them "
            f"out: {names}."
        )
        return
    odd = unlike(campaign.watched)
    if odd:
        said.warn(
            f"{len(odd)} of {len(campaign.runs)} runs are unlike the others: too many to be exceptions, so what the runs share is a mean over "
            "several kinds of runs. Look which, and identify them apart."
        )


def _steps(said: Judgement, watched: Sequence[OverRuns]) -> None:
    """Say steps and spells, those of several numbers at one place together, the ones that most numbers show first."""
    found = sorted(
        (
            (number, change)
            for number in watched
            for change in number.course.changes
            if change.kind != "drift" and _matters(number, change)
        ),
        key=lambda one: (one[1].kind, one[1].first, one[1].last),
    )
    events: list[list[tuple[OverRuns, Change]]] = []
    for number, change in found:
        before = events[-1][-1][1] if events else None
        if (
            before is not None
            and before.kind == change.kind
            and _near(before.first, change.first)
            and _near(before.last, change.last)
        ):
            events[-1].append((number, change))
        else:
            events.append([(number, change)])
    for event in sorted(events, key=lambda event: (-len(event), event[0][1].first))[:_STEPS]:
        number, change = event[0]
        told = listing([_change(*one) for one in event], 9)
        if change.kind == "spell":
            which = (
                f"From run {number.runs[change.first]} to run {number.runs[change.last]} the runs are off the others"
            )
            told = listing([*(_change(*one) for one in event), *_odd_there(watched, event)], 9)
        else:
            which = f"With run {number.runs[change.first]} the runs step"
        said.warn(f"{which}: {told}. Look what was changed before it.")
    if len(events) > _STEPS:
        said.warn(f"{counted(len(events) - _STEPS, 'more change')} over the campaign stand among the quality findings.")


def _odd_there(watched: Sequence[OverRuns], event: Sequence[tuple[OverRuns, Change]]) -> list[str]:
    """Return the numbers that tell the runs of a spell as odd ones, one by one, and about how far they are off."""
    first, last = event[0][1].first, event[0][1].last
    found = []
    for number in watched:
        odd = [one for one in number.course.odd if first <= one.place <= last]
        if any(number is own for own, _ in event) or len(odd) < _MOST_OF_SPELL * (last - first + 1):
            continue
        middle = sorted(odd, key=lambda one: one.off)[len(odd) // 2]
        found.append(f"{number.what} by about {number.off_text(middle)}")
    return found


def _near(first: int, second: int) -> bool:
    return abs(first - second) <= _ONE_EVENT


def _matters(number: OverRuns, change: Change) -> bool:
    """Tell whether a change is more than clear: what is slight stands among the quality findings alone."""
    whole = _whole(number)
    return not whole or abs(change.size) > _SLIGHT * whole


def _whole(number: OverRuns) -> float:
    """Return what a change is a share of, 0 where it is told in its unit."""
    return 1.0 if number.share else 0.0 if number.grouped else abs(number.course.level)


def _change(number: OverRuns, change: Change) -> str:
    """Return a number and by how much it changes, to stand in a list."""
    whole = _whole(number)
    sizes = (change.size, *change.ci95)
    if whole:
        size, low, high = (f"{100.0 * one / whole:+.2g}" for one in sizes)
        return f"{number.what} by {size} % ({low} to {high} %)"
    unit = "" if number.unit == "1" else f" {number.unit}"
    size, low, high = (f"{one:+.3g}" for one in sizes)
    return f"{number.what} by {size}{unit} ({low} to {high}{unit})"


def by_kind(said: Judgement, left_out: Mapping[str, str], grave: Sequence[QualityFinding]) -> None:
    """Say why runs are left out, and what else was noticed: a sentence for each of the commonest kinds, with its first runs."""
    kinds: dict[str, list[str]] = {}
    for run, reason in left_out.items():
        kinds.setdefault(kind_of(reason.removeprefix(f"run '{run}'")), []).append(run)
    _tell(said, kinds, left_out, "left out")
    kinds, words = {}, dict[str, str]()
    for finding in grave:
        if finding.run is not None:
            channel = f"{finding.channel}: " if finding.channel and finding.channel not in finding.message else ""
            runs = kinds.setdefault(f"{channel}{kind_of(finding.message)}", [])
            if finding.run not in runs:
                runs.append(finding.run)
            words.setdefault(f"{channel}{kind_of(finding.message)} {finding.run}", f"{channel}{finding.message}")
    _tell(said, kinds, words, "")


def _tell(said: Judgement, kinds: Mapping[str, list[str]], words: Mapping[str, str], verb: str) -> None:
    ordered = sorted(kinds.items(), key=lambda one: -len(one[1]))
    for kind, runs in ordered[:_KINDS]:
        first = words.get(f"{kind} {runs[0]}") or words[runs[0]]
        is_ = f" {'is' if len(runs) == 1 else 'are'} {verb}" if verb else ""
        which = f"Run {runs[0]}{is_}" if len(runs) == 1 else f"{len(runs)} runs{is_} ({listing(runs, _NAMES)})"
        said.warn(
            f"{which}: {ended(first)}{' So in the first; numbers differ.' if len(runs) > 1 and kind.count('#') > 1 else ''}"
        )
    if len(ordered) > _KINDS:
        rest = {run for _, runs in ordered[_KINDS:] for run in runs}
        said.warn(
            f"{counted(len(ordered) - _KINDS, 'more kind')} of {'reasons to leave runs out' if verb else 'warnings'}, in "
            f"{counted(len(rest), 'run')}, stand among the quality findings."
        )


def ended(sentence: str) -> str:
    """Return a sentence with its full stop."""
    sentence = sentence.rstrip()
    return sentence if sentence.endswith((".", "?", "!")) else f"{sentence}."
