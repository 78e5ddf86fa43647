"""Peak over load: coefficients, Fieller's interval, and loads that are not the tire's."""

import math

import numpy as np
import pytest

from pipeline.rigs.tire.bench.calibration import calibrate
from pipeline.rigs.tire.bench.calibration_curve import fitted
from pipeline.rigs.tire.bench.calibration_points import PeakPoint

C0, C1, C2 = -150.0, 4.05, -2.4e-4
FIVE = (1000.0, 1500.0, 2000.0, 2500.0, 3000.0)


def _peak(load):
    return C0 + load * (C1 + load * C2)


def _points(loads=FIVE, seed=0, noise=5.0, friction=0.0, offset=0.0, ways=None, speed=2.78):
    rng = np.random.default_rng(seed)
    found = []
    for i, load in enumerate(loads):
        way = 0 if ways is None else ways[i]
        cell = load + way * friction - offset
        found.append(
            PeakPoint(f"run_{i}", cell, 0.1, _peak(load) + noise * rng.standard_normal(), noise, load, speed, 3.0, way)
        )
    return found


def _calibrated(points, **kind):
    return calibrate(points, 1e4, 3.3, 1e4, **{"load_gain_u": 0.0, **kind})


def test_polynomial_is_exact_without_noise():
    c, _, residual = fitted(np.array(FIVE), _peak(np.array(FIVE)), 2)
    assert c == pytest.approx([C0, C1, C2], rel=1e-9)
    assert np.abs(residual).max() < 1e-8


def test_intervals_hold_the_truth_as_often_as_they_say():
    factor = 3.3 * 1e4 / (2e4 + _peak(2000.0)) ** 2
    slope = (C1 + 2.0 * C2 * 2000.0) * factor
    hits = {"calibration_0": 0, "calibration_1": 0, "calibration_2": 0, "load_sensitivity": 0, "load": 0}
    rng = np.random.default_rng(1)
    for seed in range(400):
        found = _calibrated(_points(seed=seed))
        truth = {"calibration_0": C0, "calibration_1": C1, "calibration_2": C2, "load_sensitivity": slope}
        for name, value in truth.items():
            low, high = found.estimates[name].ci95
            hits[name] += low <= value <= high
        load = rng.uniform(1000.0, 3000.0)
        reading = found.load_of(_peak(load) + 5.0 * rng.standard_normal(), math.inf)
        hits["load"] += reading.low <= load <= reading.high
    for name, count in hits.items():
        assert 0.92 < count / 400 < 0.98, name


def test_gain_of_the_load_cell_widens_the_sensitivity():
    plain, wide = (_calibrated(_points(), load_gain_u=u).estimates["load_sensitivity"] for u in (0.0, 0.01))
    assert wide.std_error == pytest.approx(math.hypot(plain.std_error, 0.01 * plain.value), rel=1e-6)


def test_a_load_beyond_the_range_is_extrapolated_and_less_certain():
    found = _calibrated(_points())
    inside, outside = found.load_of(_peak(2000.0)), found.load_of(_peak(3600.0))
    assert inside.load == pytest.approx(2000.0, abs=20.0)
    assert not inside.extrapolated
    assert outside.extrapolated
    assert outside.high - outside.low > 2.0 * (inside.high - inside.low)
    nowhere = found.load_of(1e5)
    assert math.isnan(nowhere.load)
    assert nowhere.extrapolated


def test_three_loads_tell_a_line_and_how_little_it_is_worth():
    found = _calibrated(_points(FIVE[::2]))
    assert found.curve.degree == 1
    assert found.estimates["calibration_2"].value is None
    reading = found.load_of(_peak(2000.0), math.inf)
    assert reading.high - reading.low > 300.0  # one degree of freedom: t = 12.7
    assert any("3 loads" in said for said in found.remarks)


def test_two_loads_are_no_calibration():
    found = _calibrated(_points(FIVE[:2] + FIVE[:2]))
    assert found.curve is None
    assert "three loads" in found.reason
    assert all(e.value is None and e.reason for e in found.estimates.values())
    assert math.isnan(found.load_of(5000.0).load)


def test_other_speeds_are_left_out():
    points = [*_points(), *_points((2000.0,), speed=5.56)[:1]]
    found = _calibrated([*points[:-1], PeakPoint("fast", 2000.0, 0.1, 6000.0, 1.0, 2000.0, 5.56)])
    assert list(found.left_out) == ["fast"]
    assert found.curve.coefficients == pytest.approx(_calibrated(points[:-1]).curve.coefficients)


def test_friction_of_the_guides_is_told_and_taken_out():
    ways = (1, 1, 1, 1, 1, -1, -1, -1, -1)
    points = _points((*FIVE, 2500.0, 2000.0, 1500.0, 1000.0), friction=100.0, ways=ways)
    found = _calibrated(points)
    assert found.friction.value == pytest.approx(100.0, abs=3 * found.friction.std_error)
    assert any("friction" in said for said in found.remarks)
    assert found.load_of(_peak(2000.0), math.inf).load == pytest.approx(2000.0, abs=10.0)
    calm = _calibrated(_points((*FIVE, 2500.0, 2000.0, 1500.0, 1000.0), ways=ways))
    assert not any("friction" in said for said in calm.remarks)


def test_weight_of_the_beam_is_told():
    found = _calibrated(_points(offset=392.0, noise=1.0), mass=40.0)
    assert found.zero_load.value == pytest.approx(-392.0 + 37.1, abs=60.0)  # 37 N: the zero of the true curve itself
    assert any("tared" in said and "392 N" in said for said in found.remarks)
    assert not any("tared" in said for said in _calibrated(_points(noise=1.0)).remarks)


def test_a_curve_that_is_no_parabola_is_told():
    bent = [
        PeakPoint(p.run, p.load, p.load_se, p.peak + 4e-8 * (p.load - 2000.0) ** 3, 0.5, p.nominal_load, p.speed)
        for p in [*_points(noise=0.5), *_points(noise=0.5, seed=1)]
    ]
    found = _calibrated(bent)
    assert found.lack_of_fit.found
    assert any("parabola" in said for said in found.remarks)
    assert not _calibrated([*_points(seed=2), *_points(seed=3)]).lack_of_fit.found


def test_peaks_that_fall_with_load_are_no_calibration():
    points = [PeakPoint(p.run, p.load, 0.1, -p.peak, 5.0, p.nominal_load, p.speed) for p in _points()]
    found = _calibrated(points)
    assert found.curve is None
    assert "does not rise" in found.reason
