"""The calibration polynomial: peak of R2 over load, prediction bands, and the load of a peak with its Fieller interval.

Loads are never regressed on peaks: the noise is in the peaks (Fieller 1954). Which points go in is decided in
`calibration`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.estimation.uncertainty import t_quantile

_MESH = 4001


@dataclass(frozen=True)
class LoadReading:
    """The load of a peak and its 95 % interval, N.

    A side without an end (the curve is too flat, or ends) is infinite. `extrapolated` where the load lies outside of
    the calibrated range; `load` is NaN where the curve does not reach the peak at all.
    """

    load: float
    low: float
    high: float
    extrapolated: bool


@dataclass(frozen=True, eq=False)
class Curve:
    """Peak = c0 + c1 F + c2 F^2, less the mean of the turn, ohm.

    Attributes
    ----------
    coefficients, covariance
        c0 (ohm), c1 (ohm/N), c2 (ohm/N^2; 0 for a line) and their covariance, (3,) and (3, 3).
    degree, dof
        1 or 2; degrees of freedom of `scatter`.
    scatter
        Standard deviation of a run's mean peak about the curve, ohm.
    revolution_scatter
        Standard deviation of one revolution's peak about the mean of its run, ohm.
    least, most
        Range of loads that it was made on, N.
    load_gain_u
        Relative standard uncertainty of all loads together.
    """

    coefficients: np.ndarray
    covariance: np.ndarray
    degree: int
    dof: int
    scatter: float
    revolution_scatter: float
    least: float
    most: float
    load_gain_u: float

    def at(self, load: np.ndarray | float) -> np.ndarray:
        """Return the peak at loads (N), ohm, same shape."""
        F = np.asarray(load, dtype=float)
        c0, c1, c2 = self.coefficients
        return np.asarray(c0 + F * (c1 + F * c2))

    def slope(self, load: np.ndarray | float) -> np.ndarray:
        """Return dR2/dF at loads (N), ohm/N."""
        return np.asarray(self.coefficients[1] + 2.0 * self.coefficients[2] * np.asarray(load, dtype=float))

    def slope_se(self, load: float) -> float:
        """Return the standard error of the slope, ohm/N, without that of the load cell's gain."""
        row = np.array([0.0, 1.0, 2.0 * load])
        return math.sqrt(max(float(row @ self.covariance @ row), 0.0))

    def std_error(self, load: np.ndarray | float) -> np.ndarray:
        """Return the standard error of the curve at loads (N), ohm."""
        F = np.asarray(load, dtype=float)
        rows = np.stack([np.ones_like(F), F, F**2], axis=-1)
        return np.asarray(np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", rows, self.covariance, rows), 0.0)))

    def band(self, load: np.ndarray | float, revolutions: float = math.inf, level: float = 0.95) -> np.ndarray:
        """Return the half-width of the prediction band of a mean over `revolutions` at loads (N), ohm."""
        new = self.scatter**2 + self.revolution_scatter**2 / revolutions
        return np.asarray(t_quantile(self.dof, level) * np.sqrt(new + self.std_error(load) ** 2))

    def load_of(self, peak: float, revolutions: float = 1.0) -> LoadReading:
        """Return the load of a measured peak (ohm, mean of `revolutions`) with its inverse prediction interval.

        All loads whose prediction band holds the peak (Fieller 1954), then widened by the gain of the load cell.
        """
        F, value, half = self._mesh
        extra = self.revolution_scatter**2 / revolutions
        half = np.sqrt(half**2 + t_quantile(self.dof) ** 2 * extra)
        load = _crossing(F, value - peak)
        low, high = _crossing(F, value + half - peak), _crossing(F, value - half - peak)
        low, high = (-math.inf if math.isnan(low) else low), (math.inf if math.isnan(high) else high)
        if math.isnan(load):
            return LoadReading(math.nan, low, high, True)
        gain = t_quantile(math.inf) * self.load_gain_u * load
        low, high = load - math.hypot(load - low, gain), load + math.hypot(high - load, gain)
        return LoadReading(load, low, high, not self.least <= load <= self.most)

    @cached_property
    def _mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return loads over twice the range, the rising part of the curve there and its band without revolutions."""
        span = self.most - self.least
        F = np.linspace(self.least - span, self.most + span, _MESH)
        middle = 0.5 * (self.least + self.most)
        rising = self.slope(F) > 0.0
        falls = F[~rising]
        bottom, top = falls[falls < middle].max(initial=-math.inf), falls[falls > middle].min(initial=math.inf)
        kept = (bottom < F) & (top > F)
        return F[kept], self.at(F[kept]), self.band(F[kept])


def fitted(load: np.ndarray, peak: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coefficients (3,), their covariance for unit variance (3, 3) and the residual (n,) of a polynomial."""
    shift, size = float(load.mean()), float(np.ptp(load)) or 1.0
    u = (load - shift) / size
    A = np.stack([u**k for k in range(degree + 1)], axis=1)
    inner, *_ = np.linalg.lstsq(A, peak, rcond=None)
    inverse = np.linalg.inv(A.T @ A)
    # (F - shift)/size, written out in powers of F.
    out = np.zeros((3, degree + 1))
    out[0, 0] = 1.0
    if degree >= 1:
        out[:2, 1] = [-shift / size, 1.0 / size]
    if degree >= 2:
        out[:, 2] = [(shift / size) ** 2, -2.0 * shift / size**2, 1.0 / size**2]
    return out @ inner, out @ inverse @ out.T, peak - A @ inner


def _crossing(x: np.ndarray, y: np.ndarray) -> float:
    """Return where y first rises through zero, between the nodes; NaN where it does not."""
    up = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
    if up.size == 0:
        return math.nan
    i = int(up[0])
    return float(x[i] - y[i] * (x[i + 1] - x[i]) / (y[i + 1] - y[i]))
