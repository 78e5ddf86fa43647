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
from pipeline.estimation.residuals import whiteness
from pipeline.estimation.selection import Candidate
from pipeline.estimation.separable import SeparableFit, covariance_of
from pipeline.estimation.uncertainty import Covariance, effective_size, widened
from pipeline.rigs.mre.step.lag_problem import Lags, Problem, Rows, name_of
from pipeline.rigs.mre.step.record import DIRECTIONS, Record

_STARTS = ((0.1, 0.3), (0.4, 0.1), (0.03, 0.5), (1.2, 0.1))  # tau1 (s), tau2/tau1
_WILD = 6.0
# BIC by which a second lag must win.
_MARGIN = 6.0
# Difference of the logarithms of two lags below which they are one double lag.
ALIKE = 0.1
_SURE_DRIFT, _LEAST_DRIFT = 8.0, 5e-3  # standard errors; of the largest step


@dataclass(frozen=True, eq=False)
class Admitted:
    """A direction with a second lag admitted that the log does not tell: [L, ln_tau1, ln_tau2] and their covariance.

    `matrix` is None where the second lag ended at a bound or is the first once more. `intervals` are those of L and ln_tau1,
    by their names in the fit.
    """

    q: np.ndarray
    matrix: np.ndarray | None
    intervals: Mapping[str, ProfileInterval]


@dataclass(frozen=True, eq=False)
class LagFit:
    """The fit of one log. `values` holds L, ln_tau1 (and ln_tau2, the smaller) by direction, as ``"rise.L"``; `names` their order in `q` and `covariance`.

    `drift` is what the force drifts over the log beside creep, N, where that was fitted along. `admitted` holds directions in which no second lag was
    told, with one admitted.
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
    admitted: Mapping[str, Admitted]

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
    if drifts and not _needed(both, double):  # a lag that was missing looked like one
        drifts, both = False, Problem(record, both.lags, rows)
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
    admitted: dict[str, Admitted] = {}
    for direction in present:
        resolved = any(step.spread == 0 or record.stairs.is_set_point for step in record.of(direction))
        if lags[direction] == 1 and resolved:
            wider = Problem(record, {**lags, direction: 2}, rows, drifts)
            begin = _of_both(single, double, present, wider.lags)
            admitted[direction] = _admitted(wider, direction, begin, scale, found)
    return Found(replace(found, effective=effective, admitted=admitted), candidates)


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


def _needed(problem: Problem, fit: SeparableFit) -> bool:
    """Tell whether a drift that was fitted along is more than a trifle of the largest step."""
    size = max(abs(float(c) * (s.after - s.before)) for c, s in zip(fit.c[2:], problem.record.steps, strict=False))
    return abs(float(fit.c[-1])) > _LEAST_DRIFT * size


def _admitted(problem: Problem, direction: str, start: Mapping[str, float], scale: float, chosen: LagFit) -> Admitted:
    """Fit a direction with a second lag admitted, on thinned rows; `scale` is the variance of their unit weight."""
    best = _best(problem, [start])
    names = dict(zip(problem.names, best.q.tolist(), strict=True))
    own = [f"{direction}.L", f"{direction}.ln_tau1", f"{direction}.ln_tau2"]
    places = [problem.names.index(name) for name in own]
    if names[own[1]] < names[own[2]]:
        names[own[1]], names[own[2]] = names[own[2]], names[own[1]]
        places[1:] = places[:0:-1]
    matrix = None
    if not best.at_bound[places].any() and names[own[1]] - names[own[2]] > ALIKE:
        matrix = (covariance_of(best.jacobian)[0] * scale)[np.ix_(places, places)]
    found = {}
    for name, guess in ((own[0], 0.003), (own[1], 0.03)):
        place = chosen.names.index(name)
        error = float(np.sqrt(chosen.covariance.matrix[place, place]))
        error = error if math.isfinite(error) and error > 0 else guess

        near = dict(names)

        def misfit(value: float, name: str = name, near: dict[str, float] = near) -> float:
            fit = problem.fit(near, (name, value))
            near.update(zip(problem.names, fit.q.tolist(), strict=True))
            return fit.chi2

        least = min(best.chi2, misfit(names[name]))
        found[name] = profile_interval(
            misfit, names[name], least, max(error, guess), dof=chosen.covariance.dof, scale=scale, reach=40.0
        )
    return Admitted(np.array([names[name] for name in own]), matrix, found)


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
    together = np.eye(held.size)[:, ~held]
    for direction, count in problem.lags.items():
        i, j = (problem.names.index(f"{direction}.ln_tau{k}") for k in (1, count))
        if count == 2 and q[i] - q[j] < ALIKE and not (held[i] or held[j]):
            # To first order the response does not know their difference: they move as one.
            one = int(np.flatnonzero(together[j])[0])
            together[j] = together[i]
            together = np.delete(together, one, axis=1)
    matrix = np.full((held.size, held.size), np.nan)
    plain, _ = covariance_of(jacobian @ together)
    white = whiteness(fit.residual, q.size).passed
    scaled = plain * fit.chi2 / max(fit.dof, 1)
    # The correlation time of few white samples is little more than noise, and so would be the errors.
    free = Covariance(scaled, float(fit.dof), "white residual") if white else widened(scaled, fit.residual)
    matrix[np.ix_(~held, ~held)] = (together @ free.matrix @ together.T)[np.ix_(~held, ~held)]
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
        float(fit.residual.size) if white else effective_size(fit.residual, q.size),
        frozenset(name for name, there in zip(problem.names, bound, strict=True) if there),
        float(fit.c[-1]) if problem.drift else 0.0,
        {},
    )
