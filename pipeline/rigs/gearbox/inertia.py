"""Load inertia and drag by modulating functions (Shinbrot, Trans. ASME 79, 1957, 451; fact sheet 5.6).

T_out = J_L w' + d0 + d1 w wherever the brake is free and the output turns forward, integrated by parts
against phi = sin^4: the angle is never differentiated. J_L and the gain of torque_out trade off exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import Covariance
from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span, within
from pipeline.rigs.gearbox.ripple import learn

NAMES = ("inertia_load", "drag_coulomb", "drag_viscous")

# Window and hop, s.
_WINDOW, _HOP = 0.8, 0.1
# After the output starts to move again the brake still rubs for a moment, s.
BRAKE_FADES = 0.15
# Integrals of phi = sin^4 over the window.
_MEAN = 3 / 8


@dataclass(frozen=True, eq=False)
class Windows:
    """The integrated load equation of one run, one row a window.

    Attributes
    ----------
    run
        Name.
    columns
        Of J_L, d0, d1: shape (n, 3).
    torque
        Integral of phi T_out, N m s, shape (n,).
    time
        Centre of each window, s; `place` counts hops, so that equal differences are equal lags.
    noise
        Covariance of two windows 0, 1, ... hops apart by the noise of torque_out, (N m s)^2, shape (lags,).
    offset_error
        Standard error of the zero offset of torque_out, N m: common to all rows.
    noise_dof
        Degrees of freedom of `noise`.
    """

    run: str
    columns: np.ndarray
    torque: np.ndarray
    time: np.ndarray
    place: np.ndarray
    noise: np.ndarray
    offset_error: float
    noise_dof: float

    def part(self, span: Span) -> Windows:
        """Return the windows whose centre lies inside `span`."""
        kept = (self.time >= span[0]) & (self.time <= span[1])
        return Windows(
            self.run,
            self.columns[kept],
            self.torque[kept],
            self.time[kept],
            self.place[kept],
            self.noise,
            self.offset_error,
            self.noise_dof,
        )

    def covariance(self) -> np.ndarray:
        """Return the covariance of `torque`, shape (n, n): stationary noise and the common offset."""
        lag = np.abs(self.place[:, None] - self.place[None, :])
        table = np.append(self.noise, 0.0)
        return np.asarray(table[np.minimum(lag, self.noise.size)] + self._common)

    def weighted(self, columns: np.ndarray) -> np.ndarray:
        """Return C^-1 `columns`, shape (n, k), for the covariance C of a common offset and equal, independent noise.

        The noise is as large as the correlated one is for means; its measured correlation itself is too rough
        to be inverted (and is all but singular).
        """
        n = self.torque.size
        level = max(float(self.noise[0] + 2 * self.noise[1:].sum()), float(self.noise[0]))
        level = level if level > 0 else 1.0
        pull = self._common / (level + n * self._common)
        return np.asarray((columns - pull * columns.sum(axis=0)) / level)

    @property
    def _common(self) -> float:
        return (self.offset_error * _MEAN * _WINDOW) ** 2


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
        Ratio (squared) of what the runs say of the parameters to what their noise allows: about 1.
    undetermined
        Parameter -> why the data cannot tell it.
    """

    values: np.ndarray
    covariance: Covariance
    residuals: dict[str, tuple[np.ndarray, np.ndarray]]
    scatter: float
    undetermined: dict[str, str]

    def steady_torque(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return d0 + d1 w at steady `speed` (rad/s, shape (n,)) and its covariance, shape (n, n)."""
        slopes = np.column_stack([np.ones_like(speed), speed])
        return slopes @ self.values[1:], slopes @ self.covariance.matrix[1:, 1:] @ slopes.T


def free_spans(run: AlignedRun) -> dict[str, Span]:
    """Return the stretches where the load turns forward with a free brake: `startup` and `release`, s."""
    spans = {}
    if run.has("startup", "fos"):
        first = run.stages["startup"][0]
        # The first edge of the counter may be late by one count: start when a twentieth turn is done.
        started = run.angle - run.angle_at(np.array([first]))[0] > 2 * math.pi / 20
        moving = run.angle_time[started & (run.angle_time >= first)]
        end = run.events.get("brake_onset", run.stages["fos"][1])
        if moving.size:
            spans["startup"] = (float(moving[0]), end - 0.05)
    if run.has("release"):
        start = run.stages["release"][0] + BRAKE_FADES
        spans["release"] = (start, run.stages.get("fos_after", run.stages["release"])[1] - 0.05)
    return {name: span for name, span in spans.items() if span[1] - span[0] > _WINDOW}


def modulated(run: AlignedRun, steady: Sequence[Span]) -> Windows | None:
    """Integrate the load equation of a run over all its windows.

    Parameters
    ----------
    run
        With stages `startup` and `fos`, or `release` and `fos_after`.
    steady
        Settled locked stretches: ripple and noise of torque_out are learnt there.

    Returns
    -------
    None where no window fits.
    """
    time, _, torque = run.slow
    angle = run.angle_at(time)
    if steady:
        inside = np.concatenate([np.arange(time.size)[within(time, span)] for span in steady])
        torque = torque - learn(angle[inside], torque[inside]).at(angle)
    rows, torques, centres = [], [], []
    for span in free_spans(run).values():
        for start in np.arange(span[0], span[1] - _WINDOW, _HOP):
            row = _row(run.angle_time, run.angle, start)
            value = _weighted_torque(time, torque, start)
            if row is not None and value is not None:
                rows.append(row)
                torques.append(value)
                centres.append(start + 0.5 * _WINDOW)
    if not rows:
        return None
    noise, dof = _noise(time, torque, steady)
    centre = np.array(centres)
    return Windows(
        run.run,
        np.array(rows),
        np.array(torques),
        centre,
        np.rint((centre - centre[0]) / _HOP).astype(int),
        noise,
        run.offset_out.std_error,
        dof,
    )


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
    their noise allows.
    """
    A = np.concatenate([w.columns for w in windows])
    scale = np.linalg.norm(A, axis=0)
    if A.shape[0] < 4 or not (scale > 0).all() or np.linalg.cond(A / scale) > 1e4:
        return None
    weighted = [w.weighted(w.columns / scale) for w in windows]
    information = sum((x.T @ w.columns for x, w in zip(weighted, windows, strict=True)), np.zeros((3, 3)))
    pulls = [np.linalg.solve(information, x.T) for x in weighted]
    values = sum((pull @ w.torque for pull, w in zip(pulls, windows, strict=True)), np.zeros(3))
    total = np.zeros((3, 3))
    scores, spreads, shares = [], [], []
    for pull, w in zip(pulls, windows, strict=True):
        own = pull @ w.covariance() @ pull.T
        total += own
        scores.append(pull @ (w.torque - w.columns @ values))
        spreads.append(own)
        shares.append((float(np.trace(own / np.outer(values, values))), w.noise_dof))
    scatter = _scatter(scores, spreads) if len(windows) > 2 else 1.0
    share = np.array([s for s, _ in shares])
    dof = float(share.sum() ** 2 / np.sum(share**2 / np.array([d for _, d in shares])))
    residuals = {w.run: (w.time, (w.torque - w.columns @ values) / (_MEAN * _WINDOW)) for w in windows}
    covariance = Covariance(total * max(scatter, 1.0), dof, "noise of steady stretches")
    return LoadFit(values, covariance, residuals, scatter, _undetermined(values, covariance))


def _scatter(scores: list[np.ndarray], spreads: list[np.ndarray]) -> float:
    """Return the mean square of the runs' scores over what their noise allows, per degree of freedom."""
    sums = np.array([np.diag(s) for s in spreads]).sum(axis=0)
    ratio = np.square(scores).sum(axis=0) / sums
    runs = len(scores)
    return float(ratio.mean()) * runs / (runs - 1)


def _undetermined(values: np.ndarray, covariance: Covariance) -> dict[str, str]:
    """Tell which parameters have an error as large as themselves."""
    error = covariance.std_error
    reasons = {
        "inertia_load": "the load hardly accelerates in these runs",
        "drag_coulomb": "the runs hold too little steady motion",
        "drag_viscous": "the runs hold too few speeds",
    }
    return {name: reasons[name] for name, v, e in zip(NAMES, values, error, strict=True) if not e < abs(v)}


def _row(time: np.ndarray, angle: np.ndarray, start: float) -> np.ndarray | None:
    """Return the integrals of phi'' theta, phi and -phi' theta over the window, None where angles are missing."""
    part = slice(
        max(int(np.searchsorted(time, start)) - 1, 0), int(np.searchsorted(time, start + _WINDOW, side="right")) + 1
    )
    t, theta = time[part], angle[part]
    if t.size < 12 or t[0] > start or t[-1] < start + _WINDOW or np.diff(t).max() > 0.1 * _WINDOW:
        return None
    x = math.pi * (t - start) / _WINDOW
    inside = (x > 0) & (x < math.pi)
    s, c = np.sin(x), np.cos(x)
    rate = math.pi / _WINDOW
    first = np.where(inside, 4 * rate * s**3 * c, 0.0)
    second = np.where(inside, 4 * rate**2 * s**2 * (3 * c**2 - s**2), 0.0)
    # phi'' is orthogonal to straight lines and phi' to constants: take them off before the sum, exactly.
    centred = t - start - 0.5 * _WINDOW
    speed, level = np.polyfit(centred, theta, 1)
    rest = theta - level - speed * centred
    mean = _MEAN * _WINDOW
    return np.array([np.trapezoid(second * rest, t), mean, speed * mean - np.trapezoid(first * rest, t)])


def _weighted_torque(time: np.ndarray, torque: np.ndarray, start: float) -> float | None:
    """Return the integral of phi T_out over the window, None where torques are missing."""
    part = within(time, (start, start + _WINDOW))
    t = time[part]
    if t.size < 20 or np.diff(t).max() > 0.1 * _WINDOW:
        return None
    phi = np.sin(math.pi * (t - start) / _WINDOW) ** 4
    return float(np.trapezoid(phi * torque[part], t))


def _noise(time: np.ndarray, torque: np.ndarray, steady: Sequence[Span]) -> tuple[np.ndarray, float]:
    """Return the covariance of windows 0, 1, ... hops apart in steady stretches, and its degrees of freedom."""
    lags = math.ceil(_WINDOW / _HOP) + 2
    step = float(np.median(np.diff(time)))
    size, hop = round(_WINDOW / step), max(round(_HOP / step), 1)
    phi = np.sin(math.pi * (np.arange(size) + 0.5) / size) ** 4 * step
    products, counts, dof = np.zeros(lags), np.zeros(lags), 0.0
    for span in steady:
        part = within(time, span)
        x = torque[part] - torque[part].mean()
        if x.size < 2 * size:
            continue
        e = np.correlate(x, phi, "valid")
        # The mean of the stretch was taken out, and with it a share of the slow noise.
        lost = 1 - size / x.size
        for lag in range(lags):
            if e.size > lag * hop:
                products[lag] += e[lag * hop :] @ e[: e.size - lag * hop] / lost
                counts[lag] += e.size - lag * hop
        dof += x.size / (0.5 * size)
    if not counts[0]:
        return np.zeros(lags), 1.0
    return products / np.maximum(counts, 1), max(dof, 1.0)
