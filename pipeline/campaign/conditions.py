"""Conditions of a run, from the four places that may give them, the first one winning:

``runs.csv`` (a line a run), the log itself, the file name by the recipe's pattern, a constant in the
recipe. Where two places disagree, that is said.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError, listing, nearest
from pipeline.ingest.reader import RawLog
from pipeline.ingest.said import said_by
from pipeline.recording import Condition, QualityFinding
from pipeline.recording.units import conversion, is_unit, quantity
from pipeline.rigs.experiment import ConditionSpec

if TYPE_CHECKING:
    from pipeline.campaign.recipe import Recipe
    from pipeline.campaign.runs_table import RunsTable

# What the logs of synthetic rigs say of themselves, whatever the experiment.
SYNTHETIC = ConditionSpec("synthetic", "", "true where a synthetic rig made the log: nothing was measured")

DEFAULT = "the experiment's default"
HEADING = re.compile(r"^\s*(.*?)\s*(?:[\[(]\s*([^\])]*)\s*[\])])?\s*$")
_TRUE, _FALSE = {"true", "yes", "ja", "oui", "on"}, {"false", "no", "nein", "non", "off"}


@dataclass(frozen=True)
class Conditions:
    """Conditions of one run in SI, where each came from, and what was odd about them."""

    values: Mapping[str, Condition]
    sources: Mapping[str, str]
    notes: Sequence[QualityFinding] = field(default_factory=tuple)


def of_logs(
    run: str, recipe: Recipe, table: RunsTable | None, logs: Sequence[RawLog], file_names: Sequence[str]
) -> Conditions:
    """Gather the conditions of one run as `of_run` does, from all that its opened logs say, and note what is odd there.

    Raises
    ------
    InputError
        As `of_run`.
    """
    names = {spec.name for spec in recipe.experiment.channels}
    names |= {entry.channel for entry in recipe.channels.values() if entry.channel is not None}
    said = said_by(logs, (*recipe.experiment.conditions, SYNTHETIC), names)
    found = of_run(run, recipe, table, said.metadata, file_names)
    varying = [_said_varying(name, text, found) for name, text in said.varying.items()]
    return replace(found, notes=(*said.notes, *varying, *found.notes))


def _said_varying(name: str, text: str, found: Conditions) -> QualityFinding:
    """Say of a column with a condition's name that it gives none: a warning where nothing else does."""
    place = found.sources.get(name)
    if place in (None, DEFAULT):
        message = (
            f"{text}: a condition is one number for the whole run, so it gives none. Write '{name}' into runs.csv."
        )
        return QualityFinding("warning", message)
    return QualityFinding("note", f"{text}: it is not taken as '{name}', which {place} gives.")


def of_run(
    run: str, recipe: Recipe, table: RunsTable | None, metadata: Mapping[str, str], file_names: Sequence[str]
) -> Conditions:
    """Gather the conditions of one run.

    Parameters
    ----------
    metadata
        What the log says of itself, as text: ``{"static_load": "52 kN"}``.
    file_names
        The names of the run's files: `runs.csv` may call it by any of them, the recipe's pattern is for the first.

    Raises
    ------
    InputError
        If a value cannot be read, or a required condition is given nowhere; the text then shows all
        four ways to give it.
    """
    specs = (*recipe.experiment.conditions, SYNTHETIC)
    notes: list[QualityFinding] = []
    places = [
        ("runs.csv", table.conditions(run, file_names) if table else {}),
        ("the log", _from_log(metadata, specs, notes)),
        ("the file name", _from_file_name(recipe, file_names[0], notes)),
        ("the recipe", dict(recipe.conditions)),
    ]
    values: dict[str, Condition] = {}
    sources: dict[str, str] = {}
    for place, given in places:
        for name, value in given.items():
            if name not in values:
                values[name], sources[name] = value, place
            elif not same(values[name], value):
                unit = next((spec.unit for spec in specs if spec.name == name), "")
                notes.append(
                    QualityFinding(
                        "warning",
                        f"{name} is {shown(values[name], unit)} by {sources[name]} but {shown(value, unit)} "
                        f"by {place}; {sources[name]} is used.",
                    )
                )
    for spec in specs:
        if spec.name not in values and spec.required:
            raise InputError(_missing(spec, run, recipe))
        if spec.name not in values and spec.default is not None:
            values[spec.name], sources[spec.name] = spec.default, DEFAULT
    return Conditions(values, sources, tuple(notes))


def condition_value(value: Condition | int, spec: ConditionSpec, where: str) -> Condition:
    """Turn a condition as written (``6 A``, ``0.4``, ``true``) into SI; text conditions stay words.

    Raises
    ------
    InputError
        Where a number is expected and there is none, its unit is wrong, or it is outside the range that
        the experiment declares.
    """
    if spec.unit == "":
        return value if isinstance(value, bool) else str(value)
    if isinstance(value, bool):
        raise InputError(f"{where}: is {str(value).lower()}, expected is a number{_in(spec)}: {spec.description}.")
    number = quantity(value, spec.unit, where)
    if number not in spec.range:
        taken = shown(number, spec.unit if spec.unit != "1" else "")
        as_si = f" (taken as {taken})" if str(value) != taken else ""
        raise InputError(
            f"{where}: '{value}'{as_si} cannot be. It is: {spec.description}; plausible is {spec.range.told(spec.unit)}. "
            f"Mend the number{' or its unit' if spec.unit != '1' else ''}."
        )
    return number


def _in(spec: ConditionSpec) -> str:
    return f" in {spec.unit}" if spec.unit not in ("", "1") else ""


def spec_for(name: str, specs: Iterable[ConditionSpec]) -> ConditionSpec | None:
    """Return the condition meant by a heading: case, blanks and dashes do not matter."""
    plain = re.sub(r"[\s\-]+", "_", name.strip()).lower()
    return next((spec for spec in specs if spec.name.lower() == plain), None)


def value_of(text: str, unit: str | None, spec: ConditionSpec, where: str) -> Condition:
    """Read a condition from text; `unit` is that of the heading, used where the text bears none."""
    text = text.strip()
    if spec.unit == "":
        low = text.lower()
        return True if low in _TRUE else False if low in _FALSE else text
    bare = re.fullmatch(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?", text)
    return condition_value(f"{text} {unit}" if bare and unit else text, spec, where)


def _from_log(
    metadata: Mapping[str, str], specs: Sequence[ConditionSpec], notes: list[QualityFinding]
) -> dict[str, Condition]:
    found: dict[str, Condition] = {}
    for key, text in metadata.items():
        match = HEADING.match(key)
        name, unit = (match[1], match[2]) if match else (key, None)
        spec = spec_for(name.rsplit(".", 1)[-1], specs)
        if spec is None or not str(text).strip():
            continue
        try:
            found[spec.name] = value_of(str(text), unit, spec, f"condition '{key}' in the log")
        except InputError as error:
            notes.append(QualityFinding("warning", f"{error} It is not used."))
    return found


def _from_file_name(recipe: Recipe, file_name: str, notes: list[QualityFinding]) -> dict[str, Condition]:
    if recipe.file_name is None:
        return {}
    pattern, units = name_pattern(recipe)
    stem = Path(file_name).stem
    match = pattern.fullmatch(stem) or pattern.search(file_name)
    unfit = f"the file name '{file_name}' does not fit the recipe's pattern '{recipe.file_name}'"
    if match is None:
        notes.append(QualityFinding("warning", f"{unfit}."))
        return {}
    left_over = [part for part in (stem[: match.start()], stem[match.end() :]) if part]
    if not _is_parted(file_name, match):
        beside = listing(f"'{part}'" for part in left_over)
        notes.append(
            QualityFinding(
                "warning",
                f"{unfit}: '{match[0]}' would, but {beside} is left over and nothing parts the two. No condition is taken "
                "from this name; let the pattern tell all of it, or part what it leaves out by '_'.",
            )
        )
        return {}
    if any(letter.isdigit() for part in left_over for letter in part):
        beside = listing(f"'{part}'" for part in left_over)
        notes.append(
            QualityFinding("note", f"{beside} in the file name '{file_name}' is outside the recipe's pattern.")
        )
    found: dict[str, Condition] = {}
    for name, text in match.groupdict().items():
        spec = recipe.experiment.condition(name)
        assert spec is not None  # name_pattern has checked it
        text = text.replace("p", ".") if spec.unit else text
        found[name] = value_of(text, units[name], spec, f"{file_name}, condition '{name}'")
    return found


def _is_parted(file_name: str, match: re.Match[str]) -> bool:
    """Tell whether a match begins and ends where the name does, or at a sign that parts words; decimal signs do not."""
    before, after = file_name[: match.start()][-1:] + match[0][:1], match[0][-1:] + file_name[match.end() :][:2]
    begins = match.start() == 0 or not all(letter.isalnum() for letter in before)
    ends = match.end() == len(file_name) or not (
        all(letter.isalnum() for letter in after[:2]) or re.fullmatch(r".[.,]\d", after)
    )
    return begins and ends


def name_pattern(recipe: Recipe) -> tuple[re.Pattern[str], dict[str, str | None]]:
    """Return the regular expression of a pattern such as ``sh_{frequency}Hz_{amplitude:mm}`` and the units in it.

    A unit stands behind a colon, or follows the placeholder as text (``{frequency}Hz``); else SI.

    Raises
    ------
    InputError
        If a placeholder is no condition of the experiment, or there is none.
    """
    known = [spec.name for spec in recipe.experiment.conditions]
    expression, units = "", dict[str, str | None]()
    text = recipe.file_name or ""
    parts = re.split(r"\{(\w*)(?::([^}]*))?\}", text)
    if any(brace in literal for literal in parts[::3] for brace in "{}"):
        raise InputError(
            f"{recipe.path}: file_name: '{text}' has a brace without its partner; a condition stands between two: "
            f"'run_{{{known[0] if known else ''}}}'."
        )
    if len(parts) == 1:
        raise InputError(
            f"{recipe.path}: file_name: '{text}' names no condition; write one in braces, as 'run_{{{known[0] if known else ''}}}'."
        )
    expression += re.escape(parts[0])
    for name, unit, literal in zip(parts[1::3], parts[2::3], parts[3::3], strict=True):
        spec = recipe.experiment.condition(name)
        if spec is None:
            raise InputError(
                f"{recipe.path}: file_name: '{{{name}}}' is no condition of {recipe.experiment.id}."
                f"{nearest(name, known)} Known conditions: {listing(known, 40)}."
            )
        if unit is None and spec.unit:
            follows = re.match(r"\s*([^\W\d_]+)", literal)
            if follows and is_unit(follows[1]) and _measures(follows[1], spec.unit):
                unit = follows[1]
        if unit and spec.unit:
            conversion(unit, spec.unit, f"{recipe.path}: file_name, '{{{name}:{unit}}}'")
        units[name] = unit
        value = r"[-+]?\d+(?:[.,p]\d+)?(?:[eE][-+]?\d+)?" if spec.unit else r"[^_]+?"
        expression += f"(?P<{name}>{value}){re.escape(literal)}"
    return re.compile(expression), units


def _measures(unit: str, si_unit: str) -> bool:
    try:
        conversion(unit, si_unit)
    except InputError:
        return False
    return True


def same(one: Condition, other: Condition) -> bool:
    """Tell whether two values of a condition (SI) are one, but for rounding."""
    if isinstance(one, str) or isinstance(other, str):
        return str(one) == str(other)
    return abs(one - other) <= 1e-6 * max(abs(one), abs(other))


def shown(value: Condition, unit: str) -> str:
    """Return a condition (SI) for a message."""
    return f"{value:.6g} {unit}".strip() if isinstance(value, float) else str(value)


def _missing(spec: ConditionSpec, run: str, recipe: Recipe) -> str:
    example = f"1 {spec.unit}" if spec.unit not in ("", "1") else "1" if spec.unit else "text"
    column = f"{spec.name} [{spec.unit}]" if spec.unit not in ("", "1") else spec.name
    return (
        f"run '{run}': the condition '{spec.name}' ({spec.description}) is missing and {recipe.experiment.id} "
        f"needs it. Give it in one of four ways: a column '{column}' in runs.csv beside the logs; in the log itself as "
        f"a comment line '# {spec.name}: {example}' or MCAP metadata; in the file name, with "
        f"'file_name: \"..._{{{spec.name}}}...\"' in the recipe; "
        f"or as a constant in the recipe, 'conditions: {{{spec.name}: {example}}}'."
    )
