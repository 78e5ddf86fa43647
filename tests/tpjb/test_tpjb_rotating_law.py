"""The quasi-static law against its closed forms and the numbers printed in tpjb.md, sections 3 and 4."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotating_orbits import circle, coefficients, truth, turning_parts

from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.closed_forms import linear_displacement, polar_orbit, uncoupled_displacement
from pipeline.rigs.tpjb.rotating.second_order import second_order

F = 14.4e3
BEARINGS = [("4pad-L1", 14.4e3), ("4pad-L2", 13.6e3), ("5pad-L3", 12.48e3)]


def relative_curvature(d: np.ndarray) -> np.ndarray:
    """Return curvature times mean radius around a closed orbit: 1 everywhere for a circle."""
    z = d[0] + 1j * d[1]
    k = np.fft.fftfreq(z.size, 1 / z.size)
    first, second = (np.fft.ifft((1j * k) ** order * np.fft.fft(z)) for order in (1, 2))
    return (np.conj(first) * second).imag / np.abs(first) ** 3 * np.abs(z - z.mean()).mean()


@pytest.mark.parametrize(("name", "size"), BEARINGS)
def test_newton_solves_the_law(name, size):
    p, f = truth(name), circle(size)
    np.testing.assert_allclose(law.force(p, law.equilibrium(p, f)), f, atol=1e-9 * size)


@pytest.mark.parametrize(("name", "size"), BEARINGS)
def test_newton_agrees_with_the_polar_form(name, size):
    p = truth(name)
    d = law.equilibrium(p, circle(size))
    direction = np.arctan2(d[1], d[0])
    radius, lead = polar_orbit(p, direction, size)
    np.testing.assert_allclose(radius, np.hypot(*d), rtol=1e-12)
    angle = 2 * np.pi * np.arange(256) / 256
    np.testing.assert_allclose(np.exp(1j * (direction + lead)), np.exp(1j * angle), atol=1e-9)


def test_newton_agrees_with_the_linear_and_the_uncoupled_closed_form():
    f = circle(F)
    linear = coefficients(kxx=0.6e9, kxy=0.03e9, kyx=-0.02e9, kyy=0.8e9)
    np.testing.assert_allclose(law.equilibrium(linear, f), linear_displacement(linear, f), atol=1e-19)
    bent = coefficients(kxx=0.6e9, kyy=0.6e9, kxx2=2e12, kyy2=-4e12)
    np.testing.assert_allclose(law.equilibrium(bent, f), uncoupled_displacement(bent, f), atol=1e-19)


def test_many_coefficients_and_loads_are_solved_at_once():
    several = np.stack([truth("4pad-L1"), truth("5pad-L3")], axis=1)[:, :, None]
    f = circle(9e3, 32)[:, None, :]
    together = law.equilibrium(several, f)
    assert together.shape == (2, 2, 32)
    for i, name in enumerate(("4pad-L1", "5pad-L3")):
        np.testing.assert_allclose(together[:, i], law.equilibrium(truth(name), f[:, 0]), rtol=1e-10)


def test_sensitivities_are_the_derivatives_of_the_equilibrium():
    p, f = truth("5pad-L3"), circle(12e3, 40)
    slopes = law.sensitivity(p, law.equilibrium(p, f))
    for j in range(10):
        step = np.zeros(10)
        step[j] = 1e-4 * law.SCALE[j]
        differences = (law.equilibrium(p + step, f) - law.equilibrium(p - step, f)) / (2 * step[j])
        np.testing.assert_allclose(slopes[:, j], differences, atol=1e-6 * np.abs(differences).max())


def test_tangent_and_determinant_are_those_of_the_force():
    p, d = truth("5pad-L3"), np.array([[8e-6], [-5e-6]])
    J = law.tangent(p, d)[:, :, 0]
    for j in range(2):
        step = np.zeros((2, 1))
        step[j] = 1e-9
        np.testing.assert_allclose(J[:, j], ((law.force(p, d + step) - law.force(p, d - step)) / 2e-9)[:, 0], rtol=1e-6)
    assert law.determinant(p, d)[0] == pytest.approx(np.linalg.det(J))
    np.testing.assert_allclose(law.compliance(p, d)[:, :, 0], np.linalg.inv(J), rtol=1e-12)


def test_one_axis_folds_where_eta_is_one():
    k, k2 = 0.6e9, -2e12
    p = coefficients(kxx=k, kyy=k, kxx2=k2, kyy2=k2)
    limit = k**2 / (4 * abs(k2))
    before, after = law.equilibrium(p, circle(0.999 * limit, 8)), law.equilibrium(p, circle(1.001 * limit, 8))
    np.testing.assert_allclose(before, uncoupled_displacement(p, circle(0.999 * limit, 8)), rtol=1e-6, atol=1e-18)
    assert np.isnan(after[:, [0, 2]]).all()  # along +x and +y, where the axis softens
    assert np.isfinite(after[:, [4, 5, 6]]).all()
    assert law.fold_force(p, 1e6) == pytest.approx(limit, rel=2e-3)


def test_past_the_fold_no_other_root_is_jumped_to():
    p = truth("4pad-L1")
    fold = law.fold_force(p, 1e5)
    assert 14.4e3 < fold < 40e3
    d = law.equilibrium(p, circle(1.3 * fold))
    known = np.isfinite(d[0])
    assert 0 < known.sum() < 256
    assert (law.determinant(p, d[:, known]) > 0).all()


def test_a_search_from_nearby_ends_on_the_same_branch():
    p, f = truth("4pad-L1"), circle(F)
    near = law.equilibrium(1.02 * p, f)
    np.testing.assert_allclose(law.equilibrium(p, f, near), law.equilibrium(p, f), rtol=1e-9, atol=1e-16)


def test_bearing_with_mirrored_axis_is_solved_as_well():
    p = truth("4pad-L1") * np.array([-1, 1, 1, 1, 1, 1, 1, 1, 1, 1])
    f = circle(5e3)
    np.testing.assert_allclose(law.force(p, law.equilibrium(p, f)), f, atol=1e-6)


def test_fold_margin_of_the_largest_example_is_as_published():
    p = truth("4pad-L1")
    assert law.fold_margin(p, law.equilibrium(p, circle(F))) == pytest.approx(0.53, abs=0.005)


def test_equal_cross_terms_tilt_the_ellipse_and_opposite_ones_keep_the_circle():
    equal = coefficients(kxx=0.6e9, kxy=0.03e9, kyx=0.03e9, kyy=0.6e9)
    Z = turning_parts(law.equilibrium(equal, circle(F)))
    assert abs(Z[1]) + abs(Z[-1]) == pytest.approx(25.26e-6, abs=0.01e-6)
    assert abs(Z[1]) - abs(Z[-1]) == pytest.approx(22.86e-6, abs=0.01e-6)
    assert math.degrees(0.5 * (np.angle(Z[1]) + np.angle(Z[-1]))) == pytest.approx(-45.0, abs=1e-6)
    opposite = coefficients(kxx=0.6e9, kxy=0.03e9, kyx=-0.03e9, kyy=0.6e9)
    assert abs(turning_parts(law.equilibrium(opposite, circle(F)))[-1]) < 1e-18


def test_one_axis_harmonics_at_eta_072_are_the_exact_ones():
    k = 0.6e9
    k2 = 0.72 * k**2 / (4 * F)
    d = law.equilibrium(coefficients(kxx=k, kyy=k, kxx2=k2, kyy2=k2), circle(F))[0] * k / F
    lines = np.fft.rfft(d) / d.size
    found = [lines[0].real, 2 * abs(lines[1]), abs(lines[2] / lines[1]), abs(lines[3] / lines[1])]
    np.testing.assert_allclose(found, [-0.105, 1.061, 0.104, 0.022], atol=6e-4)


def test_one_axis_series_holds_at_small_eta():
    k, eta = 0.6e9, 0.04
    k2 = eta * k**2 / (4 * F)
    lines = np.fft.rfft(law.equilibrium(coefficients(kxx=k, kyy=k, kxx2=k2), circle(F))[0]) / 256 * k / F
    assert lines[0].real == pytest.approx(-eta / 8, rel=1e-3)
    assert 2 * abs(lines[1]) - 1 == pytest.approx(3 * eta**2 / 32, rel=2e-3)
    assert abs(lines[2] / lines[1]) == pytest.approx(eta / 8, rel=1e-3)
    assert abs(lines[3] / lines[1]) == pytest.approx(eta**2 / 32, rel=2e-3)


def test_quadratic_terms_make_corners_as_published():
    lobes = coefficients(kxx=0.6e9, kyy=0.6e9, kxx2=2e12, kyy2=2e12)
    curved = relative_curvature(law.equilibrium(lobes, circle(F, 512)))
    assert (curved.min(), curved.max()) == pytest.approx((0.76, 1.28), abs=0.005)
    curved = relative_curvature(law.equilibrium(truth("4pad-L1"), circle(F, 512)))
    assert (curved.min(), curved.max()) == pytest.approx((0.34, 2.65), abs=0.03)


def test_tilt_and_shape_of_the_1x_ellipse_change_with_the_load_as_published():
    found = []
    for ratio in (0.03, 0.36):
        Z = turning_parts(law.equilibrium(truth("4pad-L1"), circle(ratio * 40e3)))
        found += [math.degrees(0.5 * (np.angle(Z[1]) + np.angle(Z[-1]))), abs(Z[-1] / Z[1])]
    np.testing.assert_allclose(found[::2], [-45.1, -55.2], atol=0.05)
    np.testing.assert_allclose(found[1::2], [0.050, 0.060], atol=2e-4)


def test_lead_of_the_force_swings_as_published_where_the_paper_has_a_constant():
    p = truth("4pad-L1") * np.array([1, 1, 1, 1, 1, 0, 0, 1, 0, 0])  # M4
    d = law.equilibrium(p, circle(F, 2048))
    _, lead = polar_orbit(p, np.arctan2(d[1], d[0]), F)
    assert np.degrees([lead.min(), lead.max()]) == pytest.approx([-6.4, 5.5], abs=0.05)
    assert abs(np.degrees(lead.mean())) < 0.05


def test_second_order_solution_holds_at_small_load():
    p = truth("5pad-L3")
    p[:4] = [0.6e9, 0, 0, 0.6e9]
    p[9] = 0.7e12
    Z, parts = turning_parts(law.equilibrium(p, circle(144.0))), second_order(p, 144.0)
    for found, expected in ((Z[0], parts.Z0), (Z[1], parts.Z1), (Z[2], parts.Z2), (Z[-2], parts.Zm2)):
        assert abs(found / expected - 1) < 4e-4


def test_without_mixed_terms_the_2x_orbit_is_a_line_to_second_order():
    p = truth("4pad-L1")
    p[:4] = [0.6e9, 0, 0, 0.9e9]  # any diagonal K
    Z = turning_parts(law.equilibrium(p, circle(100.0)))
    assert abs(abs(Z[2]) - abs(Z[-2])) < 1e-3 * abs(Z[2])
    p[8] = 4e12
    Z = turning_parts(law.equilibrium(p, circle(100.0)))
    assert abs(abs(Z[2]) - abs(Z[-2])) > 0.2 * abs(Z[2])
