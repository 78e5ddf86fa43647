"""The step in which a channel's values come, where it is coarse: a dial gauge, an 8 bit converter."""

from __future__ import annotations

import numpy as np

# Samples of one block that are looked at.
_LOOKED_AT = 2048


class Resolution:
    """Accumulates levels of one channel from the middle of each block."""

    def __init__(self) -> None:
        self._step = np.inf
        self._levels = np.empty(0)

    def add(self, values: np.ndarray) -> None:
        """Take the next block of finite values (n,)."""
        middle = max((values.size - _LOOKED_AT) // 2, 0)
        levels = np.sort(values[middle : middle + _LOOKED_AT])
        rises = np.diff(levels)
        levels = levels[np.append(True, rises > 0)]
        if levels.size > 1:
            self._step = min(self._step, float(rises[rises > 0].min()))
        if levels.size > self._levels.size:
            self._levels = levels

    def step(self) -> float | None:
        """Return the step of which all levels are whole multiples apart, None where there is none.

        Fewer than eight levels are states, not a resolution.
        """
        if self._levels.size < 8:
            return None
        with np.errstate(over="ignore", invalid="ignore"):  # a step among denormal numbers divides to infinity: no step
            multiples = (self._levels - self._levels[0]) / self._step
            return self._step if np.abs(multiples - np.round(multiples)).max() < 0.02 else None
