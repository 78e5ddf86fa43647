"""The bench as two bodies: stator on its stabilisers, shaft on its support, the film between them.

For synthetic logs and for closed forms: the steady answer to one tone. Linear; no oil, no time steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Bench:
    """Masses (kg), stiffnesses (N/m) and damping (N s/m) of stator and shaft support."""

    stator_mass: float = 900.0
    stabilizer_stiffness: float = 5e6
    rotor_mass: float = 450.0
    support_stiffness: float = 3e9
    support_damping: float = 2e5

    def response(self, H: np.ndarray, force: np.ndarray, frequency: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the motions of stator and shaft, m, complex, shape (2,) each, to a force on the stator.

        Solves [[(k_s - w^2 m_s) I + H, -H], [-H, (k_r - w^2 m_r + i w c_r) I + H]] [s; r] = [F; 0].

        Parameters
        ----------
        H
            Impedance of the film, N/m, shape (2, 2); zeros where there is none.
        force
            Complex amplitude, N, shape (2,).
        frequency
            Hz.
        """
        w = 2 * np.pi * frequency
        one = np.eye(2)
        stator = (self.stabilizer_stiffness - w**2 * self.stator_mass) * one
        shaft = (self.support_stiffness - w**2 * self.rotor_mass + 1j * w * self.support_damping) * one
        system = np.block([[stator + H, -H], [-H, shaft + H]])
        moved = np.linalg.solve(system, np.concatenate([force, np.zeros(2)]))
        return moved[:2], moved[2:]

    def answers(
        self, impedance: Callable[[float], np.ndarray], force: np.ndarray, tones: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return displacement stator - shaft (m) and acceleration of the stator (m/s^2), shape (k, 2) each.

        `force` has the shape (k, 2); `impedance` gives H at a frequency (Hz).
        """
        d, a = np.empty(force.shape, dtype=complex), np.empty(force.shape, dtype=complex)
        for i, tone in enumerate(tones):
            stator, shaft = self.response(impedance(float(tone)), force[i], float(tone))
            d[i], a[i] = stator - shaft, -((2 * np.pi * tone) ** 2) * stator
        return d, a
