"""The ring against the sheet's vectors, closed forms and conservation laws (tire.md, 3.1-3.2)."""

import numpy as np
import pytest

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.pressure import pressed_shape, pressure_harmonics
from pipeline.rigs.tire.ring.ring import (
    Ring,
    Shape,
    curvature,
    grid,
    radial_displacement,
    shape_of,
    stiffness,
    tangential_displacement,
)
from pipeline.rigs.tire.ring.sensor import averaging, lagging

PLAIN = Ring(R=0.3171, EI=6.0, p0b=46200.0, kw=6e5, kv=2e5)
LOSSY = Ring(R=0.3171, EI=6.0, p0b=46200.0, kw=6e5, kv=2e5, eta=0.08)
THETA = np.array([-0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6])


@pytest.mark.parametrize(
    ("ring", "length", "mu", "expected"),
    [
        (PLAIN, 0.0, 0.0, [-0.15732, -0.24949, 0.42768, 1.82601, 0.42768, -0.24949, -0.15732]),
        (PLAIN, 0.05, 0.0, [-0.15782, -0.24025, 0.59221, 1.41225, 0.59221, -0.24025, -0.15782]),
        (LOSSY, 0.05, 0.0, [-0.16258, -0.24773, 0.58772, 1.41201, 0.59624, -0.23306, -0.15305]),
        (LOSSY, 0.05, 0.25, [-0.17320, -0.27452, 0.55575, 1.41124, 0.62678, -0.20704, -0.14225]),
    ],
)
def test_curvature_under_a_parabolic_pressure_agrees_with_the_sheets_vectors(ring, length, mu, expected):
    shape = pressed_shape(ring, 2000.0, 0.0775, mu=mu)
    k = shape.times(averaging(shape.orders, length, ring.R)).at(THETA)
    assert k == pytest.approx(expected, abs=1.0e-5)


def test_pressure_coefficients_are_those_of_the_skewed_parabola():
    Fz, a, R, lam = 2000.0, 0.0775, 0.3171, -0.2
    N = 1 << 18
    theta = grid(N)
    p = np.where(np.abs(theta) < a, 3 * Fz / (4 * a * R) * (1 - (theta / a) ** 2) * (1 + lam * theta / a), 0.0)
    numbers = np.fft.fft(np.fft.ifftshift(p)) / N
    orders = np.array([-90, -3, -1, 0, 1, 2, 7, 40, 150])
    found = pressure_harmonics(orders, Fz, a, R, lam)
    assert np.abs(found - numbers[orders]).max() < 1e-9 * np.abs(numbers).max() * 1e2


def test_pressure_coefficients_are_smooth_where_the_series_takes_over():
    x = np.linspace(0.04, 0.06, 401)
    P = pressure_harmonics(x / 0.0775, 2000.0, 0.0775, 0.3171, 0.3)
    assert np.abs(np.diff(P, 3)).max() < 1e-9 * np.abs(P[0])


def test_a_closed_inextensible_ring_has_neither_mean_nor_first_harmonic_of_k():
    rng = np.random.default_rng(3)
    q_w, q_v = (np.append(rng.normal(size=1), rng.normal(size=40) + 1j * rng.normal(size=40)) for _ in range(2))
    shape = curvature(radial_displacement(q_w, q_v, LOSSY, speed=9.0), LOSSY)
    assert shape.harmonics[0] == 0.0
    assert shape.harmonics[1] == 0.0
    assert np.abs(shape.harmonics[2:]).min() > 0.0
    for contact in (pressed(compliance(LOSSY), 1.2e8, 0.3266, 3000.0, 900.0),):
        assert np.abs(contact.shape.harmonics[:2]).max() < 1e-12


def test_k_is_minus_the_change_of_the_exact_curvature():
    # A circle displaced by w = A cos 5 theta and the v of an inextensible ring; its curvature from its coordinates.
    R, n, N = 0.3171, 5, 4096
    theta = grid(N)
    errors = []
    for A in (1e-4, 2e-4):
        w = np.zeros(n + 1, dtype=complex)
        w[n] = 0.5 * A
        v = tangential_displacement(w, 0.0, PLAIN)
        radial, tangential = Shape(w).on_grid(N)[1], Shape(v).on_grid(N)[1]
        z = (R + radial + 1j * tangential) * np.exp(1j * theta)
        orders = 1j * np.fft.fftfreq(N, 1.0 / N)
        d1, d2 = (np.fft.ifft(orders**m * np.fft.fft(z)) for m in (1, 2))
        kappa = np.imag(np.conj(d1) * d2) / np.abs(d1) ** 3
        k = curvature(w, PLAIN).on_grid(N)[1]
        errors.append(np.abs(k - (1.0 / R - kappa)).max())
        assert errors[-1] < 0.05 * np.abs(k).max()
    # Second order in the amplitude.
    assert errors[1] / errors[0] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("n", [2, 3, 7])
def test_tension_term_is_the_work_of_the_pressure_on_the_area_lost_at_constant_perimeter(n):
    # Area and perimeter of R + w exactly; scaled back to the perimeter of the circle, it encloses less by
    # pi A^2 (n^2 - 1)/2.
    R, A, N = 0.3171, 3e-5, 8192
    theta = grid(N)
    r, slope = R + A * np.cos(n * theta), -A * n * np.sin(n * theta)
    perimeter = np.mean(np.hypot(r, slope)) * 2 * np.pi
    area = np.mean(0.5 * r**2) * 2 * np.pi * (2 * np.pi * R / perimeter) ** 2
    lost = np.pi * R**2 - area
    assert lost == pytest.approx(np.pi * A**2 * (n**2 - 1) / 2, rel=1e-5)
    # Energy of w = A cos n theta under T2: half of stiffness times mean square, over the circumference.
    term = stiffness(np.array([n]), Ring(R, 0.0, 46200.0, 0.0, 0.0))[0].real
    assert 0.5 * term * 0.5 * A**2 * 2 * np.pi * R == pytest.approx(46200.0 * lost, rel=1e-5)


def test_bending_term_is_the_energy_of_the_changed_curvature():
    n, A, R = 4, 1e-3, 0.3171
    term = stiffness(np.array([n]), Ring(R, 6.0, 0.0, 0.0, 0.0))[0].real
    k = (1 - n**2) * A / R**2
    assert 0.5 * term * A**2 == pytest.approx(0.5 * 6.0 * k**2, rel=1e-12)


def test_without_loss_and_force_the_shape_is_even():
    shape = pressed(compliance(PLAIN), 1.2e8, 0.3266, 2000.0).shape
    assert np.abs(shape.harmonics.imag).max() < 1e-9 * np.abs(shape.harmonics).max()
    shape = pressed_shape(PLAIN, 2000.0, 0.08)
    assert np.abs(shape.harmonics.imag).max() < 1e-12 * np.abs(shape.harmonics).max()


def test_viscous_damping_at_a_speed_acts_as_loss_in_proportion_to_order():
    n = np.array([2.0, 9.0])
    viscous = Ring(0.3171, 6.0, 46200.0, 6e5, 2e5, cw=30.0, cv=10.0)
    extra = stiffness(n, viscous, 9.0) - stiffness(n, viscous, 0.0)
    assert extra == pytest.approx(1j * n * 9.0 * (30.0 + 10.0 / n**2), rel=1e-12)


def test_shape_goes_to_the_grid_and_back():
    rng = np.random.default_rng(1)
    harmonics = rng.normal(size=30) + 1j * rng.normal(size=30)
    harmonics[0] = 0.3
    shape = Shape(harmonics)
    theta, values = shape.on_grid(256)
    assert shape.at(theta) == pytest.approx(values, abs=1e-10)
    assert shape_of(values, 29).harmonics == pytest.approx(harmonics, abs=1e-12)


def test_sensor_mean_and_lag_are_those_of_the_sampled_signals():
    R, length, n = 0.3171, 0.05, 17
    piece = np.linspace(-length / 2, length / 2, 20001) / R
    assert averaging(n, length, R) == pytest.approx(np.mean(np.cos(n * piece)), abs=1e-4)
    assert averaging(2 * np.pi * R / length, length, R) == pytest.approx(0.0, abs=1e-15)
    # tau y' + y = u for u = exp(i n Omega t)
    y = lagging(n, 9.0, 1e-3)
    assert 1e-3 * 1j * n * 9.0 * y + y == pytest.approx(1.0)
