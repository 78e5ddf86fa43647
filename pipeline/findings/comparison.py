"""Two findings of one experiment held against each other: what changed, by how much, and what may have caused it.

Nothing is judged here. Findings from the same logs share their errors, so that a difference between them has no
standard error of its own: it is told in standard errors of the findings, which is a measure of size and no test.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pipeline.errors import InputError, listing
from pipeline.findings.findings import Findings, ModelResult, OperatingPoint, Parameter, Published, Quality

NEAR = 0.01  # operating points of other data are the same place within this share of the larger
_NUMBER = re.compile(r"[+\-−]?\d+(?:\.\d+)?(?:[eE][+\-]?\d+)?")

_NAMED = 8  # runs

Kind = Literal["changed", "same", "determined now", "not determined now", "not determined", "new", "gone"]


@dataclass(frozen=True)
class Change:
    """One parameter before and after; None where one of the two findings does not have it.

    Attributes
    ----------
    error
        What the difference is measured by (SI): the larger of the two standard errors where the findings share logs,
        the root of the sum of their squares where they share none. None where neither has one.
    """

    before: Parameter | None
    after: Parameter | None
    error: float | None = None

    @property
    def parameter(self) -> Parameter:
        """The parameter as it is now, as it was where it is gone."""
        found = self.after or self.before
        if found is None:
            raise LookupError("a change of nothing")
        return found

    @property
    def kind(self) -> Kind:
        """What became of it."""
        if self.before is None:
            return "new"
        if self.after is None:
            return "gone"
        if self.before.value is None:
            return "not determined" if self.after.value is None else "determined now"
        if self.after.value is None:
            return "not determined now"
        told = [(p.value, p.std_error, p.ci95) for p in (self.before, self.after)]
        return "same" if told[0] == told[1] else "changed"

    @property
    def difference(self) -> float | None:
        """After minus before, SI; None where one of them is not told."""
        if self.before is None or self.after is None or self.before.value is None or self.after.value is None:
            return None
        return self.after.value - self.before.value

    @property
    def ratio(self) -> float | None:
        """The difference over `error`; None where one of the two is not told."""
        return None if self.difference is None or not self.error else self.difference / self.error


@dataclass(frozen=True)
class Logs:
    """By content: how many log files both findings rest on, and which only one of them does."""

    common: int
    only_before: Sequence[str]
    only_after: Sequence[str]

    @property
    def shared(self) -> Literal["all", "some", "none", "unknown"]:
        """How far the two rest on the same data; unknown where neither names its logs."""
        if not self.common:
            return "none" if self.only_before and self.only_after else "unknown"
        return "some" if self.only_before or self.only_after else "all"


@dataclass(frozen=True)
class Difference:
    """Something besides the numbers that is not the same: a setting, a version, the recipe. '' where one has it not."""

    what: str
    before: str
    after: str


@dataclass(frozen=True)
class Comparison:
    """Two findings of one experiment and what is different between them."""

    before: Findings
    after: Findings
    logs: Logs
    changes: Sequence[Change]
    causes: Sequence[Difference]
    quality_came: Sequence[Quality]
    quality_went: Sequence[Quality]
    claims: Sequence[tuple[Published, Published]]

    def of(self, *kinds: Kind) -> list[Change]:
        """Return the parameters that became one of `kinds`; those that moved most (in standard errors) first."""
        found = [change for change in self.changes if change.kind in kinds]
        return sorted(found, key=lambda change: -abs(change.ratio or 0.0))

    @property
    def alike(self) -> bool:
        """Whether nothing is different but perhaps the sources of the numbers (versions, hashes)."""
        numbers = all(change.kind in ("same", "not determined") for change in self.changes)
        words = not (self.quality_came or self.quality_went or self.claims)
        return numbers and words and self.before.verdict == self.after.verdict


def compare(before: Findings, after: Findings) -> Comparison:
    """Hold two findings against each other.

    Raises
    ------
    InputError
        If they are of different experiments.
    """
    if before.experiment != after.experiment:
        raise InputError(
            f"'{before.campaign}' is a campaign of {before.experiment}, '{after.campaign}' one of {after.experiment}: their "
            "parameters are not the same quantities. Compare findings of one experiment."
        )
    logs = _logs(before, after)
    independent = logs.shared == "none"
    changes = [Change(a, b, _error(a, b, independent)) for a, b in _pairs(before.parameters, after.parameters)]
    came, went = _quality(before.quality, after.quality)
    return Comparison(before, after, logs, changes, _causes(before, after), came, went, _claims(before, after))


def _error(before: Parameter | None, after: Parameter | None, independent: bool) -> float | None:
    errors = [p.std_error for p in (before, after) if p is not None and p.std_error]
    if not errors:
        return None
    return math.hypot(*errors) if independent else max(errors)


def _logs(before: Findings, after: Findings) -> Logs:
    old, new = (
        {digest: path for run in findings.runs for path, digest in zip(run.files, run.sha256, strict=False) if digest}
        for findings in (before, after)
    )
    return Logs(
        len(old.keys() & new.keys()),
        [path for digest, path in old.items() if digest not in new],
        [path for digest, path in new.items() if digest not in old],
    )


def _pairs(before: Sequence[Parameter], after: Sequence[Parameter]) -> list[tuple[Parameter | None, Parameter | None]]:
    """Pair parameters of one name and operating point; of those left over, the only ones that are near each other."""
    old, new = _placed(before), _placed(after)
    partner = {key: key for key in new if key in old}
    left_old, left_new = ([key for key in keys if key not in partner] for keys in (old, new))
    by_kind: dict[Hashable, list[Hashable]] = {}
    for key in left_old:
        by_kind.setdefault(_kind(old[key]), []).append(key)
    near = {key: [k for k in by_kind.get(_kind(new[key]), ()) if _near(old[k].at, new[key].at)] for key in left_new}
    wanted = Counter(k for keys in near.values() for k in keys)
    partner |= {key: keys[0] for key, keys in near.items() if len(keys) == 1 and wanted[keys[0]] == 1}
    pairs: list[tuple[Parameter | None, Parameter | None]] = [
        (old[partner[key]] if key in partner else None, parameter) for key, parameter in new.items()
    ]
    taken = set(partner.values())
    return [*pairs, *((parameter, None) for key, parameter in old.items() if key not in taken)]


def _placed(parameters: Sequence[Parameter]) -> dict[Hashable, Parameter]:
    """Return parameters by name and place; one that is told twice for one place by its turn besides."""
    placed: dict[Hashable, Parameter] = {}
    turns: Counter[Hashable] = Counter()
    for parameter in parameters:
        place = (parameter.name, tuple(sorted(parameter.at.items())))
        placed[(*place, turns[place])] = parameter
        turns[place] += 1
    return placed


def _kind(parameter: Parameter) -> Hashable:
    """Return what must be the same in any case: the name, and what of the place is no measured number."""
    words = [(key, None if _is_number(value) else value) for key, value in sorted(parameter.at.items())]
    return parameter.name, tuple(words)


def _near(a: OperatingPoint, b: OperatingPoint) -> bool:
    return all(
        abs(float(a[key]) - float(b[key])) <= NEAR * max(abs(float(a[key])), abs(float(b[key])))
        for key in a
        if _is_number(a[key])
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _quality(before: Sequence[Quality], after: Sequence[Quality]) -> tuple[list[Quality], list[Quality]]:
    """Return what came and what went; a sentence that only has other numbers is the same."""
    old, new = (Counter(map(_said, quality)) for quality in (before, after))
    return _beyond(after, old), _beyond(before, new)


def _said(quality: Quality) -> Hashable:
    return quality.level, quality.run, quality.channel, without_numbers(quality.message)


def without_numbers(sentence: str) -> str:
    """Return a sentence with a sign for every number, so that the same sentence of other numbers is the same."""
    return _NUMBER.sub("#", sentence)


def _beyond(quality: Sequence[Quality], known: Counter[Hashable]) -> list[Quality]:
    left = known.copy()
    beyond = []
    for one in quality:
        left[_said(one)] -= 1
        if left[_said(one)] < 0:
            beyond.append(one)
    return beyond


def _claims(before: Findings, after: Findings) -> list[tuple[Published, Published]]:
    """Return published claims that are judged otherwise than before."""
    old = {(claim.name, claim.where): claim for claim in before.published}
    pairs = ((old[claim.name, claim.where], claim) for claim in after.published if (claim.name, claim.where) in old)
    return [(a, b) for a, b in pairs if a.agrees != b.agrees]


def _causes(before: Findings, after: Findings) -> list[Difference]:
    """Return what besides the logs is different: settings, calibration, runs used, models, recipe, versions."""
    found = [
        *_entries("setting", before.settings, after.settings),
        *_entries("calibration of", before.calibration, after.calibration),
    ]
    used = [{run.run for run in findings.runs if run.used} for findings in (before, after)]
    if used[0] != used[1]:
        found.append(Difference("runs used", *(listing(sorted(names), _NAMED) for names in used)))
    models = [_selected(findings.models) for findings in (before, after)]
    found += _entries("model of", *models)
    told = [_provenance(findings) for findings in (before, after)]
    return [*found, *_entries("", *told)]


def _selected(models: Sequence[ModelResult]) -> dict[str, str]:
    chosen: dict[str, list[str]] = {}
    for model in models:
        if model.selected:
            chosen.setdefault(model.family or "the data", []).append(model.name)
    return {family: ", ".join(names) for family, names in chosen.items()}


def _provenance(findings: Findings) -> dict[str, Any]:
    told = {name: value for name, value in findings.provenance.items() if name not in ("logs", "libraries")}
    libraries = findings.provenance.get("libraries")
    more = libraries.items() if isinstance(libraries, Mapping) else ()
    return told | {f"version of {name}": value for name, value in more}


def _entries(what: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Difference]:
    names = [*before, *(name for name in after if name not in before)]
    return [
        Difference(f"{what} {name}" if what else name.replace("_", " "), _told(before, name), _told(after, name))
        for name in names
        if before.get(name) != after.get(name) or (name in before) != (name in after)
    ]


def _told(entries: Mapping[str, Any], name: str) -> str:
    if name not in entries:
        return ""
    value = entries[name]
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {entry}" for key, entry in value.items())
    return "none" if value is None else str(value)
