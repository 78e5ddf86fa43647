"""A log of one board that ends before the others: said so, and no stage is made up from what goes on."""

import pytest

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.gearbox.check import check
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import synthesize


def cut(ends, **options):
    """Return a run whose streams end at the given times, s."""
    run = synthesize({"runs": ["g3"], "vibration": False, **options}, 3)[0]
    streams = dict(run.streams)
    for name, end in ends.items():
        log = streams[name]
        rows = log.time < end
        channels = {n: Channel(n, c.values[rows], c.unit) for n, c in log.channels.items()}
        streams[name] = Stream(name, log.time[rows], channels)
    return Recording(run.run, streams, run.conditions)


@pytest.mark.parametrize("end", [15.2, 16.66])
def test_torques_that_end_in_sos_are_told_and_no_second_run_is_seen(end):
    recording = cut({"torque": end})
    numbers = numbers_of(record_of(recording))
    assert numbers.segmentation.names == ("standstill", "startup", "fos", "brake", "sos")
    (told,) = numbers.broken_off
    assert f"the torques end at {end:.2f} s while encoder_count_out goes on to 30.00 s" in told.message
    messages = " ".join(p.message for p in numbers.segmentation.problems)
    assert "2 runs" not in messages
    assert "a standstill follows" not in messages
    assert any("the torques end at" in finding.message for finding in check(recording))


def test_torques_that_end_before_the_brake_shift_no_clock():
    numbers = numbers_of(record_of(cut({"torque": 9.0})))
    assert numbers.record.encoder.time[0] == pytest.approx(0.0)
    assert "fos_loaded" not in numbers.segmentation.names
    assert numbers.run.events["startup"] == pytest.approx(2.35, abs=0.1)


def test_a_counter_that_ends_first_is_told():
    numbers = numbers_of(record_of(cut({"encoder": 24.0})))
    assert "encoder_count_out ends at 23.99 s while the torques go on" in numbers.broken_off[0].message
    assert "fos_after" in numbers.segmentation.names


def test_boards_stopped_by_hand_or_with_other_clocks_break_off_nowhere():
    assert not numbers_of(record_of(cut({"torque": 29.8}))).broken_off
    assert not numbers_of(record_of(cut({}, encoder_shift=0.3))).broken_off
    assert not numbers_of(record_of(cut({}, encoder_shift=2.0))).broken_off
