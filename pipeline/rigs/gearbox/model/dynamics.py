"""The gearbox between motor and braked flywheel, integrated in time with lock events (gearbox.md, section 3.5).

States are the speeds of the input and the output carrier, and which of them stand still or are locked together
(Karnopp 1985): no sign function is ever integrated through zero. Numba is imported here, so import this module only
where something is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numba as nb
import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.gearbox.model import friction

STILL, LOCKED, SLIPPING, HELD = 0, 1, 2, 3
# Slip below which the gears lock, and output speed below which it can stop, rad/s.
_SLIP_ZERO, _SPEED_ZERO = 1e-3, 1e-4

# The kernel is cached by this file only: after a change in `friction` touch this file too.
_drag_locked = nb.njit(friction.drag_locked)
_drag_slipping = nb.njit(friction.drag_slipping)
_slip_torque = nb.njit(friction.slip_torque)
_drag_load = nb.njit(friction.drag_load)


class Plant(NamedTuple):
    """Constants of the equations, SI: names as in gearbox.md, section 3.5.

    `h0`, `h1` make the drag to ground at full slip (`friction.drag_slipping`); `M_lock` is the torque at which the
    lock breaks, `M_e` the slip torque as it engages again.
    """

    a: float
    J_L: float
    J_gb: float
    J_1: float
    J_m: float
    k_d: float
    d0: float
    d1: float
    c0: float
    c_s: float
    w_s: float
    b0: float
    h0: float
    h1: float
    M_c: float
    M_v: float
    s_s: float
    M_e: float
    M_lock: float


@dataclass(frozen=True, eq=False)
class Motion:
    """What the rig did: every array has shape (n,), at steps of `time` (s).

    Attributes
    ----------
    w1, w2, theta1, theta2
        Speed (rad/s) and angle (rad) of the input and the output carrier.
    a1, a2
        Their accelerations, rad/s^2.
    torque_in, torque_out
        Shaft torques, N m.
    carried, ground
        Torque through the lock or the slipping gears (M), and drag to ground, N m.
    state
        STILL, LOCKED, SLIPPING, or HELD (output stands, input turns).
    """

    time: np.ndarray
    w1: np.ndarray
    w2: np.ndarray
    theta1: np.ndarray
    theta2: np.ndarray
    a1: np.ndarray
    a2: np.ndarray
    torque_in: np.ndarray
    torque_out: np.ndarray
    carried: np.ndarray
    ground: np.ndarray
    state: np.ndarray

    @property
    def slip(self) -> np.ndarray:
        """Slip speed s = w1 - w2, rad/s."""
        return np.asarray(self.w1 - self.w2)


def simulate(plant: Plant, set_speed: np.ndarray, brake: np.ndarray, step: float) -> Motion:
    """Integrate from standstill.

    Parameters
    ----------
    set_speed, brake
        No-load speed of the drive (rad/s) and capacity of the brake (N m), shape (n,).
    step
        Seconds from sample to sample.

    Raises
    ------
    InputError
        Where the load drives the gearbox so hard that the lock would break backwards: not in this model.

    Notes
    -----
    Load flowing back from the flywheel (a steep run-down) is transmitted with the same `a` the other way round,
    ``M = a (T_out + J_gb w')``, so that the part of the drag that grows with load always takes power.
    """
    names = [f.name for f in fields(Motion) if f.name not in ("time", "state")]
    columns = np.empty((len(names), set_speed.size))
    state = np.empty(set_speed.size, dtype=np.int8)
    stopped_at = _integrate(plant, set_speed, brake, step, columns, state)
    if stopped_at >= 0:
        raise InputError(
            f"the synthetic gearbox would break its lock backwards at {stopped_at * step:.2f} s, which its model does not "
            "hold: let the set speed fall more slowly."
        )
    return Motion(time=np.arange(set_speed.size) * step, **dict(zip(names, columns, strict=True)), state=state)


@nb.njit(cache=True)
def _transmitted(carried, a):  # type: ignore[no-untyped-def]
    return a * carried if carried >= 0.0 else carried / a


@nb.njit(cache=True)
def _locked_acceleration(p, w, drive, brake):  # type: ignore[no-untyped-def]
    """Acceleration of the locked rig (eq. A and B): `drive` is the motor's torque less the drag to ground."""
    resisting = _drag_load(w, p.d0, p.d1) + brake
    inertia = p.J_L + p.J_gb
    rate = (drive - resisting / p.a) / (p.J_m + inertia / p.a)
    if resisting + inertia * rate < 0.0:
        rate = (drive - p.a * resisting) / (p.J_m + p.a * inertia)
    return rate


@nb.njit(cache=True)
def _rates(p, state, w1, w2, peak, set_speed, brake):  # type: ignore[no-untyped-def]
    """Return w1', w2', the carried torque M and the drag T_0 of the input, for turning shafts."""
    motor = (set_speed - w1) / p.k_d
    drag = _drag_locked(w1, p.c0, p.c_s, p.w_s, p.b0)
    if state == STILL:
        return 0.0, 0.0, motor - drag, drag
    if state == LOCKED:
        rate = _locked_acceleration(p, w1, motor - drag, brake)
        return rate, rate, motor - p.J_m * rate - drag, drag
    s = w1 - w2
    share = 1.0 if state == HELD else (min(max(s / w1, 0.0), 1.0) if w1 > 1e-9 else 0.0)
    drag = _drag_slipping(w1, share, drag, p.h0, p.h1)
    carried = _slip_torque(s, p.M_c, p.M_v, peak, p.s_s)
    rate1 = (motor - drag - carried) / (p.J_m + p.J_1)
    if state == HELD:
        return rate1, 0.0, carried, drag
    rate2 = (p.a * carried - _drag_load(w2, p.d0, p.d1) - brake) / (p.J_L + p.J_gb)
    return rate1, rate2, carried, drag


@nb.njit(cache=True)
def _next_state(p, state, w1, w2, peak, set_speed, brake):  # type: ignore[no-untyped-def]
    """Return the state that holds from now on: the same where nothing changes."""
    rate1, rate2, carried, _ = _rates(p, state, w1, w2, peak, set_speed, brake)
    if state == STILL:
        if p.a * min(carried, p.M_lock) > p.d0 + brake:
            return LOCKED
        return HELD if carried > p.M_lock else STILL
    if state == LOCKED:
        if w1 <= _SPEED_ZERO and rate1 <= 0.0:
            return STILL
        if carried > p.M_lock:
            slipping1, slipping2, _, _ = _rates(p, SLIPPING, w1, w2, p.M_lock, set_speed, brake)
            return SLIPPING if slipping1 > slipping2 else LOCKED
        return LOCKED
    if w1 - w2 <= _SLIP_ZERO and rate1 <= rate2:
        return STILL if state == HELD else LOCKED
    can_stand = p.a * carried <= p.d0 + brake
    if state == SLIPPING and w2 <= _SPEED_ZERO and can_stand:
        return HELD
    if state == HELD and not can_stand:
        return SLIPPING
    return state


@nb.njit(cache=True)
def _integrate(p, set_speed, brake, step, columns, states):  # type: ignore[no-untyped-def]
    """Fill `columns` and `states`; return the sample where the lock would break backwards, or -1."""
    state, w1, w2, theta1, theta2 = STILL, 0.0, 0.0, 0.0, 0.0
    peak = p.M_lock
    n = set_speed.size
    for k in range(n):
        for _ in range(3):
            before = state
            state = _next_state(p, state, w1, w2, peak, set_speed[k], brake[k])
            if state == before:
                break
            if state == LOCKED and before == SLIPPING:
                first, second = p.J_m + p.J_1, (p.J_L + p.J_gb) / p.a
                w1 = w2 = (first * w1 + second * w2) / (first + second)
            elif state == HELD:
                w2 = 0.0
            elif state == STILL:
                w1 = w2 = 0.0
            if before in (LOCKED, STILL):
                peak = p.M_lock
            elif state == HELD:
                peak = p.M_e
        rate1, rate2, carried, drag = _rates(p, state, w1, w2, peak, set_speed[k], brake[k])
        if state == LOCKED and carried < -p.M_lock:
            return k
        # Once the gears slip fast, or the output stands, the lock's peak is forgotten; they engage again at M_e.
        if state >= SLIPPING and w1 - w2 > 3.0 * p.s_s:
            peak = p.M_e
        torque_in = (set_speed[k] - w1) / p.k_d - p.J_m * rate1
        if state == STILL:
            # At rest the drag takes what it can; only the rest winds up the gears.
            carried = max(carried, 0.0)
            drag = torque_in - carried
        through = _transmitted(carried, p.a)
        torque_out = through - p.J_gb * rate2
        columns[:, k] = (w1, w2, theta1, theta2, rate1, rate2, torque_in, torque_out, carried, drag + carried - through)
        states[k] = state
        if k + 1 == n or state == STILL:
            continue
        # Heun's step within the state; events wait for the next sample.
        later1, later2, _, _ = _rates(
            p, state, w1 + step * rate1, w2 + step * rate2, peak, set_speed[k + 1], brake[k + 1]
        )
        new1 = max(w1 + 0.5 * step * (rate1 + later1), 0.0)
        new2 = max(w2 + 0.5 * step * (rate2 + later2), 0.0)
        theta1 += 0.5 * step * (w1 + new1)
        theta2 += 0.5 * step * (w2 + new2)
        w1, w2 = new1, new2
    return -1
