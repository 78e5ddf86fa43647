"""Orbits under a turning load: true rotation frequency, complex harmonics with errors, filtered orbits.

Vectors are complex here, z = x + i y, so that forward and backward turning parts stand apart:
z(t) = sum_k Z_k e^{i k 2 pi f t}, k = +-1..+-6, with f negative for a load that turns clockwise, so
that k > 0 always turns with the load. No bearing law is fitted here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError

ORDERS = 6
# Below this share of its size in the steady turns the load counts as absent.
DWELL = 0.05
# Steady is the load where it has this share of what the same direction sees in the steady turns.
_STEADY = 0.95
# A 2X orbit is open above this difference of its two circles, if it is also 3 sigma.
OPEN = 0.1


@dataclass(frozen=True, eq=False)
class Orbit:
    """One run: stamps (n,), displacement (2, n) m and dynamic force (2, n) N in x and y, all finite.

    `force_noise` (N, per axis) is the standard deviation of the force signal, None where it is to be
    estimated; `shaft_frequency` (Hz) tells where the shaft's own line is expected after sampling.
    """

    run: str
    time: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    force_noise: float | None = None
    shaft_frequency: float | None = None

    @property
    def z(self) -> np.ndarray:
        """Complex displacement dx + i dy, shape (n,), m."""
        return np.asarray(self.displacement[0] + 1j * self.displacement[1])

    @property
    def step(self) -> float:
        """Median sampling interval, s."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def tau(self) -> np.ndarray:
        """Time scaled to -1..1 over the run, shape (n,)."""
        return np.asarray(2 * (self.time - self.time[0]) / (self.time[-1] - self.time[0]) - 1)

    @cached_property
    def rotation(self) -> Rotation:
        """How the load turns."""
        return rotation(self.time, self.force)

    def part(self, kept: np.ndarray) -> Orbit:
        """Return the run with the samples of a mask or of indices only."""
        return Orbit(
            self.run,
            self.time[kept],
            self.displacement[:, kept],
            self.force[:, kept],
            self.force_noise,
            self.shaft_frequency,
        )


@dataclass(frozen=True, eq=False)
class Rotation:
    """How the load vector turns.

    Attributes
    ----------
    frequency, std_error
        Turns per second, negative clockwise, and its standard error, Hz.
    turns
        Turns of the steady part.
    angle
        Force angle, unwrapped from the first sample with load on, shape (n,), rad; NaN in the dwell.
    wander
        rms departure of the angle from a uniform rotation in the steady part, rad.
    size
        Size of the load in the steady part (mean of |f|), N.
    steady, dwell
        Masks, shape (n,): the turns at full load; no load.
    """

    frequency: float
    std_error: float
    turns: float
    angle: np.ndarray
    wander: float
    size: float
    steady: np.ndarray
    dwell: np.ndarray

    @property
    def has_dwell(self) -> bool:
        """Whether the log holds the static equilibrium itself: at least 5 samples without load."""
        return int(self.dwell.sum()) >= 5


def rotation(time: np.ndarray, force: np.ndarray) -> Rotation:
    """Find the true rotation frequency from the force angle, and where the load is steady or absent.

    Parameters
    ----------
    time, force
        Stamps (s), shape (n,), and force in x and y, shape (2, n), N.

    Raises
    ------
    InputError
        If there is no force, it does not turn, or there are fewer than 8 samples at load or per turn.
    """
    f = force[0] + 1j * force[1]
    modulus = np.abs(f)
    high = _closed(modulus > 0.2 * np.quantile(modulus, 0.98)) if modulus.size else np.zeros(0, dtype=bool)
    if high.sum() < 8 or not modulus.max() > 0:
        raise InputError("the dynamic force is zero throughout: no turning load can be found in it.")
    full = _longest(high)
    t, angle = time[full], _unwrapped(time[full], f[full])
    line = np.polynomial.Polynomial.fit(t, angle, 1).convert().coef
    advance = abs(line[1]) * float(np.median(np.diff(t)))
    if abs(angle[-1] - angle[0]) < 1.5 * np.pi or advance > 2 * np.pi / 8:
        raise InputError(
            f"the dynamic force does not turn: its direction changes by {math.degrees(angle[-1] - angle[0]):.0f} deg "
            f"in {t[-1] - t[0]:.0f} s at full size; a turning load with at least 8 samples a turn was expected."
        )
    steady = _steady(time, f, full, line[1])
    t, angle = time[steady], _unwrapped(time[steady], f[steady])
    line = np.polynomial.Polynomial.fit(t, angle, 1).convert().coef
    departure = angle - line[0] - line[1] * t
    wander = float(np.sqrt(np.mean(departure**2)))
    # A wandering angle: its straight line is as uncertain as if each turn told it once.
    turns = abs(line[1]) * (t[-1] - t[0] + np.median(np.diff(t))) / (2 * np.pi)
    std_error = wander * math.sqrt(12 / max(turns, 1.0)) / (2 * np.pi * (t[-1] - t[0]))
    size = float(modulus[steady].mean())
    dwell = modulus < DWELL * size
    everywhere = np.full(time.size, np.nan)
    everywhere[~dwell] = _unwrapped(time[~dwell], f[~dwell])
    return Rotation(float(line[1] / (2 * np.pi)), std_error, float(turns), everywhere, wander, size, steady, dwell)


def _unwrapped(time: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return the angle of a turning vector without jumps, shape (n,), rad; gaps in the log are bridged at its usual speed."""
    speed = float(np.median(np.angle(f[1:] * f[:-1].conj()) / np.diff(time)))
    return np.asarray(np.unwrap(np.angle(f * np.exp(-1j * speed * time))) + speed * time)


def _steady(time: np.ndarray, f: np.ndarray, full: np.ndarray, speed: float) -> np.ndarray:
    """Return the mask of the longest stretch at full load, whatever ellipse the load describes.

    Loads that wander dip below the threshold for a while: it makes room for their scatter, and dips of
    a twentieth of a turn do not end the stretch.
    """
    t, inside = time[full], f[full]
    hole = max(round(0.05 * 2 * np.pi / (abs(speed) * float(np.median(np.diff(time))))), 3)
    for _ in range(3):
        turning = np.exp(1j * speed * (t - time[0]))
        Z = np.linalg.lstsq(np.stack([turning, turning.conj()], axis=1), inside, rcond=None)[0]
        turning = np.exp(1j * speed * (time - time[0]))
        expected = np.abs(Z[0] * turning + Z[1] * turning.conj())
        share = np.abs(f) / np.maximum(expected, DWELL * np.abs(Z).max())
        scatter = 1.4826 * float(np.median(np.abs(share[full] - np.median(share[full]))))
        steady = _longest(_closed(share > min(_STEADY, 1 - 3 * min(scatter, 0.1)), hole))
        t, inside = time[steady], f[steady]
    mask = np.zeros(time.size, dtype=bool)
    mask[steady] = True
    return mask


def _closed(mask: np.ndarray, hole: int = 3) -> np.ndarray:
    """Fill holes of up to `hole` samples between others: noise takes samples below a threshold."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    closed = mask.copy()
    for end, start in zip(edges[1:-1:2], edges[2::2], strict=True):
        if start - end <= hole:
            closed[end:start] = True
    return closed


def _longest(mask: np.ndarray) -> np.ndarray:
    """Return the indices of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    return np.arange(edges[2 * longest], edges[2 * longest + 1])


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
        _sigma_near(time, z, frequency, k),
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


def _sigma_near(time: np.ndarray, z: np.ndarray, frequency: float, k: np.ndarray) -> np.ndarray:
    """Return the noise of each Z_k from the residual's two-sided spectrum half an order to both sides.

    The fit itself takes the noise at the line away, so its neighbours at distances of 1/T tell it, which
    the fit leaves alone; a white residual gives (sx^2 + sy^2)/n for E|dZ|^2.
    """
    duration = time.size * float(np.median(np.diff(time)))
    beside = np.arange(1.0, max(0.5 * abs(frequency) * duration, 2.1)) / (duration * frequency)
    sigma = np.empty(k.size)
    for i, order in enumerate(k):
        at = np.r_[order - beside, order + beside]
        lines = np.exp(-2j * np.pi * frequency * np.multiply.outer(at, time - time[0])) @ z / z.size
        sigma[i] = np.sqrt(np.mean(np.abs(lines) ** 2))
    return sigma


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
