"""Fit of F = F0 + sum_k g_k y_k - c log10(1 + t) to a log with steps (mre.md 3.4): separable in F0, c and the gains.

y_k is the part of the measured current that belongs to step k, delayed by L and through one or two lags; L and
the lags are those of its direction. Each step has a gain of its own, so saturation does not bend the times.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.profile import ProfileInterval, profile_interval
from pipeline.estimation.selection import Candidate
from pipeline.estimation.separable import SeparableFit, covariance_of, fit_separable
from pipeline.estimation.uncertainty import Covariance, effective_size, widened
from pipeline.rigs.mre.step.lags import response
from pipeline.rigs.mre.step.record import DIRECTIONS, Record

_STARTS = ((0.1, 0.3), (0.4, 0.1), (0.03, 0.5), (1.2, 0.1))  # tau1 (s), tau2/tau1
_MOST_DELAY = 1.0  # s
# Rows of a search: so many over the log, and so many samples one by one after each step.
_COARSE, _CLOSE = 1000, 700
_WILD = 6.0
# BIC by which a second lag must win.
_MARGIN = 6.0
_SURE_DRIFT, _LEAST_DRIFT = 8.0, 5e-3  # standard errors; of the largest step

Lags = Mapping[str, int]


@dataclass(frozen=True, eq=False)
class LagFit:
    """The fit of one log. `values` holds L, ln_tau1 (and ln_tau2, the smaller) by direction, as ``"rise.L"``; `names` their order in `q` and `covariance`.

    `drift` is what the force drifts over the log beside creep, N, where that was fitted along. `profiles` holds the intervals of L and
    ln_tau1 with a second lag admitted, for directions in which none was told.
    """

    record: Record
    lags: dict[str, int]
    names: tuple[str, ...]
    q: np.ndarray
    c: np.ndarray
    covariance: Covariance
    model: np.ndarray
    residual: np.ndarray
    kept: np.ndarray
    effective: float
    at_bound: frozenset[str]
    drift: float
    profiles: Mapping[str, ProfileInterval]

    @property
    def values(self) -> dict[str, float]:
        """Return the search parameters by name."""
        return dict(zip(self.names, self.q.tolist(), strict=True))

    @property
    def sigma(self) -> float:
        """Standard deviation of what is left, N."""
        return float(np.sqrt(np.mean(self.residual[self.kept] ** 2)))

    def gain(self, step: int) -> float:
        """Return the force of a step per ampere, N/A."""
        return float(self.c[2 + step])

    def taus(self, direction: str) -> tuple[float, ...]:
        """Return the time constants of a direction, the larger first, s."""
        v = self.values
        return tuple(math.exp(v[f"{direction}.ln_tau{i + 1}"]) for i in range(self.lags[direction]))

    def index(self, *names: str) -> list[int]:
        """Return where parameters stand in `q`."""
        return [self.names.index(name) for name in names]


def name_of(lags: Lags) -> str:
    """Return what a model is called: ``"rise: two lags, fall: one lag"``."""
    words = {1: "one lag", 2: "two lags"}
    return ", ".join(f"{direction}: {words[lags[direction]]}" for direction in DIRECTIONS if direction in lags)


@dataclass(frozen=True, eq=False)
class Rows:
    """Force to fit, shape (n,): times, means of the samples there, and the root of their number as weight."""

    time: np.ndarray
    force: np.ndarray
    weight: np.ndarray

    @classmethod
    def all_of(cls, record: Record, kept: np.ndarray) -> Rows:
        """Return every sample that is kept."""
        return cls(record.time[kept], record.force[kept], np.ones(int(kept.sum())))

    @classmethod
    def thinned(cls, record: Record, kept: np.ndarray) -> Rows:
        """Return the samples that follow each step one by one, and means of neighbours elsewhere: enough for a search."""
        time, force = record.time[kept], record.force[kept]
        period = float(np.median(np.diff(time)))
        group = np.arange(time.size) // max(round(time.size / _COARSE), 1)
        for step in record.steps:
            close = (time > step.onset - 30 * period) & (time < step.onset + _CLOSE * period)
            group = np.where(close, time.size + np.arange(time.size), group)
        _, member, count = np.unique(group, return_inverse=True, return_counts=True)
        mean = [np.bincount(member, weights=values) / count for values in (time, force)]
        order = np.argsort(mean[0], kind="stable")
        return cls(mean[0][order], mean[1][order], np.sqrt(count[order]))


class Problem:
    """Columns of the model for given numbers of lags, at given rows."""

    def __init__(self, record: Record, lags: Lags, rows: Rows, drift: bool = False) -> None:
        self.record, self.lags, self.rows, self.drift = record, dict(lags), rows, drift
        self.names = tuple(
            f"{direction}.{name}"
            for direction, count in self.lags.items()
            for name in ("L", "ln_tau1", "ln_tau2")[: 1 + count]
        )
        self.time = rows.time
        self.parts = parts_of(record)

    def columns(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the columns 1, log10(1 + t), y_k (and t) and their slopes with q."""
        v = dict(zip(self.names, q.tolist(), strict=True))
        n, steps = self.time.size, self.record.steps
        A = np.empty((n, 2 + len(steps) + self.drift))
        if self.drift:
            A[:, -1] = self.time / float(self.record.grid[-1])
        A[:, 0], A[:, 1] = 1.0, np.log10(1 + np.maximum(self.time, 0.0))
        dA = np.zeros((q.size, n, A.shape[1]))
        for number, step in enumerate(steps):
            count = self.lags[step.direction]
            taus = tuple(math.exp(v[f"{step.direction}.ln_tau{i + 1}"]) for i in range(count))
            y, rate, slopes = response(self.parts[number], taus, self.record.dt)
            at = self.time - v[f"{step.direction}.L"]
            first = self.names.index(f"{step.direction}.L")
            found = self._sampled(at, np.vstack([y, -rate, slopes]))
            A[:, 2 + number] = found[0]
            dA[first : first + 1 + count, :, 2 + number] = found[1:]
        return A, dA

    def _sampled(self, at: np.ndarray, curves: np.ndarray) -> np.ndarray:
        """Return curves of the grid, shape (m, grid), at other times: straight between its points, held beyond its ends."""
        place = np.clip((at - self.record.grid[0]) / self.record.dt, 0.0, curves.shape[1] - 1.000001)
        k = place.astype(int)
        share = place - k
        return np.asarray(curves[:, k] * (1 - share) + curves[:, k + 1] * share)

    def fit(self, start: Mapping[str, float], hold: tuple[str, float] | None = None) -> SeparableFit:
        """Fit from a start; with one parameter held where asked for (and no second lag above a first that is held).

        Raises
        ------
        ValueError
            If the columns are not finite there.
        """
        period, length = self.record.period, float(self.record.grid[-1])
        low, high = math.log(0.02 * min(period, 0.01)), math.log(3 * length)
        bounds = {"L": (-_MOST_DELAY, _MOST_DELAY), "ln_tau1": (low, high), "ln_tau2": (low, high)}
        lower, upper = np.array([bounds[name.split(".")[1]] for name in self.names]).T
        q0 = np.array([start[name] for name in self.names])
        if hold is not None:
            at = self.names.index(hold[0])
            q0[at], lower[at], upper[at] = hold[1], hold[1] - 1e-9, hold[1] + 1e-9
            if hold[0].endswith("ln_tau1"):
                upper[at + 1] = max(hold[1], lower[at + 1] + 1e-3)
        scale = np.array([0.02 if name.endswith(".L") else 0.2 for name in self.names])
        return fit_separable(
            self.columns,
            self.rows.force,
            np.clip(q0, lower + 1e-10, upper - 1e-10),
            lower=lower,
            upper=upper,
            scale=scale,
            weights=self.rows.weight,
            tolerance=1e-8,
            max_evaluations=60,
        )


def parts_of(record: Record) -> list[np.ndarray]:
    """Return what each step adds to the current, on the grid: 0 before, the change of the level after."""
    parts = []
    starts = [step.start for step in record.steps]
    for number, step in enumerate(record.steps):
        end = starts[number + 1] if number + 1 < len(starts) else math.inf
        part = np.where(record.grid < step.start, 0.0, record.current - step.before)
        parts.append(np.where(record.grid >= end, step.after - step.before, part))
    return parts


@dataclass(frozen=True, eq=False)
class Found:
    """The fit that was chosen, and all candidates that it was chosen from."""

    fit: LagFit
    candidates: tuple[Candidate, ...]


def fit_lags(record: Record) -> Found:
    """Fit one and two lags in each direction and take the model with no more lags than BIC asks for.

    Raises
    ------
    ValueError
        If nothing could be fitted.
    """
    present = [direction for direction in DIRECTIONS if record.of(direction)]
    kept = np.ones(record.time.size, dtype=bool)
    rows = Rows.thinned(record, kept)
    single = _best(Problem(record, dict.fromkeys(present, 1), rows), [_start(present, *pair) for pair in _STARTS])
    drifts = _drifts(Problem(record, dict.fromkeys(present, 1), rows), single)
    both = Problem(record, dict.fromkeys(present, 2), rows, drifts)
    double = _best(both, [_start(present, *pair) for pair in _STARTS[:2]] + _from_one(single, present))
    drifts = drifts or _drifts(both, double)
    if drifts and not both.drift:
        both = Problem(record, both.lags, rows, drifts)
        double = _best(both, [dict(zip(both.names, double.q.tolist(), strict=True))])
    everywhere = Problem(record, both.lags, Rows.all_of(record, kept), drifts)
    rest = record.force - everywhere.columns(double.q)[0] @ double.c
    off = np.abs(rest - np.median(rest))
    kept = off <= _WILD * 1.4826 * float(np.median(off)) if float(np.median(off)) > 0 else kept
    if kept.mean() < 0.98:  # no lone samples: the model misses something, which must show
        kept = np.ones(record.time.size, dtype=bool)
    rows = Rows.thinned(record, kept)
    effective = effective_size(rest[kept], 3 * len(present))
    tried = []
    for lags in _choices(present):
        fit = _best(Problem(record, lags, rows, drifts), [_of_both(single, double, present, lags)])
        tried.append((lags, fit, fit.q.size + fit.c.size))
    # Means weigh as their samples do: a rise of the misfit is the same as with every sample.
    least = min(fit.chi2 for _, fit, _ in tried)
    n = max(round(effective), max(k for _, _, k in tried) + 3)
    base = float(rest[kept] @ rest[kept])
    candidates = tuple(
        Candidate(name_of(lags), (base + fit.chi2 - least) * n / int(kept.sum()), n, k) for lags, fit, k in tried
    )
    best = min(candidate.bic for candidate in candidates)
    near = [i for i, candidate in enumerate(candidates) if candidate.bic < best + _MARGIN]
    chosen = min(near, key=lambda i: (candidates[i].n_parameters, candidates[i].bic))
    lags, rough = tried[chosen][:2]
    problem = Problem(record, lags, Rows.all_of(record, kept), drifts)
    found = _result(problem, _best(problem, [dict(zip(problem.names, rough.q.tolist(), strict=True))]), kept)
    scale = found.sigma**2 * max(int(kept.sum()) / effective, 1.0)
    profiles: dict[str, ProfileInterval] = {}
    for direction in present:
        if lags[direction] == 1:
            wider = Problem(record, {**lags, direction: 2}, rows, drifts)
            begin = _of_both(single, double, present, wider.lags)
            profiles |= _profiles(wider, direction, begin, scale, found)
    return Found(replace(found, effective=effective, profiles=profiles), candidates)


def _drifts(problem: Problem, fit: SeparableFit) -> bool:
    """Tell whether what is left asks for a straight drift beside creep, by far more than noise would."""
    rest = fit.residual
    column = problem.time / float(problem.record.grid[-1]) * problem.rows.weight
    left = column - fit.jacobian @ np.linalg.lstsq(fit.jacobian, column, rcond=None)[0]
    norm = float(left @ left)
    if norm < 1e-8 * float(column @ column):
        return False
    value = float(left @ rest) / norm
    sigma = float(np.sqrt(np.mean((rest - value * left) ** 2)))
    size = max(abs(float(c) * (s.after - s.before)) for c, s in zip(fit.c[2:], problem.record.steps, strict=False))
    return abs(value) * math.sqrt(norm) > _SURE_DRIFT * sigma and abs(value) > _LEAST_DRIFT * size


def _profiles(
    problem: Problem, direction: str, start: Mapping[str, float], scale: float, chosen: LagFit
) -> dict[str, ProfileInterval]:
    """Return the intervals of L and ln_tau1 of a direction with a second lag admitted, on thinned rows."""
    best = _best(problem, [start])
    names = dict(zip(problem.names, best.q.tolist(), strict=True))
    first, second = f"{direction}.ln_tau1", f"{direction}.ln_tau2"
    if names[first] < names[second]:
        names[first], names[second] = names[second], names[first]
    found = {}
    for name, guess in ((f"{direction}.L", 0.003), (first, 0.03)):
        place = chosen.names.index(name)
        error = float(np.sqrt(chosen.covariance.matrix[place, place]))
        error = error if math.isfinite(error) and error > 0 else guess

        def misfit(value: float, name: str = name) -> float:
            return problem.fit(names, (name, value)).chi2

        least = min(best.chi2, misfit(names[name]))
        found[name] = profile_interval(
            misfit, names[name], least, max(error, guess), dof=chosen.covariance.dof, scale=scale, reach=40.0
        )
    return found


def _choices(present: Sequence[str]) -> list[dict[str, int]]:
    if len(present) == 1:
        return [{present[0]: count} for count in (1, 2)]
    return [dict(zip(present, pair, strict=True)) for pair in ((1, 1), (1, 2), (2, 1), (2, 2))]


def _start(present: Sequence[str], tau1: float, ratio: float) -> dict[str, float]:
    start: dict[str, float] = {}
    for direction in present:
        start |= {
            f"{direction}.L": 0.01,
            f"{direction}.ln_tau1": math.log(tau1),
            f"{direction}.ln_tau2": math.log(tau1 * ratio),
        }
    return start


def _from_one(single: SeparableFit, present: Sequence[str]) -> list[dict[str, float]]:
    """Return starts with a second lag split off the delay and lag of the first fit."""
    starts = []
    for ratio in (0.1, 0.4):
        start: dict[str, float] = {}
        for number, direction in enumerate(present):
            L, tau = float(single.q[2 * number]), math.exp(float(single.q[2 * number + 1]))
            start |= {
                f"{direction}.L": max(L - ratio * tau, 0.0),
                f"{direction}.ln_tau1": math.log(tau),
                f"{direction}.ln_tau2": math.log(tau * ratio),
            }
        starts.append(start)
    return starts


def _of_both(single: SeparableFit, double: SeparableFit, present: Sequence[str], lags: Lags) -> dict[str, float]:
    """Return the best start for a mixed model: each direction from the fit with its number of lags."""
    start: dict[str, float] = {}
    for number, direction in enumerate(present):
        if lags[direction] == 1:
            L, tau = single.q[2 * number : 2 * number + 2]
            start |= {f"{direction}.L": float(L), f"{direction}.ln_tau1": float(tau)}
        else:
            L, first, second = double.q[3 * number : 3 * number + 3]
            start |= {
                f"{direction}.L": float(L),
                f"{direction}.ln_tau1": float(first),
                f"{direction}.ln_tau2": float(second),
            }
    return start


def _best(problem: Problem, starts: Sequence[Mapping[str, float]]) -> SeparableFit:
    ends, failure = [], ""
    for start in starts:
        try:
            ends.append(problem.fit(start))
        except ValueError as error:
            failure = str(error)
    if not ends:
        raise ValueError(f"the response could not be fitted: {failure}")
    return min(ends, key=lambda end: end.chi2)


def _result(problem: Problem, fit: SeparableFit, kept: np.ndarray) -> LagFit:
    q, jacobian, bound = fit.q.copy(), fit.jacobian.copy(), fit.at_bound.copy()
    for direction, count in problem.lags.items():
        if count == 2:  # tau1 is the larger
            i, j = (problem.names.index(f"{direction}.ln_tau{k}") for k in (1, 2))
            if q[i] < q[j]:
                q[[i, j]], bound[[i, j]] = q[[j, i]], bound[[j, i]]
                jacobian[:, [i, j]] = jacobian[:, [j, i]]
    held = np.r_[bound, np.zeros(fit.c.size, dtype=bool)]
    matrix = np.full((held.size, held.size), np.nan)
    plain, _ = covariance_of(jacobian[:, ~held])
    free = widened(plain * fit.chi2 / max(fit.dof, 1), fit.residual)
    matrix[np.ix_(~held, ~held)] = free.matrix
    covariance = Covariance(matrix, free.dof, free.method)
    everything = np.ones(problem.record.time.size, dtype=bool)
    whole = Problem(problem.record, problem.lags, Rows.all_of(problem.record, everything), problem.drift)
    model = whole.columns(q)[0] @ fit.c
    return LagFit(
        problem.record,
        problem.lags,
        problem.names,
        q,
        fit.c,
        covariance,
        model,
        problem.record.force - model,
        kept,
        effective_size(fit.residual, q.size),
        frozenset(name for name, there in zip(problem.names, bound, strict=True) if there),
        float(fit.c[-1]) if problem.drift else 0.0,
        {},
    )
