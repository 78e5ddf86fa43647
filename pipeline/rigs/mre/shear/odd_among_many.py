"""Runs that contradict the others in a campaign of many: found at once by a fit that few of them can bend.

Beside hundreds of runs no sets can be tried (`odd_runs` does, for few). Here the sum of the runs' relative misfits is made
least, which up to a third of odd runs hardly moves; then each run is held against the crowd by its gain, and by what no gain
explains. Runs of one condition that are odd together are no odd runs: the model, or that condition, is to be doubted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.errors import listing
from pipeline.estimation.scatter import gain_vectors
from pipeline.estimation.separable import SeparableFit
from pipeline.rigs.mre.model.dynamic_model import HarmonicModel, Layout, spread_starts
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, layouts_of, solve
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.model.many import conditions_of, standing_for

# A run is odd that chance brings about in less than this share of campaigns, and only if its gain, or what else it
# misses, is so large a share of the force.
_CHANCE, _GAIN_SIZE, _SHAPE_SIZE = 0.003, 0.01, 0.005
# Runs that can be odd at most, of all and of one condition; conditions of fewer runs are not judged.
_MOST_ODD, _MOST_OF_CONDITION, _REPEATS = 1 / 3, 0.5, 4
_CHANCE_OF_CONDITION = 0.05
_ROUNDS = 12
_SPELL = 4  # odd runs one after the other are no chance
_OF_MEDIAN = 0.37  # degrees of freedom of a scale from the median, as a share of its number
# Misfits below this share of the force, and of the median misfit, count as equally good.
_LEAST_MISFIT, _LEAST_OF_MEDIAN = 1e-4, 0.3
_RICHEST = "ksa"  # holds the paper's variant and two more: what a run of it contradicts, it contradicts by itself


@dataclass(frozen=True)
class OddAmongMany:
    """Names of odd runs in the order of the campaign; conditions that contradict the others, in words."""

    runs: tuple[str, ...] = ()
    conditions: str = ""


def odd_among(loops: Sequence[Loop], options: FitOptions) -> OddAmongMany:
    """Return which of many loops contradict the others.

    Raises
    ------
    ValueError
        If nothing can be fitted.
    """
    loops = [loop for loop in loops if loop.kept.any()]
    layout = _richest(layouts_of(loops, options))
    held = None if options.fit_lag else options.force_lag
    few = [loops[i] for i in standing_for(loops, layout.labels)]
    small = HarmonicModel(few, _richest(layouts_of(few, options)), held)
    starts = spread_starts(max(loop.amplitude for loop in few), options.starts, options.seed)
    ends = [end for start in starts if (end := _least_misfit(small, start)) is not None]
    if not ends:
        raise ValueError("no start led to a fit")
    start = min(ends, key=lambda end: end[1])[0]
    model = HarmonicModel(loops, layout, held)
    end = _least_misfit(model, start.q)
    if end is None:
        raise ValueError("the fit of all runs failed")
    odd = _odd(model, end[0])
    conditions = conditions_of(loops, layout.labels)
    odd, doubted = _of_no_condition(odd, conditions)
    if odd.sum() > _MOST_ODD * odd.size:
        return OddAmongMany()
    return OddAmongMany(
        tuple(loop.run for loop, is_odd in zip(loops, odd, strict=True) if is_odd),
        _told(loops, layout.levels, conditions, doubted),
    )


def spells(runs: Sequence[str], odd: Sequence[str]) -> list[tuple[str, str, int]]:
    """Return first and last run, and the number of runs, of stretches of odd runs one after the other, of four at least.

    Examples
    --------
    >>> spells(["r1", "r2", "r3", "r4", "r5", "r6", "r7"], ["r1", "r3", "r4", "r5", "r6"])
    [('r3', 'r6', 4)]
    """
    is_odd = [run in set(odd) for run in runs]
    edges = np.flatnonzero(np.diff(np.r_[False, is_odd, False].astype(int)))
    found = [(runs[a], runs[b - 1], int(b - a)) for a, b in edges.reshape(-1, 2)]
    return [stretch for stretch in found if stretch[2] >= _SPELL]


def _richest(layouts: Sequence[Layout]) -> Layout:
    return next((layout for layout in layouts if layout.variant == _RICHEST), layouts[0])


def _scaled(scale: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return np.asarray(rows * scale.reshape(-1, *[1] * (rows.ndim - 1)))


def _least_misfit(model: HarmonicModel, q0: np.ndarray) -> tuple[SeparableFit, float] | None:
    """Minimise the sum of the runs' relative misfits by reweighted least squares; None where nothing can be fitted."""
    force = np.sqrt(_per_run(model, model.whitened(model.real_data)))
    weight = 1 / force
    fit, q, before = None, q0[: model.n_shape], math.inf
    for _ in range(_ROUNDS):
        scale = weight[model.groups]
        try:
            fit = solve(model, q, partial(_scaled, scale))
        except ValueError:
            return None
        misfit = np.sqrt(_per_run(model, fit.residual / scale)) / force
        total = float(np.minimum(misfit, 1.0).sum())
        least = max(_LEAST_MISFIT, _LEAST_OF_MEDIAN * float(np.median(misfit)))
        weight = 1 / force / np.sqrt(np.maximum(misfit, least))
        q = fit.q
        if abs(before - total) < 1e-3 * total:
            break
        before = total
    assert fit is not None
    return fit, total


def _per_run(model: HarmonicModel, rows: np.ndarray) -> np.ndarray:
    return np.bincount(model.groups, rows**2, len(model.loops))


def _odd(model: HarmonicModel, fit: SeparableFit) -> np.ndarray:
    """Tell which runs stand off the crowd, shape (runs,): by their gain, or by what no gain explains."""
    from scipy.special import stdtrit

    modelled = model.predicted(fit.q, fit.c)
    force, missed = model.whitened(modelled), model.whitened(model.real_data - modelled)
    V = gain_vectors(force, model.groups)
    gain = V.across(missed) / V.squares
    rest = _per_run(model, missed - V.along(gain))
    number = np.bincount(model.groups)
    off = np.abs(gain - np.median(gain))
    # As many gains as there are parameters are fitted away: the least sum of misfits passes through them.
    left = np.sort(off)[min(fit.jacobian.shape[1], gain.size // 2) :]
    limit = -float(stdtrit(_OF_MEDIAN * left.size, _CHANCE / 2 / gain.size))
    by_gain = off > np.maximum(limit * 1.4826 * float(np.median(left)), _GAIN_SIZE)
    # The cube root of a mean of squares is all but normal (Wilson and Hilferty 1931).
    usual = (rest / number) ** (1 / 3)
    above = usual - np.median(usual)
    noise = float(np.median(rest / number)) * number
    by_shape = above > limit * 1.4826 * float(np.median(np.abs(above)))
    by_shape &= np.sqrt(np.maximum(rest - noise, 0.0) / V.squares) > _SHAPE_SIZE
    return np.asarray(by_gain | by_shape)


def _of_no_condition(
    odd: np.ndarray, conditions: Sequence[tuple[int, int, int]]
) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """Take conditions out of which most runs are odd, and more than as many odd runs elsewhere let expect; return those."""
    from scipy.special import bdtrc

    number, among = Counter(conditions), Counter(c for c, is_odd in zip(conditions, odd, strict=True) if is_odd)

    def by_chance(c: tuple[int, int, int]) -> float:
        elsewhere = (1 + int(odd.sum()) - among[c]) / (2 + odd.size - number[c])
        return float(bdtrc(among[c] - 1, number[c], elsewhere))

    doubted = [
        c
        for c in sorted(among)
        if number[c] >= _REPEATS
        and among[c] > _MOST_OF_CONDITION * number[c]
        and by_chance(c) < _CHANCE_OF_CONDITION / len(number)
    ]
    if len(doubted) == len(number):
        return odd, []
    return odd & np.array([c not in doubted for c in conditions]), doubted


def _told(
    loops: Sequence[Loop],
    levels: Sequence[float],
    conditions: Sequence[tuple[int, int, int]],
    doubted: Sequence[tuple[int, int, int]],
) -> str:
    named = []
    for one in doubted:
        members = [loop for loop, condition in zip(loops, conditions, strict=True) if condition == one]
        frequency, amplitude = (
            float(np.median(v)) for v in zip(*[(m.frequency, m.amplitude) for m in members], strict=True)
        )
        named.append(f"{frequency:.3g} Hz, {1e3 * amplitude:.2g} mm, {levels[one[0]]:g} A ({len(members)} runs)")
    return listing(named, 4) if named else ""
