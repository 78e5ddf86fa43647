"""Complex harmonics of a turning vector with their errors, filtered orbits, ellipses.

Vectors are complex here, z = x + i y, so that forward and backward turning parts stand apart:
z(t) = sum_k Z_k e^{i k 2 pi f t}, k = +-1..+-6, with f negative for a load that turns clockwise, so
that k > 0 always turns with the load. No bearing law is fitted here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.uncertainty import t_quantile

ORDERS = 6
# A 2X orbit is open above this difference of its two circles, if it is also 3 sigma.
OPEN = 0.1


@dataclass(frozen=True, eq=False)
class Harmonics:
    """A vector signal as its turning parts.

    Attributes
    ----------
    frequency
        Rotation frequency, Hz (signed).
    k
        Orders -K..-1, 1..K, shape (2 K,).
    Z
        Complex amplitudes, shape (2 K,), in the unit of the signal.
    sigma
        Standard deviation of each (root of E|dZ|^2), shape (2 K,), from the residual near its order.
    offset, drift
        Complex: mean level, and the two drift coefficients of tau and tau^2 (tau in -1..1).
    x, y
        Amplitudes along x and y of orders 1..K, complex, shape (K,): x(t) = Re x_k e^{i k w t}.
    residual
        Complex, shape (n,).
    time
        Stamps used, shape (n,), s.
    """

    frequency: float
    k: np.ndarray
    Z: np.ndarray
    sigma: np.ndarray
    offset: complex
    drift: np.ndarray
    x: np.ndarray
    y: np.ndarray
    residual: np.ndarray
    time: np.ndarray

    def at(self, order: int) -> complex:
        """Return Z_order."""
        return complex(self.Z[np.flatnonzero(self.k == order)[0]])

    def sigma_at(self, order: int) -> float:
        """Return the standard deviation of Z_order."""
        return float(self.sigma[np.flatnonzero(self.k == order)[0]])

    def filtered(self, order: int, angle: np.ndarray) -> np.ndarray:
        """Return the orbit of one order (1X, 2X, ...) over the load angle, shape (2, m), mean removed."""
        turning = np.exp(1j * order * np.asarray(angle))
        z = self.at(order) * turning + self.at(-order) * turning.conj()
        return np.stack([z.real, z.imag])

    def orbit(self, angle: np.ndarray) -> np.ndarray:
        """Return the orbit of all orders over the load angle, shape (2, m), mean removed."""
        z = np.exp(1j * np.multiply.outer(np.asarray(angle), self.k)) @ self.Z
        return np.stack([z.real, z.imag])

    def ellipse(self, order: int) -> Ellipse:
        """Return the ellipse of one order."""
        forward, backward = self.at(order), self.at(-order)
        tilt = 0.5 * (np.angle(forward) + np.angle(backward))
        tilt = (tilt + np.pi / 2) % np.pi - np.pi / 2
        return Ellipse(abs(forward) + abs(backward), abs(forward) - abs(backward), float(tilt))

    def distortion(self) -> float:
        """Return sqrt(sum |Z_k|^2, |k| > 1) over that of |k| = 1, noise included."""
        first = np.abs(self.k) == 1
        return float(np.sqrt((np.abs(self.Z[~first]) ** 2).sum() / (np.abs(self.Z[first]) ** 2).sum()))


@dataclass(frozen=True)
class Ellipse:
    """Half axes (the smaller one negative for an orbit against the load) and tilt of the long one, rad."""

    major: float
    minor: float
    tilt: float


def harmonics(time: np.ndarray, signal: np.ndarray, frequency: float, orders: int = ORDERS) -> Harmonics:
    """Fit orders 1..K with offset, linear and square drift by least squares to both axes.

    Parameters
    ----------
    time, signal
        Stamps (s), shape (n,), of the steady turns, and x and y, shape (2, n).
    frequency
        Rotation frequency, Hz, signed.

    Raises
    ------
    InputError
        If less than 1.5 turns were logged, or fewer samples than unknowns.
    """
    duration = float(time[-1] - time[0])
    if abs(frequency) * duration < 1.5:
        raise InputError(f"{abs(frequency) * duration:.2f} turns are too few for the harmonics of an orbit.")
    columns = _columns(time, frequency, orders)
    if time.size <= columns.shape[1] + 3:
        raise InputError(f"{time.size} samples are too few for {orders} harmonics.")
    solution = np.linalg.lstsq(columns, signal.T, rcond=None)[0]
    residual = signal.T - columns @ solution
    cosine, sine = solution[3::2], solution[4::2]  # (orders, 2)
    forward = 0.5 * (cosine[:, 0] + sine[:, 1]) + 0.5j * (cosine[:, 1] - sine[:, 0])
    backward = 0.5 * (cosine[:, 0] - sine[:, 1]) + 0.5j * (cosine[:, 1] + sine[:, 0])
    k = np.r_[-np.arange(orders, 0, -1), np.arange(1, orders + 1)]
    z = residual[:, 0] + 1j * residual[:, 1]
    # Rows: x, y. Re x_k e^{i k w t} = c cos - (-s) sin.
    phasor = cosine - 1j * sine
    return Harmonics(
        float(frequency),
        k,
        np.r_[backward[::-1], forward],
        sigma_near(time, z, frequency, k),
        complex(solution[0, 0], solution[0, 1]),
        solution[1:3, 0] + 1j * solution[1:3, 1],
        phasor[:, 0],
        phasor[:, 1],
        z,
        time,
    )


def _columns(time: np.ndarray, frequency: float, orders: int) -> np.ndarray:
    """Return 1, tau, tau^2 - 1/3, cos, sin of each order, shape (n, 3 + 2 K)."""
    tau = 2 * (time - time[0]) / (time[-1] - time[0]) - 1
    columns = [np.ones_like(tau), tau, tau**2 - 1 / 3]
    for order in range(1, orders + 1):
        angle = 2 * np.pi * order * frequency * time
        columns += [np.cos(angle), np.sin(angle)]
    return np.stack(columns, axis=1)


def sigma_near(time: np.ndarray, z: np.ndarray, frequency: float, k: np.ndarray) -> np.ndarray:
    """Return the noise of each Z_k from the residual's two-sided spectrum half an order to both sides, shape of `k`.

    The fit itself takes the noise at the line away, so its neighbours at distances of 1/T tell it, which
    the fit leaves alone; a white residual gives (sx^2 + sy^2)/n for E|dZ|^2.
    """
    beside = _beside(time, frequency)
    sigma = np.empty(k.size)
    for i, order in enumerate(k):
        at = np.r_[order - beside, order + beside]
        lines = np.exp(-2j * np.pi * frequency * np.multiply.outer(at, time - time[0])) @ z / z.size
        sigma[i] = np.sqrt(np.mean(np.abs(lines) ** 2))
    return sigma


def _beside(time: np.ndarray, frequency: float) -> np.ndarray:
    """Return how far the lines lie from an order that tell its noise, in orders."""
    duration = time.size * float(np.median(np.diff(time)))
    return np.arange(1.0, max(0.5 * abs(frequency) * duration, 2.1)) / (duration * frequency)


@dataclass(frozen=True)
class Amplitude:
    """Amplitude along one axis with the standard error of its phasor's components and the 95 % interval."""

    value: float
    std_error: float
    ci95: tuple[float, float]


def amplitude(motion: Harmonics, residual: np.ndarray, axis: str, order: int) -> Amplitude:
    """Return the amplitude of an order along "x" or "y" with its error by the noise of the sensors.

    What the load's unrest moves is motion, no noise. An amplitude has no sign: near zero its interval is that
    of a Rice distribution.

    Parameters
    ----------
    residual
        Noise of the displacement at the stamps of `motion`, shape (2, n), m.
    """
    value = float(abs((motion.x if axis == "x" else motion.y)[order - 1]))
    z = (residual[0] if axis == "x" else residual[1]) + 0j
    # x_k = Z_k + conj Z_-k = 2 Z_k of a real signal; half of its power lies along the phasor.
    error = math.sqrt(2.0) * float(sigma_near(motion.time, z, motion.frequency, np.array([order]))[0])
    dof = 4.0 * _beside(motion.time, motion.frequency).size
    return Amplitude(value, error, _rice(value, error * t_quantile(dof) / t_quantile(math.inf)))


def _rice(value: float, sigma: float) -> tuple[float, float]:
    """Return the 95 % interval of an amplitude of which value^2/sigma^2 is noncentral chi-square with two degrees of freedom."""
    from scipy.special import chndtr, chndtrinc

    if not sigma > 0 or value > 20.0 * sigma:
        return max(value - t_quantile(math.inf) * sigma, 0.0), value + t_quantile(math.inf) * sigma
    power = (value / sigma) ** 2
    low = float(chndtrinc(power, 2, 0.975)) if chndtr(power, 2, 0.0) > 0.975 else 0.0
    high = float(chndtrinc(power, 2, 0.025)) if chndtr(power, 2, 0.0) > 0.025 else 0.0
    return sigma * math.sqrt(low), sigma * math.sqrt(high)


def openness(h: Harmonics, order: int = 2) -> tuple[float, float, bool]:
    """Tell whether the filtered orbit of an order is a line or open (tpjb.md, consequence 2).

    Returns
    -------
    ||Z_2| - |Z_-2|| / (|Z_2| + |Z_-2|), its standard error, and whether it is open: above 0.1 and
    above 3 standard errors. To second order the paper's eqs (3) and (4) only make lines.
    """
    forward, backward = abs(h.at(order)), abs(h.at(-order))
    total = forward + backward
    if not total > 0:
        return math.nan, math.nan, False
    value = abs(forward - backward) / total
    # |Z| takes half of the noise power; d value/d|Z_2| = 2 |Z_-2|/total^2 and vice versa.
    spread = math.hypot(backward * h.sigma_at(order), forward * h.sigma_at(-order))
    sigma = 2 * spread / (math.sqrt(2) * total**2)
    return value, sigma, value > OPEN and value > 3 * sigma


def circularity(load: Harmonics) -> float:
    """Return |ZF_-1| / |ZF_1|: 0 for a load of constant size; above 0.02 the load control is poor."""
    return abs(load.at(-1)) / abs(load.at(1))
