"""Lumped hydraulics of the circuit: state space, exact step, steady state and transfer of the filter (rap.md, 3.3).

The pump is not in here: it enters as the flows that it takes and gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

STATES = ("P_a", "P_pre", "P_ret", "P_uf", "Q_a", "Q_r")
INPUTS = ("Q_in", "Q_out", "Q_uf")


@dataclass(frozen=True)
class Circuit:
    """Resistances (Pa s/m^3), inertances (Pa s^2/m^3), compliances (m^3/Pa), ultrafiltration coefficient (m^3/(s Pa)).

    a: access line; 1: between pump and filter; f: hollow fibres; 2, r: return line; u: ultrafiltrate side.
    """

    R_a: float = 1.4e9
    L_a: float = 1.0e8
    C_a: float = 4.0e-11
    C_1: float = 6.0e-11
    R_f: float = 1.2e9
    C_2: float = 6.0e-11
    R_r: float = 1.4e9
    L_r: float = 1.2e8
    C_u: float = 3.0e-11
    K_uf: float = 2.0835e-11


def state_space(c: Circuit) -> tuple[np.ndarray, np.ndarray]:
    """Return A (6, 6) and B (6, 3) of eq. 3; states in the order of `STATES`, inputs in that of `INPUTS`.

    Reservoir heads are zero: pressures are gauge, referred to the reservoir's level. Half of the ultrafiltration leaves
    each node of the blood side, which makes eq. 1 exact.
    """
    K = c.K_uf
    A, B = np.zeros((6, 6)), np.zeros((6, 3))
    A[0, 4] = 1.0 / c.C_a
    A[4, 0], A[4, 4] = -1.0 / c.L_a, -c.R_a / c.L_a
    A[5, 2], A[5, 5] = 1.0 / c.L_r, -c.R_r / c.L_r
    A[1, 1:4] = np.array([-1.0 / c.R_f - K / 4.0, 1.0 / c.R_f - K / 4.0, K / 2.0]) / c.C_1
    A[2, 1:4] = np.array([1.0 / c.R_f - K / 4.0, -1.0 / c.R_f - K / 4.0, K / 2.0]) / c.C_2
    A[2, 5] = -1.0 / c.C_2
    A[3, 1:4] = np.array([K / 2.0, K / 2.0, -K]) / c.C_u
    B[0, 0], B[1, 1], B[3, 2] = -1.0 / c.C_a, 1.0 / c.C_1, -1.0 / c.C_u
    return A, B


def discrete(A: np.ndarray, B: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return Ad and Bd of ``x[k+1] = Ad x[k] + Bd u[k]``, exact for inputs that are constant over `dt` (s)."""
    from scipy.linalg import expm

    n, m = B.shape
    E = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return E[:n, :n], E[:n, n:]


def steady_state(c: Circuit, Q: float, Q_uf: float) -> np.ndarray:
    """Return the states at steady blood flow `Q` and ultrafiltration `Q_uf` (m^3/s), shape (6,)."""
    P_ret = c.R_r * (Q - Q_uf)
    P_pre = P_ret + c.R_f * (Q - 0.5 * Q_uf)
    return np.array([-c.R_a * Q, P_pre, P_ret, 0.5 * (P_pre + P_ret) - Q_uf / c.K_uf, Q, Q - Q_uf])


def transmembrane(P_pre: Any, P_ret: Any, P_uf: Any) -> Any:
    """Return the transmembrane pressure, Pa (eq. 1): mean of filter inlet and return less ultrafiltrate side."""
    return 0.5 * (P_pre + P_ret) - P_uf


def membrane_admittance(c: Circuit, s: Any) -> Any:
    """Return G_m of eq. 4, m^3/(s Pa), at the complex frequencies `s` (rad/s), shape (n,)."""
    half = 0.5 * c.K_uf
    return half * (0.5 - half / (s * c.C_u + c.K_uf))


def filter_transfer(c: Circuit, s: Any) -> Any:
    """Return P_ret / P_pre (eq. 4) at the complex frequencies `s` (rad/s), shape (n,).

    It knows nothing of the pump nor of `C_1`.
    """
    G = membrane_admittance(c, s)
    return (1.0 / c.R_f - G) / (s * c.C_2 + 1.0 / c.R_f + 1.0 / (c.R_r + s * c.L_r) + G)


def outlet_impedance(c: Circuit, s: Any) -> Any:
    """Return Z = P_pre / Q_out at the complex frequencies `s` (rad/s), Pa s/m^3, shape (n,)."""
    G = membrane_admittance(c, s)
    return 1.0 / (s * c.C_1 + 1.0 / c.R_f + G - (1.0 / c.R_f - G) * filter_transfer(c, s))
