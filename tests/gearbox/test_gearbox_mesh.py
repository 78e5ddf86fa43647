from functools import cache

import numpy as np
import pytest

from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import gearbox_truth
from pipeline.rigs.gearbox.vibration.mesh import input_speed, partial_slip, slip_ridge

RPM = 2 * np.pi / 60
NAMES = ("acc_in_radial", "acc_in_axial", "acc_out_radial", "acc_out_axial", "acc_load_radial")


@cache
def logged(name, seed, **options):
    """Truth, stamps and vibration channels of one synthetic run."""
    options = {"runs": [name], **options}
    truth, _ = next(iter(known_runs(gearbox_truth(options), seed)))
    (recording,) = synthesize(options, seed)
    return truth, recording.signal(NAMES[0])[0], {n: recording.signal(n)[1] for n in NAMES}


def tones(rate, duration, speed, noise, seed, wander=0.0):
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 1 / rate)
    turned = speed * t - wander / 0.7 * (np.cos(0.7 * t) - 1)
    lines = sum(
        a * np.sin(k * turned + rng.uniform(0, 6.28)) for k, a in ((40, 1.0), (80, 0.4), (140, 0.7), (280, 0.3))
    )
    return t, {"acc": lines + noise * rng.normal(size=t.size)}


@pytest.mark.parametrize("name", ["g1", "g3", "g7", "g8"])
def test_the_input_speed_in_sos_is_found_within_two_in_a_hundred_thousand(name):
    truth, time, channels = logged(name, 0)
    found = input_speed(time, channels, (truth.events["sos_start"], truth.events["sos_end"]), truth.speed)
    held = (truth.motion.time > 13) & (truth.motion.time < 18)
    true = truth.motion.w1[held].mean()
    assert abs(found.speed / true - 1) < 2e-5
    assert found.speed < 0.995 * truth.speed, "the drive droops: nominal speed would be wrong"
    assert found.orders == (40.0, 80.0, 140.0, 280.0)


def test_its_error_covers_and_does_not_exaggerate():
    ratios = []
    for seed in range(40):
        t, channels = tones(2000.0, 8.0, 12.37, 4.0, seed)
        found = input_speed(t, channels, (0.0, 8.0), 12.566)
        ratios.append((found.speed - 12.37) / found.std_error)
    assert np.mean(np.abs(ratios) < 1.96) > 0.9
    assert np.std(ratios) > 0.15


def test_noise_alone_has_no_mesh_speed():
    for seed in range(10):
        t, channels = tones(2000.0, 8.0, 0.0, 1.0, seed)
        assert input_speed(t, channels, (0.0, 8.0), 12.566) is None


def test_a_wandering_speed_is_averaged_and_its_wander_told():
    t, channels = tones(2000.0, 9.4, 12.37, 0.3, 1, wander=0.08)
    found = input_speed(t, channels, (0.0, 9.4), 12.566)
    true = 12.37 + 0.08 * np.sin(0.7 * t).mean()
    assert abs(found.speed - true) < 3 * found.std_error + 0.01
    assert found.wander > 0.02


def test_lines_beyond_the_band_of_a_slow_log_are_left_out():
    t, channels = tones(800.0, 8.0, 21.6, 0.5, 2)
    found = input_speed(t, channels, (0.0, 8.0), 22.0)
    assert found.orders == (40.0, 80.0)
    assert found.speed == pytest.approx(21.6, rel=1e-4)


def test_a_fast_log_tells_the_same_speed():
    t, channels = tones(25600.0, 8.0, 12.37, 2.0, 5)
    found = input_speed(t, channels, (0.0, 8.0), 12.566)
    assert found.speed == pytest.approx(12.37, rel=2e-5)
    ridge = slip_ridge(t, channels, (1.0, 3.0), 13.0)
    assert np.nanmax(np.abs(ridge.slip - 12.37)) < 0.1
    assert np.isfinite(ridge.slip).all()


def test_a_stage_too_short_or_a_dead_channel_has_no_speed():
    t, channels = tones(2000.0, 8.0, 12.37, 0.5, 0)
    assert input_speed(t, channels, (0.0, 0.6), 12.566) is None
    assert input_speed(t, {"acc": np.zeros_like(t)}, (0.0, 8.0), 12.566) is None


def test_the_slip_is_followed_through_the_release_until_it_fades():
    truth, time, channels = logged("g3", 0)
    ridge = slip_ridge(time, channels, (truth.events["sos_end"], truth.events["relock"] + 0.3), 13.0)
    true = np.interp(ridge.time, truth.motion.time, truth.motion.slip)
    seen = np.isfinite(ridge.slip)
    assert seen[true > 3.0].mean() > 0.9
    assert np.nanmedian(np.abs(ridge.slip - true)[seen]) < 0.1
    assert not seen[ridge.time > truth.events["relock"] + 0.1].any()


def test_locked_gears_show_no_mesh_lines_and_creeping_ones_do():
    truth, time, channels = logged("g3", 0)
    fos = (4.2, truth.events["brake_onset"])
    assert partial_slip(time, channels, fos, truth.speed) is None
    truth, time, channels = logged("g3", 0, creep=1.5)
    found = partial_slip(time, channels, fos, truth.speed)
    assert found.speed == pytest.approx(1.5, rel=1e-3)


def test_harmonics_of_the_shaft_are_no_partial_slip():
    rng = np.random.default_rng(0)
    t = np.arange(0, 6, 1 / 2500)
    shaft = sum(0.3 / k * np.sin(k * 12.566 * t + k) for k in range(1, 11))
    assert partial_slip(t, {"acc": shaft + 0.3 * rng.normal(size=t.size)}, (0.0, 6.0), 12.566) is None


def test_a_shaft_too_slow_for_the_window_has_no_ridge():
    t, channels = tones(2000.0, 4.0, 1.5, 0.5, 0)
    assert slip_ridge(t, channels, (0.0, 4.0), 1.6).time.size == 0


@pytest.mark.parametrize("droop", [0.02, 0.1, 0.2, 0.35])
def test_a_drive_that_droops_by_tens_of_percent_is_found(droop):
    t, channels = tones(2500.0, 9.0, 12.566 * (1 - droop), 0.5, 4)
    found = input_speed(t, channels, (0.0, 9.0), 12.566)
    assert found.speed == pytest.approx(12.566 * (1 - droop), rel=2e-5)
