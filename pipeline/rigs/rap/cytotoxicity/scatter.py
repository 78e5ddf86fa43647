"""What the scatter between cultures tells against the test: cells that scatter unequally, one culture far from its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.cytotoxicity.equivalence import Cell
from pipeline.rigs.rap.cytotoxicity.samples import Samples

# Bartlett's test and the largest residual are told at these levels: seldom where nothing is wrong.
_UNEQUAL = 0.001
_LONE = 0.001


def unequal_scatter(run: str, name: str, cells: Sequence[Cell]) -> list[QualityFinding]:
    """Note where the cells scatter unequally (Bartlett's test, 0.1 %), which the pooled variance ignores."""
    from scipy.special import chdtrc

    free = [cell for cell in cells if cell.dof > 0 and cell.squares > 0.0]
    if len(free) < 2:
        return []
    dof = np.array([cell.dof for cell in free], float)
    variance = np.array([cell.squares for cell in free]) / dof
    mean = float(np.sum(dof * variance) / dof.sum())
    statistic = float(dof.sum() * np.log(mean) - np.sum(dof * np.log(variance)))
    correction = 1.0 + float(np.sum(1.0 / dof) - 1.0 / dof.sum()) / (3.0 * (len(free) - 1))
    if chdtrc(len(free) - 1, statistic / correction) > _UNEQUAL:
        return []
    low, high = (100.0 * np.sqrt(v) for v in (variance.min(), variance.max()))
    message = (
        f"{name}: cultures scatter unequally, from {low:.2g} to {high:.2g} points (standard deviation within a time); the "
        "test pools them, so its limits are too narrow where they scatter most. Look for a lost culture or a counting error."
    )
    return [QualityFinding("warning", message, run, name)]


def lone_sample(samples: Samples, times: np.ndarray, name: str, deviation: float, dof: int) -> list[QualityFinding]:
    """Note the sample furthest from the mean of its cell where that is beyond what the pooled scatter makes (0.1 %)."""
    from scipy.special import stdtr

    column = samples.values[name]
    worst, place = 0.0, -1
    for time in np.unique(times):
        for treated in (False, True):
            rows = np.flatnonzero(
                (times == time) & (samples.treated == treated) & np.isfinite(column) & (samples.weight < 2.0)
            )
            if rows.size < 3:
                continue
            residual = np.abs(column[rows] - column[rows].mean()) / np.sqrt(1.0 - 1.0 / rows.size)
            if residual.max() > worst:
                worst, place = float(residual.max()), int(rows[np.argmax(residual)])
    if place < 0 or dof < 3 or not deviation > 0.0:
        return []
    inside = min(worst / deviation, np.sqrt(dof) * 0.999999)
    # Externally studentised: the sample itself does not widen what it is held against.
    t = inside * np.sqrt((dof - 1.0) / (dof - inside**2))
    if 2.0 * float(stdtr(dof - 1, -t)) * column.size > _LONE:
        return []
    group = "treated" if samples.treated[place] else "control"
    message = (
        f"{name}: one {group} sample at {times[place] / 60.0:g} min is {100 * column[place]:.3g} %, {100 * worst:.2g} points off "
        "the others of its time. It counts; if the count was wrong, mend or leave out that row."
    )
    return [QualityFinding("warning", message, samples.run, name)]
