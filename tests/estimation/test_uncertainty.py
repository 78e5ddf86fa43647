import math

import numpy as np
import pytest
from scipy.signal import lfilter

from pipeline.errors import InputError
from pipeline.estimation.bootstrap import blocks, bootstrap, groups
from pipeline.estimation.uncertainty import (
    Covariance,
    clustered,
    effective_size,
    jackknife,
    newey_west,
    propagate,
    t_quantile,
    widened,
)


def ar1(rng, n, memory):
    innovation = rng.normal(size=n) * np.sqrt(1 - memory**2)
    innovation[0] /= np.sqrt(1 - memory**2)
    return lfilter([1.0], [1.0, -memory], innovation)


def coverage(make, runs=300):
    """Return how often the 95 % intervals of ``make() -> (estimate, Covariance)`` hold zero."""
    hits = []
    for _ in range(runs):
        estimate, covariance = make()
        limits = covariance.intervals(estimate)
        hits.append((limits[:, 0] < 0) & (limits[:, 1] > 0))
    return np.mean(hits, axis=0)


def test_t_quantiles_are_the_tabulated_ones():
    assert t_quantile(4) == pytest.approx(2.776, abs=5e-4)
    assert t_quantile(4, 0.90) == pytest.approx(2.132, abs=5e-4)
    assert t_quantile(math.inf, 0.90) == pytest.approx(1.645, abs=5e-4)


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9, 0.98])
def test_effective_size_of_an_autoregression_is_the_known_one(memory):
    rng = np.random.default_rng(0)
    n = 40_000
    measured = np.mean([effective_size(ar1(rng, n, memory)) for _ in range(5)])
    assert measured == pytest.approx(n * (1 - memory) / (1 + memory), rel=0.15)


def test_effective_size_never_exceeds_the_number_of_samples():
    alternating = np.tile([1.0, -1.0], 500)
    assert effective_size(alternating) == 1000
    assert effective_size(np.ones(50)) == 50
    assert effective_size(np.array([1.0, 2.0])) == 2


@pytest.mark.parametrize("method", ["effective size", "newey-west"])
@pytest.mark.parametrize(("n", "memory"), [(200, 0.0), (200, 0.7), (400, 0.9), (2000, 0.95), (2000, 0.99)])
def test_intervals_cover_under_coloured_noise(method, n, memory):
    rng = np.random.default_rng(1)
    t = np.linspace(-1, 1, n)
    A = np.stack([np.ones(n), t], axis=1)
    bread = np.linalg.inv(A.T @ A)

    def make():
        y = ar1(rng, n, memory)
        estimate = bread @ A.T @ y
        residual = y - A @ estimate
        if method == "newey-west":
            return estimate, newey_west(A, residual)
        return estimate, widened(residual @ residual / (n - 2) * bread, residual)

    # Three standard deviations of 300 trials below 0.90 and above 0.99 would be 0.85 and 1.0.
    assert np.all(coverage(make) >= 0.90)
    assert np.all(coverage(make) <= 0.99)


def test_newey_west_follows_a_changing_variance():
    rng = np.random.default_rng(2)
    t = np.linspace(-1, 1, 400)
    A = np.stack([np.ones(t.size), t], axis=1)

    def make():
        y = rng.normal(size=t.size) * (0.1 + t**2)
        estimate = np.linalg.lstsq(A, y, rcond=None)[0]
        return estimate, newey_west(A, y - A @ estimate)

    assert np.all((coverage(make) >= 0.90) & (coverage(make) <= 0.99))


@pytest.mark.parametrize("count", [4, 8])
def test_clusters_and_jackknife_cover_run_to_run_scatter(count):
    rng = np.random.default_rng(3)
    member = np.repeat(np.arange(count), 30)

    def data():
        x = rng.normal(size=member.size) + rng.normal(size=count)[member]
        A = np.stack([np.ones(member.size), x], axis=1)
        return A, rng.normal(size=count)[member] + 0.3 * rng.normal(size=member.size)

    def by_sandwich():
        A, y = data()
        estimate = np.linalg.lstsq(A, y, rcond=None)[0]
        return estimate, clustered(A, y - A @ estimate, member)

    def by_jackknife():
        A, y = data()
        out = [np.linalg.lstsq(A[member != k], y[member != k], rcond=None)[0] for k in range(count)]
        return np.linalg.lstsq(A, y, rcond=None)[0], jackknife(np.array(out))

    for make in (by_sandwich, by_jackknife):
        share = coverage(make)
        assert np.all((share >= 0.90) & (share <= 0.99))


def test_cluster_sandwich_is_the_jackknife_of_a_linear_model():
    rng = np.random.default_rng(4)
    member = np.repeat(list("abcdef"), 20)
    A = np.stack([np.ones(member.size), rng.normal(size=member.size)], axis=1)
    y = rng.normal(size=member.size)
    estimate = np.linalg.lstsq(A, y, rcond=None)[0]
    out = np.array([np.linalg.lstsq(A[member != k], y[member != k], rcond=None)[0] for k in "abcdef"])
    around_estimate = 5 / 6 * (out - estimate).T @ (out - estimate)
    np.testing.assert_allclose(clustered(A, y - A @ estimate, member).matrix, around_estimate, rtol=1e-9)


def test_a_parameter_of_one_cluster_alone_is_refused():
    member = np.repeat([0, 1], 5)
    A = np.stack([np.ones(10), (member == 1) * 1.0], axis=1)
    with pytest.raises(ValueError, match="alone determines"):
        clustered(A, np.arange(10.0), member)
    with pytest.raises(ValueError, match="two groups"):
        clustered(A, np.arange(10.0), np.zeros(10))
    with pytest.raises(ValueError, match="two groups"):
        jackknife(np.ones((1, 2)))


def test_delta_method_follows_strong_correlation_exactly():
    # a + b is known to 0.01 although each is known to 10 only.
    matrix = np.array([[100.0, -100.0 + 5e-5], [-100.0 + 5e-5, 100.0]])
    value, spread = propagate(lambda p: np.array([p[0] + p[1], p[0]]), np.array([3.0, 4.0]), Covariance(matrix, 7))
    np.testing.assert_allclose(value, [7.0, 3.0])
    np.testing.assert_allclose(spread.std_error, [0.01, 10.0], rtol=1e-6)
    assert spread.dof == 7


def test_delta_method_uses_the_finite_side_only():
    value, spread = propagate(
        lambda p: math.sqrt(p[0]) if p[0] >= 1 else math.nan, np.array([1.0]), Covariance([[0.01]])
    )
    assert value[0] == 1.0
    assert spread.std_error[0] == pytest.approx(0.05, rel=0.01)


def test_block_bootstrap_covers_a_mean_of_coloured_noise():
    rng = np.random.default_rng(5)
    hits = []
    for trial in range(200):
        x = ar1(rng, 600, 0.8)
        low, high = bootstrap(lambda rows, x=x: x[rows].mean(), 600, blocks(600, 40, 200, trial)).intervals()[0]
        hits.append(low < 0 < high)
    assert 0.88 <= np.mean(hits) <= 0.99  # blocks of five correlation times still lose a little


def test_group_bootstrap_takes_whole_groups():
    labels = ["a", "a", "b", "c", "c", "c"]
    for rows in groups(labels, 20):
        counts = np.bincount(rows, minlength=6)
        assert counts[0] == counts[1]
        assert counts[3] == counts[4] == counts[5]


def test_a_bootstrap_that_mostly_fails_is_refused():
    with pytest.raises(InputError, match="resampled"):
        bootstrap(lambda rows: math.nan if rows[0] != 0 or rows[1] != 1 else 1.0, 50, blocks(50, 5, 40))
