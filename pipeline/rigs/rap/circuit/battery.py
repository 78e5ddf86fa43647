"""Energy of the battery: what is used, what is left, how long it lasts (rap.md, 3.11)."""

from __future__ import annotations

from typing import Any

import numpy as np


def energy_used(time: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Return the energy (J) taken since the first sample, shape (n,), from `time` (s) and `power` (W)."""
    steps = 0.5 * (power[1:] + power[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def runtime(energy: float, efficiency: float, power: float) -> float:
    """Return how long (s) a battery of `energy` (J) runs a load of mean `power` (W)."""
    return efficiency * energy / power


def open_circuit_voltage(charge: Any, empty: float = 13.2, full: float = 16.6) -> Any:
    """Return the voltage (V) at rest of a battery with `charge` left (share, 0 to 1); a straight line."""
    return empty + (full - empty) * np.asarray(charge)


def current(power: Any, voltage_at_rest: Any, R_0: float) -> Any:
    """Return the current (A) at which a battery of inner resistance `R_0` (ohm) gives `power` (W)."""
    if R_0 == 0.0:
        return power / voltage_at_rest
    return (voltage_at_rest - np.sqrt(np.asarray(voltage_at_rest) ** 2 - 4.0 * R_0 * power)) / (2.0 * R_0)
