"""What makes the two units incomparable: mixed units, turned signs, taps exchanged in one of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.results import DeviceLog
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.tables import Signal

# Correlation from which two records are the same but for a factor.
_ALIKE = 0.8
_FACTOR = 2.0
# Exchanged taps agree this much better the other way round.
_BETTER = 5.0


def incomparable(control: np.ndarray, protective: np.ndarray) -> str:
    """Return why two records (n,) of one tap cannot be held against each other; '' where they can."""
    scatter = float(np.std(control)), float(np.std(protective))
    if min(scatter) <= 0.0:
        return ""
    factor, alike = scatter[1] / scatter[0], float(np.corrcoef(control, protective)[0, 1])
    if abs(alike) > _ALIKE and not 1.0 / _FACTOR < factor < _FACTOR:
        return f"the protective unit's pressure is {factor:.3g} times the control unit's; look for mixed units (mmHg, kPa, Pa)"
    return (
        "the protective unit's pressure runs against the control unit's; look for a turned sign"
        if alike < -_ALIKE
        else ""
    )


def exchanged_taps(log: DeviceLog) -> list[QualityFinding]:
    """Return a warning for each pair of taps that agree with each other between the units and not with themselves."""
    both = [tap for tap in log.control if tap in log.protective]
    grid = log.control[both[0]].time[:: max(log.control[both[0]].time.size // 5000, 1)] if both else np.zeros(0)
    found = []
    for i, a in enumerate(both):
        for b in both[i + 1 :]:
            own = min(_apart(log.control, log.protective, grid, a, a), _apart(log.control, log.protective, grid, b, b))
            crossed = max(
                _apart(log.control, log.protective, grid, a, b), _apart(log.control, log.protective, grid, b, a)
            )
            if crossed * _BETTER < own:
                message = (
                    f"{TAP_NAMES[a]} and {TAP_NAMES[b]} pressure look exchanged in one of the two units: each agrees with the "
                    "other's reading and not with its own. Mend the recipe, under 'channels'."
                )
                found.append(QualityFinding("warning", message, log.run))
    return found


def _apart(control: Mapping[str, Signal], protective: Mapping[str, Signal], grid: np.ndarray, a: str, b: str) -> float:
    one, other = (np.interp(grid, s.time, s.values) for s in (control[a], protective[b]))
    return float(np.median(np.abs(one - other)))
