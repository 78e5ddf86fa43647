"""Ultrafiltration coefficient of the membrane and its decline (rap.md, 3.1 and 3.8)."""

from __future__ import annotations

from typing import Any

import numpy as np

T_REF = 18000.0
"""Time (s) to which the decline a refers: 5 h."""


def coefficient(t: Any, K_0: float, a: float, t_ref: float = T_REF) -> np.ndarray:
    """Return K_uf(t) = K_0 / (1 + a t / t_ref), m^3/(s Pa): the resistance grows in proportion to time."""
    return np.asarray(K_0 / (1.0 + a * np.asarray(t) / t_ref))


def effective_pressure(tmp: Any, osmotic: float = 0.0) -> Any:
    """Return what drives fluid through the membrane (eq. 1), Pa: `tmp` less the proteins' `osmotic` pressure (Pa)."""
    return tmp - osmotic


def water_viscosity(T: Any) -> np.ndarray:
    """Return the viscosity of water (Pa s) at `T` (K), about 2 % less per kelvin; saline behaves alike.

    Kestin, Sokolov and Wakeham (1978), good to 1 % from 273 to 313 K.
    """
    c = np.asarray(T) - 273.15
    exponent = (20.0 - c) / (c + 96.0) * (1.2364 - 1.37e-3 * (20.0 - c) + 5.7e-6 * (20.0 - c) ** 2)
    return np.asarray(1.002e-3 * 10.0**exponent)
