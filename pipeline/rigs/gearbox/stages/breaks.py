"""Where a straight signal bends: one break time found by least squares, with its error.

Numbers only; which break means what is told in `events`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.rigs.gearbox.stages.stage import EventTime

# Candidates of the first search and of the three finer ones.
_STEPS, _FINER = 40, 21
# By that factor a shift grows until it costs enough.
_GROWS = 1.5
Shape = Callable[[np.ndarray], np.ndarray]


def ramp(late: np.ndarray) -> np.ndarray:
    """Zero before the break, rising in proportion to time after it."""
    return np.asarray(np.maximum(late, 0.0))


def parabola(late: np.ndarray) -> np.ndarray:
    """Zero before the break, rising with the square of time after it: what an angle does where a speed bends."""
    return np.asarray(np.maximum(late, 0.0) ** 2)


def cubic(late: np.ndarray) -> np.ndarray:
    """Zero before the break, rising with the cube of time after it: an angle under a torque that grows from nothing."""
    return np.asarray(np.maximum(late, 0.0) ** 3)


def parabola_before(late: np.ndarray) -> np.ndarray:
    """The same the other way round: falling to zero at the break."""
    return np.asarray(np.minimum(late, 0.0) ** 2)


def ramp_before(late: np.ndarray) -> np.ndarray:
    """Falling or rising in proportion to time up to the break, zero after it."""
    return np.asarray(np.minimum(late, 0.0))


def step(late: np.ndarray) -> np.ndarray:
    """Zero before the break and one after it."""
    return (late > 0.0).astype(float)


def find_break(
    time: np.ndarray,
    values: np.ndarray,
    columns: Sequence[np.ndarray],
    shapes: Sequence[Shape],
    within: tuple[float, float],
    noise: float = 0.0,
) -> tuple[EventTime, np.ndarray]:
    """Return the break time t_0 at which ``values = columns c + shapes(t - t_0) d`` fits best.

    Parameters
    ----------
    time, values
        s and any unit, shape (n,).
    columns
        What is there without the break, shape (n,) each.
    shapes
        What the break adds.
    within
        First and last candidate, s.
    noise
        Standard deviation that the values have at the least (quantisation).

    Returns
    -------
    break and its standard error (s; white residuals), residual sum of squares without and with it, shape (2,)

    Examples
    --------
    >>> t = np.arange(0, 1, 0.01)
    >>> found, _ = find_break(t, 2 * np.maximum(t - 0.423, 0), [np.ones_like(t)], [ramp], (0.1, 0.9))
    >>> round(found.time, 3)
    0.423
    """
    base, _ = np.linalg.qr(np.column_stack(columns))
    rest = values - base @ (base.T @ values)
    without = float(rest @ rest)
    low, high = within
    for steps in (_STEPS, _FINER, _FINER, _FINER):
        candidates = np.linspace(low, high, steps)
        squares = np.array([_unexplained(time - t0, rest, base, shapes) for t0 in candidates])
        best = int(np.argmin(squares))
        low, high = candidates[max(best - 2, 0)], candidates[min(best + 2, steps - 1)]
    t0 = float(candidates[best])
    dof = max(time.size - base.shape[1] - len(shapes) - 1, 1)
    variance = max(float(squares[best]) / dof, noise**2)
    # The curvature over a shift that costs several times the noise, so that single samples do not count.
    sd = _width(t0, variance, float(squares[best]), within, lambda t: _unexplained(time - t, rest, base, shapes))
    return EventTime(t0, sd), np.array([without, squares[best]])


def _unexplained(late: np.ndarray, rest: np.ndarray, base: np.ndarray, shapes: Sequence[Shape]) -> float:
    added = np.column_stack([shape(late) for shape in shapes])
    added = added - base @ (base.T @ added)
    gram = added.T @ added
    gram.flat[:: gram.shape[0] + 1] += 1e-12 * max(float(np.trace(gram)), 1e-30)
    projected = added.T @ rest
    return float(rest @ rest - projected @ np.linalg.solve(gram, projected))


def _width(
    t0: float, variance: float, least: float, within: tuple[float, float], squares: Callable[[float], float]
) -> float:
    """Return how far t_0 must move for nine variances more, over three."""
    reach, most, enough = 1e-4, within[1] - within[0], 9.0 * variance
    while reach < most:
        rise = min(squares(t0 - reach), squares(t0 + reach)) - least
        if rise > enough:
            # The last step has gone too far, by up to a half: the squares grow with the square of the reach.
            reach *= max(float(np.sqrt(enough / rise)), 1.0 / _GROWS)
            break
        reach *= _GROWS
    return min(reach, most) / 3.0
