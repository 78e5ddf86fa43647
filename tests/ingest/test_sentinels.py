"""Numbers that stand for "no value" are taken as missing and named; measured numbers never are."""

from __future__ import annotations

import numpy as np
import pytest
from memory_log import Collected, MemoryTable, Spec, streamed

from pipeline.recording import QualityFinding

N = 3000
TIME = np.arange(N) / 500.0
FORCE = 180.0 * np.sin(2 * np.pi * 5.0 * TIME)


def passed(values: np.ndarray, unit: str = "N", block_rows: int = 700) -> tuple[Collected, list[QualityFinding]]:
    table = MemoryTable({"time": TIME, "force": values}, {"time": "s", "force": unit}, block_rows=block_rows)
    (stream,), (sink,) = streamed(table, specs=[Spec("force", "N")])
    return sink, stream.repairs


def with_value(value: float, every: int = 97) -> np.ndarray:
    values = FORCE.copy()
    values[50::every] = value
    return values


@pytest.mark.parametrize("value", [-9999.0, 9999.0, -999.25, 1e30, -1e30, 9.91e37, float(np.float32(1e30))])
def test_a_repeated_sentinel_is_named_counted_and_missing(value: float) -> None:
    values = with_value(value)
    sink, [repair] = passed(values)
    np.testing.assert_array_equal(np.isnan(sink.values("force")), values == value)
    np.testing.assert_array_equal(sink.values("force")[values != value], FORCE[values != value])
    assert repair.level == "warning"
    assert f"{np.count_nonzero(values == value)} values logged as exactly {value:.10g}" in repair.message
    assert "First at 0.1 s, taken as missing" in repair.message


def test_it_is_the_logged_number_that_counts_not_its_si_value() -> None:
    sink, [repair] = passed(with_value(-9999.0) / np.where(with_value(-9999.0) == -9999.0, 1.0, 1000.0), unit="kN")
    assert np.nanmin(sink.values("force")) == pytest.approx(-180.0, abs=0.1)
    assert "exactly -9999" in repair.message


def test_two_sentinels_beside_missing_and_infinite_values_are_both_taken() -> None:
    values = with_value(-9999.0)
    values[[7, 8, 9]], values[10], values[11] = 1e30, np.nan, np.inf
    sink, repairs = passed(values)
    assert np.nanmax(np.abs(sink.values("force"))) <= 180.0
    assert "exactly -9999 and 1e+30" in repairs[0].message


def test_a_sentinel_in_a_log_with_wrong_stamps_is_taken_too() -> None:
    stamps = TIME.copy()
    stamps[[100, 200]] = stamps[[99, 199]]
    table = MemoryTable({"time": stamps, "force": with_value(-9999.0)}, {"time": "s", "force": "N"}, block_rows=700)
    (stream,), (sink,) = streamed(table, specs=[Spec("force", "N")])
    assert np.nanmin(sink.values("force")) >= -180.0
    assert {"repeated" in repair.message for repair in stream.repairs} == {True, False}
    assert len(stream.repairs) == 2


@pytest.mark.parametrize(
    "values",
    [
        with_value(-9999.0, every=N),  # one alone may be a spike
        np.round(12000.0 * np.sin(2 * np.pi * 5.0 * TIME)).clip(-9999.0, 9999.0),  # a meter of four digits
        np.where(np.sin(2 * np.pi * TIME) > 0, 9999.0, 0.0),  # a switch
        np.full(N, -9999.0),  # dead, said elsewhere
        np.arange(N) + 8000.0,  # a counter on its way
    ],
)
def test_measured_numbers_are_no_sentinels(values: np.ndarray) -> None:
    sink, repairs = passed(values)
    np.testing.assert_array_equal(sink.values("force"), values)
    assert repairs == []
