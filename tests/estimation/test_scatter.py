from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.scatter import estimate_scatter, gain_vectors, whitening

RUNS, ROWS = 12, 30
GROUPS = np.repeat(np.arange(RUNS), ROWS)


def campaign(rng: np.random.Generator, scatter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns (two stiffness-like parameters), prediction, data with a gain error per run and unit noise."""
    A = np.stack([rng.uniform(1, 3, GROUPS.size), rng.normal(0, 1, GROUPS.size)], axis=1) * 1000
    truth = A @ [1.0, 0.5]
    gains = 1 + scatter * rng.normal(size=RUNS)
    return A, truth, gains[GROUPS] * truth + rng.normal(size=GROUPS.size)


def fitted(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    c = np.linalg.lstsq(A, y, rcond=None)[0]
    return A @ c, y - A @ c


def test_restricted_likelihood_finds_the_scatter_without_bias() -> None:
    rng = np.random.default_rng(0)
    squares, plain = [], []
    for _ in range(150):
        A, _, y = campaign(rng, 0.004)
        prediction, residual = fitted(A, y)
        V = gain_vectors(prediction, GROUPS)
        squares.append(estimate_scatter(residual, V, A).value ** 2)
        plain.append(estimate_scatter(residual, V, A, restricted=False).value ** 2)
    assert np.sqrt(np.mean(squares)) == pytest.approx(0.004, rel=0.06)
    assert np.mean(plain) < np.mean(squares)


def test_claimed_variance_of_the_scatter_is_the_actual_one() -> None:
    rng = np.random.default_rng(1)
    found = []
    for _ in range(150):
        A, _, y = campaign(rng, 0.004)
        prediction, residual = fitted(A, y)
        found.append(estimate_scatter(residual, gain_vectors(prediction, GROUPS), A))
    actual = np.std([s.value**2 for s in found])
    assert np.sqrt(np.mean([s.variance_of_square for s in found])) == pytest.approx(actual, rel=0.25)
    assert np.median([s.dof for s in found]) == pytest.approx(RUNS - 1, abs=2)


def test_no_scatter_is_not_invented() -> None:
    rng = np.random.default_rng(2)
    ratios, uppers = [], []
    for _ in range(100):
        A, _, y = campaign(rng, 0.0)
        prediction, residual = fitted(A, y)
        found = estimate_scatter(residual, gain_vectors(prediction, GROUPS), A)
        ratios.append(found.ratio)
        uppers.append(found.upper)
    assert np.mean(np.array(ratios) > 2.71) < 0.12
    assert np.median(uppers) < 2e-4


def test_cap_is_told() -> None:
    A, _, y = campaign(np.random.default_rng(3), 0.2)
    prediction, residual = fitted(A, y)
    found = estimate_scatter(residual, gain_vectors(prediction, GROUPS), A, cap=0.02)
    assert found.at_cap
    assert found.value == pytest.approx(0.02, rel=0.01)


def test_whitening_gives_unit_covariance() -> None:
    v = np.random.default_rng(4).normal(size=GROUPS.size)
    V = gain_vectors(v, GROUPS)
    whiten = whitening(V, 0.3)
    W = whiten(np.eye(GROUPS.size))
    columns = V.columns(range(RUNS))
    assert W @ (np.eye(GROUPS.size) + 0.09 * columns @ columns.T) @ W.T == pytest.approx(np.eye(GROUPS.size), abs=1e-10)


def test_gain_vectors_from_the_data_bias_what_those_from_the_model_do_not() -> None:
    """Peelle's puzzle: readings of one quantity that share a gain error are pulled low by data-based vectors."""
    rng = np.random.default_rng(5)
    means = {"data": [], "model": []}
    for _ in range(60):
        y = 100 * (1 + 0.02 * rng.normal(size=1)) + 3 * rng.normal(size=20)
        y = y / 3  # weighted by the noise
        A = np.full((20, 1), 1 / 3)
        for name, v in (("data", y), ("model", np.full(20, y.mean()))):
            whiten = whitening(gain_vectors(v, np.zeros(20, dtype=int)), 0.02 * 10)
            means[name].append(np.linalg.lstsq(whiten(A), whiten(y), rcond=None)[0][0])
    assert np.mean(means["model"]) == pytest.approx(100, rel=0.01)
    assert np.mean(means["data"]) < 0.995 * np.mean(means["model"])
