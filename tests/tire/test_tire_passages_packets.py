"""Rows of a log stand where they were sampled, however the radio lost them (tire.md, 5.1)."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Recording, Stream, storage
from pipeline.rigs.tire.passages.chains import chains_of
from pipeline.rigs.tire.passages.device import device_of
from pipeline.rigs.tire.passages.revolutions import joined, revolutions_of
from pipeline.rigs.tire.synthetic.rig import synthesize_bench


def run_of(**truth):
    (recording,) = synthesize_bench({"runs": ["load_2000"], "duration": 8.0, **truth}, 1)
    return recording


def without(recording, *names, time=None):
    device = recording.streams["device"]
    kept = {name: channel for name, channel in device.channels.items() if name not in names}
    return replace(recording, streams={"device": Stream("device", device.time if time is None else time, kept)})


def places(device, seconds=3.0):
    """Return the numbers of the samples that are valid, from the first on."""
    return np.concatenate([piece.first + np.flatnonzero(np.isfinite(piece.flex)) for piece in device.pieces(seconds)])


@pytest.mark.parametrize("left_out", [(), ("sample_index",), ("sample_index", "packet_counter")])
@pytest.mark.parametrize("truth", [{}, {"loss": 0.1, "burst": 12.0}, {"counter_bits": 8}, {"silence": (2.0, 5.0)}])
def test_samples_stand_where_they_were_taken_by_index_counter_or_time(left_out, truth):
    recording = run_of(**truth)
    index = recording.values("sample_index").astype(int)
    device = device_of(without(recording, *left_out))
    assert device.layout.by == ("sample_index", "packet_counter", "time")[len(left_out)]
    assert np.array_equal(places(device), index - index[0])
    missing = index[-1] - index[0] + 1 - index.size
    assert device.loss.packets == missing / 10
    assert device.loss.share == pytest.approx(missing / (missing + index.size))
    assert device.loss.longest == pytest.approx((np.diff(index).max() - 1) / 12e3)


def test_a_counter_that_wraps_several_times_in_a_silence_is_told_by_time():
    recording = run_of(counter_bits=6, silence=(1.0, 7.0), told={"counter_bits": 6.0})
    index = recording.values("sample_index").astype(int)
    device = device_of(without(recording, "sample_index"))
    assert np.array_equal(places(device), index - index[0])


def test_times_that_jitter_by_packets_do_not_move_samples_that_a_counter_places():
    recording = run_of()
    time = recording.streams["device"].time
    late = np.sort(time + 2e-3 * np.random.default_rng(1).random(time.size)) + 1e-9 * np.arange(time.size)
    index = recording.values("sample_index").astype(int)
    assert np.array_equal(places(device_of(without(recording, "sample_index", time=late))), index - index[0])


def test_a_sample_index_that_wraps_or_restarts_is_placed_by_time_and_told():
    recording = run_of()
    device = recording.streams["device"]
    index = recording.values("sample_index")
    wrapped = {**device.channels, "sample_index": Channel("sample_index", index % 65536, "1")}
    found = device_of(replace(recording, streams={"device": replace(device, channels=wrapped)}))
    assert np.array_equal(places(found), index - index[0])
    assert any("restart or wrap" in finding.message for finding in found.quality)


def by_rows(recording, rows, *left_out):
    """The same log with its rows as they came in; their times are those of arrival."""
    device = recording.streams["device"]
    kept = {n: replace(c, values=np.asarray(c.values)[rows]) for n, c in device.channels.items() if n not in left_out}
    time = np.maximum.accumulate(device.time[rows]) + 1e-9 * np.arange(rows.size)
    return replace(recording, streams={"device": Stream("device", time, kept)})


@pytest.mark.parametrize("left_out", [(), ("sample_index",)])
def test_packets_that_come_late_or_twice_stand_where_they_belong(left_out):
    recording = run_of()
    index = recording.values("sample_index").astype(int)
    packets = np.arange(index.size // 10 * 10).reshape(-1, 10)
    order = np.arange(len(packets))
    order[40:-40:50], order[41:-40:50] = order[41:-40:50].copy(), order[40:-40:50].copy()
    for rows in (packets[order], np.repeat(packets, 1 + (order % 30 == 0), axis=0)):
        device = device_of(by_rows(recording, rows.ravel(), *left_out))
        assert device.layout.rate == 12e3
        assert np.array_equal(places(device), index[: packets.size] - index[0])
        missing = index[packets.size - 1] - index[0] + 1 - packets.size
        assert device.loss.packets == pytest.approx(missing / 10, abs=0.5)


@pytest.mark.parametrize("left_out", [(), ("sample_index",), ("packet_counter",)])
def test_counters_that_begin_again_are_placed_by_time_and_told(left_out):
    recording = run_of()
    device = recording.streams["device"]
    index = recording.values("sample_index")
    half = index.size // 20 * 10
    channels = {
        name: replace(c, values=np.where(np.arange(index.size) < half, c.values, c.values - c.values[half]))
        for name, c in device.channels.items()
        if name in ("sample_index", "packet_counter")
    }
    kept = {n: c for n, c in {**device.channels, **channels}.items() if n not in left_out}
    found = device_of(replace(recording, streams={"device": Stream("device", device.time, kept)}))
    assert np.array_equal(places(found), index.astype(int) - int(index[0]))
    assert any("jumps where time does not, 1 time" in finding.message for finding in found.quality)


def test_a_radio_id_of_two_bits_is_told_not_to_count():
    recording = run_of(counter_bits=2, told={"counter_bits": None})
    (finding,) = device_of(recording).quality
    assert "radio packet id of 2 bits cannot count losses, timing unsafe beyond 3 lost packets" in finding.message


def test_a_counter_that_stands_while_the_transmitter_sleeps_tells_loss_from_sleep():
    device = device_of(run_of(gated=True, gated_counts=False, loss=0.02, burst=1.0))
    assert device.layout.slept
    assert device.loss.share == pytest.approx(0.02, abs=0.008)


def test_what_a_gated_log_lost_is_unknown_where_its_counter_counts_the_sleep():
    assert np.isnan(device_of(run_of(gated=True)).loss.share)


@pytest.mark.parametrize(
    "lost", [(5,), (5, 6), (5, 7), (5, 6, 8), (5, 7, 8, 10), (4, 6, 8, 10)], ids=lambda turns: "-".join(map(str, turns))
)
def test_passages_lost_one_after_the_other_are_no_slower_turns(lost):
    places = np.cumsum(np.full(16, 1000.0) * (1.0 + 0.002 * np.arange(16)))
    there = np.ones(20_000, dtype=bool)
    for turn in lost:
        there[int(places[turn]) - 100 : int(places[turn]) + 100] = False
    seen = np.delete(places, lost)
    ((chain,), doubled) = chains_of(seen, np.ones(seen.size), np.concatenate([[0], np.cumsum(there)]))
    assert doubled == 0
    assert np.flatnonzero(chain.repaired).tolist() == list(lost)
    assert np.allclose(chain.places, places, atol=10.0)


def test_voltages_and_codes_give_the_same_volts():
    code, volt = (next(device_of(run_of(as_voltage=v, adc_reference=5.0)).pieces()) for v in (False, True))
    assert np.allclose(code.flex, volt.flex, equal_nan=True)
    assert np.allclose(code.film, volt.film, equal_nan=True)


def test_volts_are_not_held_against_a_scale_that_nobody_stated():
    recording = run_of(as_voltage=True, adc_reference=5.0, supply_voltage=5.0, divider_resistance=5e3)
    conditions = {name: value for name, value in recording.conditions.items() if name != "adc_reference"}
    piece = next(device_of(replace(recording, conditions=conditions)).pieces())
    assert np.nanmax(piece.flex) > 3.3
    assert piece.clipped is None
    assert piece.film_clipped is None


def test_an_id_too_short_and_a_time_that_does_not_know_of_losses_tell_no_speed():
    recording = run_of(counter_bits=2, told={"counter_bits": None})
    rows = recording.streams["device"].time.size
    device = device_of(without(recording, "sample_index", time=np.arange(rows) / 12e3))
    assert [finding.level for finding in device.quality] == ["error"]
    assert "speeds and moments cannot be told" in device.quality[0].message


def test_clipped_samples_are_no_numbers_and_are_told():
    piece = next(device_of(run_of(film_gain=1300.0)).pieces())
    assert piece.film_clipped.mean() > 0.01
    assert np.isnan(piece.film[piece.film_clipped]).all()
    assert piece.clipped is None


def test_a_log_on_disk_gives_the_revolutions_of_one_in_memory(tmp_path):
    recording = run_of()
    on_disk = storage.read(storage.write(recording, tmp_path), lazily=True)
    one, other = (joined(revolutions_of(device_of(r))) for r in (recording, on_disk))
    assert np.array_equal(one.times, other.times)
    assert np.array_equal(one.resistance, other.resistance, equal_nan=True)


def test_a_rate_that_the_times_contradict_is_told_and_not_used():
    device = device_of(run_of(told={"sample_rate": 10e3}))
    assert device.rate == 12e3
    assert "sample_rate is stated as 10000 Hz but the log's times tell 12000 Hz" in device.quality[0].message


def test_a_log_without_flex_sensor_is_refused_in_words():
    recording = Recording("r1", {"device": Stream("device", np.arange(3.0), {"a": Channel("a", np.zeros(3), "V")})})
    with pytest.raises(InputError, match="run 'r1' has neither flex_code nor flex_voltage; it has a"):
        device_of(recording)
