"""Errors of fits whose weights are estimates, and of fits in coloured noise, held against what they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pipeline.estimation.scatter import Scatter, gain_vectors
from pipeline.rigs.mre.model.fit_errors import errors_with_scatter
from pipeline.rigs.mre.model.time_errors import stationary

_NONE = Scatter(0.0, 0.0, 0.0, 0.0, at_cap=False, deviance=0.0)


def test_a_mean_weighted_by_noise_levels_that_are_estimates_is_as_sure_as_told() -> None:
    """Levels known to 32 % from 10 ordinates each: told as if known, they would be 13 % too sure."""
    rng = np.random.default_rng(1)
    harmonics, ordinates, trials = 12, 10, 4000
    error, told, naive = np.zeros(trials), np.zeros(trials), np.zeros(trials)
    for k in range(trials):
        level = rng.gamma(ordinates, 1 / ordinates, harmonics)
        column = np.tile(1 / np.sqrt(level), 2)[:, None]
        rows = column[:, 0] * rng.standard_normal(2 * harmonics)
        error[k] = column[:, 0] @ rows / (column[:, 0] @ column[:, 0])
        nothing = gain_vectors(np.zeros(2 * harmonics), np.zeros(2 * harmonics, dtype=int))
        arguments = (column, nothing, _NONE, 1.0, np.array([False]))
        levels = np.full(2 * harmonics, 1 / ordinates)
        told[k] = errors_with_scatter(*arguments, levels).covariance[0, 0]
        naive[k] = errors_with_scatter(*arguments).covariance[0, 0]
    assert error.var() / told.mean() == pytest.approx(1.0, abs=0.07)
    assert error.var() / naive.mean() > 1.15


@pytest.mark.parametrize("frequency", [3.0, 17.0])
def test_the_error_in_coloured_noise_is_that_of_the_noise_at_the_frequency_of_the_motion(frequency: float) -> None:
    rate, n, memory = 700.0, 14000, 0.01
    t = np.arange(n) / rate
    columns = np.column_stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t + 4 * np.sin(t))])
    rho = float(np.exp(-1 / (rate * memory)))
    noise = lfilter([1.0], [1.0, -rho], np.random.default_rng(2).standard_normal(n))
    pull = columns @ np.linalg.inv(columns.T @ columns)
    true = np.linalg.norm(lfilter([1.0], [1.0, -rho], pull[::-1], axis=0), axis=0)
    residual = noise - columns @ (pull.T @ noise)
    assert stationary(columns, residual).std_error / true == pytest.approx(np.ones(2), abs=0.12)
