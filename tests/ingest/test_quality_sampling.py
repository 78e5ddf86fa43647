"""Gaps, uneven sampling and changes of rate are told from jitter, rounding and late stamps."""

from __future__ import annotations

import numpy as np
import pytest
from memory_log import judged

from pipeline.ingest.mapping import SelectedChannel
from pipeline.ingest.quality import StreamQuality
from pipeline.ingest.reader import RawChannel
from pipeline.recording import QualityFinding

N, RATE = 20000, 5000.0
TRUE = np.arange(N) / RATE
BLOCKS = [1 << 18, 3000, 700]


def quality(time: np.ndarray, block: int) -> StreamQuality:
    rng = np.random.default_rng(3)
    return judged(rng.standard_normal(time.size), time=time, block=block)


def said(time: np.ndarray, block: int) -> list[QualityFinding]:
    return quality(time, block).findings()


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize(
    "time",
    [
        TRUE,
        TRUE + 5e-6 * np.random.default_rng(0).standard_normal(N),
        TRUE + 2e-5 * np.random.default_rng(0).standard_normal(N),
        np.round(np.arange(N) / 3004.8, 7),
        np.round(np.arange(N) / 3004.8, 4),
        TRUE * (1 + 1e-4 * np.sin(TRUE)),
        TRUE[:3],
        TRUE[:2],
        TRUE[:1],
    ],
    ids=["exact", "2.5 % jitter", "10 % jitter", "fine", "rounded", "wandering", "3 rows", "2 rows", "1 row"],
)
def test_even_sampling_is_not_remarked_on(time: np.ndarray, block: int) -> None:
    assert said(time, block) == []


@pytest.mark.parametrize("block", BLOCKS)
def test_samples_lost_one_by_one_are_counted(block: int) -> None:
    rng = np.random.default_rng(5)
    lost = np.sort(rng.choice(np.arange(20, N - 20, 10), 12, replace=False))
    time = np.delete(TRUE, lost) + 5e-6 * rng.standard_normal(N - 12)
    (finding,) = said(time, block)
    assert finding.level == "note"
    assert "12 gaps, 12 samples (0.06 %)" in finding.message


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("start", [5000, 1020, 2999, 12, N - 60])
def test_a_gap_is_found_with_its_span_wherever_it_lies(block: int, start: int) -> None:
    (finding,) = said(np.delete(TRUE, slice(start, start + 50)), block)
    assert finding.level == "warning"
    assert "50 samples" in finding.message
    assert finding.span == pytest.approx((TRUE[start - 1], TRUE[start + 50]))


@pytest.mark.parametrize("block", BLOCKS)
def test_stamps_that_come_late_and_catch_up_are_no_gaps(block: int) -> None:
    time = TRUE.copy()
    for at in range(500, N - 10, 1000):
        time[at : at + 4] = time[at + 4] - np.array([4e-6, 3e-6, 2e-6, 1e-6])
    assert said(time, block) == []


@pytest.mark.parametrize("block", BLOCKS)
def test_two_rates_in_one_log_are_a_change_and_not_gaps(block: int) -> None:
    time = np.concatenate([np.arange(8000) * 1e-3, 8 + np.arange(8000) * 1e-2])
    (finding,) = said(time, block)
    assert (finding.level, "between 100 Hz and 1000 Hz" in finding.message) == ("note", True)


@pytest.mark.parametrize("block", BLOCKS)
def test_sampling_on_events_is_called_uneven_and_not_full_of_gaps(block: int) -> None:
    time = np.cumsum(np.random.default_rng(1).exponential(1e-3, N))
    (finding,) = said(time, block)
    assert finding.level == "warning"
    assert "unevenly" in finding.message


@pytest.mark.parametrize("block", BLOCKS)
def test_rate_and_duration_are_those_of_the_stamps(block: int) -> None:
    summary = quality(np.delete(TRUE, slice(5000, 5050)) + 3.0, block).summary()
    assert summary.rate == pytest.approx(RATE, rel=1e-9)
    assert (summary.n, summary.start, summary.end) == (N - 50, 3.0, pytest.approx(3.0 + TRUE[-1]))


def test_gaps_beside_a_counter_of_samples_are_the_rigs_to_judge() -> None:
    kept = np.delete(np.arange(3000.0), slice(1000, 1200))
    quality = StreamQuality(
        [
            SelectedChannel("index", RawChannel("index", "1"), "1", "1", counts_samples=True),
            SelectedChannel("force", RawChannel("force", "N"), "N", "N"),
        ]
    )
    quality.add(kept / 1000.0, {"index": kept, "force": np.sin(kept / 7.0)})
    quality.finish()
    (finding,) = quality.findings()
    assert finding.level == "note"
    assert "a gap from 0.999 s to 1.2 s (200 samples)" in finding.message
