"""The flex sensor: mean of the curvature over its length, lag, resistance and divider (tire.md, 3.2-3.3, eqs 3-4).

Angles and shapes come from the ring; work in R2 or k, not in V: the divider compresses peaks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.ring.ring import Shape


@dataclass(frozen=True)
class Sensor:
    """A flex sensor and its divider. SI.

    Attributes
    ----------
    c, R0
        R2 = R0 + c k: gain, ohm m; resistance on the undeformed tire, ohm.
    length
        Length Ls over which it averages, m.
    lag
        First-order lag tau_f, s.
    VIN, R1
        Supply of the divider, V; its fixed resistor, ohm.
    """

    c: float
    R0: float
    length: float
    lag: float
    VIN: float = 3.3
    R1: float = 1e4


def flex_shape(k: Shape, sensor: Sensor, R: float, speed: float) -> Shape:
    """Return R2 - R0, ohm, round a belt of radius R (m) that turns at `speed` (rad/s), from its curvature k.

    Its mean is zero as that of k: R0 is the mean of R2 over any whole revolution.
    """
    n = k.orders
    return k.times(sensor.c * averaging(n, sensor.length, R) * lagging(n, speed, sensor.lag))


def averaging(n: np.ndarray, length: float, R: float) -> np.ndarray:
    """Return sin(y)/y, y = n length/(2R): what the mean over a sensor's length leaves of order n."""
    return np.asarray(np.sinc(np.asarray(n, dtype=float) * length / (2.0 * np.pi * R)))


def lagging(n: np.ndarray, speed: float, lag: float) -> np.ndarray:
    """Return 1/(1 + i n Omega tau): what a first-order lag (s) makes of order n at `speed` (rad/s)."""
    return np.asarray(1.0 / (1.0 + 1j * np.asarray(n, dtype=float) * speed * lag))


def highest_order(length: float, R: float) -> int:
    """Return the order up to which a waveform of this sensor is worth keeping: 2.25 times its first null, 90 at 50 mm.

    Cut at 1.5 times, the peak at 1000 N is 0.2 % high and Ld 8 mm long; at 2.25 times 0.03 % and 0.6 mm.
    """
    return math.ceil(2.25 * 2.0 * math.pi * R / length)


def resistance(k: np.ndarray, c: float, R0: float) -> np.ndarray:
    """Return R2 = R0 + c k, ohm (eq. 3)."""
    return np.asarray(R0 + c * np.asarray(k, dtype=float))


def divider_voltage(R2: np.ndarray, VIN: float, R1: float) -> np.ndarray:
    """Return V = VIN R2/(R1 + R2), V (eq. 4)."""
    R2 = np.asarray(R2, dtype=float)
    return np.asarray(VIN * R2 / (R1 + R2))


def divider_resistance(V: np.ndarray, VIN: float, R1: float) -> np.ndarray:
    """Return R2 = R1 V/(VIN - V), ohm, the inverse of eq. 4; NaN outside 0 < V < VIN."""
    V = np.asarray(V, dtype=float)
    valid = (V > 0.0) & (V < VIN)
    V = np.where(valid, V, np.nan)
    return np.asarray(R1 * V / (VIN - V))


def voltage_slope(R2: np.ndarray, VIN: float, R1: float) -> np.ndarray:
    """Return dV/dR2 = VIN R1/(R1 + R2)^2, V/ohm; sigma_R2 = sigma_V over it."""
    return np.asarray(VIN * R1 / (R1 + np.asarray(R2, dtype=float)) ** 2)
