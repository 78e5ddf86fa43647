"""Volume in the tank at the end of a run from its last levels alone, where nobody logged what the pump was asked for."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.rap.circuit.tank import Tank
from pipeline.rigs.rap.therapy.levels import Levels

# Levels of the last so many seconds, s; fewer than that many tell no line; beyond so many sd an echo is wild.
_WINDOW, _LEAST, _WILD = 600.0, 20, 3.0
# A line through a tank that fills steadily leaves less than that, m.
_LARGEST_SCATTER = 5e-3


def final_by_levels(levels: Levels, tank: Tank) -> Estimate:
    """Return the volume at the last level from a straight line through those of the last ten minutes.

    Raises
    ------
    InputError
        If the last levels are too few, or lie on no line.
    """
    usable = np.flatnonzero(levels.usable)
    last = float(levels.time[usable[-1]]) if usable.size else math.nan
    taken = usable[levels.time[usable] >= last - _WINDOW]
    if taken.size < _LEAST:
        raise InputError(
            f"the last ten minutes hold {taken.size} usable levels, and what the pump was asked for is not logged: {_LEAST} are the least to tell "
            "the volume."
        )
    time, level = levels.time[taken] - last, levels.level[taken]
    # Wild echoes are few: the median of the slopes between the halves does not see them.
    half = taken.size // 2
    slope = float(np.median((level[-half:] - level[:half]) / (time[-half:] - time[:half])))
    left = level - slope * time
    scatter = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    good = np.abs(left - np.median(left)) <= _WILD * max(scatter, 1e-6)
    if scatter > _LARGEST_SCATTER:
        raise InputError(
            f"the last levels scatter by {1e3 * scatter:.0f} mm about a straight line, and what the pump was asked for is not logged: nothing "
            "tells the volume."
        )
    (bend, end), covariance = np.polyfit(time[good], level[good], 1, cov=True)
    common = float(np.median(levels.common_sd[taken]))
    sd = math.hypot(math.sqrt(float(covariance[1, 1])), common)
    remark = f"from the levels of the last ten minutes alone, rising by {6e7 * tank.area * float(bend):.2g} mL/min: what the pump was asked for is not logged"
    return estimate("uf_volume_final", tank.area * float(end), tank.area * sd, reason=remark)
