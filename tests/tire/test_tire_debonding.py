"""A flex sensor that comes loose is told from a load that falls, and a slow gain drift from both."""

import numpy as np
import pytest
from drives_of_truth import drive

from pipeline.rigs.tire.road.debonding import debonding


def told(n=800, sd=0.0045, seed=1):
    rng = np.random.default_rng(seed)
    return 0.15 * np.arange(n), np.exp(sd * rng.standard_normal(n))


@pytest.mark.parametrize("seed", range(20))
def test_a_good_bond_has_no_step_and_no_drift(seed):
    found = debonding(*told(seed=seed))
    assert found.ok
    assert found.sd == pytest.approx(0.0045, rel=0.2)


@pytest.mark.parametrize("share", [0.55, 0.9, 0.97])
def test_a_step_is_found_with_its_time_and_share(share):
    time, ratio = told()
    found = debonding(time, ratio * np.where(time > 70.0, share, 1.0))
    (step,) = found.steps
    assert step.time == pytest.approx(70.0, abs=0.5)
    assert step.share == pytest.approx(share, abs=4.0 * step.share_se)
    assert "debonding" in found.verdict


def test_two_steps_are_two():
    time, ratio = told()
    found = debonding(time, ratio * np.where(time > 40.0, 0.9, 1.0) * np.where(time > 80.0, 0.8, 1.0))
    assert [round(step.time) for step in found.steps] == [40, 80]
    assert [step.share for step in found.steps] == pytest.approx([0.9, 0.8], abs=0.01)


def test_a_film_that_comes_loose_is_not_called_the_flex_sensor():
    time, ratio = told()
    assert "film or its readout" in debonding(time, ratio * np.where(time > 70.0, 1.5, 1.0)).verdict


def test_a_slow_drift_is_one_and_no_step():
    time, ratio = told(n=20000)
    found = debonding(time, ratio * np.exp(-0.03 * time / 3600.0))
    assert not found.steps
    assert found.drifts
    assert found.drift == pytest.approx(-0.03, abs=4.0 * found.drift_se)


def test_a_wild_revolution_is_no_step():
    time, ratio = told()
    ratio[300] = 0.2
    assert not debonding(time, ratio).steps


def test_few_revolutions_are_not_judged():
    assert "not judged" in debonding(*told(n=10)).verdict


def test_a_sensor_of_the_drive_that_comes_loose_is_found():
    forces = drive(1, debond_time=20.0).forces
    found = debonding(forces.time, forces.gain_ratio)
    (step,) = found.steps
    assert step.time == pytest.approx(20.0, abs=0.3)
    assert step.share == pytest.approx(0.55, abs=0.05)


def test_manoeuvres_and_bumps_of_the_drive_are_no_debonding():
    forces = drive(1).forces
    found = debonding(forces.time, forces.gain_ratio)
    assert found.ok
    assert found.mean == pytest.approx(1.0, abs=0.005)


def test_on_the_bench_the_ratio_of_one_revolution_is_as_sharp_as_the_sheet_has_it():
    forces = drive(
        4,
        road_noise=0.0,
        loss=0.01,
        pulses=(),
        static_load=2000.0,
        duration=25.0,
        speeds=((0.0, 10 / 3.6), (1.0, 10 / 3.6)),
    ).forces
    assert debonding(forces.time, forces.gain_ratio).sd < 0.0025
