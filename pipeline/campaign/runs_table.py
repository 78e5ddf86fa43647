"""`runs.csv` of a campaign: one line a run, one column a condition."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.campaign.conditions import HEADING, spec_for, value_of
from pipeline.errors import InputError, counted, listing, nearest
from pipeline.recording import Condition, QualityFinding
from pipeline.recording.units import conversion
from pipeline.rigs.experiment import ConditionSpec, Experiment


@dataclass(frozen=True)
class RunsTable:
    """`runs.csv`: one line a run, one column a condition. A run is called by its name or by its file's."""

    path: str
    rows: Mapping[str, Mapping[str, Condition]]
    notes: Sequence[QualityFinding] = ()

    def conditions(self, run: str, file_names: Sequence[str] = ()) -> Mapping[str, Condition]:
        """Return what the table says of a run.

        Raises
        ------
        InputError
            If two of its lines mean this run.
        """
        meant = [name for name in dict.fromkeys((run, *file_names)) if name in self.rows]
        if len(meant) > 1:
            raise InputError(f"{self.path}: {listing(map(repr, meant))} are the same run; keep one line for each run.")
        return self.rows[meant[0]] if meant else {}

    def only(self, run: str, file_names: Sequence[str] = ()) -> RunsTable:
        """Return the same table with the line of one run; raises as `conditions`."""
        self.conditions(run, file_names)
        return RunsTable(self.path, {name: self.rows[name] for name in (run, *file_names) if name in self.rows})

    def unknown(self, runs: Mapping[str, Sequence[str]]) -> list[str]:
        """Return what the table calls a run and is none of `runs` (name -> its files' names), with the nearest name."""
        names = {*runs, *(name for files in runs.values() for name in files)}
        return [f"'{name}'{_instead(name, runs)}" for name in sorted(self.rows) if name not in names]

    def remarks(self, runs: Mapping[str, Sequence[str]]) -> list[QualityFinding]:
        """Return what is odd about the table beside `runs` (name -> its files' names)."""
        if not (unknown := self.unknown(runs)):
            return list(self.notes)
        message = f"{self.path}: no log for {listing(unknown)}; the runs here are {listing(runs)}."
        return [*self.notes, QualityFinding("warning", message)]


def _instead(name: str, runs: Iterable[str]) -> str:
    hint = nearest(Path(name).stem, runs) or nearest(name, runs)
    return f" ({hint.strip()})" if hint else ""


def read(path: Path, experiment: Experiment, shown_as: str) -> RunsTable:
    """Read `runs.csv`: a column ``run`` and conditions, units in the heading (``coil_current [A]``) or the cell.

    Raises
    ------
    InputError
        If there is no column ``run``, a run stands twice, a line has more cells than the header, or a value
        cannot be read: file, line, column.
    """
    lines = list(csv.reader(_text_of(path, shown_as).splitlines(), delimiter=_delimiter(path, shown_as)))
    numbered = [(n, row) for n, row in enumerate(lines, 1) if any(c.strip() for c in row) and row[0][:1] != "#"]
    if not numbered:
        raise InputError(
            f"{shown_as}: is empty; write a header line such as 'run,coil_current [A]' or remove the file."
        )
    headings = [HEADING.match(cell) for cell in numbered[0][1]]
    names = [match[1] if match else "" for match in headings]
    units = [match[2] if match else None for match in headings]
    lowered = [name.lower() for name in names]
    if "run" not in lowered:
        raise InputError(
            f"{shown_as} line {numbered[0][0]}: no column 'run'; the columns are {listing(names)}. "
            "The first line must name a column 'run' that holds the log's name without its ending."
        )
    if len(set(lowered)) < len([n for n in lowered if n]) and len(lowered) != len(set(lowered)):
        twice = next(n for n in lowered if n and lowered.count(n) > 1)
        raise InputError(f"{shown_as} line {numbered[0][0]}: two columns are called '{twice}'; keep one of them.")
    notes: list[QualityFinding] = []
    specs: list[ConditionSpec | None] = []
    for name, unit in zip(names, units, strict=True):
        spec = spec_for(name, experiment.conditions)
        specs.append(spec)
        if spec is not None and unit and spec.unit:
            conversion(unit, spec.unit, f"{shown_as} line {numbered[0][0]}, column '{name}'")
        if spec is None and name and name.lower() != "run":
            hint = nearest(name, [s.name for s in experiment.conditions])
            if hint:
                notes.append(
                    QualityFinding("warning", f"{shown_as}: column '{name}' is no condition of {experiment.id}.{hint}")
                )
    rows: dict[str, Mapping[str, Condition]] = {}
    for number, row in numbered[1:]:
        run = row[lowered.index("run")].strip() if len(row) > lowered.index("run") else ""
        if not run:
            raise InputError(f"{shown_as} line {number}: the column 'run' is empty; write the log's name there.")
        if run in rows:
            raise InputError(f"{shown_as} line {number}: the run '{run}' stands twice; keep one line for each run.")
        if extra := [cell for cell in row[len(names) :] if cell.strip()]:
            raise InputError(
                f"{shown_as} line {number}: has {counted(len(row), 'cell')} but the header names "
                f"{counted(len(names), 'column')}; nothing says what '{extra[0].strip()}' is. A decimal comma? Write a point, "
                "or separate the cells by semicolons. Else name the column."
            )
        values: dict[str, Condition] = {}
        for cell, name, unit, spec in zip(row, names, units, specs, strict=False):
            if spec is not None and cell.strip():
                where = f"{shown_as} line {number}, column '{name}'"
                values[spec.name] = value_of(cell, unit, spec, where)
        rows[run] = values
    return RunsTable(shown_as, rows, tuple(notes))


def _text_of(path: Path, shown_as: str) -> str:
    content = path.read_bytes()
    if b"\0" in content and not content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{shown_as}: is not text (it holds NUL bytes); write it as a CSV table.")
    encodings = ["utf-16"] if content.startswith((b"\xff\xfe", b"\xfe\xff")) else ["utf-8-sig", "gb18030", "cp1252"]
    for encoding in encodings:
        try:
            return content.decode(encoding)
        except UnicodeDecodeError:
            continue
    return content.decode("latin-1")


def _delimiter(path: Path, shown_as: str) -> str:
    first = next((ln for ln in _text_of(path, shown_as).splitlines() if ln.strip() and not ln.startswith("#")), "")
    return max(";\t,|", key=first.count)
