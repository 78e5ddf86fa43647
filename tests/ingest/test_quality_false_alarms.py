"""Sound signals of many kinds raise no alarm: neither warnings nor errors, and notes only where they are true."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from memory_log import found

from pipeline.ingest.scan import scan_log

N, RATE = 20000, 5000.0
T = np.arange(N) / RATE


def rounded(values: np.ndarray, step: float) -> np.ndarray:
    return np.asarray(np.round(values / step) * step)


def noise(size: float, seed: int = 1) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(N)


def band(part: float, seed: int = 2) -> np.ndarray:
    spectrum = np.fft.rfft(noise(1.0, seed))
    spectrum[int(part * N) :] = 0
    return np.fft.irfft(spectrum, N)


def sine(frequency: float) -> np.ndarray:
    return np.sin(2 * np.pi * frequency * T)


def trapezoid() -> np.ndarray:
    return np.clip((T % 2) * 2, 0, 1) - np.clip((T % 2 - 1) * 2, 0, 1)


def smooth_stroke() -> np.ndarray:
    def rise(u: np.ndarray) -> np.ndarray:
        u = np.clip(u, 0, 1)
        return 10 * u**3 - 15 * u**4 + 6 * u**5

    return rise(T - 1) - rise(T - 2.5)


def braked_counter() -> np.ndarray:
    left = np.maximum(N - 8.0 - np.arange(N), 0)
    counts = np.floor(0.6 - 8.2 * np.where(left < 125, left**2 / 250, left - 62.5))
    return np.asarray(counts - counts[0])


SIGNALS: dict[str, Callable[[], np.ndarray]] = {
    "sine": lambda: sine(5),
    "sine with noise": lambda: sine(5) + noise(0.01),
    "sine of 8 bit": lambda: rounded(sine(5), 2 / 256),
    "sine of 12 bit": lambda: rounded(np.sin(2 * np.pi * 5 * T + 0.3), 2 / 4096),
    "slow sine of 8 bit": lambda: rounded(sine(0.25), 2 / 256),
    "slow sine of 5 bit": lambda: rounded(sine(0.25), 2 / 32),
    "slow sine of 8 bit with noise": lambda: rounded(sine(0.25) + noise(0.004), 2 / 256),
    "drifting sine": lambda: sine(5) * (1 + 0.1 * T) + T,
    "chirp": lambda: np.sin(2 * np.pi * (T + 20 * T**2)),
    "growing chirp": lambda: T**3 * np.sin(2 * np.pi * (T + 100 * T**2)),
    "white noise": lambda: noise(1.0),
    "heavy tails": lambda: np.random.default_rng(3).laplace(size=N),
    "band-limited noise": lambda: band(0.05),
    "band-limited noise, rounded": lambda: rounded(band(0.05), 0.01),
    "slow noise": lambda: band(0.01),
    "square": lambda: np.sign(sine(3)),
    "square with noise": lambda: np.sign(sine(3)) + noise(0.01),
    "steps": lambda: np.floor(T * 2.5),
    "steps with noise": lambda: np.floor(T * 2.5) + noise(0.01),
    "set value with noise": lambda: 6 + noise(0.01),
    "set value that flickers by one step": lambda: rounded(6 + noise(0.003), 0.01),
    "set value that flickers rarely": lambda: 6 + 0.01 * (np.random.default_rng(4).random(N) < 1e-3),
    "ramps and holds": trapezoid,
    "ramps and holds, rounded": lambda: rounded(trapezoid(), 1e-3),
    "ramps and holds with noise": lambda: rounded(trapezoid() + noise(0.001), 1e-3),
    "smooth strokes": smooth_stroke,
    "smooth strokes, rounded": lambda: rounded(smooth_stroke(), 1e-3),
    "step response": lambda: 1 - np.exp(-T / 0.1),
    "step response, rounded": lambda: rounded(1 - np.exp(-T / 0.1), 1e-3),
    "step response, rounded, with noise": lambda: rounded(1 - np.exp(-T / 0.1) + noise(5e-4), 1e-3),
    "warming up by tenths of a kelvin": lambda: rounded(290 + T * 0.5, 0.1),
    "warming up with noise": lambda: rounded(290 + 0.5 * T + noise(0.03), 0.1),
    "sawtooth": lambda: T % 0.5,
    "triangle": lambda: np.abs((T * 3) % 2 - 1),
    "contact in half of each cycle": lambda: np.maximum(sine(3), 0),
    "counter": lambda: np.floor(T * 100),
    "counter of a shaft that is braked to rest": braked_counter,
    "switched current": lambda: ((T * 50) % 1 < 0.3) * 1.0,
    "wrapping angle": lambda: (T * 7) % (2 * np.pi),
    "speed from an encoder": lambda: np.diff(np.floor(np.cumsum(1 + np.sin(T * 6)) * 0.07), prepend=0) * RATE,
    "impacts": lambda: np.where(T % 1 > 0.5, np.exp(-(T % 1 - 0.5) * 60) * sine(200), 0) + noise(0.001),
    "rest before the start": lambda: np.where(T < 1, 0.2, 0.2 + sine(5)),
    "rest before and after": lambda: np.where((T < 1) | (T > 3), 0.1, 0.1 + sine(5)),
    "friction loop": lambda: np.tanh(5 * sine(2)),
    "friction loop, rounded": lambda: rounded(np.tanh(5 * sine(2)), 1e-3),
    "friction loop, rounded, with noise": lambda: rounded(np.tanh(5 * sine(2)) + noise(0.001), 1e-3),
    "stick and slip, rounded": lambda: rounded(np.tanh(20 * sine(2)), 1e-4),
}


@pytest.mark.parametrize("block", [1 << 18, 3000])
@pytest.mark.parametrize("kind", SIGNALS)
def test_a_sound_signal_raises_no_alarm(kind: str, block: int) -> None:
    findings = found(SIGNALS[kind](), RATE, block=block)
    assert [finding.message for finding in findings if "steps of" not in finding.message] == []
    assert all(finding.level == "note" for finding in findings)


def test_the_resolution_is_noted_only_where_it_is_coarse() -> None:
    assert found(rounded(sine(5), 2 / 4096), RATE) == []
    assert found(rounded(6 + noise(0.01), 0.001), RATE) == [], "the noise is larger"
    (finding,) = found(rounded(6e-4 * np.abs(sine(0.25)), 1e-5), RATE)
    assert "steps of 1e-05 N, only 61 of them" in finding.message


def test_a_constant_channel_is_noted_and_only_warned_of_where_it_is_required() -> None:
    (note,) = found(np.full(N, 6.0), RATE)
    (warning,) = found(np.full(N, 6.0), RATE, required=True)
    assert (note.level, warning.level) == ("note", "warning")
    assert "6 N in every sample" in warning.message


def test_logs_of_real_machines_raise_no_false_alarm(realdata: Path) -> None:
    logs = sorted(path for path in realdata.glob("*/*") if path.suffix in (".csv", ".mat"))
    assert logs
    for log in logs:
        scan = scan_log(log)
        assert [finding for finding in scan.quality if finding.level != "note"] == [], log.name
        assert all(table.time is not None for table in scan.tables)
