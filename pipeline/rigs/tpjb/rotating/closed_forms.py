"""Solutions of the quasi-static law on paper: the linear ones, one axis, and the paper's polar form.

They check the Newton solver and draw nothing; fits use `law.equilibrium`. SI.
"""

from __future__ import annotations

import numpy as np


def linear_displacement(p: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return d = K^-1 f (m), shape (2, n): models M1 and M2 (eqs 5 and 6)."""
    kxx, kxy, kyx, kyy = p[:4]
    return np.asarray(np.stack([kyy * f[0] - kxy * f[1], kxx * f[1] - kyx * f[0]]) / (kxx * kyy - kxy * kyx))


def uncoupled_displacement(p: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return the displacement (m), shape (2, n), of model M3 (eq. 7): each axis for itself.

    NaN where |f| exceeds k^2/(4 |k2|) against the curvature: past the fold.
    """
    k, k2 = p[[0, 3]][:, None], p[[4, 7]][:, None]
    with np.errstate(invalid="ignore"):
        return np.asarray(2 * f / (k + np.sqrt(k**2 + 4 * k2 * f)))


def polar_orbit(p: np.ndarray, direction: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return radius R (m) and phase lead phi (rad) of the force where the orbit crosses `direction`, eq. (10').

    The paper's (10), with the terms that it leaves out: (A^2 + B^2) R^4 + 2 (a A + b B) R^3 +
    (a^2 + b^2) R^2 - F^2 = 0 on the ray at angle t; R is its smallest positive root, and phi follows
    from it, so no constant phi is free to choose.

    Parameters
    ----------
    p
        Coefficients, shape (10,).
    direction
        Angles t of the displacement from x, shape (n,), rad.
    size
        Of the turning force F, N.
    """
    c, s = np.cos(direction), np.sin(direction)
    a, b = p[0] * c + p[1] * s, p[2] * c + p[3] * s
    A = p[4] * c * c + p[5] * s * s + p[8] * c * s
    B = p[6] * c * c + p[7] * s * s + p[9] * c * s
    radius = np.full(direction.shape, np.nan)
    unit = size / np.sqrt(abs(p[0] * p[3] - p[1] * p[2]))  # roots of the size of one
    for i in range(direction.size):
        quartic = [
            (A[i] ** 2 + B[i] ** 2) * unit**4,
            2 * (a[i] * A[i] + b[i] * B[i]) * unit**3,
            (a[i] ** 2 + b[i] ** 2) * unit**2,
            0.0,
            -(size**2),
        ]
        roots = np.roots(quartic)
        real = roots.real[(np.abs(roots.imag) < 1e-7 * np.abs(roots)) & (roots.real > 0)]
        if real.size:
            radius[i] = unit * real.min()
    phi = np.arctan2(radius * b + radius**2 * B, radius * a + radius**2 * A) - direction
    return radius, (phi + np.pi) % (2 * np.pi) - np.pi
