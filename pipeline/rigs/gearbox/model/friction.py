"""Friction of the gearbox and its load: drag to ground, slip torque, drag of the flywheel (gearbox.md, section 3.5).

Coulomb, viscous and Stribeck parts as in Armstrong-Hélouvry, Dupont and Canudas de Wit (1994). Plain functions of
numbers or arrays, SI, for motion in the motor's direction; sticking is not here but in `dynamics`.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

# A number or an array of numbers, shape (n,), SI.
Number = TypeVar("Number", float, np.ndarray)


def drag_locked(w: Number, c0: float, c_s: float, w_s: float, b0: float) -> Number:
    """Return the drag to ground of the locked gearbox, N m: ``T_0 = c0 + c_s exp(-(w/w_s)^2) + b0 w``.

    Examples
    --------
    >>> f"{drag_locked(12.566, 0.10, 0.406, 17.08, 0.004):.4f}"
    '0.3866'
    """
    decay: Number = np.exp(-((w / w_s) ** 2))
    return c0 + c_s * decay + b0 * w


def drag_slipping(w1: Number, slip_share: Number, locked: Number, h0: float, h1: float) -> Number:
    """Return the drag to ground of the slipping gearbox, N m.

    From `locked`, the drag at `slip_share` = s/w1 = 0, to ``h0 + h1 w1`` at s = w1 (output stopped), in proportion.
    """
    drag: Number = (1.0 - slip_share) * locked + slip_share * (h0 + h1 * w1)
    return drag


def slip_torque(s: Number, M_c: float, M_v: float, M_p: float, s_s: float) -> Number:
    """Return the torque of the slipping gears, N m: ``M_slip = M_c + M_v s + (M_p - M_c) exp(-(s/s_s)^2)``.

    `M_p` is the torque as s goes to 0: the lock torque when breaking away, less when engaging again.
    """
    decay: Number = np.exp(-((s / s_s) ** 2))
    return M_c + M_v * s + (M_p - M_c) * decay


def drag_load(w2: Number, d0: float, d1: float) -> Number:
    """Return the drag of the turning load, N m: ``d0 + d1 w2`` (eq. A)."""
    return d0 + d1 * w2
