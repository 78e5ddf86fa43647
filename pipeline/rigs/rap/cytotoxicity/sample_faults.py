"""Shares that cannot be: percent among fractions, more than all cells, columns that do not sum to all (rap.md, 8)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding

# A share beyond this is meant in percent.
_PERCENT = 1.5
# Shares of all cells may miss 1 by this much: counting and rounding.
_SUM_OFF = 0.03
# A share below zero by no more than this is zero less a background.
_BACKGROUND = 0.01
# Shares that are missing in no more than that part of the samples were lost; more were not counted.
_FEW = 0.25


def as_shares(
    run: str, raw: Mapping[str, np.ndarray], problems: list[QualityFinding]
) -> tuple[dict[str, np.ndarray], set[str]]:
    """Return the outcomes as shares of 1 and which of them were percent without saying so.

    Parameters
    ----------
    raw
        Columns as read, shape (n,) each: viability 0.92 or 92.

    Raises
    ------
    InputError
        If one column holds both.
    """
    percent = {name for name, column in raw.items() if np.nanmedian(column) > _PERCENT}
    # Small percentages look like large fractions: beside a viability in percent they are judged by the sum.
    if "viability" in percent and len(raw) == 3:
        total = sum(np.nanmedian(column) for column in raw.values())
        percent = set(raw) if abs(total - 100.0) < 100.0 * _SUM_OFF else percent
    for name in percent:
        column = raw[name]
        low = np.isfinite(column) & (column > 0.0) & (column <= 1.0) & (np.nanmedian(column) > 20.0)
        if low.any():
            _mixed(run, name, column, low)
    for name in set(raw) - percent:
        column = raw[name]
        high = np.isfinite(column) & (column > _PERCENT)
        if high.any():
            _mixed(run, name, column, high)
    if percent:
        words = ", ".join(name for name in raw if name in percent)
        message = f"{words}: the numbers are percent, though their unit does not say so; they are divided by 100. Declare the unit %."
        problems.append(QualityFinding("warning", message, run))
    return {name: column * (0.01 if name in percent else 1.0) for name, column in raw.items()}, percent


def missing_shares(
    run: str, time: np.ndarray, shares: Mapping[str, np.ndarray], problems: list[QualityFinding]
) -> None:
    """Tell samples that lack one outcome and have another: a warning where they are few, a note where that is how the outcome was counted."""
    counted = np.any([np.isfinite(column) for column in shares.values()], axis=0)
    for name, column in shares.items():
        lost = np.flatnonzero(counted & ~np.isfinite(column))
        if lost.size:
            few = lost.size <= _FEW * column.size
            message = (
                f"{name} is missing in {lost.size} of {column.size} samples (first at {round(time[lost[0]] / 60.0, 2):g} min); the others of that time "
                f"count alone{', which biases the difference if it was not lost by chance' if few else ''}."
            )
            problems.append(QualityFinding("warning" if few else "note", message, run, name))


def _mixed(run: str, name: str, column: np.ndarray, odd: np.ndarray) -> None:
    i = int(np.argmax(odd))
    raise InputError(
        f"run '{run}': {name} holds fractions and percent mixed: {column[i]:g} in sample {i + 1} among a median of "
        f"{np.nanmedian(column):g}; {int(odd.sum())} of {column.size} samples. Bring the column to one unit."
    )


def judge_shares(run: str, time: np.ndarray, shares: Mapping[str, np.ndarray], problems: list[QualityFinding]) -> None:
    """Note shares below 0 or beyond 1, and columns that are each all right but do not sum to all cells.

    Raises
    ------
    InputError
        If a share is negative by more than a background that was subtracted.
    """
    for name, column in shares.items():
        below, beyond = (np.flatnonzero(np.isfinite(column) & odd) for odd in (column < 0.0, column > 1.0 + 1e-9))
        if below.size and np.nanmin(column) < -_BACKGROUND:
            raise InputError(
                f"run '{run}': {name} is {100 * column[below[0]]:.3g} % in sample {below[0] + 1}; a share of cells is not negative. "
                "Mend the log."
            )
        if below.size:
            message = (
                f"{name} is negative in {below.size} of {column.size} samples, down to {100 * np.nanmin(column):.2g} %: a background was "
                "subtracted? The numbers are used as they are."
            )
            problems.append(QualityFinding("warning", message, run, name))
        if beyond.size:
            message = (
                f"{name} is more than 100 % in {beyond.size} of {column.size} samples, up to {100 * np.nanmax(column):.4g} % at "
                f"{round(time[beyond[np.argmax(column[beyond])]] / 60.0, 2):g} min: check the gating, or say what it is related to."
            )
            problems.append(QualityFinding("warning", message, run, name))
    if len(shares) == 3:
        total = np.sum([*shares.values()], axis=0)
        off = np.flatnonzero(np.isfinite(total) & (np.abs(total - 1.0) > _SUM_OFF))
        if off.size:
            message = (
                f"viability, necrosis and apoptosis do not sum to 100 % in {off.size} of {total.size} samples ({100 * np.nanmin(total):.4g} to "
                f"{100 * np.nanmax(total):.4g} %): check the gating; if the classes overlap by design, say so in the report."
            )
            problems.append(QualityFinding("warning", message, run))
