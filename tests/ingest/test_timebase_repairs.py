"""Stamps that do not increase are mended where that is safe, and refused where it is not; both is said."""

from __future__ import annotations

import numpy as np
import pytest
from memory_log import Collected, MemoryTable, Spec, streamed

from pipeline.errors import InputError
from pipeline.ingest.stream import StreamInSI

N = 20000
RATE = 5000.0
TRUE = np.arange(N) / RATE
ROWS = np.arange(N, dtype=float)


def passed(
    stamps: np.ndarray, values: np.ndarray | None = None, unit: str = "s", block_rows: int = 7000
) -> tuple[Collected, StreamInSI]:
    """Return what came through, with the row's number as the only channel unless values are given."""
    values = np.arange(stamps.size, dtype=float) if values is None else values
    table = MemoryTable({"time": stamps, "row": values}, {"time": unit, "row": "1"}, block_rows=block_rows)
    (stream,), (sink,) = streamed(table, specs=[Spec("row", "1")])
    assert (np.diff(sink.time) > 0).all()
    assert sink.values("row").size == sink.time.size
    return sink, stream


def refused(stamps: np.ndarray) -> str:
    with pytest.raises(InputError) as caught:
        passed(stamps)
    return str(caught.value)


def test_sound_stamps_pass_in_one_reading_unchanged() -> None:
    table = MemoryTable({"time": TRUE, "row": ROWS}, {"time": "s", "row": "1"}, block_rows=3000)
    (stream,), (sink,) = streamed(table, specs=[Spec("row", "1")])
    np.testing.assert_array_equal(sink.time, TRUE)
    np.testing.assert_array_equal(sink.values("row"), ROWS)
    assert table.readings == 1
    assert stream.repairs == []


def test_rows_without_time_are_dropped() -> None:
    stamps = TRUE.copy()
    stamps[[4, 15000]] = np.nan
    sink, stream = passed(stamps)
    np.testing.assert_array_equal(sink.values("row"), np.delete(ROWS, [4, 15000]))
    assert "2 rows without a time dropped, first row 5" in stream.repairs[0].message


def test_a_log_that_begins_without_times_is_dated_by_the_first_that_comes() -> None:
    stamps = np.concatenate([np.full(40_000, np.nan), 1.7e12 + 1e3 * TRUE])
    sink, _ = passed(stamps, unit="ms", block_rows=40_000)
    assert sink.time[0] == 0.0
    np.testing.assert_allclose(sink.time, TRUE, atol=1e-6)


def test_isolated_repeated_stamps_lose_the_later_row() -> None:
    stamps = np.insert(TRUE, [101, 9001], TRUE[[100, 9000]])
    sink, stream = passed(stamps)
    np.testing.assert_array_equal(sink.time, TRUE)
    np.testing.assert_array_equal(sink.values("row"), np.delete(np.arange(N + 2.0), [101, 9002]))
    assert "2 rows with the time of the row before" in stream.repairs[0].message
    assert "first row 102" in stream.repairs[0].message


@pytest.mark.parametrize("rate", [5000.0, 3100.0, 1300.0])
def test_coarse_stamps_are_spread_to_within_one_stamp(rate: float) -> None:
    true = np.arange(N) / rate
    sink, stream = passed(np.floor(true * 1000 + 1e-9), unit="ms")
    assert sink.time.size == N, "no sample is lost"
    assert np.abs(sink.time - true).max() < 1e-3
    np.testing.assert_allclose(np.diff(sink.time), 1 / rate, rtol=1e-3)
    assert "coarse" in stream.repairs[0].message
    assert stream.repairs[0].level == "warning"


def test_coarse_stamps_keep_a_gap() -> None:
    true = np.delete(TRUE, slice(5003, 6007))
    sink, _ = passed(np.floor(true * 1000 + 1e-9) / 1000)
    assert np.abs(sink.time - true).max() < 1e-3
    assert np.diff(sink.time).max() == pytest.approx(1005 / RATE, abs=1e-3)


def test_rows_logged_twice_are_dropped_and_not_spread() -> None:
    sink, stream = passed(np.repeat(TRUE, 2), np.repeat(ROWS, 2))
    np.testing.assert_array_equal(sink.time, TRUE)
    np.testing.assert_array_equal(sink.values("row"), ROWS)
    assert "dropped" in stream.repairs[0].message


def test_a_single_wild_stamp_costs_only_its_row() -> None:
    for wild in (9999.0, -9999.0):
        stamps = TRUE.copy()
        stamps[500] = wild
        sink, stream = passed(stamps)
        np.testing.assert_array_equal(sink.values("row"), np.delete(ROWS, 500))
        assert "steps backward" in stream.repairs[0].message
        assert stream.repairs[0].level == "warning"


@pytest.mark.parametrize("begin", [9900, 4000, 1])
def test_a_block_logged_again_is_dropped(begin: int) -> None:
    sink, stream = passed(np.concatenate([TRUE[:10000], TRUE[begin:]]))
    np.testing.assert_array_equal(sink.time, TRUE)
    assert "a block was written twice" in stream.repairs[0].message


@pytest.mark.parametrize("parts", [(15000, 5000), (5000, 15000)])
def test_where_the_clock_starts_again_the_longest_part_is_kept_and_nothing_joined(parts: tuple[int, int]) -> None:
    stamps = np.concatenate([TRUE[: parts[0]], TRUE[: parts[1]]])
    sink, stream = passed(stamps)
    start = 0 if parts[0] > parts[1] else parts[0]
    np.testing.assert_array_equal(sink.values("row"), np.arange(start, start + 15000.0))
    assert f"row {start + 1} to row {start + 15000}" in stream.repairs[0].message
    assert "split" in stream.repairs[0].message


def test_many_runs_in_one_file_are_refused() -> None:
    message = refused(np.concatenate([TRUE[:5000]] * 3))
    assert "several runs in one file" in message
    assert "row 5001" in message


@pytest.mark.parametrize(("bits", "begin"), [(16, 65000.0), (32, 2.0**32 - 1e5)])
def test_a_counter_that_wraps_is_continued(bits: int, begin: float) -> None:
    counts = np.mod(begin + 200.0 * np.arange(N), 2.0**bits)
    sink, stream = passed(counts, unit="us")
    np.testing.assert_allclose(sink.time - sink.time[0], TRUE, atol=1e-12)
    assert "wrapped" in stream.repairs[0].message


def test_time_that_stands_still_is_refused() -> None:
    message = refused(np.full(10, 3.0))
    assert "stands still at 3 in all 10 rows" in message
    assert "time: {rate: 5 kHz}" in message


def test_time_that_runs_backward_is_refused() -> None:
    assert "from 3.9998 to 3.9996 in row 2" in refused(TRUE[::-1].copy())
    assert "runs backward" in refused(np.random.default_rng(0).random(1000))
    assert "runs backward" in refused(np.array([1.0, 0.0]))


def test_no_time_in_any_row_is_refused() -> None:
    assert "no rows with a time" in refused(np.full(5, np.nan))


def test_infinite_values_become_missing_and_that_is_said() -> None:
    values = ROWS.copy()
    values[[10, 20, 30, 40, 50]] = np.inf, -np.inf, np.nan, 1.797e308, -1.797e308
    sink, stream = passed(TRUE, values)
    assert np.isnan(sink.values("row")[[10, 20, 30, 40, 50]]).all()
    assert np.isfinite(sink.values("row")).sum() == N - 5
    assert "4 values infinite or beyond 1e+100, up to 1.8e+308, first at 0.002 s" in stream.repairs[0].message


@pytest.mark.parametrize("block_rows", [64, 1000, 1 << 20])
def test_the_size_of_the_readers_blocks_changes_nothing(block_rows: int) -> None:
    stamps = np.insert(TRUE, 101, TRUE[100])
    stamps[7000] = np.nan
    stamps[12000] = -1.0
    sink, stream = passed(stamps)
    reference, other = passed(stamps, block_rows=4321)
    np.testing.assert_array_equal(sink.time, reference.time)
    np.testing.assert_array_equal(sink.values("row"), reference.values("row"))
    assert stream.repairs == other.repairs


@pytest.mark.parametrize("block_rows", [70, 4096, 7000])
def test_rows_a_little_out_of_order_are_sorted_and_none_is_lost(block_rows: int) -> None:
    order = np.arange(N)
    order[100:110] = order[100:110][::-1]
    order[4090:4100] = np.roll(order[4090:4100], 3)
    order[12000:12900:2], order[12001:12900:2] = order[12001:12900:2].copy(), order[12000:12900:2].copy()
    sink, stream = passed(TRUE[order], ROWS[order], block_rows=block_rows)
    np.testing.assert_array_equal(sink.time, TRUE)
    np.testing.assert_array_equal(sink.values("row"), ROWS)
    [repair] = stream.repairs
    assert repair.level == "note"
    assert "first from 0.0218 to 0.0216 in row 102" in repair.message
    assert "920 rows sorted by time, moved by up to 9 rows" in repair.message


def test_merged_publishers_out_of_step_are_sorted() -> None:
    rng = np.random.default_rng(3)
    uneven = TRUE + rng.uniform(-0.15, 0.15, N) / RATE
    late = np.argsort(uneven + (np.arange(N) % 2) * 3.0 / RATE, kind="stable")
    sink, _ = passed(uneven[late], ROWS[late])
    np.testing.assert_array_equal(sink.values("row"), ROWS)


def test_one_wrong_stamp_is_no_disorder() -> None:
    stamps = TRUE.copy()
    stamps[500] = stamps[300] + 0.5 / RATE
    sink, stream = passed(stamps)
    assert 500 not in sink.values("row")
    assert "1 row dropped" in stream.repairs[0].message


def test_a_clock_set_back_a_little_is_not_sorted_into_itself() -> None:
    stamps = TRUE.copy()
    stamps[8000:] -= 40.4 / RATE
    sink, stream = passed(stamps)
    assert (np.diff(sink.values("row")) > 0).all()
    assert "time steps backward" in stream.repairs[0].message
