"""What the bench's own table says of a run: means of load, speed and hub height while the wheel turned.

A channel that is frozen, empty or does not overlap the transmitter in time is set aside, and that is
said. Units and zero points are judged in `load_faults` and `speed_faults`, where the tire is known too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.recording import QualityFinding, Recording

LOAD, SPEED, HEIGHT = "vertical_load", "road_speed", "hub_height"
# What a reading is good for: fewer samples than that are no mean, a longer standstill (s) of the reading is no measurement.
_FEWEST, _FROZEN = 10, 2.0
# Shares of the run that must be covered, and that may be without a reading.
_COVERED, _EMPTY = 0.2, 0.5
# The sensor is in the patch and its dips for this share of a turn, before and behind the passage.
_PATCH = 0.125
# From the first to the last quarter: a mean that moves more than that is told.
_DRIFT = {LOAD: 0.02, SPEED: 0.02}
# Another speed in so much of the log, of which no passage is used, is told.
_UNUSED, _UNUSED_SPEED = 0.2, 0.05
_WORDS = {LOAD: "load", SPEED: "speed", HEIGHT: "hub height"}


@dataclass(frozen=True)
class Mean:
    """Mean of a channel over a run: its value, what its noise leaves uncertain, its spread, how many samples. SI."""

    value: float
    std_error: float
    spread: float
    samples: int


@dataclass(frozen=True)
class Reference:
    """Means by channel, and what is wrong with those that are missing."""

    means: Mapping[str, Mean] = field(default_factory=dict)
    why_not: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[QualityFinding, ...] = ()

    def value(self, channel: str) -> float:
        """Return the mean of a channel, NaN where there is none."""
        return self.means[channel].value if channel in self.means else math.nan

    def std_error(self, channel: str) -> float:
        """Return the standard error of a mean, NaN where there is none."""
        return self.means[channel].std_error if channel in self.means else math.nan


def reference_of(recording: Recording, begin: np.ndarray, end: np.ndarray, log: tuple[float, float]) -> Reference:
    """Return the means of the reference channels over the revolutions that begin and end then (s), shape (m,) each.

    `log` is when the transmitter's log begins and ends, s.

    The waveform shows load and height of the moments when the sensor is in the patch, so these are averaged about
    the passages only, half a turn after each begin: a drum's wave is seen at its same phases turn after turn. Only the
    noise of a reading, taken from its second differences, makes its mean uncertain.
    """
    span = (float(begin.min()), float(end.max()))
    means: dict[str, Mean] = {}
    why: dict[str, str] = {}
    findings: list[QualityFinding] = []
    for name in (LOAD, SPEED, HEIGHT):
        if name not in recording:
            if name != HEIGHT:
                why[name] = f"there is no channel {name}"
            continue
        time, values = recording.signal(name)
        turn = np.clip(np.searchsorted(begin, time, side="right") - 1, 0, begin.size - 1)
        inside = (time >= begin[turn]) & (time <= end[turn])
        near = np.abs(time - 0.5 * (begin + end)[turn]) <= _PATCH * (end - begin)[turn]
        reason = _unusable(time, values, inside, span)
        if reason:
            why[name] = reason
            findings.append(QualityFinding("warning", _set_aside(name, reason), recording.run, name))
            continue
        kept, frozen = _moving(time[inside], values[inside])
        seen = kept & near[inside]
        if frozen is not None:
            text = (
                f"{name} stands still for {frozen[1] - frozen[0]:.3g} s and moves before or after: the logger repeated its last reading. "
                "That stretch does not enter the mean"
            )
            findings.append(QualityFinding("warning", text, recording.run, name, frozen))
        means[name] = _mean(values[inside], kept, seen if name != SPEED and seen.sum() >= _FEWEST else kept)
        drift = _drifting(recording.run, name, time[inside], values[inside])
        findings += drift
        if name == SPEED and not drift:
            findings += _elsewhere(recording.run, time, values, inside, means[name].value, log)
    return Reference(means, why, tuple(findings))


def _set_aside(name: str, reason: str) -> str:
    return f"{name} is set aside: {reason}. Look at the sensor, its cable and the logger's clock, and log it again"


def _unusable(time: np.ndarray, values: np.ndarray, inside: np.ndarray, span: tuple[float, float]) -> str:
    """Say why a channel gives no mean over a span, empty where it does."""
    if not time.size:
        return "its table is empty"
    finite = np.isfinite(values)
    own = (float(time[0]), float(time[-1]))
    covered = min(own[1], span[1]) - max(own[0], span[0])
    if covered <= _COVERED * (span[1] - span[0]):
        shared = "do not overlap" if covered <= 0 else f"overlap for {covered:.3g} s only"
        return (
            f"its table runs from {own[0]:.4g} to {own[1]:.4g} s and the wheel's passages from {span[0]:.4g} to {span[1]:.4g} s, so that they "
            f"{shared}: the two clocks differ, or the files belong to different runs"
        )
    if not finite.any():
        return "it holds no number"
    good = inside & finite
    if good.sum() < max(_FEWEST, _EMPTY * inside.sum()):
        return f"only {int(good.sum())} of its {int(inside.sum())} samples while the wheel turned are numbers"
    if np.ptp(values[good]) == 0.0 and good.sum() > 2 * _FEWEST:
        return (
            f"it reads exactly {values[good][0]:.6g} in all {int(good.sum())} samples: a set-point or a frozen sensor"
        )
    return ""


def _moving(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, tuple[float, float] | None]:
    """Return which samples are numbers outside the longest standstill of a reading, and that stretch where it is long."""
    finite = np.isfinite(values)
    numbers = np.flatnonzero(finite)
    time, values = time[finite], values[finite]
    ends = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0, [True]]))
    runs = np.diff(ends)
    longest = int(np.argmax(runs))
    first, last = int(ends[longest]), int(ends[longest + 1]) - 1
    others = np.delete(runs, longest)
    usual = int(others.max()) if others.size else 0
    if time[last] - time[first] < _FROZEN or runs[longest] < 5 * usual:
        return finite, None
    finite[numbers[first : last + 1]] = False
    return finite, (float(time[first]), float(time[last]))


def _mean(values: np.ndarray, kept: np.ndarray, seen: np.ndarray) -> Mean:
    """Return the mean of what is seen; noise and spread are those of all that is kept."""
    whole = values[kept]
    # Second differences lose what varies slowly; white noise keeps sqrt(6) of its standard deviation.
    noise = float(np.std(np.diff(whole, 2))) / math.sqrt(6.0) if whole.size > 4 else float(np.std(whole))
    count = int(seen.sum())
    return Mean(float(values[seen].mean()), noise / math.sqrt(count), float(whole.std()), count)


def _elsewhere(
    run: str, time: np.ndarray, values: np.ndarray, inside: np.ndarray, used: float, log: tuple[float, float]
) -> list[QualityFinding]:
    """Tell of a wheel that turned at another speed for much of the log, of which no passages are used."""
    others = ~inside & np.isfinite(values) & (time >= log[0]) & (time <= log[1])
    share = float(others.sum()) / max(int((others | inside).sum()), 1)
    mean = float(values[others].mean()) if others.any() else math.nan
    if share < _UNUSED or not abs(mean - used) > _UNUSED_SPEED * abs(used):
        return []
    text = (
        f"speed is not constant: road_speed is {mean:.3g} m/s on the mean in the {share:.0%} of the log whose passages are not used, and {used:.3g} m/s in the "
        "rest. The run stands for the latter only; hold the speed, or cut the run in recipe or log"
    )
    return [QualityFinding("warning", text, run, SPEED, log)]


def _drifting(run: str, name: str, time: np.ndarray, values: np.ndarray) -> list[QualityFinding]:
    """Tell of a mean that moves from the first quarter of a run to the last."""
    finite = np.isfinite(values)
    time, values = time[finite], values[finite]
    quarter = values.size // 4
    if name not in _DRIFT or quarter < _FEWEST:
        return []
    first, last, whole = (float(part.mean()) for part in (values[:quarter], values[-quarter:], values))
    if whole == 0.0 or abs(last - first) < _DRIFT[name] * abs(whole):
        return []
    text = (
        f"{_WORDS[name]} is not constant: {name} moves by {100 * (last - first) / abs(whole):+.1f} % from the first to the last quarter of "
        "the run. Its mean stands for the run; hold it constant, or cut the run in recipe or log"
    )
    return [QualityFinding("warning", text, run, name, (float(time[0]), float(time[-1])))]
