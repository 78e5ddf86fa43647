"""Events and stages where single signals mislead: slip that needs more than the lock, gaps, light loads, torques that end."""

from dataclasses import replace

import pytest

from pipeline.rigs.gearbox.clocks.alignment import align
from pipeline.rigs.gearbox.record import Signal, record_of
from pipeline.rigs.gearbox.stages.counts import counts_of
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import RPM, gearbox_truth

RIGID = {
    "a": 1.0, "d0": 0.15, "d1": 0.003, "c0": 0.15, "c_s": 0.2, "w_s": 14.0, "b0": 0.006, "M_c": 0.5, "M_v": 0.02, "M_e": 0.8,
    "M_lock": 1.9, "brake_capacity": 2.2,
}  # fmt: skip
"""A box without load-proportional drag."""


def run(rpm, seed=0, **truth):
    options = {"speeds": [rpm * RPM], **truth}
    (recording,) = synthesize(options, seed)
    known, _ = next(iter(known_runs(gearbox_truth(options), seed)))
    return record_of(recording), known.events


@pytest.mark.parametrize("rpm", [120.0, 180.0, 240.0])
def test_unlocking_is_found_where_slip_needs_more_torque_than_the_lock_carried(rpm):
    record, true = run(rpm, **RIGID | {"M_lock": 1.2, "M_lock_slope": 0.0, "M_v": 0.03, "brake_capacity": 1.6})
    found = segment(record)
    assert found.complete
    for name in ("brake_onset", "unlock"):
        assert abs(found.events[name].time - true[name]) < max(3.0 * found.events[name].sd, 0.006), name


@pytest.mark.parametrize("frozen", [False, True])
def test_relocking_that_the_encoder_did_not_see_is_known_to_the_gap_only(frozen):
    record, true = run(120.0, 1, **RIGID)
    time, counts = record.encoder.time, record.encoder["encoder_count_out"].copy()
    lost = (time >= 20.5) & (time <= 21.2)
    if frozen:
        counts[lost] = counts[lost][0]
    else:
        time, counts = time[~lost], counts[~lost]
    relock = segment(replace(record, encoder=Signal(time, {"encoder_count_out": counts}))).events["relock"]
    assert relock.sd > 0.1
    assert abs(relock.time - true["relock"]) < 2.0 * relock.sd


@pytest.mark.parametrize("together", [False, True])
def test_torques_that_end_in_sos_make_no_standstill(together):
    record, _ = run(120.0, 2)
    cut = replace(record, torque=record.torque.part(0.0, 16.66))
    if together:
        cut = replace(cut, encoder=record.encoder.part(0.0, 16.66), vibration=record.vibration.part(0.0, 16.66))
    found = segment(align(cut)[0])
    assert found.names == ("standstill", "startup", "fos", "brake", "sos")
    told = " ".join(problem.message for problem in found.problems)
    assert "the record ends in SOS, at 16.66 s" in told
    assert ("the torques end at 16.66 s, the encoder goes on to 30.00 s" in told) is not together
    assert "started again" not in told


def test_second_brake_cycle_is_no_fault_of_the_run():
    record, _ = run(120.0, 3, brakes=[[8.0, 13.0, 1.3], [18.0, 23.0, 1.3]])
    found = segment(record)
    assert found.complete
    assert len(found.cycles) == 2
    assert {problem.level for problem in found.problems} == {"note"}


@pytest.mark.parametrize("seed", range(3))
def test_light_load_that_stops_between_two_updates_is_no_dropout(seed):
    light = {"J_L": 0.008, "brake_rise": 0.25, "encoder_ppr": 1024, "encoder_decoding": 1, "encoder_rate": 100.0}
    record, true = run(60.0, seed, vibration=False, **light)
    assert not counts_of(record).problems
    stop = segment(record).events["sos_start"]
    assert abs(stop.time - true["sos_start"]) < 3.0 * stop.sd < 0.05


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("ramp", [0.5, 1.0])
def test_begin_of_motion_is_not_taken_for_the_begin_of_the_motor(seed, ramp):
    record, true = run(210.0, seed, ramp_time=ramp, J_L=0.008, vibration=False)
    found = segment(record).events["startup"]
    assert true["startup"] - true["motor_on"] < 0.3
    assert abs(found.time - true["startup"]) < 3.0 * found.sd < 0.1
