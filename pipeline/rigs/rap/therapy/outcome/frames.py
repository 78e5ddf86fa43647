"""Rows of the tables beside the findings, run by run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.findings.figures import Axis

if TYPE_CHECKING:
    import pandas as pd

HOURS, SECONDS = Axis("time", "h"), Axis("time", "s")
_LONG = 2.0 * 3600.0


def of_run(table: pd.DataFrame, run: str) -> pd.DataFrame:
    """Return the rows of one run."""
    return table[table["run"] == run]


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows as dictionaries."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def runs_of(table: pd.DataFrame) -> list[str]:
    """Return the runs that a table has rows of, in order."""
    return [str(run) for run in dict.fromkeys(table["run"])]


def time_axis(table: pd.DataFrame) -> Axis:
    """Return the axis of time: hours for long runs, minutes and seconds for short ones."""
    length = float(table["time"].max() - table["time"].min()) if len(table) else 0.0
    if length > 0.75 * _LONG:
        return HOURS
    return Axis("time", "min") if length > 0.1 * _LONG else SECONDS
