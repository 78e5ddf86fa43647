"""Warming of the housing by the device's own power (rap.md, 3.6)."""

from __future__ import annotations

from typing import Any

import numpy as np


def housing_temperature(t: Any, T_0: float, T_inf: float, tau: float) -> np.ndarray:
    """Return the temperature of the air (K) at `t` (s) after switching on (eq. 7)."""
    return np.asarray(T_inf + (T_0 - T_inf) * np.exp(-np.asarray(t) / tau))


def final_temperature(T_amb: float, R_th: float, P_el: float) -> float:
    """Return T_inf (K) of a housing with the thermal resistance `R_th` (K/W) that takes up `P_el` (W)."""
    return T_amb + R_th * P_el


def thermal_resistance(T_inf: float, T_amb: float, P_el: float) -> float:
    """Return R_th (K/W) if all of `P_el` (W) warms the air."""
    return (T_inf - T_amb) / P_el


def time_constant_for(share: float, within: float) -> float:
    """Return the time constant (s) with which the `share` of a rise is reached `within` that time (s)."""
    return float(-within / np.log(1.0 - share))
