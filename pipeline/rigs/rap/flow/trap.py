"""Why 60, 80 and 100 mL/min alone cannot tell a good estimator from a bad one, computed on the windows at hand (rap.md, 5.3)."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.rap.flow.calibration import LAWS, solve, usable
from pipeline.rigs.rap.flow.results import Trap
from pipeline.rigs.rap.flow.windows import FlowWindows, stacked

# The access line is open where its resistance is within that share of the least one.
_OPEN = 0.3


def access_resistance(windows: FlowWindows) -> np.ndarray:
    """Return -P_a/Q, Pa s/m^3, of each window, shape (w,); NaN without access pressure or flow."""
    return np.asarray(-windows.access / windows.flow)


def unclamped(windows: FlowWindows) -> np.ndarray:
    """Return which windows have the access line open, mask (w,): by its resistance, else by what is stated of the clamp."""
    resistance = access_resistance(windows)
    if np.isfinite(resistance).any() and np.nanmin(resistance) > 0.0:
        return np.asarray((resistance < (1.0 + _OPEN) * np.nanmin(resistance)) | ~np.isfinite(resistance))
    words = np.array([str(word).lower().strip("x× ") for word in windows.clamp])
    return np.isin(words, ("", "1", "1.0", "open", "none", "no", "off", "unclamped"))


def trap_of(calibration: FlowWindows, holdout: FlowWindows) -> Trap | None:
    """Fit laws to the unclamped calibration windows alone and try them on the clamped ones, of the hold-out where there are no others.

    None where there are not both.
    """
    usual = _usable(calibration)
    open_line = unclamped(usual) if usual.size else np.empty(0, dtype=bool)
    inside, outside = usual.of(open_line), usual.of(~open_line)
    if not outside.size and inside.size and holdout.size:
        both = _usable(stacked([calibration, holdout]))
        outside = both.of(~unclamped(both))
    if not outside.size or np.unique(inside.set_point).size < 3:
        return None
    values = {name: solve(LAWS[name], inside) for name in ("E1", "affine", "E2", "E3")}
    worst = [
        {name: float(np.abs(LAWS[name].columns(part) @ v / part.flow - 1.0).max()) for name, v in values.items()}
        for part in (inside, outside)
    ]
    return Trap(worst[0], worst[1], values)


def _usable(windows: FlowWindows) -> FlowWindows:
    return usable(LAWS["E2"], usable(LAWS["E3"], windows))
