"""Faults of sensors and loggers are found, named once, and placed: clipping, freezing, spikes, dropouts, wrong units."""

from __future__ import annotations

import numpy as np
import pytest
from memory_log import found, judged

from pipeline.ingest.mapping import SelectedChannel
from pipeline.ingest.quality import StreamQuality, of_run
from pipeline.ingest.reader import RawChannel
from pipeline.recording import QualityFinding

N, RATE = 20000, 5000.0
T = np.arange(N) / RATE
SINE = np.sin(2 * np.pi * 5 * T)
BLOCKS = [1 << 18, 3000]


def noise(size: float, seed: int = 1) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(N)


def rounded(values: np.ndarray, step: float) -> np.ndarray:
    return np.asarray(np.round(values / step) * step)


def frozen(values: np.ndarray, start: int, stop: int) -> np.ndarray:
    values = values.copy()
    values[start:stop] = values[start]
    return values


def the_one(values: np.ndarray | dict[str, np.ndarray], block: int = 1 << 18) -> QualityFinding:
    """Return the only finding beside remarks on resolution."""
    findings = [finding for finding in found(values, RATE, block=block) if "steps of" not in finding.message]
    assert len(findings) == 1, findings
    return findings[0]


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize(
    ("signal", "levels"),
    [
        (np.clip(SINE, -0.8, 0.8), "-0.8 N and 0.8 N"),
        (np.clip(SINE, -2, 0.9), "0.9 N"),
        (np.clip(SINE, -2, 0.99), "0.99 N"),
        (np.clip(SINE + noise(0.01), -0.8, 0.8), "-0.8 N and 0.8 N"),
        (np.clip(rounded(SINE, 1e-3), -0.8, 0.8), "-0.8 N and 0.8 N"),
        (np.clip(rounded(SINE + noise(1e-3), 1e-3), -0.7, 0.95), "-0.7 N and 0.95 N"),
        (np.clip(rounded(np.sin(np.pi * T), 2 / 256), -0.703125, 0.703125), "-0.70312 N and 0.70312 N"),
        (np.clip(np.sin(2 * np.pi * (T + 20 * T**2)), -0.9, 0.9), "-0.9 N and 0.9 N"),
        (np.clip(rounded(np.tanh(5 * np.sin(4 * np.pi * T)) + noise(1e-3), 1e-3), -0.95, 0.95), "-0.95 N and 0.95 N"),
        (np.clip(np.sin(2 * np.pi * 150 * T), -0.7, 0.7), "-0.7 N and 0.7 N"),
        (np.clip(3 * np.exp(-(((T - 2) / 0.05) ** 2)) + noise(0.01), -1, 2), "2 N"),
    ],
    ids=["both", "upper", "slightly", "noisy", "rounded", "converter", "slow 8 bit", "chirp", "loop", "fast", "once"],
)
def test_a_clipped_signal_is_found_with_its_levels(signal: np.ndarray, levels: str, block: int) -> None:
    finding = the_one(signal, block)
    assert finding.level == "warning"
    assert f"clipped (saturated) at {levels}:" in finding.message
    assert finding.span is not None


def test_how_much_is_clipped_is_right() -> None:
    signal = np.clip(SINE, -0.8, 2)
    finding = the_one(signal)
    assert f"{np.count_nonzero(signal == -0.8)} samples" in finding.message
    assert "20 flat tops" in finding.message
    first = T[np.argmax(signal == -0.8)]
    assert finding.span is not None
    assert finding.span[0] == pytest.approx(first)


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize(
    ("signal", "start", "stop"),
    [
        (SINE, 5000, 7000),
        (SINE + noise(0.01), 5000, 5500),
        (SINE + noise(0.01), 15000, N),
        (SINE, 15010, N),
        (rounded(SINE + noise(0.01), 1e-3), 5000, 7000),
        (T + noise(0.001), 5000, 9000),
        (rounded(np.sin(np.pi * T / 2) + noise(0.004), 2 / 256), 5990, 9000),
        (noise(1.0), 2900, 3500),
    ],
    ids=["clean", "noisy", "to the end", "clean to the end", "rounded", "ramp", "8 bit", "across blocks"],
)
def test_a_stuck_channel_is_found_with_its_span(signal: np.ndarray, start: int, stop: int, block: int) -> None:
    finding = the_one(frozen(signal, start, stop), block)
    assert finding.level == "warning"
    assert "stuck" in finding.message
    assert f"{stop - start} samples" in finding.message
    assert finding.span == pytest.approx((T[start], T[stop - 1]))


def test_a_counter_that_stands_is_no_stuck_sensor() -> None:
    turning = np.floor(N * np.sort(np.random.default_rng(3).random(N)))
    counts = frozen(turning, 5000, 9000)
    assert any("stuck" in finding.message for finding in judged(counts, RATE, unit="N").findings())
    assert not any("stuck" in finding.message for finding in judged(counts, RATE, unit="count").findings())


def test_a_channel_that_sticks_more_than_once_is_said_once() -> None:
    signal = frozen(frozen(SINE + noise(0.01), 2000, 2500), 8000, 8600)
    assert "and 1 more time" in the_one(signal).message


def test_when_all_channels_freeze_together_it_is_the_logger() -> None:
    signals = {"force": frozen(SINE + noise(0.01), 5000, 7000), "x": frozen(SINE + noise(0.01, 2), 5000, 7000)}
    assert "all channels stand still from 1 s to 1.3998 s" in the_one(signals).message
    signals["x"] = SINE + noise(0.01, 2)
    assert the_one(signals).channel == "force"


@pytest.mark.parametrize("block", [*BLOCKS, 1000])
@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize(
    ("signal", "height"),
    [(SINE, 3.0), (SINE + noise(0.01), 0.6), (rounded(SINE, 1e-3), -0.3), (6 + noise(0.01), 10.0), (noise(1.0), 80.0)],
    ids=["clean", "noisy", "rounded", "constant", "noise"],
)
def test_isolated_spikes_are_counted_and_placed(signal: np.ndarray, height: float, width: int, block: int) -> None:
    at = [37, 2985, 8000, 11999, 12345, N - 40]
    values = signal.copy()
    for row in at:
        values[row : row + width] += height
    finding = the_one(values, block)
    assert f"{len(at)} spikes (outliers), first at {T[37]:.6g} s" in finding.message
    assert finding.level == "warning"


def test_missing_samples_are_a_note_when_few_and_a_warning_when_many() -> None:
    values = SINE.copy()
    values[77] = np.nan
    one = the_one(values)
    assert (one.level, "1 sample (NaN, 0.005 %), at 0.0154 s" in one.message) == ("note", True)
    values[5000:6000] = np.nan
    many = the_one(values, block=3000)
    assert (many.level, "1001 samples (NaN, 5 %)" in many.message) == ("warning", True)
    assert many.span == (0.0154, pytest.approx(T[5999]))


def test_a_channel_without_any_value_is_warned_of() -> None:
    assert "no value (NaN) in any sample" in the_one({"force": np.full(N, np.nan)}).message


def limited(peak: float, unit: str, taken_as: str, limit: float) -> list[QualityFinding]:
    channel = SelectedChannel("x", RawChannel("x", taken_as), unit, taken_as, limit=limit)
    quality = StreamQuality([channel])
    quality.add(T, {"x": peak * SINE})
    quality.finish()
    return quality.findings()


@pytest.mark.parametrize(
    ("peak", "unit", "taken_as", "limit", "guess"),
    [
        (0.41, "m", "m", 0.02, "mm labelled as m (factor 1000)"),
        (500.0, "T", "T", 3.0, "mT labelled as T (factor 1000)"),
        (2e5, "N", "kN", 2000.0, "N labelled as kN (factor 1000)"),
        (150.0, "rad", "rad", 7.0, "deg labelled as rad (factor 57.3)"),
        (0.6, "m", "inch", 0.05, "mm labelled as inch (factor 25.4)"),
        (1e4, "K", "K", 400.0, "check its unit"),
        (0.0201, "m", "m", 0.02, "check its unit"),
    ],
)
def test_an_implausible_size_names_the_unit_that_it_looks_like(
    peak: float, unit: str, taken_as: str, limit: float, guess: str
) -> None:
    (finding,) = limited(peak, unit, taken_as, limit)
    assert finding.level == "warning"
    assert guess in finding.message
    assert limited(0.9 * limit, unit, taken_as, limit) == []


def test_small_lengths_are_told_in_millimetres() -> None:
    (finding,) = limited(0.0042, "m", "m", 0.004)
    assert "reaches 4.2 mm, more than the plausible 4 mm" in finding.message


def test_findings_of_a_run_bear_its_name() -> None:
    named = of_run([QualityFinding("note", "a"), QualityFinding("note", "b", run="other")], "r1")
    assert [finding.run for finding in named] == ["r1", "other"]
