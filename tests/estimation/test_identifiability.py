import numpy as np
import pytest

from pipeline.estimation.identifiability import assess

x = np.linspace(0.0, 1.0, 40)
UNITS = {"k1": "N/m", "k2": "N/m", "k3": "N/m", "rho": "1/m", "alpha": "N"}


def test_well_determined_parameters_are_said_to_be():
    found = assess({"offset": 1.0, "slope": 2.0}, np.stack([np.ones_like(x), x], axis=1), sigma=0.01)
    assert found.undetermined == ()
    assert found.statements[0].startswith("All 2 parameters are determined")
    covariance = 0.01**2 * np.linalg.inv([[40, x.sum()], [x.sum(), x @ x]])
    np.testing.assert_allclose(found.std_error, np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert found.correlation[0, 1] == pytest.approx(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]))


def test_springs_in_parallel_are_known_as_their_sum():
    J = np.stack([x, x, np.ones_like(x)], axis=1)
    found = assess({"k1": 3.0, "k2": 4.0, "alpha": 0.5}, J, sigma=0.01, units=UNITS)
    assert found.undetermined == ("k1", "k2")
    assert [c.text for c in found.combinations] == ["k1 + k2"]
    assert found.combinations[0].value == 7.0
    slope_error = 0.01 / np.sqrt(((x - x.mean()) ** 2).sum())
    assert found.combinations[0].std_error == pytest.approx(slope_error, rel=1e-6)
    assert "only k1 + k2 = 7 N/m" in found.statements[0]


def test_a_gain_of_two_factors_is_known_as_their_product():
    J = np.stack([3.0 * x, 5.0 * x], axis=1)  # of alpha * rho * x at alpha = 5, rho = 3
    found = assess({"alpha": 5.0, "rho": 3.0}, J, sigma=0.01, units=UNITS)
    assert [c.text for c in found.combinations] == ["alpha * rho"]
    assert found.combinations[0].value == 15.0


def test_a_proposed_combination_is_tried():
    # Small loops: F = (k2 + alpha rho) x, all three undetermined, and nothing simpler known.
    J = np.stack([x, 2000.0 * x, 40.0 * x], axis=1)
    found = assess(
        {"k2": 5e4, "alpha": 40.0, "rho": 2000.0},
        J,
        sigma=1.0,
        units={"k2": "N/m", **UNITS},
        candidates={"k2 + alpha*rho": lambda p: p["k2"] + p["alpha"] * p["rho"]},
    )
    assert set(found.undetermined) == {"k2", "alpha", "rho"}
    assert "k2 + alpha*rho" in [c.text for c in found.combinations]
    assert "alpha * rho" not in [c.text for c in found.combinations]


def test_three_springs_are_known_as_one_sum():
    found = assess({"k1": 1.0, "k2": 2.0, "k3": 3.0}, np.stack([x, x, x], axis=1), sigma=0.01, units=UNITS)
    assert [c.text for c in found.combinations] == ["k1 + k2 + k3"]


def test_nearly_the_same_columns_count_as_the_same():
    # The condition number is what tells; the formal errors alone would still look harmless.
    J = np.stack([x, x + 1e-3 * np.sin(20 * x)], axis=1)
    found = assess({"k1": 3.0, "k2": 4.0}, J, sigma=1e-4, units=UNITS)
    assert found.condition > 500
    assert found.undetermined == ("k1", "k2")
    assert found.combinations[0].text == "k1 + k2"


def test_a_difference_may_be_what_is_known():
    J = np.stack([x, -x], axis=1) + 1e-4 * np.stack([np.sin(9 * x), np.sin(9 * x)], axis=1)
    found = assess({"k1": 3.0, "k2": 1.0}, J, sigma=1e-3)
    assert [c.text for c in found.combinations] == ["k1 - k2"]


def test_a_well_measured_zero_is_determined():
    found = assess({"offset": 1e-5, "slope": 2.0}, np.stack([np.ones_like(x), x], axis=1), sigma=0.001)
    assert found.undetermined == ()


def test_a_parameter_without_effect_is_said_to_have_none():
    found = assess({"k1": 3.0, "rho": 4.0}, np.stack([x, 0 * x], axis=1), sigma=0.01)
    assert found.undetermined == ("rho",)
    assert found.std_error[1] == np.inf
    assert found.statements == ("rho is not determined: the data say nothing about it.",)


def test_a_covariance_serves_as_well_as_a_jacobian():
    matrix = np.array([[4.0, -3.9999], [-3.9999, 4.0]])
    root = np.linalg.cholesky(np.linalg.inv(matrix)).T
    found = assess({"k1": 1.0, "k2": 2.0}, root)
    np.testing.assert_allclose(found.std_error, [2.0, 2.0], rtol=1e-6)
    assert found.combinations[0].text == "k1 + k2"
    assert found.combinations[0].std_error == pytest.approx(np.sqrt(8 - 2 * 3.9999), rel=1e-4)
