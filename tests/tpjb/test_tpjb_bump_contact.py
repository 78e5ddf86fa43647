"""The contact law against closed forms, minimisation and energy; polygons against their geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.rigs.tpjb.axes import pad_directions
from pipeline.rigs.tpjb.bump.contact import Bearing, centred, corners, rest, rest_on, sensitivities, side_normals
from pipeline.rigs.tpjb.bump.geometry import count_pads, fit_polygon

C = 200e-6


def bearing(n_pads: int = 4, rotation: float = 0.01) -> Bearing:
    angles = pad_directions(n_pads)
    centre = np.array([12e-6, -7e-6])
    clearances = C * (1 + 0.01 * np.cos(np.arange(n_pads)))
    sides = clearances + side_normals(angles, rotation) @ centre
    return Bearing(angles, rotation, sides, np.array([20e-6, 5e-6]), 1.5e9, 2e6)


def turning(size: float, n: int = 90) -> np.ndarray:
    psi = 2 * np.pi * np.arange(n) / n
    return size * np.stack([np.cos(psi), np.sin(psi)], axis=-1)


def potential(d: np.ndarray, force: np.ndarray, b: Bearing) -> float:
    pressed = np.maximum(b.normals @ d - b.sides, 0.0)
    return float(0.5 * b.k_s * ((d - b.neutral) ** 2).sum() - force @ d + 0.5 * b.k_p * (pressed**2).sum())


@pytest.mark.parametrize("n_pads", [3, 4, 5, 6])
@pytest.mark.parametrize("size", [200.0, 1e3, 8e3])
def test_the_stator_rests_in_equilibrium_of_support_contact_and_force(n_pads: int, size: float) -> None:
    b, force = bearing(n_pads), turning(size)
    d = rest(force, b).displacement
    pressed = np.maximum(d @ b.normals.T - b.sides, 0.0)
    balance = force - b.k_s * (d - b.neutral) - b.k_p * pressed @ b.normals
    assert np.abs(balance).max() < 1e-6 * size


def test_no_other_place_has_less_potential() -> None:
    b = bearing(5)
    rng = np.random.default_rng(0)
    for force in turning(3e3, 7):
        d = rest(force[None], b).displacement[0]
        least = potential(d, force, b)
        assert all(potential(d + rng.normal(0, 5e-6, 2), force, b) >= least for _ in range(50))


def test_one_side_gives_way_as_two_springs_side_by_side() -> None:
    b = bearing(4)
    n = b.normals[0]
    force = 5e3 * n
    at = rest(force[None], b)
    assert at.touching[0].tolist() == [True, False, False, False]
    expected = (5e3 + b.k_s * (n @ b.neutral) + b.k_p * b.sides[0]) / (b.k_s + b.k_p)
    assert n @ at.displacement[0] == pytest.approx(expected, rel=1e-12)


def test_without_contact_only_the_support_holds() -> None:
    b = bearing(4)
    at = rest(np.array([[100.0, -50.0]]), b)
    np.testing.assert_allclose(at.displacement[0], b.neutral + np.array([100.0, -50.0]) / b.k_s)


@pytest.mark.parametrize("name", ["sides", "neutral", "rotation", "k_p", "k_s", "force"])
def test_sensitivities_are_the_derivatives(name: str) -> None:
    b, force = bearing(5), turning(2e3, 37)
    at = rest(force, b)
    exact = sensitivities(b, at)

    def moved(step: float, index: int) -> np.ndarray:
        values = dict(vars(b))
        if name == "force":
            return rest_on(force + step * np.eye(2)[index], b, at.number).displacement
        if name in ("sides", "neutral"):
            values[name] = values[name] + step * np.eye(len(values[name]))[index]
        else:
            values[name] += step
        return rest_on(force, Bearing(**values), at.number).displacement

    size = {"sides": 1e-9, "neutral": 1e-6, "rotation": 1e-6, "k_p": 1e5, "k_s": 100.0, "force": 1.0}[name]
    count = {"sides": 5, "neutral": 2, "force": 2}.get(name, 1)
    for i in range(count):
        numeric = (moved(size, i) - moved(-size, i)) / (2 * size)
        analytic = at.compliance[:, :, i] if name == "force" else exact[name].reshape(len(force), 2, -1)[:, :, i]
        np.testing.assert_allclose(numeric, analytic, atol=1e-5 * max(np.abs(analytic).max(), 1e-30))


def test_normalised_clearances_have_no_first_harmonic_and_shift_nothing() -> None:
    b = bearing(5)
    centre, c = centred(b.sides, b.normals)
    np.testing.assert_allclose(c @ b.normals, 0, atol=1e-18)
    np.testing.assert_allclose(c + b.normals @ centre, b.sides)
    moved, same = centred(b.sides + b.normals @ np.array([3e-6, 4e-6]), b.normals)
    np.testing.assert_allclose(moved - centre, [3e-6, 4e-6])
    np.testing.assert_allclose(same, c)


def test_opposed_pads_of_four_share_their_width() -> None:
    """Only the width of an opposed pair is observable: both get half of it."""
    b = bearing(4)
    _, c = centred(b.sides, b.normals)
    assert c[0] == pytest.approx(c[2])
    assert c[0] + c[2] == pytest.approx(b.sides[0] + b.sides[2])


def test_the_four_pad_diamond_and_the_five_pad_pentagon_have_their_corners() -> None:
    square = corners(np.full(4, C), side_normals(pad_directions(4), 0.0))
    np.testing.assert_allclose(np.sort(np.hypot(*square.T)), np.sqrt(2) * C)
    pentagon = corners(np.full(5, C), side_normals(pad_directions(5), 0.0))
    top = pentagon[pentagon[:, 1].argmax()]
    np.testing.assert_allclose(top, [0, C / math.cos(math.radians(36))], atol=1e-15)
    assert pentagon[:, 1].min() == pytest.approx(-C)


def test_sides_that_do_not_close_have_no_corners() -> None:
    assert corners(np.array([C, 1.0, C, -2.0]), side_normals(pad_directions(4), 0.0)).size == 0


@pytest.mark.parametrize("n_pads", [3, 4, 5, 6])
def test_the_polygon_of_an_orbit_is_found_with_its_number_of_sides(n_pads: int) -> None:
    b = bearing(n_pads, rotation=0.014)
    d = rest(turning(2e3, 720), b).displacement
    found = fit_polygon(d, b.pad_angles)
    assert found.rotation == pytest.approx(0.014, abs=2e-4)
    np.testing.assert_allclose(found.centre, centred(b.sides, b.normals)[0], atol=0.05e-6)
    growth = found.clearances - centred(b.sides, b.normals)[1]
    deepest = (2e3 - b.k_s * C) / b.k_p  # the support holds back its share
    assert growth.max() < deepest
    assert growth.min() > 0.6 * deepest
    assert count_pads(d, (3, 4, 5, 6, 7)).found == n_pads


def test_an_orbit_that_dwells_in_its_corners_is_not_turned_by_half_a_side() -> None:
    b = bearing(4, rotation=0.0)
    corner = corners(b.sides, b.normals)
    path = np.concatenate([np.tile(corner, (200, 1)), np.linspace(corner[:-1], corner[1:], 40).reshape(-1, 2)])
    assert abs(fit_polygon(path, b.pad_angles).rotation) < 1e-3


def test_a_round_orbit_is_no_polygon() -> None:
    assert count_pads(turning(1e-4, 400), (3, 4, 5, 6, 7)).found is None
