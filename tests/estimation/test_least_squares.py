import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.estimation.least_squares import Unknown, fit

x = np.linspace(0.0, 4.0, 81)


def decay(p):
    return p["a"] * np.exp(-x / p["tau"]) + p["b"]


def noisy(rng, sigma=0.02):
    return decay({"a": 2.0, "tau": 0.8, "b": 0.5}) + sigma * rng.normal(size=x.size)


def unknowns(**changes):
    given = {"a": Unknown("a", 1.0), "tau": Unknown("tau", 0.3, 1e-3, 1e3, "s", logarithmic=True), "b": Unknown("b", 0)}
    return list((given | changes).values())


def test_linear_model_has_the_textbook_covariance():
    y = 1 + 2 * x + 0.1 * np.random.default_rng(0).normal(size=x.size)
    found = fit(lambda p: p["c"] + p["m"] * x - y, [Unknown("c", 0.0), Unknown("m", 0.0)])
    A = np.stack([np.ones_like(x), x], axis=1)
    solution, rest, *_ = np.linalg.lstsq(A, y, rcond=None)
    np.testing.assert_allclose(list(found.values.values()), solution, rtol=1e-9)
    np.testing.assert_allclose(found.covariance.matrix, rest / (x.size - 2) * np.linalg.inv(A.T @ A), rtol=1e-8)
    assert found.dof == x.size - 2


def test_95_percent_intervals_cover_the_truth():
    rng = np.random.default_rng(1)
    hits = np.zeros(3)
    for _ in range(200):
        y = noisy(rng)
        found = fit(lambda p, y=y: decay(p) - y, unknowns())
        limits = [entry.ci95 for entry in found.estimates()]
        hits += [low < truth < high for (low, high), truth in zip(limits, (2.0, 0.8, 0.5), strict=True)]
    assert np.all(hits >= 0.90 * 200)
    assert np.all(hits <= 0.99 * 200)


def test_analytic_jacobian_gives_the_same_and_needs_fewer_evaluations():
    y = noisy(np.random.default_rng(2))

    def slopes(p):
        e = np.exp(-x / p["tau"])
        return np.stack([e, p["a"] * e * x / p["tau"] ** 2, np.ones_like(x)], axis=1)

    plain = fit(lambda p: decay(p) - y, unknowns())
    analytic = fit(lambda p: decay(p) - y, unknowns(), jacobian=slopes)
    np.testing.assert_allclose(list(analytic.values.values()), list(plain.values.values()), rtol=1e-7)
    np.testing.assert_allclose(analytic.covariance.matrix, plain.covariance.matrix, rtol=1e-6)
    assert analytic.evaluations < plain.evaluations


def test_known_noise_is_not_rescaled_and_larger_noise_only_upwards():
    y = noisy(np.random.default_rng(3), 0.02)
    honest, optimistic = (lambda p: (decay(p) - y) / 0.02), (lambda p: (decay(p) - y) / 0.002)
    known = fit(honest, unknowns(), noise="known").std_error["a"]
    assert fit(honest, unknowns()).std_error["a"] == pytest.approx(known, rel=0.2)
    assert fit(optimistic, unknowns(), noise="known").std_error["a"] == pytest.approx(known / 10, rel=1e-3)
    assert fit(optimistic, unknowns(), noise="larger").std_error["a"] == pytest.approx(known, rel=0.2)


def test_optimum_on_a_bound_is_said_and_the_others_are_conditional_on_it():
    y = noisy(np.random.default_rng(4))
    found = fit(lambda p: decay(p) - y, unknowns(b=Unknown("b", 0.7, low=0.6)))
    held = fit(lambda p: decay(p) - y, unknowns(b=Unknown("b", 0.6, fixed=True)))
    assert found.at_bound == ("b",)
    assert not found.estimates()[2].determined
    assert "bound, 0.6" in found.estimates()[2].reason
    assert np.isnan(found.std_error["b"])
    assert found.values["tau"] == pytest.approx(held.values["tau"], rel=1e-6)
    assert held.names == ("a", "tau")
    assert held.values["b"] == 0.6


def test_parameters_that_only_enter_as_a_sum_have_infinite_errors():
    y = 3.0 * x
    found = fit(lambda p: (p["k1"] + p["k2"]) * x + p["c"] - y, [Unknown(n, 1.0) for n in ("k1", "k2", "c")])
    assert found.std_error["k1"] == np.inf
    assert [entry.determined for entry in found.estimates({"run": "r1"})] == [False, False, True]
    assert np.isfinite(found.std_error["c"])
    assert found.values["k1"] + found.values["k2"] == pytest.approx(3.0, rel=1e-9)


def test_more_starts_leave_a_local_minimum():
    y = np.sin(5.0 * x)
    single = fit(lambda p: np.sin(p["w"] * x) - y, [Unknown("w", 2.0, 0.5, 9.0)])
    several = fit(lambda p: np.sin(p["w"] * x) - y, [Unknown("w", 2.0, 0.5, 9.0)], starts=12)
    assert single.chi2 > 1
    assert several.values["w"] == pytest.approx(5.0, rel=1e-8)


def test_regions_without_finite_numbers_are_avoided():
    y = np.log(1 + 2.0 * x)
    found = fit(lambda p: np.log(1 + p["a"] * x) - y, [Unknown("a", 30.0)])
    assert found.values["a"] == pytest.approx(2.0, rel=1e-8)


def test_starts_whose_squares_overflow_are_avoided():
    y = np.exp(-2.0 * x)
    found = fit(lambda p: np.exp(p["a"] * x) - y, [Unknown("a", -1.0, -1e3, 1e3)], starts=12)
    assert found.values["a"] == pytest.approx(-2.0, rel=1e-8)


def test_a_rough_residual_is_followed_with_larger_differences():
    def rough(p):  # an adaptive solver's answer changes by its tolerance from call to call
        return np.round(decay(p), 6) - decay({"a": 2.0, "tau": 0.8, "b": 0.5})

    assert fit(rough, unknowns(), step=1e-3).values["tau"] == pytest.approx(0.8, rel=1e-4)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_the_residual_does_not_matter(unit):
    y = noisy(np.random.default_rng(6))
    plain = fit(lambda p: decay(p) - y, unknowns())
    scaled = fit(lambda p: unit * (decay(p) - y), unknowns())
    np.testing.assert_allclose(list(scaled.values.values()), list(plain.values.values()), rtol=1e-9)
    np.testing.assert_allclose(scaled.covariance.matrix, plain.covariance.matrix, rtol=1e-7)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e12])
def test_the_size_of_a_parameter_does_not_matter(size):
    found = fit(lambda p: p["k"] / size * x - 2 * x, [Unknown("k", 0.3 * size)])
    assert found.values["k"] == pytest.approx(2 * size, rel=1e-9)


def test_faults_of_the_call_are_told_plainly():
    with pytest.raises(InputError, match="3 parameters"):
        fit(lambda p: np.zeros(2) * p["a"], [Unknown(name, 1.0) for name in "abc"])
    with pytest.raises(InputError, match="no finite numbers"):
        fit(lambda p: np.full(5, np.nan), [Unknown("a", 1.0)])
    with pytest.raises(InputError, match="does not lie within"):
        fit(lambda p: x, [Unknown("a", 5.0, 0.0, 1.0)])
    with pytest.raises(InputError, match="nothing to fit"):
        fit(lambda p: x, [Unknown("a", 5.0, fixed=True)])


def test_every_parameter_on_its_bound_is_no_crash():
    found = fit(lambda p: p["a"] * x - 9 * x, [Unknown("a", 1.0, 0.0, 2.0)])
    assert found.at_bound == ("a",)
    assert found.values["a"] == pytest.approx(2.0)
