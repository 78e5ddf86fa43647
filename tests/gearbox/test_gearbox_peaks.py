import numpy as np
import pytest
from gearbox_known import known, wander

from pipeline.rigs.gearbox.aligned_run import within
from pipeline.rigs.gearbox.torques.peaks import CUTOFF, ORDER, peak, steady_noise, unlock_peak
from pipeline.signals.filtering import low_pass

STEP = 5e-4


def bump(t, centre=5.0, width=0.3):
    return 0.9 + 0.5 * np.exp(-(((t - centre) / width) ** 2))


def noise(t, seed, ripple=0.03):
    rng = np.random.default_rng(seed)
    once, twice = rng.uniform(0, 2 * np.pi, 2)
    turned = 12.566 * t
    shaft = ripple * (np.sin(turned + once) + 0.6 * np.sin(2 * turned + twice))
    return shaft + wander(rng, t.size, STEP, 0.012) + 0.02 * rng.normal(size=t.size)


def test_intervals_of_peaks_cover_and_the_told_bias_is_the_real_one():
    t = np.arange(0, 16, STEP)
    covered, errors, told, raw = [], [], [], []
    for seed in range(40):
        x = bump(t) + noise(t, seed)
        found = peak(t, x, (4.0, 6.0), steady_noise(t, x, [(7.0, 15.5)]))
        covered.append(found.ci95[0] <= 1.4 <= found.ci95[1])
        errors.append(found.value - 1.4)
        told.append(found.bias)
        raw.append(found.raw - 1.4)
    assert np.mean(covered) > 0.9
    assert np.mean(errors) == pytest.approx(np.mean(told), abs=0.012)
    assert np.mean(raw) > np.mean(errors) + 0.03, "raw maxima are biased high"


def test_a_quiet_peak_is_read_exactly_and_at_its_time():
    t = np.arange(0, 16, STEP)
    x = bump(t)
    found = peak(t, x, (4.0, 6.0), steady_noise(t, x, [(8.0, 15.0)]))
    assert found.value == pytest.approx(1.4, abs=5e-4)
    assert found.time == pytest.approx(5.0, abs=2e-3)
    assert not found.saturated


def test_a_flat_top_is_told_as_saturation():
    t = np.arange(0, 16, STEP)
    x = np.minimum(bump(t) + noise(t, 1), 1.3)
    assert peak(t, x, (4.0, 6.0), steady_noise(t, x, [(7.0, 15.5)])).saturated


def test_where_nothing_was_logged_there_is_no_peak():
    t = np.arange(0, 16, STEP)
    assert peak(t, bump(t), (20.0, 21.0), steady_noise(t, bump(t), [(7.0, 15.5)])) is None


@pytest.mark.parametrize("name", ["g3", "g7"])
def test_peaks_of_the_synthetic_rig_are_those_of_its_low_passed_torques(name):
    for seed in (0, 1):
        case = known(name, seed)
        motion = case.truth.motion
        for side in ("in", "out"):
            measured, true = getattr(case.run, f"torque_{side}"), getattr(motion, f"torque_{side}")
            calm = steady_noise(case.run.time, measured, case.steady[:1])
            for stage in ("startup", "brake"):
                span = case.run.stages[stage]
                near = within(motion.time, (span[0] - 0.5, span[1] + 0.5))
                smooth = low_pass(motion.time[near], true[near], CUTOFF, ORDER)
                expected = smooth[within(motion.time[near], span)].max()
                found = peak(case.run.time, measured, span, calm)
                assert abs(found.value - found.bias - expected) < min(4 * found.std_error, 0.1)


def test_without_the_ripple_the_torque_that_breaks_the_lock_is_twice_as_certain():
    errors, quoted = [], []
    for seed in range(4):
        case = known("g3", seed)
        found = unlock_peak(case.run, case.run.stages["brake"], case.steady[0])
        errors.append(found.value - case.truth.motion.torque_in[90000:120000].max())
        quoted.append(found.std_error)
    plain = steady_noise(case.run.time, case.run.torque_in, case.steady[:1]).values.std()
    assert max(quoted) < 0.65 * plain
    assert np.all(np.abs(errors) < 0.05)
