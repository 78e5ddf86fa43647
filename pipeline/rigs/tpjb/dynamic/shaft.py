"""The angle of the shaft over time: the integral of the measured speed, or of what stands in for it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.recording import Stream

# Seconds between the knots that the angle is kept at; a shaft's speed does not change within.
_STEP = 0.05


@dataclass(frozen=True, eq=False)
class ShaftPhase:
    """Turns of the shaft at knots of time (s), shape (n,) each; straight between and beyond them."""

    time: np.ndarray
    at_knots: np.ndarray

    def turns(self, time: np.ndarray) -> np.ndarray:
        """Return the turns done at `time` (s), same shape."""
        inside = np.interp(time, self.time, self.at_knots)
        first = (self.at_knots[1] - self.at_knots[0]) / (self.time[1] - self.time[0])
        last = (self.at_knots[-1] - self.at_knots[-2]) / (self.time[-1] - self.time[-2])
        before, after = np.minimum(time - self.time[0], 0.0), np.maximum(time - self.time[-1], 0.0)
        return np.asarray(inside + first * before + last * after)

    def frequency(self, time: float, over: float = 1.0) -> float:
        """Return the turns a second about `time` (s)."""
        before, after = self.turns(np.array([time - over / 2, time + over / 2]))
        return float(after - before) / over

    @classmethod
    def steady(cls, frequency: float) -> ShaftPhase:
        """Return a shaft that turns at `frequency` (Hz)."""
        return cls(np.array([0.0, 1.0]), np.array([0.0, frequency]))

    @classmethod
    def of(cls, stream: Stream, channel: str = "speed") -> ShaftPhase | None:
        """Integrate the speed (rad/s) of a stream, piece by piece; None with fewer than two samples.

        Trapezia from sample to sample; samples that are no number are bridged.
        """
        times: list[np.ndarray] = []
        turns: list[np.ndarray] = []
        last_time = last_speed = np.nan
        total = 0.0
        for time, (speed,) in stream.blocks([channel]):
            valid = np.isfinite(speed)
            t, w = time[valid], speed[valid] / (2 * np.pi)
            if not t.size:
                continue
            if np.isfinite(last_time):
                t, w = np.r_[last_time, t], np.r_[last_speed, w]
            summed = total + np.r_[0.0, np.cumsum(np.diff(t) * (w[1:] + w[:-1]) / 2)]
            every = max(1, int(_STEP * t.size / max(t[-1] - t[0], 1e-12)))
            kept = np.unique(np.r_[np.arange(0, t.size, every), t.size - 1])
            fresh = kept if not times else kept[1:]
            times.append(t[fresh])
            turns.append(summed[fresh])
            last_time, last_speed, total = t[-1], w[-1], summed[-1]
        if not times or sum(part.size for part in times) < 2:
            return None
        return cls(np.concatenate(times), np.concatenate(turns))


def followed(start: np.ndarray, length: float, amplitude: np.ndarray, assumed: ShaftPhase) -> ShaftPhase:
    """Return the shaft's angle from the phase of its own line, block after block.

    Parameters
    ----------
    start
        Where the blocks begin, s, shape (B,).
    length
        Of a block, s.
    amplitude
        The 1X line fitted with the angle `assumed`, shape (B, c): the phase that it gains from block to
        block is what the shaft turns faster.
    """
    from scipy.interpolate import CubicSpline

    weight = np.nansum(np.abs(amplitude) ** 2, axis=1)
    valid = np.flatnonzero(weight > 0)
    if valid.size < 3:
        return assumed
    steps = [np.nansum(np.conj(amplitude[i]) * amplitude[j]) for i, j in pairwise(valid)]
    gained = np.r_[0.0, np.cumsum(np.angle(steps))] / (2 * np.pi)
    middle = start[valid] + length / 2
    knots = np.arange(start[valid[0]], start[valid[-1]] + length + _STEP, _STEP)
    return ShaftPhase(knots, assumed.turns(knots) + CubicSpline(middle, gained)(knots))
