"""The rotation between the contact's centres: a waveform that moves under the longitudinal force is no change of speed."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.rigs.tire.road.revolution_fit import Forces, between_centres

OMEGA = 40.0
TURNS = 30


def drive(shift: np.ndarray) -> Forces:
    """Return revolutions of a wheel that turns evenly, whose waveform peaks `shift` (rad) after the contact's centre."""
    time = (2.0 * np.pi * np.arange(TURNS) + shift) / OMEGA
    speed = np.full(TURNS, np.nan)
    speed[1:-1] = 4.0 * np.pi / (time[2:] - time[:-2])
    values = {f.name: np.ones(TURNS) for f in fields(Forces)}
    return Forces(**{**values, "time": time, "speed": speed, "shift": shift, "fits": np.ones(TURNS, dtype=bool)})


def test_a_waveform_that_moves_is_no_change_of_speed() -> None:
    forces = drive(0.01 * np.sin(0.5 * np.arange(TURNS)))
    assert np.ptp(forces.speed[1:-1]) > 1e-3 * OMEGA
    assert between_centres(forces).speed[1:-1] == pytest.approx(OMEGA, rel=1e-12)


def test_without_a_fit_beside_it_a_revolution_keeps_the_speed_between_passages() -> None:
    forces = drive(0.01 * np.sin(0.5 * np.arange(TURNS)))
    fits = forces.fits.copy()
    fits[10] = False
    found = between_centres(replace(forces, fits=fits)).speed
    assert found[[9, 11]] == pytest.approx(forces.speed[[9, 11]], rel=1e-15)
    assert found[10] == pytest.approx(OMEGA, rel=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_revolutions_are_left_as_they_are(count: int) -> None:
    forces = drive(np.zeros(TURNS))
    few = Forces(**{f.name: getattr(forces, f.name)[:count] for f in fields(Forces)})
    assert np.array_equal(between_centres(few).speed, few.speed, equal_nan=True)
