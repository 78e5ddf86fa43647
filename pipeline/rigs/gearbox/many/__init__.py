"""A campaign of many runs: which numbers are watched over it, which runs are unlike the others, which stand for all."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.over_runs import MANY

_BLOCKS = 24


def blocks(runs: int) -> list[np.ndarray]:
    """Return the places of neighbouring runs that are taken together where the scatter of many runs is told.

    What neighbours have in common (a warm day) is then no noise that averages out; few runs stand alone.
    """
    return list(np.array_split(np.arange(runs), _BLOCKS if runs > MANY else runs))
