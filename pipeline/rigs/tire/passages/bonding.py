"""A step of the flex sensor's amplitude that the PVDF film does not show: debonding (tire.md, section 8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.passages.revolutions import Revolutions

# Standard deviations and relative size of a step; without a film load may change, so more is asked.
_SURE, _LEAST, _LEAST_ALONE = 5.0, 0.03, 0.2
# A change of speed that the film follows.
_FASTER = 0.1
# Revolutions on either side.
_SIDE, _FEWEST = 20, 3


@dataclass(frozen=True)
class Step:
    """When (s), relative change of flex and film amplitude (None without one), in standard deviations of a revolution."""

    time: float
    flex: float
    film: float | None
    sds: float


def step_of(revolutions: Revolutions, *, has_film: bool) -> Step | None:
    """Return the largest step of the ratio of the amplitudes, None where there is none.

    Without a film the flex amplitude alone is looked at.
    """
    flex = revolutions.amplitude
    film = revolutions.film_amplitude if has_film else None
    good = revolutions.whole & (flex > 0.0)
    if film is not None:
        with_film = good & np.isfinite(film) & (np.nan_to_num(film) > 0.0)
        if with_film.sum() >= 0.5 * good.sum():
            good = with_film
        else:
            film = None
    if good.sum() < 2 * _FEWEST:
        return None
    value = np.log(flex[good]) - (np.log(film[good]) if film is not None else 0.0)
    times = revolutions.times[good]
    if film is not None:
        value = _without_speed(value, np.log(revolutions.speed[good]))
    noise = 1.4826 * float(np.median(np.abs(np.diff(value) - np.median(np.diff(value))))) / np.sqrt(2.0)
    best, at = 0.0, 0
    for k in range(_FEWEST, value.size - _FEWEST + 1):
        change = float(np.median(value[k : k + _SIDE]) - np.median(value[max(k - _SIDE, 0) : k]))
        if abs(change) > abs(best) + 1e-12:
            best, at = change, k
    least = _LEAST if film is not None else _LEAST_ALONE
    if abs(best) < max(_SURE * noise, least):
        return None
    if not _sudden(value, at):
        return None
    sides = slice(max(at - _SIDE, 0), at), slice(at, at + _SIDE)
    at = _sharpest(value, at)

    def change_of(values: np.ndarray) -> float:
        before, after = (float(np.median(values[side])) for side in sides)
        return after / before - 1.0

    if (
        film is not None
        and abs(change_of(revolutions.speed[good])) > _FASTER
        and abs(change_of(flex[good])) < _LEAST_ALONE
    ):
        return None  # It is the film, which grows with the speed.
    return Step(
        float(0.5 * (times[at - 1] + times[at])),
        change_of(flex[good]),
        None if film is None else change_of(film[good]),
        abs(best) / max(noise, 1e-12),
    )


def _sudden(value: np.ndarray, at: int) -> bool:
    """Tell whether a step explains the values better than a straight line: a drift is none."""
    order = np.arange(value.size, dtype=float)
    line = value - np.polyval(np.polyfit(order, value, 1), order)
    at = _sharpest(value, at)
    step = np.where(order < at, value - value[:at].mean(), value - value[at:].mean())
    return float(step @ step) < 0.5 * float(line @ line)


def _sharpest(value: np.ndarray, at: int) -> int:
    """Return where next to `at` two parts with a mean each leave least."""
    near = range(max(at - _SIDE, _FEWEST), min(at + _SIDE, value.size - _FEWEST) + 1)
    left = [float(np.var(value[:k]) * k + np.var(value[k:]) * (value.size - k)) for k in near]
    return near[int(np.argmin(left))]


def _without_speed(value: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Take out what goes with the speed (the film grows with it), if the speed changes enough to tell it from a step."""
    u = speed - speed.mean()
    if float(np.ptp(u)) < 0.02:
        return value
    jump, lead = np.diff(value), np.diff(u)
    slope = float(lead @ jump / max(float(lead @ lead), 1e-12)) if abs(lead).max() > 1e-6 else 0.0
    return np.asarray(value - np.clip(slope, -1.5, 1.5) * u)
