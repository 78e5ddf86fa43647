"""Stages and events without labels, and runs off the protocol (gearbox.md, 5.1, 6, 8)."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.gearbox.clocks.alignment import align
from pipeline.rigs.gearbox.record import COUNT, Signal, record_of
from pipeline.rigs.gearbox.stages.breaks import find_break, parabola, ramp
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import RPM, gearbox_truth

CYCLE = ("standstill", "startup", "fos", "brake", "sos", "release", "fos_after", "rundown")


def run(rpm=120.0, seed=0, **truth):
    (recording,) = synthesize({"speeds": [rpm * RPM], **truth}, seed)
    return record_of(recording)


def events(rpm, seed, **truth):
    known, _ = next(iter(known_runs(gearbox_truth({"speeds": [rpm * RPM], **truth}), seed)))
    return known.events


def messages(found):
    return " / ".join(problem.message for problem in found.problems)


@pytest.mark.parametrize(
    "disturbance",
    [
        {},
        {"encoder_decoding": 1},
        {"fixture": "x1_decoding"},
        {"fixture": "three_times_noise"},
        {"encoder_ppm": 200.0, "vibration_ppm": -200.0},
        {"speed_only": True, "vibration": False},
    ],
    ids=["plain", "x1", "x1 at 16 ms", "three times the noise", "200 ppm", "speed only"],
)
@pytest.mark.parametrize("rpm", [60.0, 120.0, 210.0])
def test_sequence_is_exact_and_events_are_within_150_ms(rpm, disturbance):
    found = segment(align(run(rpm, 11, **disturbance))[0])
    assert found.names == CYCLE
    assert found.complete
    assert not found.problems
    assert found.speed_nominal == pytest.approx(rpm * RPM, rel=1e-3)
    true = events(rpm, 11, **disturbance)
    for name, event in found.events.items():
        assert event.time == pytest.approx(true[name], abs=0.15), name
        assert abs(event.time - true[name]) < 4.0 * event.sd + 0.01, name
    assert set(found.events) == set(true) - {"motor_on"}


def test_stages_share_their_bounds_with_each_other_and_with_the_events():
    found = segment(run())
    for before, after in zip(found.stages[:-1], found.stages[1:], strict=True):
        assert before.end == after.start
    assert found.stage("brake").start == found.events["brake_onset"].time
    assert found.stage("sos").start == found.events["sos_start"].time
    assert found.stage("fos_after").start == found.events["relock"].time


def test_weak_brake_is_a_loaded_fos_and_no_sos():
    found = segment(run(fixture="weak_brake"))
    assert found.names == ("standstill", "startup", "fos", "fos_loaded", "fos", "rundown")
    assert not found.complete
    loaded = found.stage("fos_loaded")
    assert (loaded.start, loaded.end) == pytest.approx((10.0, 20.2), abs=0.3)
    (problem,) = found.problems
    assert "lock never broke" in problem.message
    assert problem.span == (loaded.start, loaded.end)


def test_missing_standstill_is_told_and_the_rest_found():
    found = segment(run(fixture="no_standstill"))
    assert found.names == CYCLE[1:]
    assert not found.complete
    assert "startup" not in found.events
    assert "begins with the start-up" in messages(found)


def test_second_brake_cycle_is_told_with_its_times():
    found = segment(run(brakes=[[10.0, 14.0, 1.3], [20.0, 24.0, 1.3]]))
    assert found.names == (*CYCLE[:7], *CYCLE[3:])
    assert len(found.cycles) == 2
    second = found.all("sos")[1]
    assert found.problems[0].span == (second.start, second.end)
    assert "further brake cycle" in found.problems[0].message
    assert found.events["unlock"].time == pytest.approx(10.1, abs=0.1)


@pytest.mark.parametrize("lost", [False, True])
def test_encoder_dropout_is_no_sos(lost):
    found = segment(run(fixture="encoder_dropout", dropout_lost=lost))
    assert found.names == CYCLE
    assert found.problems[0].span == pytest.approx((7.0, 7.4), abs=0.02)
    assert "dropout, not a stop" in messages(found)


def test_encoder_that_dies_at_full_speed_is_no_sos():
    plain = run()
    time, counts = plain.encoder.time, plain.encoder[COUNT].copy()
    counts[time > 7.0] = counts[np.searchsorted(time, 7.0)]
    found = segment(replace(plain, encoder=Signal(time, {COUNT: counts})))
    assert found.names == ("standstill", "startup", "fos")
    assert "dropout, not a stop" in messages(found)


def test_encoder_silent_while_the_output_stops_leaves_the_sequence():
    plain = run()
    kept = (plain.encoder.time < 10.05) | (plain.encoder.time > 10.6)
    found = segment(replace(plain, encoder=Signal(plain.encoder.time[kept], {COUNT: plain.encoder[COUNT][kept]})))
    assert found.names == CYCLE
    assert "told nothing for 0.5" in messages(found)


def test_brake_that_never_frees_ends_in_sos():
    found = segment(run(brake_off=60.0, rundown_start=60.0))
    assert found.names == CYCLE[:5]
    assert not found.complete
    assert "step 6 of the protocol is missing" in messages(found)


def test_motor_switched_off_in_sos_ends_it_there():
    found = segment(run(rundown_start=15.0, brake_off=60.0))
    assert found.names == (*CYCLE[:5], "standstill")
    assert found.stage("sos").end == pytest.approx(15.8, abs=0.4)
    assert "a standstill follows SOS" in messages(found)
    assert not found.complete


def test_loaded_stand_without_mesh_noise_is_a_stall():
    plain = run()
    quiet = {
        n: np.where(plain.vibration.time > 9.9, np.random.default_rng(0).normal(0.0, v[:4000].std(), v.size), v)
        for n, v in plain.vibration.values.items()
    }
    found = segment(replace(plain, vibration=Signal(plain.vibration.time, quiet)))
    assert "sos" not in found.names
    assert "the motor is stalled" in messages(found)


@pytest.mark.parametrize(("speed", "name"), [(12.4, "sos"), (0.0, "stall")])
def test_measured_input_speed_tells_sos_from_a_stall(speed, name):
    plain = run(vibration=False)
    t = plain.torque.time
    speed_in = np.interp(t, [2.0, 4.0, 10.1, 10.3, 20.0, 20.3], [0.0, 12.57, 12.57, speed, speed, 12.57])
    found = segment(replace(plain, speed_in=Signal(t, {"speed_in": speed_in})))
    assert name in found.names


def test_brake_that_slows_the_output_without_stopping_it_is_told_and_not_forced():
    found = segment(run(brakes=[[10.0, 10.2, 1.3], [10.25, 20.0, 0.2]]))
    assert "sos" not in found.names
    assert not found.complete
    assert "without a stop" in messages(found)


def test_run_without_motion_is_an_error():
    plain = run()
    still = Signal(plain.encoder.time, {COUNT: np.zeros(plain.encoder.time.size)})
    found = segment(replace(plain, encoder=still))
    assert not found.stages
    assert found.problems[0].level == "error"


def test_reversed_torque_sign_changes_no_event():
    plain = run()
    turned = replace(plain, torque=Signal(plain.torque.time, {n: -v for n, v in plain.torque.values.items()}))
    assert segment(turned).events == pytest.approx(segment(plain).events)


def test_break_error_is_honest_for_white_noise():
    t = np.arange(0.0, 1.0, 0.005)
    z = []
    for seed in range(200):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(t.size)
        found, _ = find_break(t, np.maximum(t - 0.6, 0.0) + noise, [np.ones_like(t)], [ramp], (0.1, 0.95))
        z.append((found.time - 0.6) / found.sd)
    assert 0.75 < np.std(z) < 1.2


def test_break_of_a_parabola_is_exact_without_noise():
    t = np.arange(0.0, 1.0, 0.01)
    found, squares = find_break(t, 3.0 + parabola(t - 0.4321), [np.ones_like(t)], [parabola], (0.1, 0.9))
    assert found.time == pytest.approx(0.4321, abs=1e-4)
    assert squares[1] < 1e-8 * squares[0]


def test_random_loss_of_most_encoder_samples_leaves_the_sequence():
    plain = run()
    kept = np.random.default_rng(3).random(plain.encoder.time.size) < 0.3
    found = segment(replace(plain, encoder=Signal(plain.encoder.time[kept], {COUNT: plain.encoder[COUNT][kept]})))
    assert found.names[:7] == CYCLE[:7]


@pytest.mark.parametrize("span", [(0.0, 3.0), (7.0, 12.0), (11.0, 21.0), (25.0, 30.0)])
def test_torques_of_a_part_of_the_run_only_never_break_or_disorder_the_stages(span):
    plain = run()
    moved, _ = align(replace(plain, torque=plain.torque.part(*span)))
    found = segment(moved)
    for before, after in zip(found.stages[:-1], found.stages[1:], strict=True):
        assert before.start < before.end <= after.start + 1e-9


def test_dead_torque_channel_is_no_sos():
    plain = run()
    dead = {name: np.zeros(plain.torque.time.size) for name in plain.torque.values}
    found = segment(replace(plain, torque=Signal(plain.torque.time, dead)))
    assert "sos" not in found.names
    assert not found.complete
