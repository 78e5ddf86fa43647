"""Which number of the bench, if it were another in this drive, would explain what the ring leaves of the mean waveform.

Pressure is the one that changes on the road: it moves the load most and leaves a shape of its own. Nothing is corrected,
but errors hold what the load would be off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.ring.ring import grid
from pipeline.rigs.tire.ring.sensor import voltage_slope
from pipeline.rigs.tire.road.library import UNKNOWNS, WaveformLibrary
from pipeline.rigs.tire.road.shape_error import ShapeError
from pipeline.rigs.tire.road.systematic import waveforms

_STEP = 0.02
_ANGLES = 256
# Shares of what is left over that a cause has to explain to be thought of, to be named; its least change, relative.
_THOUGHT_OF, _NAMED, _LEAST = 0.3, 0.5, 0.03
# What no cause that matters leaves so little of, as a share of the signal.
_LITTLE = 0.003
PRESSURE = "p0b"


@dataclass(frozen=True)
class Cause:
    """A number out of `UNKNOWNS` that differs from the bench's.

    Attributes
    ----------
    change
        Of its natural logarithm, by least squares.
    explains
        Share of the square of what is left over, 0..1.
    load, force
        What Fz and Fx read too high by it, N.
    """

    name: str
    change: float
    explains: float
    load: float
    force: float


@dataclass(frozen=True)
class ShapeCauses:
    """What may be behind a shape that is not that of the bench's ring."""

    causes: tuple[Cause, ...]

    @property
    def load_sd(self) -> float:
        """How far the load may be off by one of them, N."""
        return self._most([cause.load for cause in self.causes])

    @property
    def force_sd(self) -> float:
        """How far the longitudinal force may be off, N."""
        return self._most([cause.force for cause in self.causes])

    @property
    def pressure(self) -> Cause | None:
        """The pressure, where it explains most."""
        best = max(self.causes, key=lambda cause: cause.explains, default=None)
        return best if best is not None and best.name == PRESSURE and best.explains > _NAMED else None

    def _most(self, values: list[float]) -> float:
        weighed = [abs(value) * math.sqrt(cause.explains) for value, cause in zip(values, self.causes, strict=True)]
        return max(weighed, default=0.0)


def shape_causes(known: WaveformLibrary, shape: ShapeError, load: float, speed: float, R0: float) -> ShapeCauses:
    """Return the causes that explain some of what is left over, at the median load (N), rotation (rad/s), R0 (ohm)."""
    if shape.net < _LITTLE:
        return ShapeCauses(())
    n, theta = known.orders, grid(_ANGLES)
    wave = np.exp(1j * np.outer(n, theta))
    loads, speeds = np.array([load]), np.array([speed])

    def values(harmonics: np.ndarray) -> np.ndarray:
        return np.asarray(2.0 * (harmonics[0, 1:] @ wave[1:]).real)

    H, slope, pushed = known.harmonics(loads, np.zeros(1), speeds)
    g = voltage_slope(R0 + values(H), known.tire.sensor.VIN, known.tire.sensor.R1)
    # Order 1 tells nothing of bending.
    fitted = np.stack([*(g * values(c) for c in (slope, pushed, 1j * n * H)), g, np.cos(theta), np.sin(theta)], axis=1)
    left = np.interp(theta, shape.angle, shape.left, period=2.0 * np.pi)
    left = left - fitted @ np.linalg.lstsq(fitted, left, rcond=None)[0]
    found = []
    for name in UNKNOWNS:
        up, down = (
            waveforms(known.tire.scaled(name, math.exp(sign * _STEP)), loads, speeds, n.size)[0, 0, 0]
            for sign in (1, -1)
        )
        moved = g * (up - down) / (2.0 * _STEP)
        taken = np.linalg.lstsq(fitted, moved, rcond=None)[0]
        pattern = moved - fitted @ taken
        change = float(pattern @ left / (pattern @ pattern))
        explains = change**2 * float(pattern @ pattern) / float(left @ left)
        if abs(change) > _LEAST and explains > _THOUGHT_OF:
            found.append(Cause(name, change, explains, float(taken[0]) * change, float(taken[1]) * change))
    return ShapeCauses(tuple(found))
