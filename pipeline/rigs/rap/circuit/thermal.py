"""Warming of the housing by the device's own power (rap.md, 3.6)."""

from __future__ import annotations

from typing import Any

import numpy as np


def housing_temperature(t: Any, T_0: float, T_inf: float, tau: float) -> np.ndarray:
    """Return the temperature of the air (K) at `t` (s) after switching on (eq. 7)."""
    return np.asarray(T_inf + (T_0 - T_inf) * np.exp(-np.asarray(t) / tau))
