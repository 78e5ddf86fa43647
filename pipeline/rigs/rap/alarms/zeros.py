"""What each pressure reads while the blood stands: the offset of its sensor and the head of its place."""

from __future__ import annotations

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.pump import PumpRun
from pipeline.rigs.rap.alarms.spans import since
from pipeline.rigs.rap.conditions import TAP_NAMES

# After the pump stops, pressures level out; a standstill is read this long after, s.
_SETTLED = 8.0
# Samples of a standstill before the first start that make a zero.
_ENOUGH = 20


def zeros(
    grid: np.ndarray,
    means: dict[str, np.ndarray],
    pump: PumpRun,
    uf: np.ndarray,
    run: str,
    problems: list[QualityFinding],
) -> dict[str, float]:
    """Return what each tap reads while the blood stands, from before the first start where the log holds that; 0 where it cannot be told."""
    starts, stops = (np.array(moments) for moments in zip(*pump.running, strict=True))
    ahead = starts[np.minimum(np.searchsorted(starts, grid), starts.size - 1)] - grid
    still = ~pump.on & (since(grid, stops) >= _SETTLED) & ((ahead > 1.0) | (ahead <= 0.0))
    zero: dict[str, float] = {}
    lacking: list[str] = []
    for tap, mean in means.items():
        own = still & np.isfinite(mean) & ((uf <= 0.0) if tap == "uf" else True)
        before = own & (grid < starts[0])
        used = before if before.sum() >= _ENOUGH else own
        zero[tap] = float(np.median(mean[used])) if used.any() else 0.0
        if not used.any():
            lacking.append(TAP_NAMES[tap])
    if lacking:
        message = (
            f"The pressures ({', '.join(lacking)}) cannot be zeroed: the log holds no standstill of the blood pump. Ratios are "
            "formed with them as they stand; an offset of 100 Pa moves them by some percent."
        )
        problems.append(QualityFinding("warning", message, run))
    return zero
