"""Load inertia and drag from the integrated load equation of one or several runs (fact sheet 5.6).

T_out = J_L w' + d0 + d1 w wherever the brake is free and the output turns forward. J_L and the gain of
torque_out trade off exactly: a known added inertia would break it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import Covariance
from pipeline.rigs.gearbox.load.load_windows import HOP, MEAN, WINDOW, Noise, Windows, overlaps
from pipeline.rigs.gearbox.many import blocks

NAMES = ("inertia_load", "drag_coulomb", "drag_viscous")
# What a bench can have (section 5.6): kg m^2, N m, N m s/rad.
_POSSIBLE = ((1e-4, 1.0), (0.0, 2.0), (0.0, 0.1))
_SPOKEN = {
    "inertia_load": ("the load's inertia", "kg m2"),
    "drag_coulomb": ("the load's Coulomb drag", "N m"),
    "drag_viscous": ("the load's viscous drag", "N m s/rad"),
}
_BEYOND = 2.0  # standard errors outside of it


@dataclass(frozen=True, eq=False)
class LoadFit:
    """Load parameters of one or several runs.

    Attributes
    ----------
    values
        J_L (kg m^2), d0 (N m), d1 (N m s/rad), in the order of `NAMES`, shape (3,).
    covariance
        With its degrees of freedom.
    residuals
        Run -> (centres of the windows in s, residual in N m as a mean over the window).
    scatter
        Ratio (squared) of what the runs say of the parameters to what their noise allows: about 1; 1 below four runs.
    noises
        Run -> what its steady stretches leave over.
    undetermined
        Parameter -> why the data cannot tell it.
    """

    values: np.ndarray
    covariance: Covariance
    residuals: dict[str, tuple[np.ndarray, np.ndarray]]
    scatter: float
    noises: dict[str, Noise]
    undetermined: dict[str, str]

    def steady_torque(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return d0 + d1 w at steady `speed` (rad/s, shape (n,)), and by how much its common errors move it, shape (n, 2)."""
        slopes = np.column_stack([np.ones_like(speed), speed])
        sizes, directions = np.linalg.eigh(self.covariance.matrix[1:, 1:])
        return slopes @ self.values[1:], slopes @ (directions * np.sqrt(np.maximum(sizes, 0.0)))


def load_parameters(windows: Sequence[Windows]) -> LoadFit | None:
    """Fit J_L, d0 and d1 to the windows of one or several runs together.

    Parameters
    ----------
    windows
        Of each run; their noise is that of the run.

    Returns
    -------
    None where there are fewer than four windows or they cannot tell the parameters apart.

    Notes
    -----
    Least squares in which the windows of a run share its zero offset; the covariance comes from the measured
    noise of each run, correlation of overlapping windows included, widened where the runs differ by more than
    their noise allows. A run's own drift (`Windows.drift`) is projected out.
    """
    free = [_free(w) for w in windows]
    A = np.concatenate([columns for columns, _ in free])
    scale = np.linalg.norm(A, axis=0)
    if A.shape[0] < 4 or not (scale > 0).all() or np.linalg.cond(A / scale) > 1e4:
        return None
    first = np.linalg.lstsq(A / scale, np.concatenate([torque for _, torque in free]), rcond=None)[0] / scale
    noises = [_noise(w, w.residual(first)) for w in windows]
    # One weight for all runs: each run's own noise is too rough a figure, and would favour runs that look quiet by chance.
    typical = Noise(np.mean([noise.covariance for noise in noises], axis=0), 1.0)
    weighted = [w.weighted(w.columns / scale, typical) for w in windows]
    shares = [x.T @ w.columns for x, w in zip(weighted, windows, strict=True)]
    sums = [x.T @ w.torque for x, w in zip(weighted, windows, strict=True)]
    information = np.sum(shares, axis=0)
    pulls = [np.linalg.solve(information, x.T) for x in weighted]
    values = np.linalg.solve(information, np.sum(sums, axis=0))
    left = [w.residual(values) for w in windows]
    spreads = [_spread(pull, w, noise) for pull, w, noise in zip(pulls, windows, noises, strict=True)]
    noise_only = np.sum(spreads, axis=0)
    own = np.array([float(np.trace(spread / np.outer(values, values))) for spread in spreads])
    own = own / own.sum() if own.sum() > 0 else np.full(own.size, 1 / own.size)
    dof = 1 / float(np.sum(own**2 / np.array([noise.dof for noise in noises])))
    residuals = {w.run: (w.time, rest / (MEAN * WINDOW)) for w, rest in zip(windows, left, strict=True)}
    by_run = {w.run: noise for w, noise in zip(windows, noises, strict=True)}
    together = blocks(len(windows))
    covariance, scatter = _with_scatter(
        noise_only,
        dof,
        [np.sum([shares[k] for k in block], axis=0) for block in together],
        [np.sum([sums[k] for k in block], axis=0) for block in together],
    )
    return LoadFit(values, covariance, residuals, scatter, by_run, _undetermined(values, covariance))


def _free(windows: Windows) -> tuple[np.ndarray, np.ndarray]:
    """Return columns and torque of a run without what a drift of its own could explain."""
    drift = windows.nuisance
    if not drift.size:
        return windows.columns, windows.torque
    basis = drift / np.linalg.norm(drift)
    return windows.columns - basis @ (basis.T @ windows.columns), windows.torque - (basis @ (basis.T @ windows.torque))


def _with_scatter(
    noise: np.ndarray, dof: float, shares: Sequence[np.ndarray], sums: Sequence[np.ndarray]
) -> tuple[Covariance, float]:
    """Widen the covariance that noise gives where the runs differ by more, told by leaving out one block of runs at a time.

    The excess over the noise is as uncertain as a variance of so many blocks, less one for each drag they share.
    """
    runs = len(shares)
    method = "noise of steady stretches"
    if runs < 4:
        return Covariance(noise, dof, method), 1.0
    information, sum_ = np.sum(shares, axis=0), np.sum(sums, axis=0)
    without = [information - share for share in shares]
    if max(float(np.linalg.cond(part)) for part in without) > 1e12:
        return Covariance(noise, dof, method), 1.0
    left_out = np.array([np.linalg.solve(part, sum_ - own) for part, own in zip(without, sums, strict=True)])
    jackknife = (runs - 1) / runs * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0)
    ratio = jackknife / np.diag(noise)
    factor = np.sqrt(np.maximum(ratio, 1.0))
    excess = max(float(ratio.max()) - 1.0, 0.0)
    dof = (1.0 + excess) ** 2 / (1.0 / dof + excess**2 / (runs - 2))
    return Covariance(noise * np.outer(factor, factor), dof, f"{method}, scatter of the runs"), float(ratio.mean())


def _spread(pull: np.ndarray, windows: Windows, noise: Noise) -> np.ndarray:
    """Return what a run's noise does to the parameters, shape (3, 3): no less than noise short against the windows does.

    A few steady windows tell how the noise of neighbours goes together so roughly that its sum may be small by chance; how
    overlapping windows share noise without memory is known.
    """
    rough = pull @ windows.covariance(noise) @ pull.T
    least = pull @ windows.covariance(Noise(noise.covariance[0] * overlaps(noise.covariance.size), noise.dof)) @ pull.T
    if not np.all(np.diag(rough) > 0):
        # An autocovariance cut at some lag need not be one.
        return np.asarray(least)
    wider = np.sqrt(np.maximum(np.diag(least) / np.diag(rough), 1.0))
    return np.asarray(rough * np.outer(wider, wider))


def _undetermined(values: np.ndarray, covariance: Covariance) -> dict[str, str]:
    """Tell which parameters have an error as large as themselves; all, where one of them is impossible."""
    error = covariance.std_error
    for name, value, sd, (least, most) in zip(NAMES, values, error, _POSSIBLE, strict=True):
        if value < least - _BEYOND * sd or value > most + _BEYOND * sd:
            words, unit = _SPOKEN[name]
            reason = f"{words} would be {value:.2g} {unit}, which no bench has ({least:g} to {most:g} {unit}): {_cause(values)}"
            return dict.fromkeys(NAMES, reason)
    reasons = {
        "inertia_load": "the load hardly accelerates in these runs",
        "drag_coulomb": "the runs hold too little steady motion",
        "drag_viscous": "the runs hold too few speeds",
    }
    return {name: reasons[name] for name, v, e in zip(NAMES, values, error, strict=True) if not e < abs(v)}


def unit_mistake(values: np.ndarray) -> str:
    """Say by what factor torque_out is off where a thousandth or a thousandfold of an impossible load would be plausible."""
    if all(least <= value <= most for value, (least, most) in zip(values, _POSSIBLE, strict=True)):
        return ""
    for factor, told in ((1e3, "a thousandth of"), (1e-3, "a thousand times")):
        if all(least <= factor * value <= most for value, (least, most) in zip(values, _POSSIBLE, strict=True)):
            return f"torque_out reads {told} what a plausible load needs, so look at its unit (N m against mN m)"
    return ""


def _cause(values: np.ndarray) -> str:
    """Say what makes an impossible inertia."""
    return unit_mistake(values) or "counts, torques or their clocks do not go together in these runs"


def _noise(windows: Windows, residual: np.ndarray) -> Noise:
    """Return the noise of the steady windows; of all windows where too few are steady."""
    overlap = round(WINDOW / HOP)
    calm = windows.calm if windows.calm.sum() > 2 * overlap else np.ones(residual.size, dtype=bool)
    rows = np.flatnonzero(calm)
    lags = overlap + 2
    products, counts, parts = np.zeros(lags), np.zeros(lags), 0
    for part in np.split(rows, np.flatnonzero(np.diff(windows.place[rows]) != 1) + 1):
        if part.size < overlap:
            continue
        parts += 1
        x = residual[part] - residual[part].mean()
        for lag in range(min(lags, part.size)):
            products[lag] += float(x[lag:] @ x[: part.size - lag])
            counts[lag] += part.size - lag
    covariance = products / np.maximum(counts, 1)
    # Each stretch lost its mean, and with it the variance of a mean at every lag: long-run variance over length.
    long_run = max(2 * float(covariance.sum()) - float(covariance[0]), 0.0)
    room = counts[0] / max(parts, 1) - (2 * lags - 1)
    covariance = covariance + (long_run / room if room > lags else 0.0)
    return Noise(covariance, max(rows.size / (0.75 * overlap), 1.0))
