"""Variant A: the ring under a given parabolic contact pressure, in closed form (tire.md, 3.2, T4-T5).

Fast, but the contact half-angle is an input. Where it follows from the load, use `contact`.
"""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.ring.ring import Ring, Shape, stiffness


def pressure_harmonics(n: np.ndarray, Fz: float, a: float, R: float, lam: float = 0.0) -> np.ndarray:
    """Return the Fourier coefficients P_n of p = 3 Fz/(4 a R) (1 - (theta/a)^2)(1 + lam theta/a), N/m (T5).

    Parameters
    ----------
    n
        Orders, any sign, shape (m,).
    Fz, a
        Vertical load, N; half-angle of the contact, rad.
    lam
        Skew of the pressure towards the trailing edge.
    """
    x = np.asarray(n, dtype=float) * a
    # Near 0 the closed forms cancel; their series are good to 1e-9 there.
    small = np.abs(x) < 0.05
    y = np.where(small, 1.0, x)
    even = np.where(small, 1.0 - x**2 / 10.0 + x**4 / 280.0, 3.0 * (np.sin(y) - y * np.cos(y)) / y**3)
    odd = np.where(
        small,
        2.0 * x / 15.0 * (1.0 - x**2 / 14.0 + x**4 / 504.0),
        ((6.0 - 2.0 * y**2) * np.sin(y) - 6.0 * y * np.cos(y)) / y**4,
    )
    return np.asarray(Fz / (2.0 * np.pi * R) * (even - 1.5j * lam * odd))


def pressed_shape(
    ring: Ring,
    Fz: float,
    a: float,
    *,
    mu: float = 0.0,
    lam: float = 0.0,
    n_max: int = 400,
    speed: float = 0.0,
) -> Shape:
    """Return the curvature k of a ring under parabolic pressure, 1/m, n = 0..n_max (T1-T5).

    Parameters
    ----------
    Fz, a
        Vertical load, N; half-angle of the contact, rad.
    mu
        Fx/Fz, spread like the pressure.
    lam
        Skew of the pressure; left free in a fit it runs away, keep abs(lam) <= 0.3.
    speed
        Rotation, rad/s; acts through viscous damping only.
    """
    n = np.arange(1, n_max + 1, dtype=float)
    below, above = (pressure_harmonics(order, Fz, a, ring.R, lam) for order in (n - 1.0, n + 1.0))
    load = -0.5 * ((1.0 - 1j * mu) * (1.0 + 1.0 / n) * below + (1.0 + 1j * mu) * (1.0 - 1.0 / n) * above)
    k = (1.0 - n * n) / ring.R**2 * load / stiffness(n, ring, speed)
    return Shape(np.concatenate([[0.0], k]))
