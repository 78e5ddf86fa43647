"""What the calibration tells of its loads: friction of the guide by loading up and down, offset of the load cell."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.tire.bench.calibration_curve import Curve, fitted
from pipeline.rigs.tire.bench.calibration_points import PeakPoint

# Load without a peak, over the load at mid-range.
_MOST_OFFSET = 0.08


def friction_of(
    points: Sequence[PeakPoint], F: np.ndarray, y: np.ndarray, degree: int
) -> tuple[Estimate | None, np.ndarray]:
    """Return the friction h by which the cell reads more on the way up and less on the way down, and the loads without it.

    Peak = f(load - direction h), h along with the curve.
    """
    way = np.array([p.direction for p in points], dtype=float)
    if not ((way > 0).any() and (way < 0).any()) or F.size < degree + 3:
        return None, F
    h, h_se, dof = 0.0, 0.0, F.size - degree - 2
    for _ in range(4):
        coefficients, _, _ = fitted(F - way * h, y, degree)
        slope = coefficients[1] + 2.0 * coefficients[2] * (F - way * h)
        u = (F - F.mean()) / np.ptp(F)
        A = np.column_stack([*[u**k for k in range(degree + 1)], -way * slope])
        solution, *_ = np.linalg.lstsq(A, y, rcond=None)
        left = y - A @ solution
        h = float(solution[-1])
        h_se = math.sqrt(float(left @ left) / dof * np.linalg.inv(A.T @ A)[-1, -1])
    return estimate("guide_friction", h, h_se, dof=dof), F - way * h


def covariance_by_friction(
    friction: Estimate | None, F: np.ndarray, y: np.ndarray, way: np.ndarray, degree: int
) -> np.ndarray:
    """Return what the friction's error adds to the covariance of the coefficients, (3, 3)."""
    if friction is None or not friction.std_error:
        return np.zeros((3, 3))
    moved = fitted(F - way * friction.std_error, y, degree)[0] - fitted(F, y, degree)[0]
    return np.outer(moved, moved)


def zero_load_of(curve: Curve) -> Estimate | None:
    """Return the load at which the curve goes through zero, with the error of its extrapolation."""
    c0, c1, c2 = curve.coefficients
    root = c1 * c1 - 4.0 * c0 * c2
    if root <= 0.0:
        return None
    load = -2.0 * c0 / (c1 + math.sqrt(root))
    slope = float(curve.slope(load))
    return estimate("zero_load", load, float(curve.std_error(load)) / slope, dof=curve.dof) if slope > 0.0 else None


def offset_of(curve: Curve, zero: Estimate | None) -> float | None:
    """Return the load without a peak where it is surely far from none; else None."""
    if zero is None or zero.value is None or zero.ci95 is None or zero.ci95[0] <= 0.0 <= zero.ci95[1]:
        return None
    return zero.value if abs(zero.value) > _MOST_OFFSET * 0.5 * (curve.least + curve.most) else None
