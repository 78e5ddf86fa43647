"""What is said many times is said once: with how often, of which runs, and from which number to which.

For the reasons, quality findings and remarks of campaigns of very many runs; few sentences stay as they are.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pipeline.errors import counted, listing
from pipeline.report.words import clean, typeset

MOST_TOLD = 40  # sentences that are told one by one
_NAMED, _FOLDED = 4, 200  # runs named at once, and on demand
_RUN, _NUMBER = "\x00", "\x01"
_WORD = re.compile(r"'[^']+'|\w[\w.\-]*")
_DIGITS = re.compile(r"(?<![\w\x00.])[+\-−]?\d+(?:\.\d+)?(?:[eE][+\-]?\d+)?(?!\w|\.\d)")


@dataclass(frozen=True)
class Gathered:
    """Sentences that differ in numbers and names of runs only.

    Attributes
    ----------
    text
        One for all: "the force is clipped at 5 … 990 N", names that differ as '…'.
    places
        Which of the sentences these are.
    runs
        The runs that they name, each once.
    """

    text: str
    places: Sequence[int]
    runs: Sequence[str]


def gathered(texts: Sequence[str], runs: Collection[str], apart: Sequence[object] | None = None) -> list[Gathered]:
    """Gather sentences, in the order in which the first of each kind comes.

    Parameters
    ----------
    texts
        The sentences, shape (n,).
    runs
        Names of the runs of the campaign. One that is a number counts as a name only between quotes.
    apart
        What must be the same besides (a level, a channel), shape (n,).
    """
    runs = runs if isinstance(runs, set | frozenset) else set(runs)
    kinds: dict[tuple[str, object], list[int]] = {}
    found: list[tuple[list[str], list[str]]] = []
    for place, text in enumerate(texts):
        kind, names, numbers = _kind(text, runs)
        kinds.setdefault((kind, apart[place] if apart is not None else None), []).append(place)
        found.append((names, numbers))
    return [_one_for_all(kind, places, found) for (kind, _), places in kinds.items()]


def _kind(text: str, runs: Collection[str]) -> tuple[str, list[str], list[str]]:
    """Return the sentence without its names of runs and its numbers, and these."""
    names: list[str] = []
    numbers: list[str] = []

    def name(match: re.Match[str]) -> str:
        word = match[0]
        bare = word[1:-1] if word.startswith("'") else word.rstrip(".-")
        if bare not in runs or (bare == word and bare.replace(".", "").isdigit()):
            return word
        names.append(bare)
        return word.replace(bare, _RUN, 1)

    def number(match: re.Match[str]) -> str:
        numbers.append(match[0])
        return _NUMBER

    text = text.replace(_RUN, "").replace(_NUMBER, "")
    return _DIGITS.sub(number, _WORD.sub(name, text)), names, numbers


def _one_for_all(kind: str, places: Sequence[int], found: Sequence[tuple[list[str], list[str]]]) -> Gathered:
    names = zip(*(found[place][0] for place in places), strict=True)
    numbers = zip(*(found[place][1] for place in places), strict=True)
    slots = {_RUN: iter([_same(slot) for slot in names]), _NUMBER: iter([_range(slot) for slot in numbers])}
    text = "".join(next(slots[part]) if part in slots else part for part in re.split(f"([{_RUN}{_NUMBER}])", kind))
    return Gathered(text, places, list(dict.fromkeys(name for place in places for name in found[place][0])))


def _same(texts: Sequence[str]) -> str:
    return texts[0] if len(set(texts)) == 1 else "…"


def _range(texts: Sequence[str]) -> str:
    if len(set(texts)) == 1:
        return texts[0]
    ordered = sorted(set(texts), key=lambda text: float(text.replace("−", "-")))
    return f"{ordered[0]} … {ordered[-1]}"


def told(texts: Sequence[str], runs: Iterable[str]) -> list[str]:
    """Return sentences fit to be listed: up to 40 as they are, more gathered, with how often and of which runs."""
    texts = [typeset(text) for text in texts]
    if len(texts) <= MOST_TOLD:
        return texts
    lines = []
    for one in gathered(texts, set(runs)):
        times = len(one.places)
        of = f": {listing(one.runs, _NAMED)}" if len(one.runs) > 1 else ""
        lines.append(one.text if times == 1 else f"{one.text} ({times} times{of})")
    more = len(lines) - MOST_TOLD
    return lines if more <= 0 else [*lines[:MOST_TOLD], f"{counted(more, 'more sentence')} in findings.json."]


def runs_cell(runs: Sequence[str]) -> str:
    """Return names of runs for a cell: up to 40 as they are, of more the number and the first, the others on demand."""
    if len(runs) <= MOST_TOLD:
        return ", ".join(clean(run) for run in runs)
    return Markup("<details><summary>{} runs: {} …</summary>{}</details>").format(
        len(runs), clean(", ".join(runs[:_NAMED])), clean(listing(runs, _FOLDED))
    )
