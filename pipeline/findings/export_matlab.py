"""Findings handed on to MATLAB: one struct ``findings`` in a MAT-file of version 5, which every MATLAB, Octave and SciPy reads.

``struct2table(findings.parameters)`` is the table of parameters; ``findings.arrays.<table>.<column>`` are column
vectors. What MATLAB cannot take as a name is renamed, and what it was called stands in ``findings.columns``.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pipeline import __version__
from pipeline.findings.export_json import AT, places, records
from pipeline.findings.findings import Findings, Run

if TYPE_CHECKING:
    import pandas as pd

LONGEST_NAME = 63
_HEADER = 116  # bytes of text at the beginning of the file, where SciPy writes the time of day
_KEYWORDS = frozenset(
    ("break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
     "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while")
)  # fmt: skip


def as_mat(findings: Findings, unit_of: Callable[[str], str]) -> bytes:
    """Return the bytes of the .mat file; the same findings give the same bytes.

    Numbers that are not told are NaN, texts that are not told ''. Whole numbers and flags are doubles and logicals.

    Parameters
    ----------
    unit_of
        Gives the SI unit of a condition or channel, '' for text and what is not declared.
    """
    from scipy.io import savemat

    tables = matlab_names(findings.arrays)
    content = {
        "campaign": findings.campaign,
        "experiment": findings.experiment,
        "verdict": findings.verdict,
        "reasons": _cells(findings.reasons),
        "rigfit": str(findings.provenance.get("rigfit", __version__)),
        "parameters": _parameters(findings),
        "units": {name: unit_of(key) for key, name in matlab_names(places(findings), "at_").items()},
        "runs": _structs([_run(run, unit_of) for run in findings.runs]),
        "arrays": {tables[name]: _columns(table) for name, table in findings.arrays.items()},
        "columns": {tables[name]: _cells(map(str, table.columns)) for name, table in findings.arrays.items()},
    }
    file = io.BytesIO()
    savemat(
        cast(Any, file), {"findings": content}, format="5", long_field_names=True, do_compression=True, oned_as="column"
    )
    told = f"MATLAB 5.0 MAT-file, written by rigfit {__version__}: findings of {findings.campaign}, SI units"
    header = told.encode("ascii", "replace")[:_HEADER].ljust(_HEADER)
    return header + file.getvalue()[_HEADER:]


def matlab_names(names: Iterable[str], prefix: str = "") -> dict[str, str]:
    """Return for each name one that MATLAB takes for a field, each another one.

    Examples
    --------
    >>> matlab_names(["k_mr at 2 A", "end", "k_mr_at_2_A"])
    {'k_mr at 2 A': 'k_mr_at_2_A', 'end': 'x_end', 'k_mr_at_2_A': 'k_mr_at_2_A_2'}
    """
    given: dict[str, str] = {}
    for name in names:
        text = prefix + re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
        if not text or not text[0].isalpha() or text in _KEYWORDS:
            text = f"x_{text}".rstrip("_")
        text, turn = text[:LONGEST_NAME], 1
        while text in given.values():
            turn += 1
            text = f"{text.removesuffix(f'_{turn - 1}')[: LONGEST_NAME - 4]}_{turn}"
        given[name] = text
    return given


def _parameters(findings: Findings) -> np.ndarray:
    """Return a struct array of shape (1, n): name, operating point (at_...), value, errors, unit, texts."""
    names = {AT + key: name for key, name in matlab_names(places(findings), "at_").items()}
    rows = records(findings)
    texts = {key for key in rows[0] if any(isinstance(row[key], str) for row in rows)} if rows else set()
    return _structs([{names.get(key, key): _scalar(value, key in texts) for key, value in row.items()} for row in rows])


def _scalar(value: Any, text: bool) -> Any:
    """Return a field of a record: text as text, also where another record has a number there; numbers as doubles."""
    if text:
        return "" if value is None else value if isinstance(value, str) else f"{value:g}"
    return value if isinstance(value, bool) else np.nan if value is None else float(value)


def _run(run: Run, unit_of: Callable[[str], str]) -> dict[str, Any]:
    conditions = matlab_names(run.conditions)
    return {
        "run": run.run,
        "used": run.used,
        "reason": run.reason,
        "duration": np.nan if run.duration is None else run.duration,
        "begins": np.nan if run.begins is None else run.begins,
        "conditions": {
            conditions[key]: _scalar(value, isinstance(value, str)) for key, value in run.conditions.items()
        },
        "units": {conditions[key]: unit_of(key) for key in run.conditions},
        "files": _cells(run.files),
        "sha256": _cells(run.sha256),
    }


def _structs(rows: list[dict[str, Any]]) -> np.ndarray:
    """Return a struct array of shape (1, n); all rows have the same fields."""
    if not rows:
        return np.zeros((1, 0), dtype=[("name", object)])
    array = np.empty((1, len(rows)), dtype=[(name, object) for name in rows[0]])
    for place, row in enumerate(rows):
        for name, value in row.items():
            array[0, place][name] = value
    return array


def _cells(texts: Iterable[str]) -> np.ndarray:
    """Return a column of cells."""
    texts = list(texts)
    cells = np.empty((len(texts), 1), dtype=object)
    cells[:, 0] = texts
    return cells


def _columns(table: pd.DataFrame) -> Mapping[str, np.ndarray]:
    names = matlab_names(map(str, table.columns))
    return {names[str(name)]: _column(table[name]) for name in table.columns}


def _column(series: pd.Series) -> np.ndarray:
    if series.dtype.kind == "b":
        return series.to_numpy(bool).reshape(-1, 1)
    if series.dtype.kind in "iuf":
        return series.to_numpy(float).reshape(-1, 1)
    return _cells("" if value is None or value != value else str(value) for value in series)
