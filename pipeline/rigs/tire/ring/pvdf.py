"""The PVDF film: strain of the inner liner through the high-pass of its readout (tire.md, 3.4, T6-T8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.ring.ring import Shape
from pipeline.rigs.tire.ring.sensor import averaging, lagging


@dataclass(frozen=True)
class Film:
    """A PVDF film and its readout. SI.

    Attributes
    ----------
    gain
        G, V per unit strain.
    length
        L_p, m.
    time_constant
        tau_p of the high-pass, s.
    offset_angle
        dtheta by which the film runs ahead of the flex sensor, rad.
    mid_voltage
        V_mid at rest, V.
    """

    gain: float
    length: float
    time_constant: float
    offset_angle: float
    mid_voltage: float = 1.65


def film_shape(k: Shape, film: Film, thickness: float, R: float, speed: float) -> Shape:
    """Return V_p - V_mid, V, round a belt of radius R (m) that turns at `speed` (rad/s), from its curvature k (T6).

    The angle is that of the flex sensor.
    """
    n = k.orders
    turned = np.exp(1j * n * film.offset_angle)
    response = film.gain * averaging(n, film.length, R) * high_pass(n, speed, film.time_constant) * turned
    return k.times(0.5 * thickness * response)


def high_pass(n: np.ndarray, speed: float, time_constant: float) -> np.ndarray:
    """Return i n Omega tau/(1 + i n Omega tau), the readout's response to order n at `speed` (rad/s) (T6)."""
    x = 1j * np.asarray(n, dtype=float) * speed * time_constant
    return np.asarray(x / (1.0 + x))


def liner_strain(k: np.ndarray, thickness: float) -> np.ndarray:
    """Return eps = (h/2) k, the strain of the inner liner (eq. 2): tension where the belt is flattened."""
    return np.asarray(0.5 * thickness * np.asarray(k, dtype=float))


def film_over_flex(
    n: np.ndarray,
    speed: float,
    *,
    gain: float,
    time_constant: float,
    offset_angle: float,
    film_length: float,
    flex_length: float,
    flex_lag: float,
    R: float,
) -> np.ndarray:
    """Return V_p,n/R2_n of order n, V/ohm, complex (T8).

    Parameters
    ----------
    n, speed
        Orders; rotation, rad/s.
    gain
        G' = G h/(2c), V/ohm.
    """
    lengths = averaging(n, film_length, R) / averaging(n, flex_length, R)
    turned = np.exp(1j * np.asarray(n, dtype=float) * offset_angle)
    return np.asarray(gain * turned * lengths * high_pass(n, speed, time_constant) / lagging(n, speed, flex_lag))


def strain_from_voltage(
    V: np.ndarray, step: float, gain: float, time_constant: float, mid_voltage: float
) -> np.ndarray:
    """Return eps(t) - eps(t_0) of evenly spaced voltages, shape (n,): the exact inverse of the high-pass (T7).

    The integral is by the trapezoid rule; its drift from an error of `mid_voltage` goes with the mean of a revolution.
    """
    above = np.asarray(V, dtype=float) - mid_voltage
    integral = np.concatenate([[0.0], np.cumsum(0.5 * step * (above[1:] + above[:-1]))])
    return np.asarray((above - above[0] + integral / time_constant) / gain)
