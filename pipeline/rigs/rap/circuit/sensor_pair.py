"""Device and bench looking at the same pressure, each through its own pole and on its own clock (rap.md, 3.2)."""

from __future__ import annotations

from typing import Any

import numpy as np


def pole(omega: Any, tau: Any) -> Any:
    """Return the response of a first-order sensor of time constant `tau` (s) at `omega` (rad/s)."""
    return 1.0 / (1.0 + 1j * np.asarray(omega) * tau)


def device_over_bench(
    omega: Any, g: Any, tau_d: Any, tau_b: float, lag: float, rho: float = 0.0, t: Any = 0.0, t_ref: float = 0.0
) -> Any:
    """Return H_db of eq. 2: device over bench at `omega` (rad/s), both read at the same stamps.

    Parameters
    ----------
    g
        Gain of the device over the bench.
    tau_d, tau_b
        Time constants of device and bench, s.
    lag
        What is to be added to the device's stamps at `t_ref` to get bench time, s.
    rho
        How much that grows per second of bench time `t` (s).
    """
    shift = lag + rho * (np.asarray(t) - t_ref)
    return g * pole(omega, tau_d) / pole(omega, tau_b) * np.exp(1j * np.asarray(omega) * shift)


def bench_time(device_time: Any, lag: float, rho: float, t_ref: float) -> Any:
    """Return the bench time t of device stamps: ``t = t_d + lag + rho (t - t_ref)``, all in s."""
    return (np.asarray(device_time) + lag - rho * t_ref) / (1.0 - rho)


def device_time(t: Any, lag: float, rho: float, t_ref: float) -> Any:
    """Return the device's stamps at bench time `t`, all in s; the inverse of `bench_time`."""
    return np.asarray(t) - lag - rho * (np.asarray(t) - t_ref)
