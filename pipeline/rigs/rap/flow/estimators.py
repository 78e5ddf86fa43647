"""Blood flow from roller frequency, pulsation and mean pressures: E0 to E3 as plain functions (rap.md, 3.5).

All are linear in their coefficients. They know nothing of logs, windows or fits.
"""

from __future__ import annotations

import numpy as np

# Frequency about which E2's admittance is expanded, Hz (eq. 6).
F_0 = 2.0


def stroke_flow(f: np.ndarray, V: float) -> np.ndarray:
    """Return E0 and E1, ``Q = V f``, m^3/s, of passages a second (Hz) and the volume of one (m^3)."""
    return np.asarray(V * f)


def pulsation_flow(f: np.ndarray, A_1: np.ndarray, V_g: float, y_0: float, y_1: float) -> np.ndarray:
    """Return E2 of eq. 6, ``Q = V_g f - A_1 [y_0 + y_1 (f - f_0)]``, m^3/s.

    Parameters
    ----------
    f, A_1
        Passages a second, Hz, and amplitude of the pre-filter pressure there, Pa, shape (n,).
    V_g
        Geometric volume of a passage, m^3.
    y_0, y_1
        What a pascal of pulsation stands for, m^3/(s Pa), at f_0 = 2 Hz, and its slope over frequency, m^3/Pa.
    """
    return np.asarray(V_g * f - A_1 * (y_0 + y_1 * (f - F_0)))


def pressure_flow(f: np.ndarray, back_pressure: np.ndarray, V_0: float, C_p: float) -> np.ndarray:
    """Return E3, ``Q = f [V_0 - C_p (P_pre - P_a)]``, m^3/s.

    Parameters
    ----------
    f, back_pressure
        Passages a second, Hz, and mean pre-filter less mean access pressure, Pa, shape (n,).
    V_0, C_p
        Volume of a passage against no pressure, m^3, and its loss with pressure, m^3/Pa.
    """
    return np.asarray(f * (V_0 - C_p * back_pressure))


def pulsation_columns(f: np.ndarray, A_1: np.ndarray) -> np.ndarray:
    """Return what V_g, y_0 and y_1 of E2 are multiplied with, shape (n, 3)."""
    return np.stack([f, -A_1, -A_1 * (f - F_0)], axis=-1)


def quadratic_columns(f: np.ndarray, A_1: np.ndarray) -> np.ndarray:
    """Return the columns of E2 with a term in (f - f_0)^2, shape (n, 4): it fits better and predicts worse."""
    return np.concatenate([pulsation_columns(f, A_1), -(A_1 * (f - F_0) ** 2)[:, None]], axis=1)


def pressure_columns(f: np.ndarray, back_pressure: np.ndarray) -> np.ndarray:
    """Return what V_0 and C_p of E3 are multiplied with, shape (n, 2)."""
    return np.stack([f, -f * back_pressure], axis=-1)


def affine_columns(f: np.ndarray) -> np.ndarray:
    """Return the columns of ``Q = a f + b``, shape (n, 2): no model of a pump, and right on set-points that nobody clamps."""
    return np.stack([f, np.ones_like(f)], axis=-1)
