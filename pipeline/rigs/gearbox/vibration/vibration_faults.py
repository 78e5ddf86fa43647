"""Vibration channels that cannot be what they are declared: dead, clipped, or in another unit than their neighbours."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.record import Signal
from pipeline.rigs.gearbox.torques.clipping import clip_of

# g in m/s^2, and what a level may be off that factor by the place of the sensor.
_G0, _PLACE = 9.81, 0.5
# A channel that is cut more often than this hides part of its level.
_CUT = 1e-4


def channel_faults(run: str, log: Signal, levels: Mapping[str, Mapping[str, float]]) -> list[QualityFinding]:
    """Return what is wrong with the vibration channels of a run.

    Parameters
    ----------
    run, log
        Name; channels as logged, m/s^2.
    levels
        Channel -> stage -> rms, m/s^2; every stage must show what a wrong unit would.
    """
    found = []
    live = {name: values for name, values in log.values.items() if np.ptp(values) > 0}
    for name in log.values:
        if name not in live:
            text = "does not move at all: dead, not connected, or mapped to the wrong column; it is left out"
            found.append(QualityFinding("warning", f"{name} {text}", run, name))
    for name, values in live.items():
        times = clip_of(log.time, values).times
        if times.size > _CUT * values.size:
            text = (
                f"{name} stands at its end stop in {times.size} samples ({np.abs(values).max():.3g} m/s^2): its levels are lower bounds, "
                "and clipping makes harmonics of its own. Choose a larger range"
            )
            found.append(QualityFinding("warning", text, run, name, (float(times[0]), float(times[-1]))))
    if len(live) < 3:
        return found
    for name in live:
        ratios = [
            median(levels[other][stage] for other in live if other != name) / level
            for stage, level in levels.get(name, {}).items()
        ]
        for factor, told in ((min(ratios, default=0.0), "below"), (1.0 / max(ratios, default=math.inf), "above")):
            if factor > _PLACE * _G0:
                unit = "g where m/s^2 is declared" if told == "below" else "m/s^2 where g is declared"
                text = (
                    f"the level of {name} is {factor:.0f} times {told} that of the other channels in every stage: perhaps in {unit} "
                    f"(factor {_G0}), or of another gain. Look at its unit in the recipe"
                )
                found.append(QualityFinding("warning", text, run, name))
    return found
