"""Ultrafiltration while the blood stands: fluid is drawn from blood that nobody replaces (rap.md, 8)."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.rap.alarms.pump import PumpRun
from pipeline.rigs.rap.alarms.ratios import RatioResult
from pipeline.rigs.rap.alarms.results import DeviceLog, UfAlone
from pipeline.rigs.rap.alarms.spans import joined, spans
from pipeline.rigs.rap.alarms.windows import held

# The two pumps need not stop in the same second.
_SHORTEST = 3.0
# Transmembrane pressure over that of therapy from which ultrafiltration is seen in the pressures.
_SHARE = 0.3


def uf_alone(log: DeviceLog, found: RatioResult) -> tuple[UfAlone, ...]:
    """Return the spans in which ultrafiltration ran while the blood pump stood.

    The command of the ultrafiltrate pump tells them; a set-point alone, which stands in the log during a pause, only where
    the transmembrane pressure says so too.
    """
    pump, grid = found.pump, found.grid
    if pump is None or found.ratios is None:
        return ()
    asked = log.uf_command if log.uf_command is not None else log.uf_set
    if asked is None:
        return ()
    rate = held(asked, grid)
    after_start = grid > (pump.running[0][0] if pump.running else np.inf)
    pressed = _pressed(found, pump)
    alone = []
    for start, end in joined(spans(grid, ~pump.on & after_start & (rate > 0.0)), 1.0):
        inside = (grid >= start) & (grid <= end)
        certain = bool(np.nanmean(pressed[inside]) > 0.5) if np.isfinite(pressed[inside]).any() else False
        if end - start >= _SHORTEST and (log.uf_command is not None or certain):
            volume = float(np.trapezoid(rate[inside], grid[inside]))
            alone.append(UfAlone(start, end, volume, certain))
    return tuple(alone)


def _pressed(found: RatioResult, pump: PumpRun) -> np.ndarray:
    """Return 1 where the zeroed TMP is a good part of that during therapy, 0 where not, NaN where it is not known."""
    means, ratios = found.means, found.ratios
    if ratios is None or not {"prefilter", "return", "uf"} <= set(means):
        return np.full(found.grid.size, np.nan)
    zeroed = {tap: means[tap] - ratios.zero[tap] for tap in ("prefilter", "return", "uf")}
    tmp = 0.5 * (zeroed["prefilter"] + zeroed["return"]) - zeroed["uf"]
    therapy = tmp[pump.on & (ratios.uf > 0.0) & np.isfinite(tmp)]
    usual = float(np.median(therapy)) if therapy.size else np.nan
    return np.where(np.isfinite(tmp), (tmp > _SHARE * usual).astype(float), np.nan)
