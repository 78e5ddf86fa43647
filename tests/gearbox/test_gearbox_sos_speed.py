"""The input speed in SOS with its interval, from the logs of a whole run."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.gearbox.clocks.alignment import RATE_SD
from pipeline.rigs.gearbox.record import Signal, record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import gearbox_truth
from pipeline.rigs.gearbox.vibration.sos_speed import input_speed_of

# A box without load-proportional drag, x4 decoding, one accelerometer.
SINGLE = {"a": 1.0, "brake_capacity": 2.4, "c0": 0.2, "c_s": 0.1}


def solved(options, seed, one_channel=False):
    """Return what was found and the true mean input speed over the same stage."""
    truth, _ = next(iter(known_runs(gearbox_truth(options), seed)))
    record = record_of(synthesize(options, seed)[0])
    if one_channel:
        name = "acc_in_radial"
        record = replace(record, vibration=Signal(record.vibration.time, {name: record.vibration[name]}))
    numbers = numbers_of(record)
    start, end = numbers.run.stages["sos"]
    held = (truth.motion.time > start + 0.2) & (truth.motion.time < end - 0.2)
    return numbers, float(truth.motion.w1[held].mean())


@pytest.mark.thorough
def test_one_channel_of_a_lossless_box_tells_the_speed_without_a_bias():
    """Its lines are clean: means of one-second pieces once were off by 1.2 to 1.8 mrad/s, to one side."""
    errors = []
    for seed in range(6):
        numbers, true = solved({"runs": ["g3"], **SINGLE}, seed, one_channel=True)
        errors.append(numbers.speed_in.value / true - 1)
        assert numbers.speed_in.source == "mesh lines"
    assert np.max(np.abs(errors)) < 1e-5


@pytest.mark.parametrize("ppm", [-200.0, -70.0, 0.0, 120.0, 200.0])
def test_an_unknown_rate_of_the_boards_clock_is_in_the_interval(ppm):
    numbers, true = solved({"runs": ["g3"], "vibration_ppm": ppm}, 1)
    found = numbers.speed_in
    assert abs(found.value - true) < 1.96 * found.std_error
    assert found.std_error == pytest.approx(RATE_SD * true, rel=0.01)
    assert "clock" in found.told
    assert "115 ppm" in found.told


def test_one_board_has_one_clock():
    numbers, true = solved({"runs": ["g3"]}, 1)
    record = numbers.record
    rate = {**numbers.run.rate_sd, "vibration": 0.0}
    found = input_speed_of(record, replace(numbers.run, rate_sd=rate))
    assert found.std_error < 1e-5 * true
    assert abs(found.value - true) < 4 * found.std_error


def test_a_measured_speed_knows_how_slowly_its_noise_moves():
    numbers, true = solved({"runs": ["g3"]}, 2)
    t = np.arange(0.0, 30.0, 0.01)
    covered = []
    for seed in range(60):
        slow = np.convolve(np.random.default_rng(seed).normal(size=t.size + 40), np.ones(41) / 41, "valid")
        record = replace(numbers.record, speed_in=Signal(t, {"speed_in": true + 0.3 * slow}))
        found = input_speed_of(record, numbers.run)
        assert found.source == "measured"
        covered.append(abs(found.value - true) < 2.05 * found.std_error)
    assert 0.86 < np.mean(covered) <= 1.0
