"""How far the device's air temperature is off the bench's (rap.md, 3.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.temperature_fit import resolution

# Differences from which on their own scatter is their noise; numbers drawn for the spread of the largest, and times at least.
_FEW_DIFFERENCES, _DRAWN, _LEAST_DRAWS = 5, 40000, 200
# Noise of a reading where too few show it, K.
_UNCHECKED_READING = 0.15


@dataclass(frozen=True, eq=False)
class TemperatureError:
    """Device less bench: `error` (K) and `percent` (of the bench in degC, the paper's way) at `time` (s), shape (n,)."""

    largest: Estimate
    bias: Estimate
    time: np.ndarray
    error: np.ndarray
    percent: np.ndarray
    percent_max: float
    problems: tuple[QualityFinding, ...]


def compare_temperatures(rap: Signal, bench: Signal, lag: float = 0.0) -> TemperatureError:
    """Return the device's error against the bench, K, at the device's samples within the bench's record.

    Parameters
    ----------
    rap, bench
        Air temperature of either, each on its own clock.
    lag
        What the bench's clock shows more than the device's, s.

    Raises
    ------
    InputError
        If the two records do not overlap.
    """
    time = rap.time + lag
    reach = max(float(np.median(np.diff(bench.time))), 1.0) if bench.time.size > 1 else 600.0
    inside = (time > bench.time[0] - 0.5 * reach) & (time < bench.time[-1] + 0.5 * reach)
    if not inside.any():
        raise InputError(
            "temperature_air_rap and temperature_air_bench do not overlap in time; look at the clocks of the two tables."
        )
    reference = np.interp(time[inside], bench.time, bench.values)
    error = rap.values[inside] - reference
    percent = 100.0 * np.abs(error) / np.maximum(np.abs(reference - 273.15), 1e-3)
    scatter = float(error.std(ddof=1)) if error.size > 1 else _reading_sd(bench)
    bias = estimate(
        "temperature_bias", float(error.mean()), scatter / math.sqrt(error.size), dof=max(error.size - 1, 1)
    )
    problems = []
    if inside.sum() < 0.5 * rap.time.size:
        text = f"only {int(inside.sum())} of {rap.time.size} temperatures of the device lie within the bench's record."
        problems.append(QualityFinding("warning", text, channel="temperature_air_bench"))
    return TemperatureError(
        _largest(time[inside], error, percent, _reading_sd(bench)),
        bias,
        rap.time[inside],
        error,
        percent,
        float(percent.max()),
        tuple(problems),
    )


def _largest(time: np.ndarray, error: np.ndarray, percent: np.ndarray, reading_sd: float) -> Estimate:
    """Return the largest size of the errors (K), as uncertain as the largest of so many noisy differences is.

    Differences with the noise of these about their straight line are drawn anew, and the spread of their largest is told.
    """
    largest = float(np.abs(error).max())
    course, noise = np.full(error.size, error.mean()), reading_sd
    if error.size >= _FEW_DIFFERENCES:
        x = time - time.mean()
        course = course + x * float(x @ error) / max(float(x @ x), 1e-9)
        left = error - course
        noise = max(math.sqrt(float(left @ left) / (error.size - 2)), reading_sd)
    draws, dof = max(_DRAWN // error.size, _LEAST_DRAWS), max(error.size - 2, 2)
    rng = np.random.default_rng(error.size)
    # The noise itself is known from so many differences only.
    sds = noise * np.sqrt(dof / rng.chisquare(dof, draws))
    others = np.array([np.abs(course + sd * rng.standard_normal(error.size)).max() for sd in sds])
    low, high = np.quantile(others - others.mean(), [0.025, 0.975])
    remark = (
        f"largest of {error.size} differences; in the paper's way {percent.max():.2f} % of the bench's reading in degC. "
        "The interval holds that another run with the same noise has another largest one"
    )
    interval = (max(largest - float(high), 0.0), largest - float(low))
    return Estimate("temperature_error_max", largest, float(others.std(ddof=1)), interval, reason=remark)


def _reading_sd(sensor: Signal) -> float:
    """Return the noise of one reading, K: from second differences, which a slow course does not enter, and the steps."""
    T, step = sensor.values, resolution(sensor.values)
    if T.size < 5:
        return _UNCHECKED_READING
    # The warming bends in its first samples.
    second = np.diff(T, 2)
    second = second[min(6, second.size // 2) :]
    noise = math.sqrt(float(np.mean(second**2)) / 6.0)
    return math.hypot(max(noise, 0.01), step / math.sqrt(12.0))
