import numpy as np
import pytest
from gearbox_known import known, wander

from pipeline.rigs.gearbox.aligned_run import ZeroOffset
from pipeline.rigs.gearbox.torques.nominal import level, truncation, type_b

STEP = 0.01


def grid(duration):
    return np.arange(0, duration, STEP)


def test_a_start_up_transient_is_cut_and_the_rest_averaged():
    t = grid(10)
    x = 0.9 + 0.5 * np.exp(-t / 0.3) + 0.002 * np.random.default_rng(0).normal(size=t.size)
    found = level(t, x, (0.0, 10.0), 12.566)
    assert abs(found.value - 0.9) < 0.001
    assert found.span[0] > 1.0


def test_truncation_leaves_a_settled_record_mostly_alone():
    cuts = [truncation(np.random.default_rng(seed).normal(size=60)) for seed in range(50)]
    assert np.mean(cuts) < 15
    assert max(cuts) <= 30


def test_ripple_of_the_shaft_does_not_move_the_mean_of_whole_revolutions():
    t, speed = grid(6.13), 9.42
    x = 0.3 + 0.05 * np.sin(speed * t + 1.0) + 0.03 * np.sin(2 * speed * t)
    found = level(t, x, (0.0, 6.13), speed)
    assert found.value == pytest.approx(0.3, abs=1e-6)
    assert found.revolutions >= 3


def test_intervals_cover_the_truth_where_the_naive_error_is_several_times_too_small():
    t, offset_sd = grid(6.0), 0.0025
    covered, naive = [], []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        x = 0.9 + 0.03 * np.sin(12.566 * t + rng.uniform(0, 6.28)) + wander(rng, t.size, STEP, 0.012)
        x = x + 0.0045 * rng.normal(size=t.size) + offset_sd * rng.normal()
        found = level(t, x, (0.0, 6.0), 12.566, ZeroOffset(0.0, offset_sd, 30.0))
        covered.append(found.ci95[0] <= 0.9 <= found.ci95[1])
        naive.append(found.own_error / (x.std() / np.sqrt(20 * x.size)))  # of the 2 kHz samples
    assert 0.92 < np.mean(covered) < 0.99
    assert np.median(naive) > 3


def test_a_stage_too_short_for_two_revolutions_has_no_nominal_value():
    t = grid(1.0)
    assert level(t, np.ones_like(t), (0.0, 1.0), 6.28) is None


def test_samples_that_are_no_numbers_do_not_count():
    t = grid(6.0)
    x = 0.5 + 0.01 * np.random.default_rng(2).normal(size=t.size)
    x[200:220] = np.nan
    assert level(t, x, (0.0, 6.0), 12.566).value == pytest.approx(0.5, abs=0.002)


def test_type_b_of_a_20_newton_metre_sensor_is_the_larger_part():
    """0.1 % of 20 N m is 0.02 N m at the limits (fact sheet 5.2)."""
    assert type_b(20.0) * np.sqrt(3) == pytest.approx(0.02)


@pytest.mark.parametrize(("name", "published_in", "published_out"), [("g3", 0.94, 0.30), ("g7", 0.89, 0.34)])
def test_levels_of_the_synthetic_rig_meet_truth_and_published_values(name, published_in, published_out):
    for seed in (0, 1):
        case = known(name, seed)
        for side, published in (("in", published_in), ("out", published_out)):
            for stage, at in (("fos", 9.0), ("sos", 15.0), ("fos_after", 27.0)):
                found, true = case.level(side, stage), case.true(f"torque_{side}", at)
                assert abs(found.value - true) < min(0.012, 4 * found.std_error)
            assert case.level(side, "fos").value == pytest.approx(published, abs=0.015)
