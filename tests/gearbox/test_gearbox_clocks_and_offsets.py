"""Clocks of three boards and zero offsets of the torques (gearbox.md, 1, 5.2, 8, 11)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from pipeline.rigs.gearbox.clocks.alignment import align
from pipeline.rigs.gearbox.record import Signal, record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.offsets import zero_offsets
from pipeline.rigs.gearbox.truth import RPM


def run(rpm=120.0, seed=0, **truth):
    (recording,) = synthesize({"speeds": [rpm * RPM], **truth}, seed)
    return record_of(recording)


@pytest.mark.parametrize("rpm", [60.0, 120.0, 210.0])
@pytest.mark.parametrize("disturbance", [{}, {"encoder_decoding": 1}, {"noise": 3.0}], ids=["plain", "x1", "noise"])
def test_shifted_boards_are_brought_together(rpm, disturbance):
    moved, clocks = align(run(rpm, 3, **{"fixture": "board_clocks", **disturbance}))
    assert clocks.encoder.applied
    assert clocks.encoder.shift == pytest.approx(0.3, abs=0.05)
    assert abs(clocks.encoder.shift - 0.3) < 3.0 * clocks.encoder.shift_sd
    assert clocks.vibration.applied
    assert clocks.vibration.shift == pytest.approx(-0.3, abs=0.08)
    assert len(clocks.problems) == 2
    assert segment(moved).complete


@pytest.mark.parametrize("rpm", [60.0, 120.0, 210.0])
def test_boards_that_agree_are_left_alone(rpm):
    plain = run(rpm, 4)
    moved, clocks = align(plain)
    assert not clocks.encoder.applied
    assert not clocks.vibration.applied
    assert not clocks.problems
    assert moved.encoder is plain.encoder


@pytest.mark.parametrize("shift", [-9.0, -3.0, 0.07, 3.0, 9.0])
@pytest.mark.parametrize("board", ["encoder", "vibration"])
@pytest.mark.thorough
def test_clocks_that_are_seconds_apart_are_brought_together_and_told(board, shift):
    plain = run(120.0, 5)
    moved, clocks = align(replace(plain, **{board: getattr(plain, board).on_clock(-shift)}))
    found = getattr(clocks, board)
    if abs(shift) > 4.0 * found.shift_sd:
        assert found.applied
        assert len(clocks.problems) == 1
        assert f"{abs(found.shift):.3f} s" in clocks.problems[0].message
    assert abs(found.shift - shift) < 3.0 * found.shift_sd
    assert segment(moved).complete


def test_both_boards_may_be_seconds_apart():
    plain = run(210.0, 5, fixture="x1_decoding")
    apart = replace(plain, encoder=plain.encoder.on_clock(4.0), vibration=plain.vibration.on_clock(-5.0))
    moved, clocks = align(apart)
    assert clocks.encoder.shift == pytest.approx(-4.0, abs=0.05)
    assert clocks.vibration.shift == pytest.approx(5.0, abs=0.1)
    assert segment(moved).complete


def test_clocks_that_nothing_tells_are_said_to_be_unknown_and_make_no_stall():
    plain = run()
    torque, encoder = plain.torque.part(13.0, 30.0), plain.encoder.on_clock(3.0).part(16.0, 33.0)
    moved, clocks = align(replace(plain, torque=torque, encoder=encoder, vibration=plain.vibration.part(13.0, 30.0)))
    assert clocks.encoder is None or not clocks.encoder.applied
    assert clocks.problems
    assert "stall" not in segment(moved).names


def test_what_is_unknown_of_a_boards_rate_is_given():
    plain = run()
    _, clocks = align(plain)
    assert clocks.rate_sd("encoder") == pytest.approx(200e-6 / np.sqrt(3.0))
    together = replace(plain, vibration=Signal(plain.torque.time, {"acc_in_radial": plain.torque["torque_in"]}))
    assert align(together)[1].rate_sd("vibration") == 0.0
    _, drifting = align(replace(plain, encoder=plain.encoder.on_clock(0.0, 0.01)))
    assert drifting.rate_sd("encoder") == drifting.encoder.drift_sd


@pytest.mark.parametrize("ppm", [-200.0, 200.0])
def test_interval_of_the_output_speed_holds_with_a_clock_that_is_off(ppm):
    speed, error = numbers_of(run(120.0, 2, encoder_ppm=ppm)).speed_out
    assert abs(speed - 120.0 * RPM) < 2.0 * error


def test_weak_brake_still_tells_the_shift():
    _, clocks = align(run(120.0, 0, fixture="weak_brake", encoder_shift=0.3))
    assert clocks.encoder.shift == pytest.approx(0.3, abs=0.05)
    assert clocks.vibration is None


def test_coarse_drift_of_a_clock_is_found_and_applied():
    plain = run(210.0)
    slow = replace(plain, encoder=plain.encoder.on_clock(0.0, 0.003))
    moved, clocks = align(slow)
    assert clocks.encoder.drift_applied
    assert clocks.encoder.drift == pytest.approx(-0.003, abs=0.001)
    np.testing.assert_allclose(moved.encoder.time, plain.encoder.time, atol=0.02)


def zeros(**truth):
    record = run(**truth)
    return zero_offsets(record, segment(record))


@pytest.mark.parametrize("rpm", [60.0, 120.0, 210.0])
def test_zero_is_that_of_the_standstill_before_the_motor(rpm):
    found = zeros(rpm=rpm, seed=2)
    for offset, true in ((found.torque_in, 0.012), (found.torque_out, -0.008)):
        assert abs(offset.value - true) < student.ppf(0.9995, offset.dof) * offset.sd
        assert offset.sd < 0.005
    # The shaft is wound up for 0.3 to 0.5 s before it turns.
    assert found.motor_on.time == pytest.approx(2.0, abs=0.15)


def test_drifting_zero_is_interpolated_and_told():
    found = zeros(offset_change_in=0.05, duration=34.0)
    assert found.torque_in.drifts
    assert not found.torque_out.drifts
    np.testing.assert_allclose(found.torque_in.at(np.array([1.0, 32.0])), [0.0135, 0.0591], atol=0.008)
    assert "the zero of torque_in drifts" in found.problems[0].message


def test_both_ends_of_a_run_agree_without_drift():
    found = zeros(duration=34.0)
    assert found.torque_in.after is not None
    assert not found.torque_in.drifts
    assert not found.problems


def test_no_standstill_leaves_the_zeros_unknown():
    found = zeros(fixture="no_standstill")
    assert found.torque_in is None
    assert not found.known
    assert "no standstill tells the zero" in found.problems[0].message


def test_shaft_that_stands_still_under_torque_tells_no_zero():
    # The log begins while the drive winds the shafts up: they stand, but not without torque.
    found = zeros(rpm=60.0, log_start=2.3, ramp_time=8.0)
    assert found.torque_in is None
    assert found.torque_out is None
    assert "held under torque" in found.problems[0].message


def test_standstill_after_the_run_tells_the_zero_where_the_begin_is_missing():
    found = zeros(fixture="no_standstill", duration=34.0)
    assert found.torque_in.before is None
    assert found.torque_in.value == pytest.approx(0.012, abs=0.01)


def test_interval_of_the_zero_covers_under_coloured_noise():
    plain = run(vibration=False)
    stages = segment(plain)
    t = plain.torque.time
    inside = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        slow = np.interp(t, t[::20], np.convolve(rng.standard_normal(t[::20].size), np.exp(-np.arange(25) / 5), "same"))
        noisy = plain.torque["torque_in"] * (t > 1.9) + 0.005 * slow
        found = zero_offsets(replace(plain, torque=Signal(t, {"torque_in": noisy, "torque_out": noisy})), stages)
        half = student.ppf(0.975, found.torque_in.dof) * found.torque_in.sd
        inside += abs(found.torque_in.value) < half
    assert inside >= 51
