"""Torque and power balance of the simulated gearbox (gearbox.md, section 3.3): what goes to ground, what becomes heat.

Both hold at every instant between lock events. The equations of the sheet give the input train its own inertia J_1 only
while it slips, so the kinetic energy steps by J_1 w1^2 / 2 at each lock event.
"""

from __future__ import annotations

import numpy as np

from pipeline.rigs.gearbox.model.dynamics import SLIPPING, Motion, Plant


def inertial_torques(plant: Plant, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return what accelerates the input train and the locked body or output train, N m, shape (n,) each."""
    return plant.J_1 * motion.a1 * (motion.state >= SLIPPING), plant.J_gb * motion.a2


def ground_drag(plant: Plant, motion: Motion) -> np.ndarray:
    """Return the torque to ground by the balance of the whole box, N m: friction inside it cancels."""
    return np.asarray(motion.torque_in - motion.torque_out - sum(inertial_torques(plant, motion)))


def kinetic_energy(plant: Plant, motion: Motion) -> np.ndarray:
    """Return the kinetic energy inside the gearbox, J, shape (n,)."""
    slipping = motion.state >= SLIPPING
    return np.asarray(0.5 * plant.J_1 * motion.w1**2 * slipping + 0.5 * plant.J_gb * motion.w2**2)


def dissipated_power(plant: Plant, motion: Motion) -> np.ndarray:
    """Return the heat made in the gearbox and at its ground, W, shape (n,): power in less power out less what accelerates it."""
    first, second = inertial_torques(plant, motion)
    return np.asarray((motion.torque_in - first) * motion.w1 - (motion.torque_out + second) * motion.w2)
