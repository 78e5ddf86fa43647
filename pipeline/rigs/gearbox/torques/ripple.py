"""Torque ripple that is tied to the shaft's angle: learnt where the load is steady, taken off elsewhere.

Fact sheet 5.4. Orders of the turning shaft only; gear mesh lines live far above the torque's band of interest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Once and twice per revolution: misalignment and coupling; more would learn noise.
ORDERS = (1, 2)


@dataclass(frozen=True, eq=False)
class Ripple:
    """Ripple x(theta) = Re sum_k X_k exp(j k theta): orders k and complex X_k, N m, shape (K,)."""

    orders: np.ndarray
    coefficients: np.ndarray

    def at(self, angle: np.ndarray) -> np.ndarray:
        """Return the ripple at `angle` (rad), N m, same shape.

        Examples
        --------
        >>> Ripple(np.array([1]), np.array([0.03 + 0j])).at(np.array([0.0, np.pi])).round(3)
        array([ 0.03, -0.03])
        """
        turn = np.exp(1j * np.asarray(angle, dtype=float))
        total = np.zeros(turn.shape)
        for order, coefficient in zip(self.orders, self.coefficients, strict=True):
            total += (coefficient * turn**order).real
        return total

    @property
    def amplitude(self) -> float:
        """Root-sum-square amplitude over the orders, N m."""
        return float(np.sqrt(np.sum(np.abs(self.coefficients) ** 2)))


NONE = Ripple(np.zeros(0, dtype=int), np.zeros(0, dtype=complex))


def columns(angle: np.ndarray, orders: tuple[int, ...] = ORDERS) -> np.ndarray:
    """Return [1, cos k theta, sin k theta, ...], shape (n, 1 + 2 K)."""
    parts = [np.ones_like(angle)]
    for order in orders:
        parts += [np.cos(order * angle), np.sin(order * angle)]
    return np.column_stack(parts)


def learn(angle: np.ndarray, torque: np.ndarray, orders: tuple[int, ...] = ORDERS) -> Ripple:
    """Fit the ripple of a torque over the angle of its shaft, beside a level and a drift.

    Parameters
    ----------
    angle, torque
        rad and N m, shape (n,), at steady load and speed.
    orders
        Which orders.

    Returns
    -------
    The ripple, or `NONE` where the shaft makes fewer than two revolutions.
    """
    if angle.size < 4 * (2 + 2 * len(orders)) or np.ptp(angle) < 4 * np.pi:
        return NONE
    drift = (angle - angle.mean()) / np.ptp(angle)
    found = np.linalg.lstsq(np.column_stack([columns(angle, orders), drift]), torque, rcond=None)[0]
    return Ripple(np.array(orders), found[1:-1:2] - 1j * found[2:-1:2])
