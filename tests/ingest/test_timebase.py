"""Which channel is time, in which unit, and what second zero is."""

from __future__ import annotations

import numpy as np
import pytest
from memory_log import MemoryTable, Spec, sources_of, streamed

from pipeline.errors import InputError
from pipeline.ingest.clock import TimeSource
from pipeline.ingest.mapping import ChannelMap
from pipeline.ingest.quality.sampling import Sampling
from pipeline.ingest.timebase import find_times

FORCE = Spec("force", "N")
N = 1000
SECONDS = np.arange(N) / 500.0
VALUES = np.sin(SECONDS)


def sampled(step: float) -> Sampling:
    sampling = Sampling()
    sampling.add(step * np.arange(100.0))
    sampling.finish()
    return sampling


def found(columns: dict[str, np.ndarray], entry: ChannelMap | None = None, **about: object) -> TimeSource:
    metadata = about.pop("metadata", None)
    table = MemoryTable({**columns, "force": VALUES}, **about)
    return find_times(sources_of(table, metadata=metadata), entry)[0]


def timed(stamps: np.ndarray, name: str = "time", unit: str | None = None, **about: object) -> np.ndarray:
    units = {"force": "N", **({name: unit} if unit else {})}
    table = MemoryTable({name: stamps, "force": VALUES}, units, **about)
    _, (sink,) = streamed(table, specs=[FORCE])
    return sink.time


@pytest.mark.parametrize(
    "name",
    ["t", "T", "Time", " TIME ", "Tout", "Zeit", "时间", "Temps", "tiempo", "Elapsed Time", "Test Time", "timestamp",
     "Time_ms", "t_us", "time.s", "millis", "Testzeit"],
)  # fmt: skip
def test_well_known_names_are_time(name: str) -> None:
    assert found({"x": VALUES, name: SECONDS}).channel == name


def test_the_order_of_places_is_recipe_then_time_then_the_formats_own_then_other_names() -> None:
    columns = {"Zeit": SECONDS, "stamp": SECONDS, "log_time": SECONDS}
    assert found(columns).channel == "Zeit"
    assert found(columns, time_channel="log_time").channel == "log_time"
    assert found({**columns, "Time": SECONDS}, time_channel="log_time").channel == "Time"
    assert found({**columns, "time": SECONDS}, ChannelMap("stamp", unit="ms"), time_channel="log_time") == TimeSource(
        "stamp", "ms", stated=True
    )
    assert found({**columns, "time": SECONDS}, ChannelMap(rate=5000.0)) == TimeSource(None, rate=5000.0)


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [("time", "ms", 1e-3), ("time", "s", 1.0), ("t_us", None, 1e-6), ("Time (ms)", None, 1e-3), ("millis", None, 1e-3),
     ("micros", None, 1e-6), ("time", "min", 60.0), ("time", "h", 3600.0), ("time", "[µs]", 1e-6)],
)  # fmt: skip
def test_units_of_time_come_from_the_log_or_the_name(name: str, unit: str | None, factor: float) -> None:
    np.testing.assert_allclose(timed(SECONDS, name, unit), SECONDS * factor, rtol=1e-12)


def test_a_unit_of_time_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match=r"r1\.csv.*'time'.*'kN'"):
        timed(SECONDS, "time", "kN")


def test_time_without_unit_is_seconds_and_that_is_said() -> None:
    table = MemoryTable({"t": SECONDS, "force": VALUES}, {"force": "N"})
    (stream,), _ = streamed(table, specs=[FORCE])
    (note,) = stream.notes(sampled(1 / 500))
    assert (note.level, "no unit" in note.message, "500" in note.message) == ("note", True, True)
    assert stream.notes(sampled(200.0))[0].level == "warning", "a step of 200 s looks like microseconds"


def test_relative_times_are_kept_as_logged() -> None:
    np.testing.assert_array_equal(timed(SECONDS + 17.25), SECONDS + 17.25)
    np.testing.assert_array_equal(timed(SECONDS - 2.0), SECONDS - 2.0)


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("stated", [True, False])
def test_times_since_1970_count_from_the_first_stamp(unit: str, per_second: float, stated: bool) -> None:
    stamps = np.round((1.7e9 + SECONDS) * per_second, 4)
    time = timed(stamps, "time", unit if stated else None)
    assert time[0] == 0.0
    np.testing.assert_allclose(time, SECONDS, atol=5e-7)


def test_a_counter_of_microseconds_since_power_on_is_no_date() -> None:
    np.testing.assert_allclose(timed(SECONDS * 1e6 + 1.7e9, "t_us"), SECONDS + 1700.0, rtol=1e-12)


def test_a_wrong_unit_of_times_since_1970_is_noticed() -> None:
    table = MemoryTable({"time": 1.7e12 + SECONDS * 1e3, "force": VALUES}, {"force": "N", "time": "s"})
    (stream,), (sink,) = streamed(table, specs=[FORCE])
    np.testing.assert_allclose(sink.time, SECONDS, atol=5e-4)
    assert any(note.level == "warning" and "ms since 1970" in note.message for note in stream.notes(sampled(1 / 500)))


def test_streams_of_one_run_share_the_earliest_absolute_second() -> None:
    one = MemoryTable({"time": 1.7e9 + 0.5 + SECONDS, "force": VALUES}, {"force": "N"}, name="a")
    other = MemoryTable(
        {"t": SECONDS, "x": VALUES}, {"x": "m", "t": "s"}, name="b", absolute_start="2023-11-14T22:13:20+00:00"
    )
    _, (a, b) = streamed(one, other, specs=[FORCE, Spec("x", "m")])
    assert a.time[0] == pytest.approx(0.5, abs=1e-6)
    assert b.time[0] == 0.0


def test_a_stream_without_date_beside_one_with_it_is_left_alone_and_said() -> None:
    one = MemoryTable({"time": 1.7e9 + SECONDS, "force": VALUES}, {"force": "N"}, name="a")
    other = MemoryTable({"time": SECONDS + 3, "x": VALUES}, {"x": "m", "time": "s"}, name="b")
    streams, (_, b) = streamed(one, other, specs=[FORCE, Spec("x", "m")])
    assert b.time[0] == 3.0
    assert any("cannot be aligned" in note.message for note in streams[1].notes(sampled(1 / 500)))


@pytest.mark.parametrize(
    ("metadata", "rate"),
    [
        ({"fs": "2000"}, 2000.0),
        ({"Sample rate": "2 kHz"}, 2000.0),
        ({"Ts": "0.5 ms"}, 2000.0),
        ({"rig.dt": "5e-4"}, 2000.0),
    ],
)
def test_a_rate_that_the_log_states_counts_samples_and_warns(metadata: dict[str, str], rate: float) -> None:
    time = found({}, metadata=metadata)
    assert time.channel is None
    assert time.rate == pytest.approx(rate)
    assert time.notes[0].level == "warning"


def test_a_rate_in_a_column_of_one_value_counts_too() -> None:
    rates = np.full(N, np.nan)
    rates[0] = 3004.8
    assert found({"fs": rates}).rate == 3004.8
    assert found({"Ts": np.full(N, 1e-3)}).rate == pytest.approx(1000.0)
    assert found({"Ts": SECONDS}).channel == "Ts", "many values are stamps, not a step"


def test_counted_samples_are_evenly_spaced() -> None:
    table = MemoryTable({"force": VALUES}, {"force": "N"}, block_rows=300)
    _, (sink,) = streamed(table, specs=[FORCE], time=ChannelMap(rate=5000.0))
    np.testing.assert_array_equal(sink.time, np.arange(N) / 5000.0)


@pytest.mark.parametrize(
    ("name", "entry"), [("sample_index", ChannelMap(rate=5000.0)), ("No", ChannelMap("No", rate=5000.0))]
)
def test_samples_lost_on_the_way_leave_a_gap_where_a_column_numbers_them(name: str, entry: ChannelMap) -> None:
    index = np.delete(7.0 + np.arange(N + 40), slice(50, 90))
    table = MemoryTable({name: index, "force": VALUES}, {"force": "N"}, block_rows=300)
    _, (sink,) = streamed(table, specs=[FORCE], time=entry)
    np.testing.assert_allclose(sink.time, index / 5000.0, rtol=1e-12)


def test_a_column_named_as_a_counter_that_counts_other_things_gives_no_time() -> None:
    table = MemoryTable({"sample_number": np.full(N, 3.0), "force": VALUES}, {"force": "N"})
    _, (sink,) = streamed(table, specs=[FORCE], time=ChannelMap(rate=5000.0))
    np.testing.assert_array_equal(sink.time, np.arange(N) / 5000.0)


def test_no_time_at_all_is_answered_with_the_ways_to_give_it() -> None:
    with pytest.raises(InputError) as caught:
        found({"x": VALUES})
    for part in ("r1.csv", "'x'", "'time'", "time: {channel:", "time: {rate: 5 kHz}"):
        assert part in str(caught.value)


def test_a_time_channel_that_the_log_lacks_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'Zeitt', which the log lacks\. Did you mean 'Zeit'\?"):
        found({"Zeit": SECONDS}, ChannelMap("Zeitt"))


def test_words_where_time_is_expected_are_shown() -> None:
    words = np.array(["yesterday"] * N, dtype=object)
    with pytest.raises(InputError, match=r"'time'.*text.*'yesterday'"):
        found({"time": words})


@pytest.mark.parametrize(
    ("first", "name", "date"), [(739000.5, "MATLAB", "2023-04-24 12:00"), (45041.25, "Excel", "2023-04-25 06:00")]
)
def test_stamps_that_no_rig_is_fast_enough_for_are_days(first: float, name: str, date: str) -> None:
    table = MemoryTable({"time": first + SECONDS / 86400.0, "force": VALUES}, {"force": "N"})
    (stream,), (sink,) = streamed(table, specs=[FORCE])
    resolution = 86400.0 * np.spacing(first)
    np.testing.assert_allclose(sink.time, SECONDS, atol=resolution)
    [note] = stream.clock.notes
    assert note.level == "warning"
    assert date in note.message
    assert name in note.message


def test_days_that_the_unit_states_have_a_date_and_slow_ones_without_are_only_suspected() -> None:
    days = 739000.5 + 10.0 * SECONDS  # a reading every half hour
    table = MemoryTable({"time": days, "force": VALUES}, {"time": "d", "force": "N"})
    (stream,), (sink,) = streamed(table, specs=[FORCE])
    np.testing.assert_allclose(sink.time, 864000.0 * SECONDS, atol=1e-3)
    assert [note.level for note in stream.clock.notes] == ["note"]
    table = MemoryTable({"time": days, "force": VALUES}, {"force": "N"})
    (stream,), (sink,) = streamed(table, specs=[FORCE])
    np.testing.assert_array_equal(sink.time, days)
    [note] = stream.clock.notes
    assert "if they are days, say `time: {unit: d}` in the recipe" in note.message


def test_seconds_since_power_on_are_no_days() -> None:
    table = MemoryTable({"time": 46000.0 + SECONDS, "force": VALUES}, {"force": "N"})
    (stream,), (sink,) = streamed(table, specs=[FORCE])
    np.testing.assert_array_equal(sink.time, 46000.0 + SECONDS)
    assert stream.clock.notes == []


@pytest.mark.parametrize(("factor", "level"), [(1.0, "note"), (1e3, "warning")])
def test_a_time_without_unit_that_would_make_a_slow_log_is_a_warning(factor: float, level: str) -> None:
    """Milliseconds of 500 Hz, taken as seconds, are one sample in 2 s."""
    table = MemoryTable({"time": factor * SECONDS, "force": VALUES}, {"force": "N"})
    (stream,), _ = streamed(table, specs=[FORCE])
    (said,) = [note for note in stream.notes(sampled(factor * 0.002)) if "has no unit" in note.message]
    assert said.level == level
    assert ('`time: {channel: "time", unit: ms}`' in said.message) is (level == "warning")
