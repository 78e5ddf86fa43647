"""Peristaltic blood pump: what a passing roller gives and sucks back, and the speed that a flow takes (rap.md, 3.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.rigs.rap.circuit.hydraulics import Circuit, steady_state


@dataclass(frozen=True)
class Pump:
    """Volumes (m^3) of a roller passage, their change with back pressure C_p (m^3/Pa), shape of the back suction.

    `w` is the share of a passage during which fluid is sucked back, `eps` how much each roller differs, `a` how strongly
    the inlet flow pulsates.
    """

    V_g: float = 0.90e-6
    V_d0: float = 0.10e-6
    C_p: float = 2.23e-11
    w: float = 0.35
    eps: tuple[float, ...] = (0.06, -0.04, -0.02)
    a: float = 0.3


def back_suction(phase: Any, w: float) -> np.ndarray:
    """Return h of eq. 5 at `phase` (passages, any number): a hump over the first `w` of a passage, of area 1."""
    part = np.mod(phase, 1.0)
    return np.asarray(np.where(part < w, (1.0 - np.cos(2.0 * math.pi * part / w)) / w, 0.0))


def fundamental(w: float) -> float:
    """Return g_w: the outlet flow pulsates with the amplitude ``2 f V_d g_w`` at the frequency f of the passages."""
    if abs(w - 1.0) < 1e-9:
        return 0.5
    return math.sin(math.pi * w) / (math.pi * w * (1.0 - w * w))


def stroke(p: Pump, back_pressure: Any) -> Any:
    """Return the volume that a passage delivers, m^3, against the `back_pressure` P_pre - P_a (mean, Pa)."""
    return p.V_g - p.V_d0 - p.C_p * back_pressure


def back_pressure(c: Circuit, Q: float, Q_uf: float) -> float:
    """Return mean P_pre - P_a at steady flows (m^3/s), Pa."""
    x = steady_state(c, Q, Q_uf)
    return float(x[1] - x[0])


def speed_for(p: Pump, c: Circuit, Q: float, Q_uf: float = 0.0) -> float:
    """Return the frequency of roller passages that delivers `Q` (m^3/s) into the circuit, Hz."""
    return Q / float(stroke(p, back_pressure(c, Q, Q_uf)))


def flow_at(p: Pump, c: Circuit, f: float, Q_uf: float = 0.0) -> float:
    """Return the mean flow that `f` passages a second (Hz) deliver into the circuit, m^3/s.

    Back pressure is linear in the flow, and so is the equation.
    """
    at_rest = back_pressure(c, 0.0, Q_uf)
    per_flow = c.R_a + c.R_f + c.R_r
    return f * float(stroke(p, at_rest)) / (1.0 + f * p.C_p * per_flow)
