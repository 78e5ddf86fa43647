"""Rotation, harmonics and filtered orbits of a turning load, from signals made of known turning parts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotating_orbits import orbits, static_load

from pipeline.errors import InputError
from pipeline.rigs.tpjb.rotating.harmonics import amplitude, circularity, harmonics, openness
from pipeline.rigs.tpjb.rotating.orbit import Orbit, rotation

RATE = 0.010013


def turning(time: np.ndarray, frequency: float, parts: dict[int, complex]) -> np.ndarray:
    """Return a vector signal made of turning parts, shape (2, n)."""
    z = sum(Z * np.exp(2j * np.pi * k * frequency * time) for k, Z in parts.items())
    return np.stack([np.real(z), np.imag(z)])


@pytest.mark.parametrize("frequency", [RATE, -RATE])
def test_turning_parts_come_back_whichever_way_the_load_turns(frequency):
    parts = {1: 20e-6 + 3e-6j, -1: 2e-6j, 2: 1e-6 + 0j, -2: -3e-6 + 1e-6j, 3: 2e-7 + 0j, -5: 1e-7 + 0j}
    t = np.arange(500) + 0.5
    tau = 2 * (t - t[0]) / (t[-1] - t[0]) - 1
    d = turning(t, frequency, parts) + np.outer([1e-6, -2e-6], tau) + np.array([[5e-6], [7e-6]])
    h = harmonics(t, d, frequency)
    for k, Z in parts.items():
        assert h.at(k) == pytest.approx(Z, abs=1e-14)
    assert h.offset == pytest.approx(5e-6 + 7e-6j, abs=1e-12)
    assert abs(h.x[0]) == pytest.approx(abs(parts[1] + np.conj(parts[-1])), rel=1e-9)
    assert abs(h.y[0]) == pytest.approx(abs(parts[1] - np.conj(parts[-1])), rel=1e-9)


def test_rotation_frequency_and_turns_are_those_of_the_log_not_the_nominal_ones():
    (orbit,) = orbits("A4", seed=3)
    found = orbit.rotation
    assert found.frequency == pytest.approx(0.010013, abs=4 * found.std_error)
    assert found.std_error < 1e-5
    assert found.turns == pytest.approx(5.0, abs=0.08)
    assert found.size == pytest.approx(0.36 * static_load("A4"), rel=0.01)
    assert found.has_dwell
    assert found.dwell.sum() == pytest.approx(124, abs=4)


def test_log_without_still_stretches_is_steady_throughout():
    (orbit,) = orbits("A7", seed=3, no_dwell=True)
    assert orbit.rotation.steady.all()
    assert not orbit.rotation.has_dwell


def test_clockwise_load_has_a_negative_frequency():
    (orbit,) = orbits("A4", seed=3)
    mirrored = rotation(orbit.time, orbit.force * np.array([[1.0], [-1.0]]))
    assert mirrored.frequency == pytest.approx(-orbit.rotation.frequency, rel=1e-6)


def test_elliptic_load_is_still_steady():
    t = np.arange(600) + 0.5
    f = turning(t, RATE, {1: 10e3 + 0j, -1: 5e3 + 0j})
    found = rotation(t, f)
    assert found.steady.mean() > 0.98
    assert circularity(harmonics(t, f, found.frequency)) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("force", "word"),
    [
        (np.zeros((2, 300)), "zero"),
        (np.stack([np.sin(np.arange(300) / 20), np.zeros(300)]), "does not turn"),
        (np.ones((2, 300)) * 5e3, "does not turn"),
    ],
)
def test_force_that_does_not_turn_is_refused_in_words(force, word):
    with pytest.raises(InputError, match=word):
        rotation(np.arange(300.0), force)


def test_less_than_one_and_a_half_turns_have_no_harmonics():
    t = np.arange(140.0)
    with pytest.raises(InputError, match="turns"):
        harmonics(t, turning(t, 0.01, {1: 1e-5 + 0j}), 0.01)


def test_errors_of_the_harmonics_are_those_of_white_noise():
    t, sigma = np.arange(500) + 0.5, 0.05e-6
    rng = np.random.default_rng(0)
    clean = turning(t, 0.01, {1: 20e-6 + 0j})
    fits = [harmonics(t, clean + rng.normal(0, sigma, clean.shape), 0.01) for _ in range(60)]
    claimed = np.sqrt(np.mean([h.sigma**2 for h in fits]))
    actual = np.sqrt(np.mean([np.abs(h.Z - 20e-6 * (h.k == 1)) ** 2 for h in fits]))
    assert claimed == pytest.approx(math.sqrt(2 / 500) * sigma, rel=0.05)
    assert actual == pytest.approx(claimed, rel=0.08)


def test_filtered_orbit_of_equal_circles_is_a_line_and_of_unequal_ones_an_ellipse():
    t = np.arange(500) + 0.5
    angle = 2 * np.pi * np.arange(100) / 100
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 1e-8, (2, 500))
    line = harmonics(t, turning(t, 0.01, {1: 2e-5 + 0j, 2: 1e-6 + 0j, -2: 1e-6j}) + noise, 0.01)
    assert not openness(line)[2]
    x, y = line.filtered(2, angle)
    assert np.linalg.svd(np.stack([x, y]))[1][1] < 0.05 * np.linalg.svd(np.stack([x, y]))[1][0]
    wide = harmonics(t, turning(t, 0.01, {1: 2e-5 + 0j, 2: 2e-6 + 0j, -2: 1e-6j}) + noise, 0.01)
    value, sigma, is_open = openness(wide)
    assert is_open
    assert value == pytest.approx(1 / 3, abs=4 * sigma)
    shape = wide.ellipse(2)
    assert (shape.major, shape.minor) == pytest.approx((3e-6, 1e-6), rel=0.01)
    assert math.degrees(shape.tilt) == pytest.approx(45.0, abs=0.5)


def test_openness_of_a_2x_buried_in_noise_is_not_called_open():
    t = np.arange(500) + 0.5
    rng = np.random.default_rng(2)
    calls = [
        openness(harmonics(t, turning(t, 0.01, {1: 2e-6 + 0j}) + rng.normal(0, 5e-8, (2, 500)), 0.01))[2]
        for _ in range(60)
    ]
    assert sum(calls) <= 2


@pytest.mark.parametrize(("run", "x", "y"), [("A4", (24.2, 1.03, 0.15), (25.1, 4.58, 0.93))])
def test_harmonics_of_the_example_are_as_published(run, x, y):
    (orbit,) = orbits(run, seed=5)
    steady = orbit.part(orbit.rotation.steady)
    h = harmonics(steady.time, steady.displacement, orbit.rotation.frequency)
    np.testing.assert_allclose(np.abs(h.x[:3]) * 1e6, x, atol=0.08)
    np.testing.assert_allclose(np.abs(h.y[:3]) * 1e6, y, atol=0.08)


def test_part_keeps_what_belongs_to_the_run():
    orbit = Orbit("r", np.arange(10.0), np.zeros((2, 10)), np.ones((2, 10)), 15.0, 16.7)
    part = orbit.part(np.arange(10) > 4)
    assert (part.run, part.time.size, part.force_noise, part.shaft_frequency) == ("r", 5, 15.0, 16.7)


def test_amplitudes_near_zero_hold_the_truth_95_times_in_100():
    """An amplitude has no sign: |x + noise| - 1.96 sigma would exclude a true zero 15 times in 100."""
    rng = np.random.default_rng(3)
    time = np.arange(500.0)
    for true in (0.0, 1.0, 30.0):
        held = []
        for _ in range(400):
            noise = rng.standard_normal((2, 500))
            signal = noise + true * np.sqrt(4 / 500) * np.cos(2 * np.pi * 0.02 * time)
            found = amplitude(harmonics(time, signal, 0.01), noise, "x", 2)
            assert found.ci95[0] >= 0
            held.append(found.ci95[0] <= true * np.sqrt(4 / 500) <= found.ci95[1])
        assert 0.91 <= np.mean(held) <= 0.99
