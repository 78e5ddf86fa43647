"""The load cycle of the synthetic rig: set speed and brake over time, its motion and its true events (gearbox.md, section 6)."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.gearbox.model.dynamics import HELD, LOCKED, SLIPPING, STILL, Motion, Plant, simulate
from pipeline.rigs.gearbox.model.friction import drag_load, drag_locked
from pipeline.rigs.gearbox.truth import RPM, GearboxTruth

STEP = 1e-4
"""Seconds from sample to sample of the simulation."""


def plant(truth: GearboxTruth, speed: float, lock_factor: float = 1.0) -> Plant:
    """Return the constants of a run at nominal `speed` (rad/s); `lock_factor` scatters its lock torque."""
    constants = {name: getattr(truth, name) for name in Plant._fields}
    constants["M_lock"] = (truth.M_lock + truth.M_lock_slope * (speed / RPM - 120.0)) * lock_factor
    return Plant(**constants)


def locked_torques(truth: GearboxTruth, w: float) -> tuple[float, float]:
    """Return T_in and T_out (N m) of the locked gearbox at constant speed `w` (rad/s), without brake (eq. B)."""
    out = drag_load(w, truth.d0, truth.d1)
    return drag_locked(w, truth.c0, truth.c_s, truth.w_s, truth.b0) + out / truth.a, out


def set_speed(truth: GearboxTruth, speed: float, time: np.ndarray) -> np.ndarray:
    """Return the drive's no-load speed (rad/s): an S-shaped ramp up, constant, a straight ramp down."""
    top = speed + truth.k_d * locked_torques(truth, speed)[0]
    x = np.clip((time - truth.ramp_start) / truth.ramp_time, 0.0, 1.0)
    rising = np.where(x < 0.96, x**2 / 0.96, 1.0 - (1.0 - x) ** 2 / 0.04)
    falling = np.clip((time - truth.rundown_start) / truth.rundown_time, 0.0, 1.0)
    return np.asarray(top * rising * (1.0 - falling))


def brake(truth: GearboxTruth, time: np.ndarray) -> np.ndarray:
    """Return the brake's capacity, N m: it rises and falls in straight lines."""
    capacity = np.zeros(time.size)
    for on, off, size in truth.brakes or ((truth.brake_on, truth.brake_off, truth.brake_capacity),):
        rising = np.clip((time - on) / truth.brake_rise, 0.0, 1.0)
        falling = np.clip((time - off) / truth.brake_fall, 0.0, 1.0)
        capacity += size * (rising - falling)
    return np.maximum(capacity, 0.0)


def run_motion(truth: GearboxTruth, speed: float, lock_factor: float = 1.0) -> Motion:
    """Return what the rig does in one run at nominal `speed` (rad/s), step `STEP`."""
    time = np.arange(round(truth.duration / STEP) + 1) * STEP
    return simulate(plant(truth, speed, lock_factor), set_speed(truth, speed, time), brake(truth, time), STEP)


def events(truth: GearboxTruth, motion: Motion) -> dict[str, float]:
    """Return when things truly happened first, s of the cycle; an event that did not happen is missing.

    `motor_on` and `brake_onset` are when the drive's ramp and the brake begin, `startup` and `rundown` when the
    output begins to turn and the set speed to fall, `unlock` and `relock` when the gears begin and cease to slip,
    `sos_start` and `sos_end` when the output stops and turns again.
    """
    found = {
        "motor_on": truth.ramp_start,
        "brake_onset": truth.brakes[0][0] if truth.brakes else truth.brake_on,
        "rundown": truth.rundown_start,
        **{
            name: _first(motion, before, after)
            for name, before, after in (
                ("startup", (STILL,), (LOCKED,)),
                ("unlock", (LOCKED,), (SLIPPING,)),
                ("sos_start", (SLIPPING,), (HELD,)),
                ("sos_end", (HELD,), (SLIPPING,)),
                ("relock", (SLIPPING, HELD), (LOCKED, STILL)),
            )
        },
    }
    return {name: time for name, time in found.items() if np.isfinite(time) and time < truth.duration}


def _first(motion: Motion, before: tuple[int, ...], after: tuple[int, ...]) -> float:
    changes = np.isin(motion.state[:-1], before) & np.isin(motion.state[1:], after)
    return float(motion.time[1 + np.argmax(changes)]) if changes.any() else float("nan")
