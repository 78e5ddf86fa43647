"""Friction over speed: drag to ground while locked, and the torque of the slipping gears (fact sheet 3.5, 5.6).

Laws are fitted to one torque per run; how that torque follows from the levels of a run is in `derived`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.estimation.separable import fit_separable, linear_fit
from pipeline.estimation.uncertainty import Covariance, effective_size
from pipeline.rigs.gearbox.many import blocks
from pipeline.rigs.over_runs import MANY

# Below so many different speeds the Stribeck law's four parameters cannot be told.
LEAST_SPEEDS = 5
# Speeds that differ by less than this share are one speed.
_SAME = 0.03
_W_S_BOUNDS = (3.0, 60.0)


def slip_torque_by_input(torque_in: float, drag: float) -> float:
    """Return M_slip = T_in - T_0, N m, with the drag found while locked: right where slipping does not change it."""
    return torque_in - drag


@dataclass(frozen=True, eq=False)
class Curve:
    """A fitted friction law.

    Attributes
    ----------
    law
        `stribeck`: c0 + c_s exp(-(w/w_s)^2) + b0 w; `line`: c0 + b0 w; `slip`: M_c + M_v s.
    names, values
        Parameters, SI, shape (k,).
    covariance
        With its degrees of freedom.
    chi2
        Weighted sum of squares of the residuals; `n` speeds.
    at_bound
        Parameters that lie at a bound.
    """

    law: Literal["stribeck", "line", "slip"]
    names: tuple[str, ...]
    values: np.ndarray
    covariance: Covariance
    chi2: float
    n: int
    at_bound: tuple[str, ...] = ()

    def at(self, speed: np.ndarray) -> np.ndarray:
        """Return the curve at `speed` (rad/s), N m, same shape."""
        return _law(self.law, self.values, np.asarray(speed, dtype=float))[0]

    def error(self, speed: np.ndarray) -> np.ndarray:
        """Return the curve's standard error at `speed`, N m, same shape: narrower than its parameters suggest."""
        slopes = _law(self.law, self.values, np.asarray(speed, dtype=float))[1]
        variance = np.einsum("ni,ij,nj->n", slopes, self.covariance.matrix, slopes)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def distinct(speeds: np.ndarray) -> int:
    """Return how many different speeds there are; those within 3 % are one.

    Examples
    --------
    >>> distinct(np.array([6.3, 12.5, 12.6, 22.0]))
    3
    """
    ordered = np.sort(speeds)
    return int(ordered.size and 1 + np.sum(np.diff(ordered) > _SAME * ordered[1:]))


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Errors of one value a run: those of its own and those that all runs share.

    Attributes
    ----------
    own
        Standard error of each run alone, shape (n,).
    common
        How much one standard error of each shared cause moves every run, shape (n, k).
    """

    own: np.ndarray
    common: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        """Covariance of the runs, shape (n, n)."""
        return np.asarray(np.diag(self.own**2) + self.common @ self.common.T)

    def whitening(self) -> Callable[[np.ndarray], np.ndarray]:
        """Return the map of rows (n, ...) after which they are independent and of unit variance.

        (I + V V')^-1/2 from the singular values of V = common / own: the work grows with the runs, not with their square.
        """
        directions, sizes, _ = np.linalg.svd(self.common / self.own[:, None], full_matrices=False)
        shrink = 1.0 / np.sqrt(1.0 + sizes**2) - 1.0

        def whiten(rows: np.ndarray) -> np.ndarray:
            scaled = (rows.T / self.own).T
            return np.asarray(scaled + (directions * shrink) @ np.tensordot(directions.T, scaled, 1))

        return whiten


def shared_errors(
    own_error: np.ndarray, torque_out: np.ndarray, a: float, a_error: float, common: np.ndarray | None = None
) -> SharedErrors:
    """Return the errors of x - T_out/a over the runs: own ones, that of `a`, which all share, and `common` ones.

    Parameters
    ----------
    own_error, torque_out
        N m, shape (n,).
    a, a_error
        Transfer slope and its standard error.
    common
        Of T_out, N m, shape (n, k).
    """
    pull = (torque_out / a**2 * a_error)[:, None]
    return SharedErrors(own_error, pull if common is None else np.hstack([pull, common / a]))


def drag_curve(speed: np.ndarray, drag: np.ndarray, errors: SharedErrors) -> Curve | None:
    """Fit T_0 over speed: Stribeck from five speeds on, a straight line with three or four, else nothing.

    Parameters
    ----------
    speed, drag
        rad/s and N m, shape (n,), one entry a run.
    errors
        Of `drag`.

    Returns
    -------
    None below three speeds: then there is T_0 per speed and no law.
    """
    count = distinct(speed)
    if count < 3:
        return None
    whiten = errors.whitening()
    if count < LEAST_SPEEDS:
        straight = linear_fit(np.column_stack([np.ones_like(speed), speed]), drag, whiten=whiten)
        return _curve("line", ("c0", "b0"), straight.c, straight.covariance, straight.chi2, speed, drag, errors.own)

    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ratio = speed / q[0]
        bump = np.exp(-(ratio**2))
        slopes = np.zeros((1, speed.size, 3))
        slopes[0, :, 1] = 2 * ratio**2 / q[0] * bump
        return np.column_stack([np.ones_like(speed), bump, speed]), slopes

    fits = [
        fit_separable(
            columns,
            drag,
            np.array([start]),
            lower=np.array([_W_S_BOUNDS[0]]),
            upper=np.array([_W_S_BOUNDS[1]]),
            scale=np.array([10.0]),
            whiten=whiten,
        )
        for start in (6.0, 12.0, 25.0)
    ]
    best = min(fits, key=lambda fit: fit.chi2)
    order = [1, 2, 0, 3]  # [w_s, c0, c_s, b0] -> [c0, c_s, w_s, b0]
    values = np.array([*best.c[:2], best.q[0], best.c[2]])
    matrix = best.covariance[np.ix_(order, order)]
    held = ("w_s",) if bool(best.at_bound[0]) else ()
    return _curve("stribeck", ("c0", "c_s", "w_s", "b0"), values, matrix, best.chi2, speed, drag, errors.own, held)


def slip_line(slip: np.ndarray, torque: np.ndarray, errors: SharedErrors) -> Curve | None:
    """Fit M_slip = M_c + M_v s over the slip speed; None below two different slips.

    Parameters
    ----------
    slip, torque
        rad/s and N m, shape (n,).
    errors
        Of `torque`.
    """
    if distinct(slip) < 2:
        return None
    fit = linear_fit(np.column_stack([np.ones_like(slip), slip]), torque, whiten=errors.whitening())
    names = ("slip_torque_intercept", "slip_torque_slope")
    return _curve("slip", names, fit.c, fit.covariance, fit.chi2, slip, torque, errors.own)


def _curve(
    law: Literal["stribeck", "line", "slip"],
    names: tuple[str, ...],
    values: np.ndarray,
    matrix: np.ndarray,
    chi2: float,
    speed: np.ndarray,
    torque: np.ndarray,
    own: np.ndarray,
    at_bound: tuple[str, ...] = (),
) -> Curve:
    """Return the curve; runs that differ by more than their errors allow widen it, and so do neighbours that are alike."""
    n, values = speed.size, np.asarray(values)
    dof = n - len(names)
    factor = max(chi2 / dof, 1.0) if dof > 0 else 1.0
    if n > MANY:
        covariance = _by_blocks(law, values, matrix, speed, torque, own)
    else:
        covariance = Covariance(matrix * factor, dof if factor > 1 else math.inf, "generalised least squares")
    return Curve(law, names, values, covariance, chi2, n, at_bound)


def _by_blocks(
    law: str, values: np.ndarray, matrix: np.ndarray, speed: np.ndarray, torque: np.ndarray, own: np.ndarray
) -> Covariance:
    """Widen what the runs' own errors give to what blocks of neighbouring runs scatter by; errors that all share stay.

    Runs of a warm day are off alike: that shifts the curve and tells little of its course over speed.
    """
    found, slopes = _law(law, values, speed)
    rows, left = slopes / own[:, None], (torque - found) / own
    alone = np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
    pulls = np.array([rows[block].T @ left[block] for block in blocks(speed.size)])
    count = pulls.shape[0]
    scatter = alone @ (pulls.T @ pulls) @ alone * count / (count - 1)
    wider = np.sqrt(np.maximum(np.diag(scatter) / np.diag(alone), 1.0))
    widened = matrix + alone * (np.outer(wider, wider) - 1.0)
    return Covariance(widened, count - values.size, "generalised least squares, scatter of blocks of runs")


def independent(values: np.ndarray) -> float:
    """Return how many runs count, where they are many and neighbours are alike: warm days, not a drift over all of them.

    Parameters
    ----------
    values
        In the order of the runs, shape (n,), their speed's part taken off.
    """
    if values.size <= MANY:
        return float(values.size)
    x = np.linspace(-1.0, 1.0, values.size)
    return max(effective_size(values - np.polyval(np.polyfit(x, values, 1), x), 2), 2.0)


def scatter_of_groups(groups: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float]:
    """Return how many times their own variance values scatter by within their groups, all groups together, and the dof.

    Parameters
    ----------
    groups
        Values and their own standard errors, shape (n,) each, n at least 2; without any the factor is 1.

    Examples
    --------
    >>> scatter_of_groups([(np.array([1.0, 3.0]), np.array([1.0, 1.0])), (np.array([8.0, 6.0]), np.array([1.0, 1.0]))])
    (2.0, 2.0)
    """
    dof = float(sum(values.size - 1 for values, _ in groups))
    if dof == 0.0:
        return 1.0, math.inf
    squares = sum(float(np.sum((values - values.mean()) ** 2) / np.mean(own**2)) for values, own in groups)
    return squares / dof, dof


def mean_of_runs(
    values: np.ndarray,
    errors: np.ndarray,
    dofs: np.ndarray,
    common: np.ndarray,
    elsewhere: tuple[float, float] = (1.0, math.inf),
) -> tuple[float, float, float]:
    """Return the mean of a quantity over runs of one speed, its own standard error and that one's degrees of freedom.

    Own errors average out, and are wider where the runs scatter by more; what all share (`common`) does not, and is
    the mean's own matter.

    Parameters
    ----------
    values, errors, dofs
        Of each run alone, in the order of the runs, shape (n,).
    common
        Standard error that all runs share, by run, shape (n,).
    elsewhere
        How many times their own variance runs of all speeds scatter by, and its degrees of freedom: few runs of one speed
        may lie close to each other by chance.
    """
    n = values.size
    own = errors**2 - common**2
    noise = float(np.maximum(own, 0.0).sum()) / n**2
    count = independent(values)
    scatter = float(values.var(ddof=1)) / count if n > 1 else 0.0
    birge = max(scatter / noise, 1.0) if noise > 0 else 1.0
    birge, freedom = max((birge, max(count - 1.0, 1.0)), elsewhere)
    shares = np.maximum(own, 0.0) / n**2 / noise if noise > 0 else np.full(n, 1.0 / n)
    spread = float(np.sum(shares**2 / dofs)) + (birge - 1.0) ** 2 / freedom
    return float(values.mean()), math.sqrt(max(birge * noise, scatter)), birge**2 / spread if spread > 0 else math.inf


def _law(law: str, values: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the law and its derivatives with respect to the parameters, shapes (n,) and (n, k)."""
    one = np.ones_like(w)
    if law != "stribeck":
        return values[0] + values[1] * w, np.column_stack([one, w])
    c0, c_s, w_s, b0 = values
    bump = np.exp(-((w / w_s) ** 2))
    return c0 + c_s * bump + b0 * w, np.column_stack([one, bump, c_s * bump * 2 * w**2 / w_s**3, w])
