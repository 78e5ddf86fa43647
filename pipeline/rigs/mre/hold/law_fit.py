"""Fit of the force law of mre.md 3.3 to the holds of one run: separable in F0 and the initial slope.

Two numbers a hold enter: its mean, and its creep against log10(t/t0). Their variances are estimated with
the fit, so noise that stays for a whole hold, or is coloured within it, widens the intervals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.separable import SeparableFit, covariance_of, fit_separable
from pipeline.rigs.mre.hold import law
from pipeline.rigs.mre.hold.law import LEAST_U, MOST_U, Shape

Q_NAMES = ("ln_I_s", "u", "r")
LARGEST_R = 0.6  # of the force per decade; more is no relaxation
_FAR, _NEAR = 30.0, 0.02  # I_s over the largest current
_PASSES = 4


@dataclass(frozen=True, eq=False)
class Rows:
    """What is fitted, one entry a hold, shape (H,): current (magnitude), mean force, mean of log10(t/t0), creep numbers.

    `white` is the variance of the mean that the scatter within the holds and the noise of the current explain; rows of `creep_*` that are
    NaN do not enter. `clock` is (t - t0)/T with T the length of the log: with `drifting`, a force that goes with it is fitted too.
    """

    current: np.ndarray
    force: np.ndarray
    log: np.ndarray
    creep_force: np.ndarray
    creep_log: np.ndarray
    creep_current: np.ndarray
    white: np.ndarray
    clock: np.ndarray
    creep_clock: np.ndarray
    drifting: bool = False

    @property
    def has_creep(self) -> np.ndarray:
        """Which holds tell of their creep, shape (H,)."""
        return np.asarray(np.isfinite(self.creep_force))

    def where(self, kept: np.ndarray) -> Rows:
        """Return some of the holds."""
        arrays = [name for name in self.__dataclass_fields__ if name != "drifting"]
        return replace(self, **{name: getattr(self, name)[kept] for name in arrays})


@dataclass(frozen=True, eq=False)
class LawFit:
    """F = (F0 + h x(I)) (1 - r log10(t/t0)) with x = I_s S(I/I_s; 1/u).

    `free` names the parameters that were searched for, in the order of `covariance`: those of `Q_NAMES` first, then F0, h.
    `scatter` is the standard deviation of a hold's mean beyond what its samples explain, N; `creep_sd` that of the creep numbers.
    """

    rows: Rows
    shape: Shape
    values: dict[str, float]
    free: tuple[str, ...]
    covariance: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    chi2: float
    dof: float
    scatter: float
    mean_sd: np.ndarray
    creep_sd: float
    at_bound: frozenset[str]
    left_out: tuple[int, ...] = ()

    @property
    def F0(self) -> float:
        """Force at 0 A and t0, N."""
        return self.values["F0"]

    @property
    def I_s(self) -> float:
        """Saturation current, A."""
        return math.exp(self.values["ln_I_s"])

    @property
    def p(self) -> float:
        """Sharpness."""
        return 1 / self.values["u"]

    @property
    def a(self) -> float:
        """Limit of the relative increment, h I_s / F0."""
        return self.values["h"] * self.I_s / self.F0

    @property
    def r(self) -> float:
        """Relaxation in a decade of time."""
        return self.values["r"]

    def sd(self, gradient: Mapping[str, float]) -> float:
        """Return the standard error of a number with these derivatives."""
        g = np.array([gradient.get(name, 0.0) for name in self.free])
        return math.sqrt(max(float(g @ self.covariance @ g), 0.0))

    def effective(self, current: np.ndarray) -> np.ndarray:
        """Return x(I), A: I as long as nothing saturates."""
        return self.shape(np.asarray(current, dtype=float), self.I_s, self.values["u"])[0]

    def predicted(self, current: np.ndarray, log_time: np.ndarray) -> np.ndarray:
        """Return the force, N, at |I| (A) and log10(t/t0)."""
        return np.asarray((self.F0 + self.values["h"] * self.effective(current)) * (1 - self.r * log_time))

    @property
    def drifted(self) -> np.ndarray:
        """Part of each hold's force that goes linearly with time, N, shape (H,); 0 where none was fitted."""
        return np.asarray(self.values.get("drift", 0.0) * self.rows.clock)

    def increment(self, current: float) -> tuple[float, float]:
        """Return F(I)/F(0) - 1 at one time, and its standard error."""
        x, by_log, by_u = (float(v[0]) for v in self.shape(np.array([current]), self.I_s, self.values["u"]))
        h, F0 = self.values["h"], self.F0
        gradient = {"ln_I_s": h / F0 * by_log, "u": h / F0 * by_u, "F0": -h * x / F0**2, "h": x / F0}
        return h * x / F0, self.sd(gradient)


class Problem:
    """The rows with their weights; fits with parameters held are what profiles need."""

    def __init__(self, rows: Rows, mean_sd: np.ndarray, creep_sd: float, shape: Shape) -> None:
        self.rows, self.shape = rows, shape
        self.with_creep = rows.has_creep
        self.mean_sd, self.creep_sd = mean_sd, creep_sd
        self.weights = np.r_[1 / mean_sd, np.full(int(self.with_creep.sum()), 1 / creep_sd)]
        self.y = np.r_[rows.force, rows.creep_force[self.with_creep]]
        self.largest = float(rows.current.max())

    def columns(self, q: np.ndarray, gain: float | None) -> tuple[np.ndarray, np.ndarray]:
        """Return columns of F0 and h and their slopes with q; with `gain` = a those of F0 alone."""
        I_s, u, r = math.exp(q[0]), float(q[1]), float(q[2])
        x, by_log, by_u = self.shape(self.rows.current, I_s, u)
        base, base_q = self._relaxed(np.ones_like(x), np.zeros_like(x), r)
        field, field_q = self._relaxed(x, self._local(I_s, u), r)
        d_log, _ = self._relaxed(by_log, np.zeros_like(x), r)
        d_u, _ = self._relaxed(by_u, np.zeros_like(x), r)
        A = np.stack([base, field], axis=1)
        zero = np.zeros_like(base)
        dA = np.stack(
            [np.stack([zero, d_log], axis=1), np.stack([zero, d_u], axis=1), np.stack([base_q, field_q], axis=1)]
        )
        if gain is not None:
            k = gain / I_s
            joined = A @ np.array([1.0, k])
            slopes = dA @ np.array([1.0, k])
            slopes[0] -= k * field
            A, dA = joined[:, None], slopes[:, :, None]
        if self.rows.drifting:
            clock = np.r_[self.rows.clock, self.rows.creep_clock[self.with_creep]]
            A = np.column_stack([A, clock])
            dA = np.concatenate([dA, np.zeros((*dA.shape[:2], 1))], axis=2)
        return A, dA

    def _local(self, I_s: float, u: float) -> np.ndarray:
        """Return dx/dI by central differences of a thousandth of the largest current."""
        step = 1e-3 * self.largest
        current = self.rows.current
        return (self.shape(current + step, I_s, u)[0] - self.shape(np.abs(current - step), I_s, u)[0]) / (2 * step)

    def _relaxed(self, x: np.ndarray, slope: np.ndarray, r: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rows (means, creep) of x (1 - r l) and their derivative with r."""
        rows, there = self.rows, self.with_creep
        mean = x * (1 - r * rows.log)
        creep = slope * rows.creep_current * (1 - r * rows.log) - r * x * rows.creep_log
        mean_r, creep_r = -x * rows.log, -x * rows.creep_log
        return np.r_[mean, creep[there]], np.r_[mean_r, creep_r[there]]

    def fit(
        self, free: Sequence[str], start: Mapping[str, float], gain: float | None = None
    ) -> tuple[SeparableFit, dict[str, float]]:
        """Fit with the parameters in `free` searched and the others of `start` held.

        Raises
        ------
        ValueError
            If the columns are not finite.
        """
        bounds = {
            "ln_I_s": (math.log(_NEAR * self.largest), math.log(_FAR * self.largest)),
            "u": (LEAST_U, MOST_U),
            "r": (-LARGEST_R, LARGEST_R),
        }
        picked = [Q_NAMES.index(name) for name in free]
        base = np.array([start[name] for name in Q_NAMES])

        def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            full = base.copy()
            full[picked] = q
            A, dA = self.columns(full, gain)
            return A, dA[picked]

        low, high = np.array([bounds[name] for name in free]).T if free else np.zeros((2, 0))
        scales = {"ln_I_s": 0.1, "u": 0.05, "r": 0.02}
        fit = fit_separable(
            columns,
            self.y,
            np.clip(base[picked], low + 1e-9, high - 1e-9),
            lower=low,
            upper=high,
            scale=np.array([scales[name] for name in free]),
            weights=self.weights,
            tolerance=1e-12,
        )
        values = dict(start) | dict(zip(free, fit.q.tolist(), strict=True))
        values["F0"] = float(fit.c[0])
        values["h"] = float(fit.c[1]) if gain is None else gain * values["F0"] / math.exp(values["ln_I_s"])
        if self.rows.drifting:
            values["drift"] = float(fit.c[-1])
        return fit, values


def starts_of(rows: Rows) -> list[dict[str, float]]:
    """Return where the search begins: several I_s and sharpnesses."""
    top = float(rows.current.max())
    return [
        {"ln_I_s": math.log(share * top), "u": u, "r": 0.02} for share in (0.4, 0.7, 0.95, 1.4) for u in (0.08, 0.5)
    ]


def fit_law(rows: Rows, shape: Shape = law.saturating, free: Sequence[str] = Q_NAMES) -> LawFit:
    """Fit the law with the variances of means and creep estimated along; outlying holds are left out.

    Raises
    ------
    ValueError
        If there are too few holds for the parameters.
    """
    kept = np.ones(rows.current.size, dtype=bool)
    found = _with_variances(rows, shape, free)
    for _ in range(2):
        off = np.full(kept.size, 0.0)
        off[kept] = found.residual[: int(kept.sum())] * found.mean_sd
        scale = 1.4826 * float(np.median(np.abs(off[kept])))
        wild = kept & (np.abs(off) > 8 * max(scale, float(np.sqrt(np.median(rows.white)))))
        if not wild.any() or wild.sum() > 0.1 * kept.size or (kept & ~wild).sum() < len(free) + 4:
            break
        kept &= ~wild
        found = _with_variances(rows.where(kept), shape, free)
    return replace(found, left_out=tuple(np.flatnonzero(~kept).tolist()))


def _with_variances(rows: Rows, shape: Shape, free: Sequence[str]) -> LawFit:
    mean_sd = np.sqrt(rows.white + (1e-3 * float(np.abs(rows.force).max())) ** 2)
    there = rows.has_creep
    creep_sd = max(1.4826 * float(np.median(np.abs(rows.creep_force[there]))), 1e-9) if there.any() else 1.0
    start: dict[str, float] | None = None
    scatter = 0.0
    for _ in range(_PASSES):
        problem = Problem(rows, mean_sd, creep_sd, shape)
        fit, values = _best(problem, free, starts_of(rows) if start is None else [start])
        start = {name: values[name] for name in Q_NAMES}
        n = rows.current.size
        # What each datum pulls on the fit: the residuals are smaller than the errors by that much.
        pull = np.einsum("ij,jk,ik->i", fit.jacobian, fit.covariance, fit.jacobian)
        pull = np.clip(pull, 0, 0.99)
        raw = fit.residual * np.r_[mean_sd, np.full(int(there.sum()), creep_sd)]
        spare = max(n - float(pull[:n].sum()), 1.0)
        total = float((raw[:n] ** 2).sum()) / spare
        scatter = math.sqrt(max(total - float(rows.white.mean()), 0.0))
        mean_sd = np.sqrt(rows.white + scatter**2)
        if there.any():
            creep_sd = max(math.sqrt(float((raw[n:] ** 2).sum()) / max(there.sum() - float(pull[n:].sum()), 1.0)), 1e-9)
    problem = Problem(rows, mean_sd, creep_sd, shape)
    fit, values = _best(problem, free, [start] if start else starts_of(rows))
    return _result(problem, fit, values, free, scatter)


def _best(
    problem: Problem, free: Sequence[str], starts: Sequence[Mapping[str, float]]
) -> tuple[SeparableFit, dict[str, float]]:
    ends = []
    for start in starts:
        try:
            ends.append(problem.fit(free, start))
        except ValueError as error:
            failure = error
    if not ends:
        raise ValueError(f"the law could not be fitted: {failure}")
    return min(ends, key=lambda end: end[0].chi2)


def _result(
    problem: Problem, fit: SeparableFit, values: dict[str, float], free: Sequence[str], scatter: float
) -> LawFit:
    bound = {name for name, there in zip(free, fit.at_bound, strict=True) if there}
    names = (*free, "F0", "h", *(("drift",) if problem.rows.drifting else ()))
    inside = [i for i, name in enumerate(names) if name not in bound]
    jacobian = fit.jacobian[:, inside]
    covariance, _ = covariance_of(jacobian)
    # Whether the holds scatter more than their samples tell is judged from n - k of them.
    dof = max(problem.rows.current.size - len(inside), 1)
    return LawFit(
        problem.rows,
        problem.shape,
        values,
        tuple(names[i] for i in inside),
        covariance,
        jacobian,
        fit.residual,
        fit.chi2,
        float(dof),
        scatter,
        problem.mean_sd,
        problem.creep_sd,
        frozenset(bound),
    )


def refit(found: LawFit, name: str) -> Callable[[float], float]:
    """Return ``misfit(value)`` with ln_I_s, u or the gain a held and all others fitted: what a profile asks for."""
    problem = Problem(found.rows, found.mean_sd, found.creep_sd, found.shape)
    near = {key: found.values[key] for key in Q_NAMES}
    free = [key for key in Q_NAMES if key != name]
    before = dict(near)

    def misfit(value: float) -> float:
        best = math.inf
        for start in (before, near):
            begin = dict(start) | ({name: value} if name != "a" else {})
            fit, values = problem.fit(free, begin, gain=value if name == "a" else None)
            if fit.chi2 < best:
                best = fit.chi2
                before.update({key: values[key] for key in Q_NAMES})
        return best

    return misfit
