"""What unlocking and relocking tell about the clock of the vibration board: mesh noise comes and goes with the slip."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from pipeline.rigs.gearbox.clocks.shift_search import FAR, Part, best_shift
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.counts import Counts
from pipeline.rigs.gearbox.stages.levels import restlessness
from pipeline.rigs.gearbox.stages.stage import Stage

# Mesh noise is read in blocks, s.
_BLOCK = 0.02
_POWERS = (1, 2, 3)


def vibration_parts(record: Record, counts: Counts, stages: Sequence[Stage]) -> list[Part]:
    """Return the shifts of unlocking and relocking: mesh noise grows with the slip ``w_n - w_2``."""
    if record.vibration is None:
        return []
    restless = restlessness(record.vibration)
    if not restless.values:
        return []
    noise = np.mean(list(restless.values.values()), axis=0)
    speed = counts.speed()
    nominal = float(np.percentile(speed, 98))
    parts = []
    for start, end in _exchanges(stages):
        grid = np.arange(start, end, 0.02)
        slip = np.clip(1.0 - np.interp(grid, counts.time, speed) / nominal, 0.0, 1.0)
        # How mesh noise grows with slip is not known: as the power that explains it best. How far another power would
        # move the shift is part of its error.
        found = [
            part
            for power in _POWERS
            if (part := _shift(grid, slip**power, lambda at: np.interp(at, restless.time, noise))) is not None
        ]
        if found:
            best = min(found, key=lambda part: part.misfit)
            stray = 0.5 * float(np.ptp([part.shift for part in found]))
            # The grid is on the torques' clock and the board's is asked for: the shift found is the board's lag.
            parts.append(Part(best.time + best.shift, -best.shift, math.hypot(best.sd, stray, _BLOCK), best.misfit))
    return parts


def _shift(grid: np.ndarray, driven: np.ndarray, signal: Callable[[np.ndarray], np.ndarray]) -> Part | None:
    return best_shift(grid, np.column_stack([np.ones_like(grid), driven]), signal, (-FAR, FAR))


def _exchanges(stages: Sequence[Stage]) -> list[tuple[float, float]]:
    """Return where slip comes and goes, with a second of steady motion beside it."""
    out = []
    for i, sos in enumerate(stages):
        if sos.name != "sos":
            continue
        before = [stage for stage in stages[:i] if stage.name.startswith("fos")]
        after = [stage for stage in stages[i + 1 :] if stage.name.startswith("fos")]
        if before:
            out.append((max(before[-1].end - 1.0, before[-1].start), min(sos.start + 1.0, sos.end)))
        if after:
            out.append((max(sos.end - 1.0, sos.start), min(after[0].start + 1.0, after[0].end)))
    return out
