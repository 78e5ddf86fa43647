"""A counter that freezes, falls silent or loses pulses, in every stage of a run (gearbox.md, 8)."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.rigs.gearbox.clocks.alignment import align
from pipeline.rigs.gearbox.record import COUNT, Signal, record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.stages.counts import counts_of
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.truth import RPM

CYCLE = ("standstill", "startup", "fos", "brake", "sos", "release", "fos_after", "rundown")
# Start-up early and late, FOS, the brake's rise and the stop, release early and late, run-down.
PLACES = (2.9, 3.0, 3.7, 6.0, 10.1, 10.2, 20.35, 20.6, 29.3)


@cache
def run(rpm=120.0, seed=0, vibration=False, **truth):
    (recording,) = synthesize({"speeds": [rpm * RPM], "vibration": vibration, **truth}, seed)
    return record_of(recording)


def frozen(record, start, duration, lost):
    """Return the record with a counter that stands from `start` on and then catches up, or has lost its counts."""
    time, counts = record.encoder.time, record.encoder[COUNT].copy()
    inside = (time >= start) & (time < start + duration)
    first, last = np.flatnonzero(inside)[[0, -1]]
    missed = counts[last] - counts[first]
    counts[inside] = counts[first]
    counts[last + 1 :] -= missed if lost else 0.0
    return replace(record, encoder=Signal(time, {COUNT: counts}))


@pytest.mark.parametrize("lost", [False, True], ids=["catches up", "lost"])
@pytest.mark.parametrize("duration", [0.09, 0.3])
@pytest.mark.parametrize("start", PLACES)
@pytest.mark.thorough
def test_a_frozen_counter_is_named_with_its_times_and_never_a_stop_or_stall(start, duration, lost):
    found = segment(align(frozen(run(), start, duration, lost))[0])
    assert found.names == CYCLE
    (problem,) = found.problems
    assert "dropout" in problem.message
    assert problem.span[0] == pytest.approx(start, abs=0.02)
    # Where the shaft came to rest while the counter was frozen, the end of the loss cannot be seen.
    if not (lost and problem.message.startswith("the encoder stopped counting")):
        assert problem.span[1] == pytest.approx(start + duration, abs=0.03)


@pytest.mark.parametrize("decoding", [1, pytest.param(4, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("rpm", [60.0, pytest.param(210.0, marks=pytest.mark.thorough)])
def test_coarse_and_fast_counters_that_freeze_leave_the_sequence(rpm, decoding):
    rng = np.random.default_rng(int(rpm) + decoding)
    for rate in (62.5, 125.0, 1000.0):
        plain = run(rpm, 3, encoder_decoding=decoding, encoder_rate=rate)
        for low, high in ((2.6, 4.0), (10.0, 10.3), (20.3, 20.9), (29.0, 29.5)):
            start, duration = rng.uniform(low, high), rng.uniform(0.08, 0.4)
            assert segment(frozen(plain, start, duration, bool(rng.integers(2)))).names == CYCLE, (
                rate,
                start,
                duration,
            )


@pytest.mark.parametrize("rate", [10.0, 60.0, 1000.0])
@pytest.mark.parametrize("rpm", [60.0, 240.0])
def test_sound_counters_of_any_rate_have_no_dropout(rpm, rate):
    assert not counts_of(run(rpm, 1, encoder_rate=rate)).problems
    assert segment(run(rpm, 1, encoder_rate=rate)).names == CYCLE


def test_an_event_hidden_by_a_frozen_counter_says_how_uncertain_it_is():
    plain, hidden = segment(run()), segment(frozen(run(), 10.2, 0.3, True))
    true, found = plain.events["sos_start"], hidden.events["sos_start"]
    assert abs(found.time - true.time) < 2.0 * found.sd
    assert found.sd > 3.0 * true.sd


def test_lost_counts_are_given_back_within_a_few():
    whole = counts_of(run())
    for start in (2.9, 3.5, 6.0, 20.6):
        mended = counts_of(frozen(run(), start, 0.2, True))
        missing = (whole.angle[-1] - mended.angle[-1]) / whole.step
        assert abs(missing) < 10, start


def test_small_jumps_are_told_and_leave_the_speed():
    plain = run()
    counts = plain.encoder[COUNT] + 25.0 * (plain.encoder.time > 7.0) - 40.0 * (plain.encoder.time > 8.5)
    broken = numbers_of(replace(plain, encoder=Signal(plain.encoder.time, {COUNT: counts})))
    assert [p.message.split(" some")[0] for p in broken.counts.problems] == ["the encoder gains", "the encoder loses"]
    speed, error = broken.speed_out
    assert abs(speed - 120.0 * RPM) < 2.0 * error
    assert error < 0.003


def test_interval_of_the_speed_covers_where_counts_are_lost():
    z = []
    for seed in range(25):
        time = np.arange(0.0, 8.0, 0.008)
        rng = np.random.default_rng(seed)
        angle = np.floor(12.5 * time / (2 * np.pi) * 512 + rng.uniform())
        for at in rng.uniform(1.0, 7.0, 2):
            angle[time > at] -= rng.integers(20, 60)
        plain = run()
        counts = counts_of(replace(plain, encoder=Signal(time, {COUNT: angle})))
        speed, error = counts.rate(0.0, 8.0)
        z.append((speed - 12.5) / error)
    assert np.std(z) < 1.5
    assert np.mean(np.abs(z) < 2.5) > 0.9


@pytest.mark.parametrize(("start", "duration"), [(3.0, 0.3), (2.9, 0.15), (20.35, 0.15), (20.6, 0.3), (6.0, 1.5)])
def test_inertia_stays_within_the_acceptance_where_counts_are_lost(start, duration):
    numbers = numbers_of(frozen(run(), start, duration, True))
    assert numbers.load.values[0] == pytest.approx(0.0195, rel=0.06)
    for at in numbers.windows.time:
        assert numbers.run.whole(at - 0.4, at + 0.4)


def test_many_short_losses_are_told_together_and_leave_the_windows():
    plain = run()
    counts = plain.encoder[COUNT].copy()
    for first in range(100, counts.size - 5, 97):
        counts[first : first + 3] = counts[first - 1]
    numbers = numbers_of(replace(plain, encoder=Signal(plain.encoder.time, {COUNT: counts})))
    (problem,) = numbers.counts.problems
    assert "dropped out" in problem.message
    assert numbers.load.values[0] == pytest.approx(0.0195, rel=0.06)


@pytest.mark.parametrize(
    ("zeroed", "said"),
    [(False, "the shaft slowed down unseen, or counts are lost"), (True, "what the output did then")],
)
def test_a_long_loss_that_hides_the_sos_is_told_and_cut_out(zeroed, said):
    plain = run()
    time, counts = plain.encoder.time, plain.encoder[COUNT].copy()
    if zeroed:  # the counter went on at full speed by itself: only the torque tells
        counts += np.where(time > 23.0, 14.0 * 2.0 * 512.0 - (counts[time > 23.0][0] - counts[time < 9.0][-1]), 0.0)
    kept = (time < 9.0) | (time > 23.0)
    found = segment(replace(plain, encoder=Signal(time[kept], {COUNT: counts[kept]})))
    assert found.names == ("standstill", "startup", "fos", "fos", "rundown")
    assert found.stages[2].end == pytest.approx(9.0, abs=0.02)
    assert found.stages[3].start == pytest.approx(23.0, abs=0.02)
    assert any(said in problem.message for problem in found.problems)
    assert not found.complete
