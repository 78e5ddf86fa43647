"""E0 to E3 fitted to the meter by linear least squares, with errors that the operating points themselves show (rap.md, 5.3).

Residuals hang together within an operating point (speed and clamp): the misfit of a law is there, not in the noise of windows. So the
scatter is told by leaving operating points out, and by leaving whole set-points out, never by the covariance of the fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import Covariance
from pipeline.rigs.rap.flow import estimators
from pipeline.rigs.rap.flow.windows import FlowWindows

# The spread over left-out set-points counts where it is that many times what the scatter of operating points explains: with three
# set-points half of that is chance.
_CLEARLY = 1.3
# Set-points closer than that (share of the frequency) are one speed.
ONE_SPEED = 0.05
Columns = Callable[[FlowWindows], np.ndarray]


@dataclass(frozen=True)
class Law:
    """An estimator: its coefficients' names, what they are multiplied with, shape (w, k), and the speeds of the pump that it takes."""

    name: str
    names: tuple[str, ...]
    columns: Columns
    speeds: int = 1


LAWS = {
    "E0": Law("E0", ("V",), lambda w: w.f[:, None]),
    "E1": Law("E1", ("V",), lambda w: w.f[:, None]),
    "E2": Law("E2", ("stroke_volume", "y0", "y1"), lambda w: estimators.pulsation_columns(w.f, w.A_1), 2),
    "E2 quadratic": Law("E2 quadratic", ("V_g", "y0", "y1", "y2"), lambda w: estimators.quadratic_columns(w.f, w.A_1), 2),
    "E3": Law("E3", ("stroke_volume_mean", "pump_compliance"), lambda w: estimators.pressure_columns(w.f, w.back_pressure)),
    "affine": Law("affine", ("a", "b"), lambda w: estimators.affine_columns(w.f), 2),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A law with its coefficients.

    Attributes
    ----------
    law, values
        The law and its coefficients, SI, shape (k,).
    covariance
        Of type A: scatter of operating points, or spread over left-out set-points where that is clearly larger; None where there are too few.
    misfit
        Relative error of a left-out operating point, root mean square: what an estimate is off beyond noise; NaN likewise.
    shared
        The part of it that all operating points of a set-point share, beyond what chance makes their mean.
    scatter
        Relative standard deviation of single windows about their operating point.
    noise
        Standard errors of the coefficients if that scatter were all, shape (k,): how much smaller they are says what the law misses.
    windows
        What it was fitted to.
    """

    law: Law
    values: np.ndarray
    covariance: Covariance | None
    misfit: float
    shared: float
    scatter: float
    noise: np.ndarray
    windows: FlowWindows

    def flow(self, windows: FlowWindows) -> np.ndarray:
        """Return the estimated blood flow, m^3/s, shape (w,); NaN where the windows lack what the law needs."""
        return np.asarray(self.law.columns(windows) @ self.values)

    def errors(self, windows: FlowWindows) -> np.ndarray:
        """Return (estimate - meter)/meter, shape (w,)."""
        return np.asarray(self.flow(windows) / windows.flow - 1.0)


def speeds_of(windows: FlowWindows) -> int:
    """Return how many speeds of the pump the windows hold."""
    f = np.sort(windows.f)
    return int((np.diff(f) > ONE_SPEED * f[:-1]).sum()) + 1 if f.size else 0


def usable(law: Law, windows: FlowWindows) -> FlowWindows:
    """Return the windows that have a blood flow and all that the law needs."""
    columns = law.columns(windows)
    return windows.of(np.isfinite(windows.flow) & (windows.flow > 0.0) & np.isfinite(columns).all(axis=1))


def solve(law: Law, windows: FlowWindows) -> np.ndarray:
    """Return the coefficients of least squares, SI, shape (k,); NaN where the windows do not tell them apart."""
    columns = law.columns(windows)
    size = np.sqrt((columns**2).sum(axis=0))
    if columns.shape[0] < columns.shape[1] or not np.all(size > 0.0):
        return np.full(columns.shape[1], np.nan)
    solution, _, rank, _ = np.linalg.lstsq(columns / size, windows.flow, rcond=1e-9)
    return np.asarray(solution / size) if rank == columns.shape[1] else np.full(columns.shape[1], np.nan)


def calibrate(law: Law, windows: FlowWindows) -> Calibrated:
    """Fit a law to `windows` (all `usable`)."""
    values = solve(law, windows)
    points, at = np.unique(windows.point, return_inverse=True)
    errors = law.columns(windows) @ values / windows.flow - 1.0
    means = np.bincount(at, errors) / np.bincount(at)
    scatter = float(np.sqrt(((errors - means[at]) ** 2).sum() / max(windows.size - points.size, 1)))
    noise = _noise(law, windows, values, at)
    missed = []
    for p in range(points.size):
        rest, out = solve(law, windows.of(at != p)), windows.of(at == p)
        missed.append(float(np.mean(law.columns(out) @ rest / out.flow - 1.0)))
    determined = points.size > values.size and np.isfinite(values).all()
    covariance = _scatter_of_points(law, windows, values, at) if determined else None
    if not determined:
        return Calibrated(law, values, None, float("nan"), float("nan"), scatter, noise, windows)
    levels = np.array([windows.set_point[at == p][0] for p in range(points.size)])
    by_level = [float(np.mean(np.array(missed)[levels == level])) for level in np.unique(levels)]
    misfit = float(np.sqrt(np.mean(np.square(missed))))
    by_chance = misfit**2 * len(by_level) / points.size
    shared = float(np.sqrt(np.maximum(np.mean(np.square(by_level)) - by_chance, 0.0)))
    return Calibrated(law, values, covariance, misfit, shared, scatter, noise, windows)


def _noise(law: Law, windows: FlowWindows, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return standard errors of the coefficients by the scatter of windows about their operating point, shape (k,)."""
    columns = law.columns(windows)
    residual = windows.flow - columns @ values
    about = residual - (np.bincount(at, residual) / np.bincount(at))[at]
    dof = windows.size - int(at.max()) - 1
    if dof < 1 or not np.isfinite(values).all():
        return np.full(values.size, np.nan)
    return np.asarray(np.sqrt(np.diag(_inverse(columns)) * float(about @ about) / dof))


def _inverse(columns: np.ndarray) -> np.ndarray:
    """Return the inverse of the normal matrix of `columns`, (k, k), scaled while it is inverted."""
    size = np.sqrt((columns**2).sum(axis=0))
    return np.asarray(np.linalg.inv((columns / size).T @ (columns / size)) / np.outer(size, size))


def _scatter_of_points(law: Law, windows: FlowWindows, values: np.ndarray, at: np.ndarray) -> Covariance:
    """Return the covariance that the means of the operating points show, widened to the spread over left-out set-points."""
    count = np.bincount(at)
    columns = np.stack([np.bincount(at, column) / count for column in law.columns(windows).T], axis=-1)
    residual = np.bincount(at, windows.flow) / count - columns @ values
    dof = count.size - values.size
    matrix = _inverse(columns) * float(residual @ residual) / dof
    without = np.array([one.values for one in leave_set_points_out(law, windows)])
    spread = np.zeros(values.size)
    if len(without) > 2:
        spread = without.std(axis=0, ddof=1)
    ratio = spread / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    wider = np.where(ratio > _CLEARLY, ratio, 1.0)
    return Covariance(matrix * np.outer(wider, wider), dof, "operating points and left-out set-points")


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A set-point (m^3/s) that the fit did not see: the largest relative error there, and the coefficients without it, shape (k,)."""

    flow_set: float
    worst: float
    values: np.ndarray


def leave_set_points_out(law: Law, windows: FlowWindows) -> list[LeftOut]:
    """Fit without each set-point in turn and predict it; those whose remainder does not determine the law are left out."""
    rows = []
    for level in np.unique(windows.set_point):
        inside = windows.set_point == level
        rest = windows.of(~inside)
        values = solve(law, rest)
        if speeds_of(rest) < law.speeds:
            values = np.full(values.size, np.nan)
        out = windows.of(inside)
        errors = law.columns(out) @ values / out.flow - 1.0
        rows.append(LeftOut(float(level) / 6e7, float(np.abs(errors).max()), values))
    known = [one for one in rows if np.isfinite(one.worst)]
    return known if len(rows) > 1 else []
