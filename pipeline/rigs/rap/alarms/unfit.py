"""Stretches that no ratio may be formed from: a reading that stands still, a pump that makes less than it is set to."""

from __future__ import annotations

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.frozen import constant_runs
from pipeline.rigs.rap.alarms.pump import RATE_NEEDED, PumpRun
from pipeline.rigs.rap.alarms.spans import spans
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.tables import Signal

# A mean holds samples of up to this long ago, s.
_SPILL = 1.5
# Where every line's resistance is below this share of its baseline, the flow is less than set.
_ALL_LOW = 0.75


def leave_out_frozen(
    grid: np.ndarray,
    signals: dict[str, Signal | None],
    means: dict[str, np.ndarray],
    pump: PumpRun,
    run: str,
    problems: list[QualityFinding],
) -> None:
    """Take out of `means` where a pressure that pulsates with the pump repeats one value: the reading stands still."""
    for tap in ("access", "prefilter", "return"):
        signal = signals.get(tap)
        if signal is None or signal.rate < RATE_NEEDED:
            continue
        for low, high in constant_runs(signal.time, signal.values):
            start, end = float(signal.time[low]), float(signal.time[high])
            inside = (grid >= start) & (grid <= end + _SPILL)
            if np.any(pump.on & inside):
                means[tap] = np.where(inside, np.nan, means[tap])
                message = f"The {TAP_NAMES[tap]} pressure stands still from {start:.0f} to {end:.0f} s while the pump runs; no ratio is formed with it there."
                problems.append(QualityFinding("warning", message, run, None, (start, end)))


def leave_out_slow_pump(
    grid: np.ndarray, values: dict[str, np.ndarray], run: str, problems: list[QualityFinding]
) -> None:
    """Take out of `values` where all lines fall together: the pump makes less than its set-point, nothing is disconnected."""
    lines = [values[name] for name in ("access", "filter", "return") if name in values]
    if len(lines) < 2:
        return
    with np.errstate(invalid="ignore"):
        together = np.all([line < _ALL_LOW for line in lines], axis=0)
    for name in values:
        values[name] = np.where(together, np.nan, values[name])
    for start, end in spans(grid, together):
        if end - start > 5.0:
            message = (
                "all resistances fall together: the blood pump makes less than its set-point (slip, stall, or a set-point that "
                "was not followed). No disconnection is read from that."
            )
            problems.append(
                QualityFinding("warning", f"From {start:.0f} to {end:.0f} s {message}", run, None, (start, end))
            )
