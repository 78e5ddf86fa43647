"""Shifts between the boards' clocks: none where there is none, whatever brake, ramp, load and speed (gearbox.md, 8)."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.gearbox.clocks.alignment import RATE_SD, align
from pipeline.rigs.gearbox.record import Signal, record_of
from pipeline.rigs.gearbox.stages.counts import counts_of
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.truth import RPM

RISES, RAMPS = (0.05, 0.15, 0.3, 0.4, 0.8, 1.5), (1.0, 2.05, 4.0, 6.0)
RPMS, INERTIAS = (60.0, 90.0, 120.0, 180.0, 240.0, 300.0), (0.008, 0.0195, 0.05, 0.1, 0.2)
MOST_LOAD = 0.6


def rig(number):
    """Return any rig whose start-up does not break the lock: the synthetic box, or one without load-proportional drag."""
    rng = np.random.default_rng(number)
    while True:
        found = {
            "brake_rise": float(rng.choice(RISES)),
            "brake_fall": float(rng.choice((0.1, 0.3, 0.6))),
            "ramp_time": float(rng.choice(RAMPS)),
            "J_L": float(rng.choice(INERTIAS)),
            "rundown_time": float(rng.choice((0.8, 2.0, 4.0))),
            "speeds": [float(rng.choice(RPMS)) * RPM],
            "encoder_decoding": int(rng.choice((1, 4))),
            "vibration": False,
        }
        if 2.0 * found["speeds"][0] / found["ramp_time"] * found["J_L"] < MOST_LOAD:
            break
    rigid = {
        "a": 1.0,
        "d0": 0.15,
        "d1": 0.003,
        "c0": 0.15,
        "c_s": 0.2,
        "b0": 0.006,
        "M_c": 0.5,
        "M_v": 0.02,
        "M_lock": 1.9,
    }
    late = {"brake_on": 12.0, "brake_off": 20.0, "rundown_start": 28.0, "duration": 33.0}
    return found | late | (rigid | {"brake_capacity": 2.2} if number % 2 else {})


def logged(number, **more):
    (recording,) = synthesize(rig(number) | more, number)
    return record_of(recording)


@pytest.mark.parametrize("number", range(16))
@pytest.mark.thorough
def test_boards_on_one_clock_are_never_moved(number):
    plain = logged(number)
    moved, clocks = align(plain)
    assert clocks.encoder is None or not (clocks.encoder.applied or clocks.encoder.disagree)
    assert moved.encoder is plain.encoder


@pytest.mark.parametrize("rise", [0.3, 0.4, 0.8])
def test_brake_that_comes_on_slowly_is_no_shift(rise):
    (recording,) = synthesize({"runs": ["g3"], "brake_rise": rise, "vibration": False}, 3)
    _, clocks = align(record_of(recording))
    assert not clocks.problems


@pytest.mark.parametrize("shift", [-9.0, 0.07, 0.3])
@pytest.mark.parametrize("number", range(3))
def test_true_shift_that_is_applied_is_right_within_its_error(number, shift):
    plain = logged(number)
    _, clocks = align(replace(plain, encoder=plain.encoder.on_clock(-shift)))
    found = clocks.encoder
    if found is not None and found.applied:
        assert abs(found.shift - shift) < 3.0 * found.shift_sd
    if abs(shift) > 1.0:
        assert clocks.problems


@pytest.mark.parametrize("shift", [0.05, 0.3, -9.0])
@pytest.mark.parametrize("rpm", [120.0, 210.0])
def test_shift_of_the_rig_is_applied(rpm, shift):
    (recording,) = synthesize({"speeds": [rpm * RPM], "vibration": False, "brake_rise": 0.4}, 7)
    plain = record_of(recording)
    _, clocks = align(replace(plain, encoder=plain.encoder.on_clock(-shift)))
    assert clocks.encoder.applied
    assert abs(clocks.encoder.shift - shift) < 3.0 * clocks.encoder.shift_sd < 0.1


def test_rate_that_is_clearly_off_is_applied_and_told():
    (recording,) = synthesize({"speeds": [210.0 * RPM], "vibration": False}, 7)
    plain = record_of(recording)
    _, clocks = align(replace(plain, encoder=plain.encoder.on_clock(0.0, 2000e-6)))
    assert clocks.encoder.drift_applied
    assert abs(clocks.encoder.drift + 2000e-6) < 3.0 * clocks.encoder.drift_sd
    assert "ppm" in clocks.problems[0].message


def test_rate_that_may_be_off_widens_what_is_unknown_of_it():
    (recording,) = synthesize({"speeds": [210.0 * RPM], "vibration": False}, 7)
    plain = record_of(recording)
    _, clocks = align(replace(plain, encoder=plain.encoder.on_clock(0.0, 900e-6)))
    assert clocks.rate_sd("encoder") > RATE_SD


def test_channels_with_the_stamps_of_the_torques_have_no_shift():
    (recording,) = synthesize({"runs": ["g3"], "vibration": False}, 3)
    plain = record_of(recording)
    counts = counts_of(plain)
    turned = np.interp(plain.torque.time + 0.3, counts.time, counts.angle) / counts.step
    kept = np.arange(turned.size) % 50 != 3
    together = Signal(plain.torque.time[kept], {"encoder_count_out": np.floor(turned[kept])})
    moved, clocks = align(replace(plain, encoder=together))
    assert clocks.encoder is None
    assert moved.encoder is together
    assert clocks.rate_sd("encoder") == 0.0
