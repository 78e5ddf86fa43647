"""Runs off the protocol are named for what they are, with their times (gearbox.md, 2, 5.1, 8)."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.gearbox.clocks.alignment import align
from pipeline.rigs.gearbox.record import COUNT, Signal, record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.truth import RPM

CYCLE = ("standstill", "startup", "fos", "brake", "sos", "release", "fos_after", "rundown")


def run(rpm=120.0, seed=0, **truth):
    (recording,) = synthesize({"speeds": [rpm * RPM], **truth}, seed)
    return record_of(recording)


def part(record, start, end):
    return replace(
        record,
        torque=record.torque.part(start, end),
        encoder=record.encoder.part(start, end),
        vibration=record.vibration.part(start, end),
    )


def twice(record, pause):
    """Return a log of the same run twice."""

    def both(one):
        values = {k: np.concatenate([v, v + (v[-1] if k == COUNT else 0.0)]) for k, v in one.values.items()}
        return Signal(np.concatenate([one.time, one.time + pause]), values)

    return replace(record, torque=both(record.torque), encoder=both(record.encoder), vibration=both(record.vibration))


# A drive so weak that the motor stops before the lock breaks.
STALL = {"k_d": 3.0, "M_lock": 20.0, "brake_capacity": 12.0}


def test_a_stall_is_named_with_its_times():
    found = segment(align(run(**STALL))[0])
    stall = found.stage("stall")
    assert (stall.start, stall.end) == pytest.approx((10.1, 20.25), abs=0.15)
    messages = [problem.message for problem in found.problems]
    assert any(f"from {stall.start:.2f} to {stall.end:.2f} s: the motor is stalled" in text for text in messages)
    assert any("the input stopped with it (stall)" in text for text in messages)
    assert not any("no brake stopped" in text for text in messages)
    assert not found.complete


def test_without_vibration_a_stall_cannot_be_told_and_that_is_said():
    found = segment(align(run(vibration=False, **STALL))[0])
    assert "cannot be told" in " ".join(problem.message for problem in found.problems)
    assert not found.complete


def test_mesh_noise_elsewhere_makes_an_sos_doubtful_and_no_stall():
    plain = run()
    late = plain.vibration.on_clock(12.0)
    found = segment(replace(plain, vibration=late))
    assert "stall" not in found.names
    (problem,) = found.problems
    assert "the clocks of the boards do not agree" in problem.message


def test_every_brake_cycle_has_its_events_and_stages():
    found = segment(run(brakes=[[10.0, 14.0, 1.3], [20.0, 24.0, 1.3]]))
    first, second = found.cycles
    for cycle, on, off in ((first, 10.0, 14.0), (second, 20.0, 24.0)):
        assert set(cycle.stages) == {"fos", "brake", "sos", "release", "fos_after"}
        assert cycle.events["brake_onset"].time == pytest.approx(on, abs=0.05)
        assert cycle.events["sos_end"].time == pytest.approx(off + 0.25, abs=0.1)
        assert cycle.stages["sos"] == pytest.approx((on + 0.35, off + 0.25), abs=0.1)
    assert second.stages["fos"] == first.stages["fos_after"]
    assert "(cycle 2)" in found.problems[0].message


def test_load_of_all_cycles_goes_into_the_inertia():
    one, two = (
        numbers_of(run(brakes=[[10.0, 14.0, 1.3]])),
        numbers_of(run(brakes=[[10.0, 14.0, 1.3], [20.0, 24.0, 1.3]])),
    )
    assert [name for name, _, _ in two.run.free] == ["startup", "release", "release"]
    assert two.windows.time.max() > 25.0
    assert two.load.values[0] == pytest.approx(0.0195, rel=0.06)
    assert one.load.values[0] == pytest.approx(0.0195, rel=0.06)


def test_loaded_fos_lies_in_no_free_stretch():
    found = segment(run(fixture="weak_brake"))
    loaded = found.stage("fos_loaded")
    assert [name for name, _, _ in found.free] == ["startup", "steady"]
    assert all(end <= loaded.start or start >= loaded.end for _, start, end in found.free)


def test_two_runs_in_one_log_are_told_with_the_time_of_the_second():
    found = segment(align(twice(run(duration=34.0), 34.0005))[0])
    assert found.names[:8] == CYCLE
    assert found.names[9:] == (*CYCLE[1:], "standstill")
    (problem,) = found.problems
    assert "the motor is started again at 36.4" in problem.message
    assert "2 runs" in problem.message


@pytest.mark.parametrize(
    ("truth", "names"),
    [
        ({"ramp_time": 7.0}, CYCLE),
        ({"brake_rise": 2.0}, CYCLE),
        (
            {"brakes": [[5.2, 6.4, 1.3], [9.0, 10.0, 1.3]], "rundown_start": 13.0, "duration": 14.5},
            (*CYCLE[:7], *CYCLE[3:], "standstill"),
        ),
        ({"brakes": [[10.0, 10.2, 1.3], [10.25, 20.0, 0.2]]}, ("standstill", "startup", "fos", "fos", "rundown")),
    ],
    ids=["slow ramp", "brake rises in 2 s", "1 s of SOS", "slowed, not stopped"],
)
def test_hostile_runs_keep_to_what_happened(truth, names):
    moved, clocks = align(run(**truth))
    assert not clocks.problems
    assert segment(moved).names == names


def test_a_record_that_begins_or_ends_in_sos_is_cut_there():
    assert segment(part(run(), 0.0, 15.0)).names == CYCLE[:5]
    late = segment(align(part(run(), 13.0, 30.0))[0])
    assert late.names == CYCLE[4:]
    assert any("begins with SOS" in problem.message for problem in late.problems)


def test_a_motor_that_turns_backwards_has_the_same_stages():
    plain = run()
    torque = {name: -values for name, values in plain.torque.values.items()}
    counts = {COUNT: -plain.encoder[COUNT]}
    back = replace(plain, torque=Signal(plain.torque.time, torque), encoder=Signal(plain.encoder.time, counts))
    assert segment(align(back)[0]).names == CYCLE


def brake(record, *times):
    """Return the record with a brake force of 50 N that comes on and goes at `times`."""
    t = record.torque.time
    force = sum(np.interp(t, [on, on + 0.15, off, off + 0.3], [0.0, 50.0, 50.0, 0.0]) for on, off in times)
    noise = np.random.default_rng(0).normal(0.0, 0.5, t.size)
    return replace(record, brake_force=Signal(t, {"brake_force": force + noise}))


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (((10.0, 20.0),), "agrees with the events"),
        (((12.0, 22.0),), "the clock of brake_force, or an event, is wrong"),
        (((10.0, 20.0), (25.0, 26.0)), "neither torques nor counts show a load"),
        (((25.0, 26.0),), "without any brake_force"),
        ((), "does not change"),
    ],
)
def test_brake_force_checks_the_events(times, said):
    plain = run()
    found = segment(
        brake(plain, *times)
        if times
        else replace(brake(plain, (1.0, 2.0)), brake_force=brake(plain, (90.0, 91.0)).brake_force)
    )
    assert any(said in problem.message for problem in found.problems)
    assert found.names == CYCLE
