"""Geometry of the pads and the moduli that follow from it; levels of current and preload."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pads:
    """Geometry for moduli: `count` pads in parallel, diameter and height in m."""

    diameter: float
    height: float
    count: float = 2.0

    @property
    def modulus_per_stiffness(self) -> float:
        """Return h / (count A), 1/m: G = K h / (2 A) for the two pads of the shear rig."""
        return self.height / (self.count * math.pi * self.diameter**2 / 4)


def group_levels(values: Sequence[float | None], tolerance: float) -> tuple[list[int], list[float]]:
    """Group measured levels (current, preload) that lie within `tolerance` of their neighbours.

    Returns the label of each value and the level of each label (mean rounded to 0.01, exactly 0 when
    within the tolerance of 0), labels in the order of rising level; None counts as 0.

    Examples
    --------
    >>> group_levels([0.004, 2.001, None, 1.996, 6.0], 0.25)
    ([0, 1, 0, 1, 2], [0.0, 2.0, 6.0])
    """
    numbers = np.array([0.0 if v is None else v for v in values])
    order = np.argsort(numbers, kind="stable")
    labels = np.zeros(numbers.size, dtype=int)
    labels[order] = np.r_[0, np.cumsum(np.diff(numbers[order]) > tolerance)] if numbers.size else []
    levels = [round(float(numbers[labels == g].mean()), 2) for g in range(int(labels.max(initial=-1)) + 1)]
    return labels.tolist(), [0.0 if abs(level) <= tolerance else level for level in levels]
