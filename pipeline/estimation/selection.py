"""Which model do the data support: information criteria and prediction of what was left out.

Candidates must be fitted to the same data. A selected model is the best of those offered, not a
good one: `residuals` tells that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pipeline.errors import InputError

Model = TypeVar("Model")
Group = TypeVar("Group", bound=Hashable)

# A BIC difference below it is "not worth more than a bare mention" (Kass and Raftery 1995).
MARGIN = 2.0


@dataclass(frozen=True)
class Candidate:
    """A fitted model: sum of squared residuals (over sigma where it is known), data, parameters.

    `sigma_known` tells that residuals were divided by a known noise; `log_determinant` is the sum
    of ln of the covariance's eigenvalues where that covariance was fitted too (run scatter).
    """

    name: str
    chi2: float
    n_data: int
    n_parameters: int
    sigma_known: bool = False
    log_determinant: float = 0.0

    @property
    def deviance(self) -> float:
        """Minus twice the largest log-likelihood, up to a constant of the data."""
        if self.sigma_known:
            return self.chi2 + self.log_determinant
        return self.n_data * math.log(max(self.chi2, 1e-300) / self.n_data)

    @property
    def aicc(self) -> float:
        """Akaike's criterion with Hurvich and Tsai's (1989) correction; an unknown sigma counts too.

        Infinite where there are not enough data for the correction.
        """
        k = self.n_parameters + (0 if self.sigma_known else 1)
        room = self.n_data - k - 1
        return self.deviance + 2 * k + 2 * k * (k + 1) / room if room > 0 else math.inf

    @property
    def bic(self) -> float:
        """Schwarz's criterion (1978): deviance + k ln n."""
        return self.deviance + self.n_parameters * math.log(self.n_data)


@dataclass(frozen=True)
class Ranked:
    """A candidate's place: differences to the best, Akaike weight, whether it is the selected one."""

    candidate: Candidate
    delta_aicc: float
    delta_bic: float
    weight: float
    selected: bool


def rank(candidates: Sequence[Candidate], margin: float = MARGIN) -> list[Ranked]:
    """Rank by BIC; of those within `margin` of the best the one with the fewest parameters is selected.

    Raises
    ------
    ValueError
        If there is no candidate, or they were not fitted to the same number of data.

    Examples
    --------
    >>> simple, rich = Candidate("line", 101.0, 100, 2), Candidate("parabola", 96.0, 100, 3)
    >>> [entry.candidate.name for entry in rank([rich, simple]) if entry.selected]
    ['line']
    """
    if not candidates or len({(c.n_data, c.sigma_known) for c in candidates}) > 1:
        raise ValueError("candidates must be fitted to the same data in the same way")
    best_bic, best_aicc = min(c.bic for c in candidates), min(c.aicc for c in candidates)
    near = [c for c in candidates if c.bic - best_bic < margin] or [min(candidates, key=lambda c: c.bic)]
    chosen = min(near, key=lambda c: (c.n_parameters, c.bic))
    aicc_differences = [c.aicc - best_aicc if math.isfinite(c.aicc) else math.inf for c in candidates]
    weights = np.exp(-0.5 * np.array(aicc_differences))
    weights = weights / weights.sum() if weights.sum() > 0 else np.full(len(candidates), math.nan)
    ranked = [
        Ranked(c, difference, c.bic - best_bic, float(weight), c is chosen)
        for c, difference, weight in zip(candidates, aicc_differences, weights, strict=True)
    ]
    return sorted(ranked, key=lambda entry: entry.delta_bic)


@dataclass(frozen=True, eq=False)
class Prediction:
    """How well groups were predicted by models that had not seen them.

    `nrmse` is the rms of all prediction errors over the rms of the measured values, each group's
    about its own mean; `by_group` the same for each group; `failed` groups had no refit.
    """

    nrmse: float
    by_group: dict[Hashable, float]
    failed: tuple[Hashable, ...] = ()


def leave_one_group_out(
    groups: Sequence[Group],
    refit: Callable[[Sequence[Group]], Model],
    predict: Callable[[Model, Group], tuple[np.ndarray, np.ndarray]],
) -> Prediction:
    """Leave each group (run, turn, setting) out, refit on the others, and predict it.

    Parameters
    ----------
    groups
        At least two.
    refit
        ``refit(kept groups) -> model``; may raise ArithmeticError, ValueError or InputError, which
        counts as a failed group.
    predict
        ``predict(model, group) -> (measured, predicted)``, shape (n,) each.

    Raises
    ------
    ValueError
        For fewer than two groups, or where no refit succeeded.
    """
    if len(groups) < 2:
        raise ValueError("leaving one group out needs at least two groups")
    by_group: dict[Hashable, float] = {}
    failed: list[Hashable] = []
    error, signal = 0.0, 0.0
    for left in groups:
        try:
            measured, predicted = predict(refit([group for group in groups if group != left]), left)
        except (ArithmeticError, ValueError, InputError):
            failed.append(left)
            continue
        own_error = float(np.sum((measured - predicted) ** 2))
        own_signal = float(np.sum((measured - measured.mean()) ** 2))
        by_group[left] = math.sqrt(own_error / own_signal) if own_signal > 0 else math.inf
        error, signal = error + own_error, signal + own_signal
    if not by_group:
        raise ValueError("no group could be predicted from the others")
    return Prediction(math.sqrt(error / signal) if signal > 0 else math.inf, by_group, tuple(failed))
