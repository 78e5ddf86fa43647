"""Intervals from the profile likelihood: right in curved valleys and near bounds.

The parameter is held at trial values, all others are refitted, and the interval ends where the
misfit has risen by the quantile. How to refit is the caller's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from pipeline.estimation.uncertainty import t_quantile

# closed: the misfit rises to the threshold; bound: the parameter's bound comes first;
# open: it never rises as far as was looked; failed: the refit gave up there.
Side = Literal["closed", "bound", "open", "failed"]


@dataclass(frozen=True)
class ProfileInterval:
    """An interval, how each side ended, and the profile (value, misfit) that was computed.

    A side that is open or failed is infinite. `better` is a value with a smaller misfit than the
    given optimum, which was then not the optimum: fit again from there.
    """

    low: float
    high: float
    low_side: Side
    high_side: Side
    profile: tuple[tuple[float, float], ...]
    better: float | None = None


def profile_interval(
    refit: Callable[[float], float],
    best: float,
    minimum: float,
    std_error: float,
    *,
    level: float = 0.95,
    dof: float = math.inf,
    scale: float = 1.0,
    low: float = -math.inf,
    high: float = math.inf,
    reach: float = 50.0,
) -> ProfileInterval:
    """Find where the misfit, minimised over all other parameters, rises by scale * t^2.

    Parameters
    ----------
    refit
        ``refit(value) -> misfit`` with the parameter held at `value`: chi2, or minus twice the log
        likelihood. May raise ArithmeticError or ValueError, or return NaN, where it cannot.
    best, minimum
        Estimate and its misfit.
    std_error
        First guess of the scale, from the covariance.
    level, dof
        Of the interval; degrees of freedom for Student's t where the noise was estimated.
    scale
        What one unit of misfit is worth: the residual variance where chi2 is a bare sum of squares.
    low, high
        Bounds of the parameter.
    reach
        How many standard errors to look before a side is called open.

    Notes
    -----
    The signed root of the rise is nearly a straight line, so a secant finds the end in a few refits.

    Examples
    --------
    >>> interval = profile_interval(lambda a: (a - 2.0) ** 2 / 0.25, 2.0, 0.0, 0.5)
    >>> round(interval.low, 3), round(interval.high, 3)
    (1.02, 2.98)
    """
    target = t_quantile(dof, level)
    step = abs(std_error) if math.isfinite(std_error) and std_error else max(abs(best), 1.0) * 0.1
    known: dict[float, float] = {best: minimum}

    def root(value: float) -> float:
        """Return the square root of the rise in units of the noise; NaN where there is no refit."""
        try:
            misfit = float(refit(value))
        except (ArithmeticError, ValueError):
            misfit = math.nan
        if math.isfinite(misfit):
            known[value] = misfit
        return math.sqrt(max(misfit - minimum, 0.0) / scale) if math.isfinite(misfit) else math.nan

    lower, lower_side = _end(root, best, -step, low, target, reach)
    upper, upper_side = _end(root, best, step, high, target, reach)
    lowest = min(known, key=lambda value: known[value])
    better = lowest if known[lowest] < minimum - 1e-3 * scale else None
    return ProfileInterval(lower, upper, lower_side, upper_side, tuple(sorted(known.items())), better)


def _end(
    root: Callable[[float], float], best: float, step: float, bound: float, target: float, reach: float
) -> tuple[float, Side]:
    """Walk from `best` by growing steps until `target` is passed, then close in."""
    direction = math.copysign(1.0, step)
    if (bound - best) * direction <= 0:
        return best, "bound"
    inner, inner_root = best, 0.0
    walked = target * abs(step)
    while True:
        outer = best + direction * walked
        at_bound = (outer - bound) * direction >= 0
        outer = bound if at_bound else outer
        outer_root = root(outer)
        if math.isnan(outer_root):
            return _last_good(root, inner, inner_root, outer, target)
        if outer_root >= target:
            return _closed(root, (inner, inner_root), (outer, outer_root), target), "closed"
        if at_bound:
            return bound, "bound"
        if walked >= reach * abs(step):
            return direction * math.inf, "open"
        inner, inner_root = outer, outer_root
        # As far as the rise so far promises, but never more than four times.
        walked *= min(4.0, max(1.3, 1.1 * target / outer_root if outer_root > 0 else 4.0))


def _last_good(
    root: Callable[[float], float], inner: float, inner_root: float, failed: float, target: float
) -> tuple[float, Side]:
    """Look between the last refit that worked and the first that failed."""
    for _ in range(8):
        middle = 0.5 * (inner + failed)
        middle_root = root(middle)
        if math.isnan(middle_root):
            failed = middle
        elif middle_root >= target:
            return _closed(root, (inner, inner_root), (middle, middle_root), target), "closed"
        else:
            inner, inner_root = middle, middle_root
    return math.copysign(math.inf, failed - inner), "failed"


def _closed(
    root: Callable[[float], float], inner: tuple[float, float], outer: tuple[float, float], target: float
) -> float:
    """Return where the root crosses the target, by the Illinois form of the false position."""
    (a, fa), (b, fb) = (inner[0], inner[1] - target), (outer[0], outer[1] - target)
    for _ in range(30):
        middle = (a * fb - b * fa) / (fb - fa)
        f = root(middle) - target
        if math.isnan(f):
            return b
        if abs(f) < 1e-4 * target or abs(b - a) < 1e-9 * max(abs(a), abs(b)):
            return middle
        if f * fb < 0:
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = middle, f
    return b
