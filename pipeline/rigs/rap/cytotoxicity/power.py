"""How likely a design shows equivalence: the test of `equivalence` on simulated means (rap.md, 6, R7 power)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.rap.cytotoxicity.equivalence import ALPHA

_TRIALS = 20_000
_MOST = 24


def power(
    deviation: float,
    n: int,
    margin: float,
    times: int = 5,
    *,
    control_each: bool = False,
    true: Sequence[float] | None = None,
    trials: int = _TRIALS,
    seed: int = 0,
) -> float:
    """Return the share of trials in which all times pass.

    Parameters
    ----------
    deviation
        Standard deviation between cultures, as a share.
    n
        Cultures of each group and time.
    margin
        Of the test, as a share.
    control_each
        A control at each time, instead of one for all.
    true
        True differences, shape (times,); none by default.
    """
    if n < 2 or not deviation > 0.0:
        return float("nan")
    rng = np.random.default_rng(seed)
    controls = times if control_each else 1
    dof = (times + controls) * (n - 1)
    error = deviation / np.sqrt(n)
    means = error * rng.standard_normal((trials, times)) + (0.0 if true is None else np.asarray(true, float))
    means -= error * rng.standard_normal((trials, controls))
    found = deviation * np.sqrt(rng.chisquare(dof, trials) / dof)
    half = t_quantile(dof, 1.0 - 2.0 * ALPHA) * found * np.sqrt(2.0 / n)
    return float(np.mean(np.all(np.abs(means) + half[:, None] < margin, axis=1)))


def cultures_needed(
    deviation: float, margin: float, times: int = 5, *, control_each: bool = False, wanted: float = 0.9
) -> int | None:
    """Return the smallest number of cultures a group and time that shows equivalence with probability `wanted`; None beyond 24."""
    for n in range(2, _MOST + 1):
        if power(deviation, n, margin, times, control_each=control_each, trials=4000) >= wanted:
            return n
    return None
