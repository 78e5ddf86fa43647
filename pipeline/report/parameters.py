"""Identified parameters as tables: the few that matter on top, all of them further down.

Those with one value stand in one list, each in its own unit. Those that vary (with current,
frequency, run) share a table with one row an operating point and one column a parameter.
"""

from __future__ import annotations

import re
import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from markupsafe import Markup

from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Cell, Column, Table, Value
from pipeline.report.numbers import Reading, aligned_readings, plain, range_of, reading
from pipeline.report.per_run import by_place, summed_up
from pipeline.report.reading_units import ReadingUnit, reading_unit, size_of, typical
from pipeline.report.symbols import symbol_html
from pipeline.report.table import MOST_ROWS, PROSE_FROM, Head, Note, Shown, TableView, table_view
from pipeline.report.uncertainty import type_a
from pipeline.report.words import clean, typeset
from pipeline.rigs.experiment import Experiment

# A key parameter with more operating points than that is summed up by its range.
_MOST_KEY_ROWS = 6
_MOST_COLUMNS = 8
_MOST_STAND_INS = 6
_UNDETERMINED = "not determined"
_WHAT_PLUS_MINUS_IS = (
    "± is one standard error in tables and half of the 95 % interval in sentences, unless they say otherwise."
)
_SAID_ALREADY = re.compile(rf"^(?:[^:;,]{{0,40}} (?:is|are) )?{_UNDETERMINED}(?:[:;,] |$)")


def symbol_of(parameter: Parameter) -> Markup:
    """Return the symbol as HTML, the name where there is none."""
    return symbol_html(parameter.symbol) or Markup("<code>{}</code>").format(clean(parameter.name))


def unit_of_condition(experiment: Experiment, name: str) -> str:
    """Return the unit in which a condition, channel or operating point is read, '' for text and for the undeclared.

    A temperature there is an absolute one: it is read in degrees Celsius.
    """
    return experiment.read_as(name)


def place_of(parameter: Parameter, experiment: Experiment) -> str:
    """Return the operating point in words: ``coil current 2 A, run sh_a``."""
    return ", ".join(
        _words(name)
        if value is True
        else f"{_words(name)} {condition_text(value, unit_of_condition(experiment, name))}"
        for name, value in parameter.at.items()
    )


def condition_text(value: float | str | bool, unit: str) -> str:
    """Return a condition with its unit for reading."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return clean(value)
    shown = reading_unit(unit or "1", abs(value))
    return f"{plain(shown.read(value))} {shown.name}".strip()


def key_parameters(findings: Findings, experiment: Experiment) -> list[list[Parameter]]:
    """Return the parameters that the experiment calls key, one list a name, in its order; absent ones are left out.

    Where none of them was looked for, as in a test that is only half of one, the first others stand in.
    """
    found = [
        _of_all_runs([p for p in findings.find(spec.name) if not spec.key_at or spec.key_at in p.at])
        for spec in experiment.parameters
        if spec.key
    ]
    others = [findings.find(spec.name) for spec in experiment.parameters if not spec.key]
    return [parameters for parameters in found if parameters] or [one for one in others if one][:_MOST_STAND_INS]


def _of_all_runs(parameters: list[Parameter]) -> list[Parameter]:
    """Return the value for the whole campaign alone where there is one beside those of single runs.

    Of single runs, those that do not tell what another one tells are left out; where none does, the first stands for all.
    """
    whole = [parameter for parameter in parameters if not parameter.at]
    if whole and all("run" in p.at for p in parameters if p.at):
        return whole
    told = [_without_run(p) for p in parameters if p.value is not None]
    kept: list[Parameter] = []
    for parameter in parameters:
        place = _without_run(parameter)
        if parameter.value is not None or "run" not in parameter.at or place not in told:
            kept.append(parameter)
            told.append(place)
    return kept


def _without_run(parameter: Parameter) -> dict[str, float | str | bool]:
    return {name: value for name, value in parameter.at.items() if name != "run"}


def key_table(findings: Findings, experiment: Experiment) -> TableView:
    """Return the table of the numbers that matter."""
    rows: list[_Row] = []
    for parameters in key_parameters(findings, experiment):
        if len(parameters) > _MOST_KEY_ROWS:
            rows.append(_range_row(parameters, experiment))
            continue
        unit = common_unit(parameters, experiment)
        for parameter in parameters:
            place = place_of(parameter, experiment)
            about = _meaning(parameter, experiment)
            what = Shown(symbol_of(parameter) + (f" at {place}" if place else ""), about)
            rows.append(_Row(what, _reading(parameter, unit), unit.name, _parts(parameter, unit)))
    errors = any(row.found is not None and row.found.error for row in rows)
    return _list_view("key", "Key parameters", rows, caption=_WHAT_PLUS_MINUS_IS if errors else "")


def parameter_tables(findings: Findings, experiment: Experiment) -> list[TableView]:
    """Return every parameter: first those with one value, then one table for each kind of operating point.

    Of more runs than a table shows, the parameters are summed up.
    """
    constant = [parameter for parameter in findings.parameters if not parameter.at]
    groups: dict[tuple[str, ...], list[Parameter]] = {}
    for parameter in findings.parameters:
        if parameter.at:
            groups.setdefault(tuple(sorted(parameter.at)), []).append(parameter)
    views = [_constant_view(constant, experiment)] if constant else []
    for kind, parameters in groups.items():
        if "run" in kind and len({parameter.at["run"] for parameter in parameters}) > MOST_ROWS:
            views.append(_many_runs_view(parameters, experiment, findings.campaign))
        else:
            views += [_varying_view(part, experiment) for part in _narrow_enough(parameters)]
    return views


def _many_runs_view(parameters: Sequence[Parameter], experiment: Experiment, campaign: str) -> TableView:
    by_name: dict[str, list[Parameter]] = {}
    for parameter in parameters:
        by_name.setdefault(parameter.name, []).append(parameter)
    quantities = []
    for name, same in by_name.items():
        unit = common_unit(same, experiment)
        spec = next((spec for spec in experiment.parameters if spec.name == name), None)
        about = clean(spec.description if spec else "")
        parts = by_place(same, MOST_ROWS // len(by_name))
        for part in parts:
            others = {key: value for key, value in part[0].at.items() if key != "run"} if len(parts) > 1 else {}
            place = place_of(part[0].model_copy(update={"at": others}), experiment)
            text = (
                symbol_of(part[0]) + Markup(" <code>{}</code>").format(clean(name)) + (f" at {place}" if place else "")
            )
            quantities.append((Shown(text, about if part is parts[0] else ""), unit, part))
    conditions = "-".join(parameters[0].at)
    return summed_up(f"parameters-{conditions}", quantities, f"rigfit export {clean(campaign)} --to csv")


def _narrow_enough(parameters: Sequence[Parameter]) -> list[list[Parameter]]:
    """Part parameters of the same operating points, by name, into tables that a page is wide enough for."""
    names = list(dict.fromkeys(parameter.name for parameter in parameters))
    tables = max(-(-len(names) // max(_MOST_COLUMNS - len(parameters[0].at), 1)), 1)
    each = -(-len(names) // tables)
    return [
        [parameter for parameter in parameters if parameter.name in names[start : start + each]]
        for start in range(0, len(names), each)
    ]


def common_unit(parameters: Sequence[Parameter], experiment: Experiment) -> ReadingUnit:
    """Return the unit in which parameters of one name read best together."""
    first = parameters[0]
    sizes = typical(size_of(p.value, p.std_error, p.ci95) for p in parameters)
    unit = experiment.parameter_read_as(first.name, first.unit)
    return reading_unit(unit, sizes, typical(p.std_error for p in parameters))


def _reading(parameter: Parameter, unit: ReadingUnit) -> Reading | None:
    if parameter.value is None:
        return None
    return reading(parameter.value, parameter.std_error, parameter.ci95, unit.size, unit.zero)


def _joined(*parts: str) -> str:
    """Return the parts that say something as one sentence; a full stop at the end of the last one stays."""
    told = [part for part in parts if part]
    return "; ".join([*(part.rstrip(".") for part in told[:-1]), *told[-1:]])


def _meaning(parameter: Parameter, experiment: Experiment) -> str:
    """Return what a parameter is and, where it could not be determined, why."""
    spec = next((spec for spec in experiment.parameters if spec.name == parameter.name), None)
    declared = spec.description if spec else ""
    if parameter.value is None:
        return typeset(_joined(clean(declared), _reason(parameter, declared)))
    return typeset(clean(parameter.description) or clean(declared))


def _reason(parameter: Parameter, declared: str) -> str:
    """Return why there is no value, without what stands beside it anyway: what it is, and that it is not determined."""
    reason = clean(parameter.description).rstrip(".")
    if declared and reason.lower().startswith(clean(declared).lower()):
        reason = reason[len(clean(declared)) :].lstrip(" ;:,")
    return _SAID_ALREADY.sub("", reason)


class _Row(NamedTuple):
    """A line of a list of parameters: `parts` tells what its standard error consists of."""

    what: Shown
    found: Reading | None
    unit: str
    parts: str = ""


def _range_row(parameters: Sequence[Parameter], experiment: Experiment) -> _Row:
    unit = common_unit(parameters, experiment)
    known = [parameter for parameter in parameters if parameter.value is not None]
    if not known:
        return _Row(Shown(symbol_of(parameters[0]), _meaning(parameters[0], experiment)), None, unit.name)
    values = [unit.read(parameter.value or 0.0) for parameter in known]
    median = f"median {plain(statistics.median(values))}; " if len(known) > MOST_ROWS else ""
    about = f"{_meaning(known[0], experiment)}; {median}range over {len(known)} operating points, see All parameters"
    return _Row(
        Shown(symbol_of(known[0]), about),
        Reading(range_of(values)),
        unit.name,
    )


def _list_view(
    name: str,
    title: str,
    rows: Sequence[_Row],
    more: Sequence[tuple[Head, list[str]]] = (),
    caption: str = "",
) -> TableView:
    """Lay out parameters one below the other, each in its own unit."""
    values = aligned_readings([row.found for row in rows])
    lines = []
    for number, (row, value) in enumerate(zip(rows, values, strict=True)):
        what = replace(row.what, below=_joined(row.what.below, row.parts))
        shown = Shown(value, row.found.interval, "number") if row.found else Shown(_UNDETERMINED, kind="number missing")
        lines.append(
            [
                what,
                shown,
                Shown(row.unit),
                *(Shown(t[number], kind="prose" if len(t[number]) > PROSE_FROM else "") for _, t in more),
            ]
        )
    heads = [Head("Quantity"), Head("Value ± standard error", "95 % interval", True), Head("Unit")]
    heads += [head for head, _ in more]
    return TableView(name, title, caption, heads, lines)


def _constant_view(parameters: Sequence[Parameter], experiment: Experiment) -> TableView:
    rows = []
    for parameter in parameters:
        unit = common_unit([parameter], experiment)
        name = Markup(" <code>{}</code>").format(clean(parameter.name)) if parameter.symbol else ""
        what = Shown(symbol_of(parameter) + name, _meaning(parameter, experiment))
        rows.append(_Row(what, _reading(parameter, unit), unit.name, _parts(parameter, unit)))
    more = [
        (Head("Source"), [clean(p.source) for p in parameters]),
        (Head("Method"), [clean(p.method) for p in parameters]),
    ]
    more = [(head, texts) for head, texts in more if any(texts)]
    return _list_view("parameters", "Parameters with one value for the campaign", rows, more)


def _parts(parameter: Parameter, unit: ReadingUnit) -> str:
    """Return what of a standard error is scatter (A) and what calibration (B); '' where it is not told apart."""
    if parameter.type_b is None:
        return ""
    scatter, calibration = (plain((part or 0.0) / unit.size, 2) for part in (type_a(parameter), parameter.type_b))
    return f"standard error: scatter {scatter}, calibration {calibration} {unit.name}".rstrip()


def _varying_view(parameters: Sequence[Parameter], experiment: Experiment) -> TableView:
    conditions = list(parameters[0].at)
    names = list(dict.fromkeys(parameter.name for parameter in parameters))
    rows: dict[tuple[object, ...], dict[str, Parameter]] = {}
    for parameter in parameters:
        place = tuple(parameter.at[name] for name in conditions)
        again = 0
        while parameter.name in rows.setdefault((*place, again), {}):  # told twice for one place: both are shown
            again += 1
        rows[(*place, again)][parameter.name] = parameter
    first = {name: next(p for p in parameters if p.name == name) for name in names}
    columns = [Column(_words(name), unit_of_condition(experiment, name)) for name in conditions]
    columns += [Column(symbol_of(first[name]), experiment.parameter_read_as(name, first[name].unit)) for name in names]
    lines: list[list[Cell]] = [
        [*place[:-1], *(_value(row.get(name)) for name in names)]  # type: ignore[list-item]
        for place, row in rows.items()
    ]
    *others, last = [_words(name) for name in conditions if name != "run" or len(conditions) == 1]
    by = f"{', '.join(others)} and {last}" if others else last
    title = (
        f"Parameters of each run, with {by}" if "run" in conditions and len(conditions) > 1 else f"Parameters by {by}"
    )
    view = table_view(
        Table("parameters-" + "-".join(conditions), title, "Below each value its 95 % interval.", columns, lines)
    )
    notes = [
        Note(
            Markup("{} <code>{}</code>").format(symbol_of(first[name]), clean(name)),
            _about(parameters, name, experiment),
        )
        for name in names
    ]
    return TableView(view.name, view.title, view.caption, view.heads, view.rows, view.left_out, notes)


def _about(parameters: Sequence[Parameter], name: str, experiment: Experiment) -> str:
    """Return what the column shows, its source, and the reasons for what is missing."""
    same = [parameter for parameter in parameters if parameter.name == name]
    spec = next((spec for spec in experiment.parameters if spec.name == name), None)
    known = next((p.description for p in same if p.value is not None and p.description), "")
    parts = [clean(spec.description if spec else known), clean(same[0].source)]
    reasons = Counter(_reason(p, spec.description if spec else "") for p in same if p.value is None)
    for reason, count in reasons.items():
        told = _UNDETERMINED if len(same) == 1 else f"{_UNDETERMINED} in {count} of {len(same)}"
        parts.append(f"{told}: {reason}" if reason else told)
    return typeset(_joined(*parts).rstrip(".") + ".")


def _value(parameter: Parameter | None) -> Value | None:
    if parameter is None:
        return None
    if parameter.value is None:
        return Value(None, note=_UNDETERMINED)
    return Value(parameter.value, parameter.std_error, parameter.ci95)


def _words(name: str) -> str:
    return clean(name).replace("_", " ")
