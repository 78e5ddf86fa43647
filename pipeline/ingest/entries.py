"""Stamps of a table that lists entries (events, samples of a culture): sorted by time, rows of one time kept apart.

A list has no rate. Two events of one moment are two events, so that nothing is dropped; the one written later stays behind
the other by a microsecond, which nobody mistakes for a measured time.
"""

from __future__ import annotations

import numpy as np

from pipeline.errors import counted
from pipeline.ingest.stamps import Repair
from pipeline.recording import QualityFinding

_APART = 1e-6
# Numbers of 64 bits tell stamps apart from so many of their last places on.
_PLACES = 4.0


def listed(stamps: np.ndarray, unit: float, where: str) -> Repair:
    """Make the stamps of a list strictly increasing.

    Parameters
    ----------
    stamps
        As logged, shape (n,), NaN where a row has none.
    unit
        Seconds per unit of the stamps.
    where
        File and channel, for messages.
    """
    rows = np.flatnonzero(np.isfinite(stamps))
    by_time = np.argsort(stamps[rows], kind="stable")
    moved = int(np.count_nonzero(by_time != np.arange(rows.size)))
    time = stamps[rows][by_time]
    findings = []
    order = None
    if moved:
        order = np.arange(stamps.size)
        order[rows] = rows[by_time]
        findings.append(
            QualityFinding("note", f"{where}: {counted(moved, 'row')} of the list sorted by time; none is lost.")
        )
    together = int(np.count_nonzero(np.diff(time) == 0))
    if together:
        apart = max(_APART / unit, _PLACES * float(np.spacing(np.abs(time).max())))
        # Each stamp is at least `apart` later than the one before: the running maximum of what is left without these steps.
        steps = apart * np.arange(time.size)
        time = np.maximum.accumulate(time - steps) + steps
        findings.append(
            QualityFinding("note", f"{where}: {counted(together, 'row')} with the time of the row before; all are kept, a microsecond apart.")
        )  # fmt: skip
    mended = np.full(stamps.size, np.nan)
    mended[rows] = time
    return Repair(mended, order, findings)
