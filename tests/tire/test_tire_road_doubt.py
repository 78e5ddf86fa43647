"""What makes the road's errors larger than one waveform tells, and what is not told at all."""

from dataclasses import replace

import numpy as np
import pytest
from drives_of_truth import drive, known_library

from pipeline.rigs.tire.road.event_centre import LONGITUDINAL
from pipeline.rigs.tire.road.events import events
from pipeline.rigs.tire.road.gain_off import gain_off, without_lost_gain
from pipeline.rigs.tire.road.height_ratio import height_ratio
from pipeline.rigs.tire.road.neighbour_scatter import with_scatter
from pipeline.rigs.tire.road.shape_causes import shape_causes
from pipeline.rigs.tire.road.steady_steps import in_step


def test_scatter_of_neighbours_widens_the_force_and_no_more():
    forces = drive(1).forces
    assert np.nanmedian(with_scatter(forces).force_se / forces.force_se) < 1.15
    hop = 120.0 * np.random.default_rng(1).standard_normal(len(forces))
    widened = with_scatter(replace(forces, force=forces.force + hop)).force_se[forces.fits]
    error = (forces.force + hop - drive(1).Fx)[forces.fits]
    assert 0.91 < np.mean(np.abs(error) < 1.96 * widened) < 0.99


def test_a_ramp_of_the_force_widens_nothing():
    forces = drive(1).forces
    ramp = 300.0 * np.abs(forces.time - 22.0)
    np.testing.assert_allclose(
        with_scatter(replace(forces, force=forces.force + ramp)).force_se, with_scatter(forces).force_se, rtol=0.05
    )


@pytest.mark.parametrize("share", [0.5, 2.0 / 3.0])
def test_two_turns_counted_as_one_are_not_told(share):
    forces = drive(1).forces
    wrong = np.zeros(len(forces), dtype=bool)
    wrong[[60, 61, 150]] = True
    found = in_step(replace(forces, speed=np.where(wrong, share * forces.speed, forces.speed)))
    assert np.isnan(found.speed[wrong]).all()
    assert np.isnan(found.load[wrong]).all()
    assert not found.fits[wrong].any()
    assert np.array_equal(found.speed[~wrong], forces.speed[~wrong], equal_nan=True)


def test_a_wheel_that_starts_and_brakes_stays_in_step():
    forces = drive(1).forces
    time = np.concatenate([np.sqrt(np.arange(1, 40)), 20.0 - np.sqrt(np.arange(1, 40))[::-1]])
    speed = np.gradient(2.0 * np.pi * np.concatenate([np.arange(39), np.arange(39) + 100.0]), time)
    some = {name: getattr(forces, name)[:78] for name in forces.__dataclass_fields__}
    found = in_step(type(forces)(**{**some, "time": time, "speed": speed}))
    assert np.isfinite(found.speed).mean() > 0.97


def test_a_gain_that_falls_against_the_film_widens_and_then_withholds():
    forces = drive(1).forces
    falling = replace(forces, gain_ratio=forces.gain_ratio * np.interp(forces.time, [10.0, 40.0], [1.0, 0.7]))
    off = gain_off(falling)
    assert np.abs(gain_off(forces)).max() == 0.0
    early = (forces.time > 14.0) & (forces.time < 19.0)
    assert np.median(off[early]) == pytest.approx(-0.065, abs=0.03)
    kept = without_lost_gain(falling, off).fits
    assert kept[early].mean() > 0.95
    assert not kept[forces.time > 25.0].any()


def test_without_a_bench_the_film_grows_with_the_speed_and_a_step_is_still_one():
    rng = np.random.default_rng(3)
    speed = np.interp(np.arange(400), [100, 150, 250, 300], [26.0, 44.0, 44.0, 20.0])
    film = speed / np.hypot(1.0, 0.02 * speed) * np.exp(0.004 * rng.standard_normal(400))
    sound = height_ratio(np.full(400, 6000.0), film, speed)
    assert sound.max() / sound.min() < 1.05
    off = height_ratio(np.where(np.arange(400) < 125, 6000.0, 3300.0), film, speed)
    assert np.median(off[130:]) / np.median(off[:120]) == pytest.approx(0.55, abs=0.05)


def test_a_pressure_that_is_not_the_stated_one_is_seen_in_the_shape():
    found = drive(1, known_library(p0b=1.1))
    shape, fits = found.fit.shape_error, found.forces.fits
    load, speed = np.median(found.forces.load[fits]), np.median(found.forces.speed[fits])
    told = shape_causes(known_library(p0b=1.1), shape, float(load), float(speed), 1e4)
    assert told.pressure.change == pytest.approx(-np.log(1.1), abs=0.02)
    assert told.pressure.load == pytest.approx(np.mean(found.load_error), rel=0.15)
    sound = drive(1).fit.shape_error
    assert not sound.matters
    assert shape_causes(known_library(), sound, 3500.0, 35.0, 1e4).causes == ()


def accelerating(force=0.0, sd=80.0, seed=0):
    """A wheel that brakes to a standstill from 20 to 25 s, and starts 10 s later: time, rotation, load, force and errors."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 60.0, 60001)
    rotation = np.interp(t, [20.0, 25.0, 35.0, 42.0], [30.0, 0.0, 0.0, 30.0])
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (rotation[1:] + rotation[:-1]) * np.diff(t))]) / (2.0 * np.pi)
    at = np.interp(np.arange(1, int(turns[-1])), turns, t)
    seen = at[np.interp(at, t, rotation) > 5.0]
    Fx = np.where((seen > 20.0) & (seen < 25.0), -force, 0.0) + np.where((seen > 35.0) & (seen < 42.0), force, 0.0)
    n = seen.size
    load, Fx = 3500.0 + 40.0 * rng.standard_normal(n), Fx + sd * rng.standard_normal(n)
    return seen, np.interp(seen, t, rotation), load, np.full(n, 40.0), Fx, np.full(n, sd)


def test_gentle_braking_to_a_standstill_is_an_event_about_its_true_middle():
    for seed in range(5):
        found = events(*accelerating(450.0, seed=seed))
        assert [event.kind for event in found] == [LONGITUDINAL] * 2
        assert [event.time for event in found] == pytest.approx([22.5, 38.5], abs=0.35)
        assert np.sign([event.change for event in found]).tolist() == [-1, 1]


def test_wind_is_no_event():
    time, rotation, load, load_se, force, force_se = accelerating()
    assert events(time, rotation, load, load_se, force + 0.5 * rotation**2, force_se) == []
