"""The windows of all runs side by side: what the estimators see and what the meter says, one row a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True, eq=False)
class FlowWindows:
    """One row a window, shape (w,) each; SI.

    Attributes
    ----------
    run, role, group, tube, clamp
        Texts: name of the run, its set and how that is called, its tube, the clamp as stated.
    time
        Centre of the window on the device's clock.
    flow_set
        Blood flow as set.
    uf
        UF rate; 0 where off or not logged.
    f, f_error
        Passages a second, and its standard error.
    A_1, A_1_error
        Amplitude of the pre-filter pressure at f; NaN without that pressure.
    back_pressure
        Mean pre-filter less mean access pressure, zeroed; NaN where one is missing.
    access, prefilter, back
        Mean pressures, zeroed: access, pre-filter, return.
    metered, metered_error
        Flow meter's mean, its zero taken off, and its standard error; NaN without one.
    flow
        Blood flow by the meter: with the UF rate added for a meter on the return line; NaN where it cannot be told.
    own
        The device's own estimate.
    """

    run: np.ndarray
    role: np.ndarray
    group: np.ndarray
    tube: np.ndarray
    clamp: np.ndarray
    time: np.ndarray
    flow_set: np.ndarray
    uf: np.ndarray
    f: np.ndarray
    f_error: np.ndarray
    A_1: np.ndarray
    A_1_error: np.ndarray
    back_pressure: np.ndarray
    access: np.ndarray
    prefilter: np.ndarray
    back: np.ndarray
    metered: np.ndarray
    metered_error: np.ndarray
    flow: np.ndarray
    own: np.ndarray

    @property
    def size(self) -> int:
        """Number of windows."""
        return int(self.time.size)

    def of(self, kept: np.ndarray) -> FlowWindows:
        """Return the windows at `kept`, a mask or indices."""
        return FlowWindows(**{one.name: getattr(self, one.name)[kept] for one in fields(self)})

    @property
    def point(self) -> np.ndarray:
        """Number of the operating point (run, set-point, clamp, UF) that each window belongs to, shape (w,)."""
        keys = list(zip(self.run, np.round(self.flow_set * 6e7, 1), self.clamp, np.round(self.uf * 6e8), strict=True))
        order = {key: i for i, key in enumerate(dict.fromkeys(keys))}
        return np.array([order[key] for key in keys], dtype=int)

    @property
    def set_point(self) -> np.ndarray:
        """Blood flow as set, rounded to 0.1 mL/min, mL/min, shape (w,)."""
        return np.asarray(np.round(self.flow_set * 6e7, 1))


def stacked(parts: Sequence[FlowWindows]) -> FlowWindows:
    """Return the windows of several runs one after the other; at least one of them."""
    return FlowWindows(
        **{one.name: np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(FlowWindows)}
    )
