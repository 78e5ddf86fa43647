"""What sensors read while the pump stands: taken off all means (rap.md, 5.4 and section 8, "zero not taken")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.tables import Signal

# Time left out behind a stop and ahead of a start, s, and the least that must remain.
_BEHIND, _AHEAD, _LEAST = 3.0, 0.5, 3.0


@dataclass(frozen=True)
class Zero:
    """Reading at rest and its standard error, in the unit of the channel; `known` False where nothing shows it."""

    value: float
    error: float
    known: bool = True


def resting(rests: Sequence[tuple[float, float]], begin: float, end: float) -> list[tuple[float, float]]:
    """Return the stretches of `rests` that are settled; those at the ends of a record (begin, end) have no stop or start there."""
    cut = [(a if a <= begin else a + _BEHIND, b if b >= end else b - _AHEAD) for a, b in rests]
    return [(a, b) for a, b in cut if b - a >= _LEAST]


def zero_of(signal: Signal, rests: Sequence[tuple[float, float]]) -> Zero:
    """Return the mean reading in the stretches `rests` (s on the signal's clock).

    The error is that of a mean of blocks of a second: rest is not white (drift, draining lines).
    """
    blocks: list[float] = []
    for first, last in rests:
        inside = signal.values[(signal.time >= first) & (signal.time <= last)]
        size = max(round(signal.rate), 1) if np.isfinite(signal.rate) else 1
        blocks += [float(inside[i : i + size].mean()) for i in range(0, inside.size - size + 1, size)]
    if len(blocks) < 2:
        return Zero(0.0, float("nan"), known=False)
    return Zero(float(np.mean(blocks)), float(np.std(blocks, ddof=1) / np.sqrt(len(blocks))))
