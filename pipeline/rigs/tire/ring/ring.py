"""The belt as an inextensible elastic ring on a foundation, rolling steadily (tire.md, 3.2, T1-T3).

Angles: theta from straight down, positive in the sense of rotation; w outward, v along +theta. All shapes are linear in
the load. Contact is solved in `contact`, a given pressure in `pressure`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Ring:
    """A belt, its inflation and the foundation on the rim. SI.

    Attributes
    ----------
    R
        Undeformed mean radius of the belt, m.
    EI
        Bending stiffness, N m^2.
    p0b
        Inflation pressure times belt width, N/m; the ring's tension is p0b R.
    kw, kv
        Radial and tangential foundation, N/m^2.
    eta
        Loss factor of the foundation.
    cw, cv
        Viscous damping of the foundation, N s/m^2.
    """

    R: float
    EI: float
    p0b: float
    kw: float
    kv: float
    eta: float = 0.0
    cw: float = 0.0
    cv: float = 0.0


@dataclass(frozen=True, eq=False)
class Shape:
    """A quantity round the tire by its harmonics: sum over n of f_n exp(i n theta), f_-n conjugate.

    `harmonics` has shape (M+1,), complex, n = 0..M: curvature k in 1/m unless said otherwise.
    """

    harmonics: np.ndarray

    def at(self, theta: np.ndarray) -> np.ndarray:
        """Return the values at the angles `theta`, rad, of any shape."""
        angle = np.asarray(theta, dtype=float)
        wave = np.exp(1j * angle)
        total = np.zeros(angle.shape, dtype=complex)
        for f in self.harmonics[:0:-1]:
            total = (total + f) * wave
        return np.asarray(self.harmonics[0].real + 2.0 * total.real)

    def on_grid(self, N: int) -> tuple[np.ndarray, np.ndarray]:
        """Return N even angles from -pi (rad) and the values there, shape (N,) each; harmonics from N/2 are left out."""
        spectrum = np.zeros(N // 2 + 1, dtype=complex)
        kept = min(self.harmonics.size, (N + 1) // 2)
        spectrum[:kept] = self.harmonics[:kept]
        return grid(N), np.fft.fftshift(np.fft.irfft(spectrum, N) * N)

    def times(self, factor: np.ndarray) -> Shape:
        """Return the shape with harmonic n multiplied by factor[n], shape (M+1,): a filter."""
        return Shape(self.harmonics * factor)

    def cut(self, n_max: int) -> Shape:
        """Return the shape without the harmonics above `n_max`; evaluating it takes that much less time."""
        return Shape(self.harmonics[: n_max + 1])

    @property
    def orders(self) -> np.ndarray:
        """The orders n = 0..M."""
        return np.arange(self.harmonics.size, dtype=float)


def shape_of(values: np.ndarray, n_max: int | None = None) -> Shape:
    """Return the shape through `values` on the N even angles of `grid`, shape (N,), up to order `n_max`."""
    N = values.size
    harmonics = np.fft.rfft(np.fft.ifftshift(values)) / N
    last = (N - 1) // 2 if n_max is None else min(n_max, (N - 1) // 2)
    return Shape(harmonics[: last + 1])


def grid(N: int) -> np.ndarray:
    """Return N even angles from -pi, rad, shape (N,); 0 stands at N // 2."""
    return np.asarray((np.arange(N) - N // 2) * (2.0 * np.pi / N))


def stiffness(n: np.ndarray, ring: Ring, speed: float = 0.0) -> np.ndarray:
    """Return K_n of the orders `n` > 0 at `speed` (rad/s), complex, N/m^2 (T2).

    The belt's inertia cancels in steady rolling: speed acts through damping only.
    """
    n = np.asarray(n, dtype=float)
    loss = 1.0 + 1j * ring.eta * np.sign(n)
    square = n * n
    bending = ring.EI / ring.R**4 * (square - 1.0) ** 2
    tension = ring.p0b / ring.R * (square - 1.0)
    damped = 1j * n * speed
    return np.asarray(
        bending + tension + ring.kw * loss + damped * ring.cw + (ring.kv * loss + damped * ring.cv) / square
    )


def radial_displacement(q_w: np.ndarray, q_v: np.ndarray, ring: Ring, speed: float = 0.0) -> np.ndarray:
    """Return w_n, m, of the loads' harmonics n = 0..M, N/m, shape (M+1,) each (T1)."""
    w = np.zeros(q_w.size, dtype=complex)
    n = np.arange(1, q_w.size, dtype=float)
    w[1:] = (q_w[1:] - 1j / n * q_v[1:]) / stiffness(n, ring, speed)
    return w


def tangential_displacement(w: np.ndarray, q_v0: float, ring: Ring) -> np.ndarray:
    """Return v_n, m, of an inextensible ring: v_n = i w_n/n (eq. 1), v_0 = q_v,0/kv (it turns on the rim)."""
    v = np.zeros(w.size, dtype=complex)
    v[1:] = 1j * w[1:] / np.arange(1, w.size)
    v[0] = q_v0 / ring.kv
    return v


def curvature(w: np.ndarray, ring: Ring) -> Shape:
    """Return k = (w + w'')/R^2 = 1/R - kappa, 1/m: minus the change of curvature (eq. 2, T3).

    Its mean and its first harmonic are zero, whatever the load: the two invariants of a closed ring.
    """
    n = np.arange(w.size, dtype=float)
    harmonics = (1.0 - n * n) / ring.R**2 * w
    harmonics[0] = 0.0
    return Shape(harmonics)
