"""Revolutions in the divider's voltage on 256 angles: what the fit of load and force works on.

In volts the noise is additive, and bins that hold no samples are told apart from those that do.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from pipeline.rigs.tire.ring.sensor import divider_voltage
from pipeline.rigs.tire.road.library import WaveformLibrary

ANGLES = 256
# Share of the angles that a revolution needs, and of the usual samples that an angle needs.
LEAST_SHARE = 0.6
_LEAST_FILLING = 0.4


class PassageBlock(Protocol):
    """What is used of some revolutions (`passages.revolutions.Revolutions`)."""

    @property
    def times(self) -> np.ndarray:
        """Moments of the passages, s, shape (m,)."""
        ...

    @property
    def time_se(self) -> np.ndarray:
        """Their standard errors, s."""
        ...

    @property
    def speed(self) -> np.ndarray:
        """Rotation, rad/s, shape (m,)."""
        ...

    @property
    def speed_se(self) -> np.ndarray:
        """Its standard errors, rad/s."""
        ...

    @property
    def resistance(self) -> np.ndarray:
        """R2 by angle, ohm, shape (m, bins)."""
        ...

    @property
    def film(self) -> np.ndarray | None:
        """Film by angle, V, shape (m, bins), or None."""
        ...

    @property
    def count(self) -> np.ndarray:
        """Samples in each bin, shape (m, bins)."""
        ...

    @property
    def whole(self) -> np.ndarray:
        """Whether a revolution is fit for use, shape (m,)."""
        ...


@dataclass(frozen=True, eq=False)
class Passages:
    """Revolutions on `ANGLES` angles, shape (m, ANGLES), in V.

    Attributes
    ----------
    time, time_se, speed, speed_se, told_speed
        Passage (s) and rotation (rad/s), shape (m,); `speed` is a usual one where none is told.
    voltage, missing
        Mean in each angle, V, and whether it holds too few samples.
    weight
        Of each bin that was merged, summing up to 1, shape (m, ANGLES, bins/ANGLES).
    film
        Of the film, V; None without one.
    usable
        Whether a revolution is worth fitting, shape (m,).
    noise_guess
        Standard deviation of the voltage from angle to angle, V: scale of the noise before its spectrum is known.
    """

    time: np.ndarray
    time_se: np.ndarray
    speed: np.ndarray
    speed_se: np.ndarray
    told_speed: np.ndarray
    voltage: np.ndarray
    weight: np.ndarray
    missing: np.ndarray
    film: np.ndarray | None
    usable: np.ndarray
    noise_guess: float

    def part(self, rows: np.ndarray) -> Passages:
        """Return some of the revolutions."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return Passages(**{name: v[rows] if isinstance(v, np.ndarray) else v for name, v in found.items()})


def passages_of(block: PassageBlock, known: WaveformLibrary) -> Passages:
    """Return revolutions in volts on `ANGLES` angles, means by the samples of the bins they are merged from."""
    sensor = known.tire.sensor
    count = np.asarray(block.count, dtype=float)
    rows, bins = count.shape
    seen = np.isfinite(block.resistance) & (count > 0.0)
    weight = np.where(seen, count, 0.0).reshape(rows, ANGLES, bins // ANGLES)
    R2 = np.where(seen, block.resistance, 0.0)
    V = divider_voltage(R2, sensor.VIN, sensor.R1).reshape(weight.shape)
    total = weight.sum(axis=2)
    usual = np.median(total, axis=1, keepdims=True)
    missing = total < np.maximum(_LEAST_FILLING * usual, 1e-9)
    weight = weight / np.where(total > 0.0, total, 1.0)[:, :, None]
    voltage = (V * weight).sum(axis=2)
    film = None
    if block.film is not None and known.tire.film is not None:
        found = np.where(np.isfinite(block.film), block.film, 0.0).reshape(weight.shape)
        film = (found * weight).sum(axis=2)
    turning = np.isfinite(block.speed) & (block.speed > 0.0)
    usable = block.whole & (missing.mean(axis=1) < 1.0 - LEAST_SHARE) & turning
    speed = np.where(turning, block.speed, np.median(block.speed[turning]) if turning.any() else 1.0)
    between = np.diff(voltage[usable], axis=1)
    guess = max(1e-9, float(np.median(np.abs(between))) / 0.954) if between.size else 1.0
    return Passages(
        block.times, block.time_se, speed, block.speed_se, block.speed, voltage, weight, missing, film, usable, guess
    )


def together(parts: list[Passages]) -> Passages:
    """Return the revolutions of several blocks in one."""

    def stacked(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])

    names = ("time", "time_se", "speed", "speed_se", "told_speed", "voltage", "weight", "missing", "usable")
    film = None if any(part.film is None for part in parts) else stacked("film")
    guess = float(np.median([part.noise_guess for part in parts]))
    return Passages(**{name: stacked(name) for name in names}, film=film, noise_guess=guess)


def angles() -> np.ndarray:
    """Return the centres of the merged bins, rad, shape (ANGLES,); bin i of N stands at -pi + 2 pi i/N."""
    step = 2.0 * np.pi / ANGLES
    return np.asarray(-np.pi + step * np.arange(ANGLES) + 0.5 * step)


def on_bins(harmonics: np.ndarray, bins: int, offset: float) -> np.ndarray:
    """Return a one-sided series on `bins` angles from -pi + offset, shape (m, bins), as means over one bin each."""
    n = np.arange(harmonics.shape[1])
    turned = harmonics * (np.exp(1j * n * (offset - np.pi)) * np.sinc(n / bins))
    if harmonics.shape[1] > bins // 2:
        turned = turned[:, : bins // 2]
    return np.asarray(np.fft.irfft(turned, bins, axis=1) * bins)


def to_variance(speed: np.ndarray) -> np.ndarray:
    """Return what turns a one-sided density (V^2/Hz) into the variance of one of `ANGLES` samples of a turn, (m, 1)."""
    return np.asarray(ANGLES * speed[:, None] / (4.0 * np.pi))
