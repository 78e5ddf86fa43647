"""How the tank stands and whether it is being moved, from its accelerometer (rap.md, 3.7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.tank import Tank, up_vector
from pipeline.rigs.rap.tables import Signal

# Acceleration beyond gravity, as a share of it, that means motion (eq. 9), and for how long around it the tank counts as moved, s.
_MOVING = 0.2 / 9.81
_AROUND = 3.0
# Echoes between which a level is compared, changes that are wild (m), how many are enough, motion that counts (m), and the share
# of what the tilt asks for from which the level moves against it.
_AFTER, _JUMP, _ENOUGH, _LEAST_MOVE, _AGAINST = 10, 0.03, 300, 0.5e-3, -0.5


def attitude(
    time: np.ndarray, accelerations: Sequence[Signal | None], problems: list[QualityFinding]
) -> tuple[np.ndarray, np.ndarray]:
    """Return up vectors (n, 3) in the tank's frame and where the tank is moved (n,), at `time` (s, (n,)).

    Parameters
    ----------
    accelerations
        `tank_accel_x`, `_y`, `_z`, m/s^2; without all three the tank is taken to stand upright and still.
    problems
        What is odd about them is added here.
    """
    from scipy.ndimage import maximum_filter1d, uniform_filter1d

    axes = [a for a in accelerations if a is not None]
    if len(axes) < 3:
        text = (
            "without tank_accel_x, _y and _z the tank is taken to stand upright and still; "
            "a tilt of 1.5 deg is worth about 8 mL. Log all three."
        )
        problems.append(QualityFinding("warning", text, channel="tank_accel_z"))
        return np.tile([0.0, 0.0, 1.0], (time.size, 1)), np.zeros(time.size, dtype=bool)
    base = axes[0].time
    a = np.stack([axes[0].values, *(np.interp(base, other.time, other.values) for other in axes[1:])], axis=1)
    size = np.linalg.norm(a, axis=1)
    g = float(np.median(size)) or 1.0
    if np.median(a[:, 2]) < 0.0:
        a = -a
        text = "tank_accel_z is negative at rest; it should read + 9.81 m/s^2. All three axes are taken with the other sign."
        problems.append(QualityFinding("warning", text, channel="tank_accel_z"))
    if not 9.3 < g < 10.3:
        text = f"the accelerometer reads {g:.3g} m/s^2 at rest, not 9.81; only its direction is used. Check its unit and calibration."
        problems.append(QualityFinding("warning", text, channel="tank_accel_z"))
    rate = axes[0].rate if base.size > 2 else 1.0
    around = max(round(_AROUND * rate), 1)
    moved = maximum_filter1d((np.abs(size - g) > _MOVING * g).astype(np.int8), 2 * around + 1) > 0
    width = max(round(rate), 1)
    calm = uniform_filter1d(a, width, axis=0, mode="nearest") if width > 1 else a
    shaken = uniform_filter1d(a, 2 * around + 1, axis=0, mode="nearest")
    smooth = np.where(moved[:, None], shaken, calm)
    at = np.stack([np.interp(time, base, smooth[:, i]) for i in range(3)], axis=1)
    nearest = np.clip(np.searchsorted(base, time), 0, base.size - 1)
    return up_vector(at), np.asarray(moved[nearest])


def turned_axes(height: np.ndarray, n: np.ndarray, tank: Tank) -> list[str]:
    """Return along which axes ("x", "y") the level moves against what the tilt asks for: a wrong sign.

    Parameters
    ----------
    height
        Sensor's height less distance at the echoes, m, NaN without one, shape (m,).
    n
        Up vectors, shape (m, 3).
    tank
        Its sensor's place.
    """
    parts = {"x": n[:, 0] * tank.dx / n[:, 2], "y": n[:, 1] * tank.dy / n[:, 2]}
    level = height[_AFTER:] - height[:-_AFTER]
    moves = {axis: part[:-_AFTER] - part[_AFTER:] for axis, part in parts.items()}
    seen = np.isfinite(level) & (np.abs(level) < _JUMP)
    told = [axis for axis, move in moves.items() if seen.sum() > _ENOUGH and float(np.std(move[seen])) > _LEAST_MOVE]
    if not told:
        return []
    X = np.stack([moves[axis][seen] for axis in told], axis=1)
    share, *_ = np.linalg.lstsq(X, level[seen], rcond=None)
    return [axis for axis, one in zip(told, share, strict=True) if one < _AGAINST]


def wrong_signs(turned: Sequence[str]) -> str:
    """Say what is wrong where the level moves against the tilt along these axes."""
    channels, places = (" and ".join(f"{name}{axis}" for axis in turned) for name in ("tank_accel_", "level_sensor_d"))
    return (
        f"the level moves against the tilt: {channels} or {places} has the wrong sign, and corrected by it the level is wrong by twice the "
        "tilt's part. It is not used; turn the sign of one of them in the recipe or the conditions."
    )
