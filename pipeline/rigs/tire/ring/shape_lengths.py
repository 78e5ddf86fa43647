"""Lengths that can be read off a waveform: dips, steepest slopes, zero crossings (tire.md, 3.5).

None of them is the contact length: Ld and L_slope are pinned by the ring's bending length and the sensor's length.
The contact length comes from `contact.pressed`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.ring.ring import Shape

_MESH = 4096
_FURTHEST_DIP = 0.5 * np.pi


@dataclass(frozen=True)
class Lengths:
    """Marks of one waveform: values in its own unit (1/m or ohm), angles in rad, lengths along the belt in m.

    Attributes
    ----------
    peak, peak_angle
        Highest value.
    dip_leading, dip_leading_angle, dip_trailing, dip_trailing_angle
        Lowest values before and behind the peak, within a quarter turn.
    deformation
        Ld, between the dips.
    slope
        L_slope, between the extreme slopes (the lobes of the PVDF).
    zero
        L_zero, between the zero crossings beside the peak.
    """

    peak: float
    peak_angle: float
    dip_leading: float
    dip_leading_angle: float
    dip_trailing: float
    dip_trailing_angle: float
    deformation: float
    slope: float
    zero: float

    @property
    def asymmetry(self) -> float:
        """A = trailing dip - leading dip: grows with Fx, and a little with Fz by hysteresis."""
        return self.dip_trailing - self.dip_leading


def lengths(shape: Shape, R: float) -> Lengths:
    """Return the marks of a waveform whose mean is zero, on a belt of radius R (m).

    A length is NaN where the waveform has no such marks.
    """
    spectrum = np.zeros(_MESH // 2 + 1, dtype=complex)
    kept = min(shape.harmonics.size, _MESH // 2)
    spectrum[:kept] = shape.harmonics[:kept]
    orders = np.arange(spectrum.size)
    value, slope = np.fft.irfft([spectrum, 1j * orders * spectrum], _MESH) * _MESH
    top = int(np.argmax(value))
    value, slope = np.roll(value, _MESH // 2 - top), np.roll(slope, _MESH // 2 - top)
    step, middle = 2.0 * np.pi / _MESH, _MESH // 2
    reach = int(_FURTHEST_DIP / step)
    leading = middle - reach + int(np.argmin(value[middle - reach : middle]))
    trailing = middle + int(np.argmin(value[middle : middle + reach]))
    angles, heights = zip(*(_turning(value, at) for at in (middle, leading, trailing)), strict=True)
    rising = leading + int(np.argmax(slope[leading : middle + 1]))
    falling = middle + int(np.argmin(slope[middle : trailing + 1]))
    up, down = _turning(slope, rising)[0], _turning(slope, falling)[0]
    origin = (top - middle) * step
    return Lengths(
        heights[0],
        _wrapped(angles[0] * step + origin),
        heights[1],
        _wrapped(angles[1] * step + origin),
        heights[2],
        _wrapped(angles[2] * step + origin),
        R * step * (angles[2] - angles[1]),
        R * step * (down - up),
        R * step * (_crossing(value, middle, 1) - _crossing(value, middle, -1)),
    )


def _turning(values: np.ndarray, at: int) -> tuple[float, float]:
    """Return place (index) and height of the extremum next to sample `at`, by a parabola."""
    before, here, after = values[at - 1], values[at], values[at + 1]
    bend = before - 2.0 * here + after
    shift = 0.0 if bend == 0.0 else float(np.clip(0.5 * (before - after) / bend, -1.0, 1.0))
    return at + shift, float(here - 0.25 * (before - after) * shift)


def _crossing(values: np.ndarray, start: int, direction: int) -> float:
    """Return where the values first reach zero from sample `start` on, index between samples; NaN where never."""
    ahead = values[start:] if direction > 0 else values[start::-1]
    below = np.flatnonzero(ahead <= 0.0)
    if below.size == 0 or below[0] == 0:
        return float("nan")
    i = int(below[0])
    return start + direction * (i - 1 + float(ahead[i - 1] / (ahead[i - 1] - ahead[i])))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
