"""The rolling radius: its error, an intercept, and speeds in a wrong unit."""

import math

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.tire.bench.speed_line import SpeedPoint, expected_radius, speed_line, speed_point

RE, DIAMETER = 0.3171, 0.6532


def _log(rng, speed=2.78, turns=27, offset=0.0, scale=1.0, colour=0.0):
    """One run: the drum wanders by 0.2 %, the wheel follows; the reference has noise, coloured by a first-order lag."""
    period = 2.0 * np.pi * RE / speed
    t = np.arange(0.0, turns * period, 0.01)
    rolling = speed * (1.0 + 0.002 * np.sin(2.0 * np.pi * 0.13 * t + rng.uniform(0, 6)))
    noise = 0.02 * rng.standard_normal(t.size)
    for i in range(1, t.size):
        noise[i] = colour * noise[i - 1] + math.sqrt(1.0 - colour**2) * noise[i]
    path = np.concatenate([[0.0], np.cumsum(rolling[:-1]) * 0.01])
    edges = np.interp(np.arange(turns) * 2.0 * np.pi * RE, path, t)
    edges = edges[: np.count_nonzero(np.arange(turns) * 2.0 * np.pi * RE < path[-1])]
    rotation = 2.0 * np.pi / np.diff(edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    return middle, rotation, np.full(rotation.size, 3e-5), t, scale * (rolling + noise) + offset


def _points(seed=0, speeds=(2.78, 2.78, 2.78, 2.78, 1.39, 5.56), **kind):
    rng = np.random.default_rng(seed)
    return [speed_point(f"run_{i}", *_log(rng, speed, **kind)) for i, speed in enumerate(speeds)]


def test_radius_is_found_within_its_error():
    z = [(line.radius.value - RE) / line.radius.std_error for line in (speed_line(_points(s)) for s in range(40))]
    assert abs(np.mean(z)) < 0.5
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.3
    assert speed_line(_points(), DIAMETER).radius.std_error < 5e-5
    assert speed_line(_points(), DIAMETER).suspicion == ""


def test_coloured_reference_noise_is_not_averaged_away():
    white, slow = _points(), _points(colour=0.95)
    ratio = np.mean([b.speed_se / a.speed_se for a, b in zip(white, slow, strict=True)])
    # A lag of 0.95 leaves (1 + 0.95)/(1 - 0.95) = 39 times less samples.
    assert ratio == pytest.approx(math.sqrt(39.0), rel=0.35)


def test_an_offset_of_the_speed_channel_is_an_intercept():
    line = speed_line(_points(offset=0.01))
    assert line.intercept == pytest.approx(0.01, abs=3 * line.intercept_se)
    assert line.p_value < 0.01
    assert "misses the origin" in line.statement
    assert speed_line(_points()).p_value > 0.01


def test_one_speed_has_no_intercept_test():
    line = speed_line(_points(speeds=(2.78, 2.78, 2.8)))
    assert line.speeds == 1
    assert math.isnan(line.p_value)
    assert "cannot be tested" in line.statement
    assert line.radius.value == pytest.approx(RE, rel=1e-3)


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (3.6, "km/h"),
        (1 / 3.6, "twice"),
        (2.23694, "mph"),
        (1000.0, "mm/s"),
        (30 / math.pi / RE, "rpm"),
        (math.pi / 30, "rpm taken for rad/s"),
        (0.5, "counted twice"),
        (2.0, "every second passage"),
    ],
)
def test_a_wrong_unit_is_named(scale, words):
    points = [SpeedPoint(f"r{i}", w, 1e-5, scale * RE * w, scale * 5e-4) for i, w in enumerate((4.4, 8.8, 17.5))]
    assert words in speed_line(points, DIAMETER).suspicion
    assert speed_line(points).suspicion


def test_other_tires_are_expected_by_their_size():
    assert expected_radius(DIAMETER) == pytest.approx(0.3171, abs=1e-4)  # the sheet, 3.5
    truck = [SpeedPoint("a", 5.0, 1e-5, 5.0 * 0.49, 5e-4)]
    assert "no unit" in speed_line(truck, DIAMETER).suspicion
    assert speed_line(truck, 1.01).suspicion == ""


def test_runs_that_do_not_roll_or_roll_back_are_left_out_by_name():
    good = _points()
    line = speed_line([*good, SpeedPoint("still", 0.0, 0.0, 0.0, 0.0), SpeedPoint("back", 8.0, 1e-5, -2.5, 1e-3)])
    assert set(line.left_out) == {"still", "back"}
    with pytest.raises(InputError, match="rolling radius"):
        speed_line([SpeedPoint("still", 0.0, 0.0, 0.0, 0.0)])


def test_logs_that_do_not_overlap_are_refused():
    middle, rotation, se, t, speed = _log(np.random.default_rng(0))
    with pytest.raises(InputError, match=r"run a: .*same time"):
        speed_point("a", middle, rotation, se, t + 1e4, speed)
