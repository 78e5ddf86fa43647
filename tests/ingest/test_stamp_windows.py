"""Stamps of a long log are repaired part by part, as they would be at once; what concerns the whole log still does."""

from __future__ import annotations

import numpy as np
import pytest
from memory_log import Collected, MemoryTable, Spec, streamed

from pipeline.errors import InputError
from pipeline.ingest import stamp_windows
from pipeline.ingest.stream import StreamInSI

N = 60_000
RATE = 5000.0
TRUE = np.arange(N) / RATE


def passed(stamps: np.ndarray, block_rows: int = 1000) -> tuple[Collected, StreamInSI]:
    """Return what came through, with the row's number as the only channel."""
    table = MemoryTable(
        {"time": stamps, "row": np.arange(stamps.size, dtype=float)}, {"time": "s", "row": "1"}, block_rows=block_rows
    )
    (stream,), (sink,) = streamed(table, specs=[Spec("row", "1")])
    assert (np.diff(sink.time) > 0).all()
    return sink, stream


@pytest.fixture
def in_parts(monkeypatch):
    """Make parts short, and count the logs that were repaired as a whole."""
    whole = []
    monkeypatch.setattr(stamp_windows, "PART_ROWS", 6000)
    monkeypatch.setattr(stamp_windows, "_LOOKED", 1500)
    found = stamp_windows._WholeOnlyError.__init__
    monkeypatch.setattr(
        stamp_windows._WholeOnlyError, "__init__", lambda self, *told: (whole.append(1), found(self, *told))[0]
    )
    return whole


def repeated(stamps: np.ndarray) -> np.ndarray:
    stamps[[7001, 30_000, 50_001]] = stamps[[7000, 29_999, 50_000]]
    return stamps


def backward(stamps: np.ndarray) -> np.ndarray:
    stamps[[9000, 9001, 41_000]] -= 0.02003
    return stamps


def written_twice(stamps: np.ndarray) -> np.ndarray:
    stamps[9000:9100] = stamps[8900:9000]
    stamps[41_000:41_050] = stamps[40_950:41_000]
    return stamps


def late(stamps: np.ndarray) -> np.ndarray:
    for at in range(400, N, 5000):
        stamps[at], stamps[at + 1] = stamps[at + 1], stamps[at]
    return stamps


def without_time(stamps: np.ndarray) -> np.ndarray:
    stamps[[5, 20_000, 20_001]] = np.nan
    return repeated(stamps)


def all_at_once(stamps: np.ndarray) -> np.ndarray:
    return without_time(backward(stamps))


@pytest.mark.parametrize("fault", [repeated, backward, written_twice, late, without_time, all_at_once])
def test_parts_give_the_stamps_and_the_words_of_the_whole(fault, request):
    stamps = fault(TRUE.copy())
    sink, stream = passed(stamps)
    whole = request.getfixturevalue("in_parts")
    in_parts, told = passed(stamps)
    assert not whole
    np.testing.assert_array_equal(in_parts.time, sink.time)
    np.testing.assert_array_equal(in_parts.values("row"), sink.values("row"))
    assert [finding.message for finding in told.repairs] == [finding.message for finding in stream.repairs]


def test_coarse_stamps_are_spread_in_parts_as_well_as_at_once(in_parts):
    sink, stream = passed(np.floor(TRUE * 1000) / 1000)
    assert not in_parts
    assert sink.time.size == N
    assert np.abs(sink.time - TRUE).max() < 2e-3
    assert np.median(np.diff(sink.time)) == pytest.approx(1 / RATE, rel=1e-3)
    assert "coarse, 5 rows share one on average" in stream.repairs[0].message


def test_a_clock_that_starts_again_is_seen_in_the_whole_log(in_parts):
    stamps = TRUE.copy()
    stamps[40_000:] -= stamps[40_000]
    sink, stream = passed(stamps)
    assert in_parts
    np.testing.assert_array_equal(sink.values("row"), np.arange(40_000.0))
    assert "starts again" in stream.repairs[0].message


def test_a_counter_that_wraps_is_continued_over_the_parts(in_parts):
    counts = np.mod(np.arange(N) * 5.0, 2.0**16)
    sink, stream = passed(counts)
    assert in_parts
    np.testing.assert_array_equal(np.diff(sink.time), 5.0)
    assert "wrapped" in stream.repairs[0].message


def test_time_that_runs_backward_is_refused(in_parts):
    with pytest.raises(InputError, match="runs backward"):
        passed(TRUE[::-1].copy())
    assert in_parts


def test_numbers_on_disk_are_read_by_slices():
    numbers = stamp_windows.OnDisk(np.float64)
    numbers.append(np.arange(5.0))
    numbers.append(np.arange(5.0, 9.0))
    np.testing.assert_array_equal(numbers[3:7], [3.0, 4.0, 5.0, 6.0])
    np.testing.assert_array_equal(numbers[7:20], [7.0, 8.0])
    assert numbers[9:12].size == 0
