"""What is left between device and bench once clock, pole, gain and offset are taken off, all harmonics together (rap.md, 5.8)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.conditions import TAP_NAMES, pressure
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.deming import Deming

# A residual that is so many times the noise of both sensors, and more than that of the pulsation, is pulsation left over.
_TIMES, _SHARE = 2.5, 0.08
_FEWEST = 12


@dataclass(frozen=True)
class Leftover:
    """Root mean squares with the pump on, Pa: `residual`, the `noise` that both sensors explain, the `pulsation` of the bench."""

    residual: float
    noise: float
    pulsation: float


def leftover(one: Aligned, line: Deming) -> Leftover | None:
    """Return what is left at one tap; None where gain and offset are not told."""
    gain, offset = line.gain.value, line.offset.value
    if gain is None or offset is None or one.good.sum() < _FEWEST:
        return None
    off = (one.device - offset - gain * one.bench)[one.good]
    noise = math.hypot(line.noise[0], gain * line.noise[1])
    size = max(round(2.0 * one.rate), 2)
    whole = one.bench[one.good]
    count = whole.size // size
    rows = whole[: count * size].reshape(count, size)
    pulsation = float(np.sqrt(np.mean((rows - rows.mean(axis=1, keepdims=True)) ** 2))) if count else 0.0
    return Leftover(float(np.sqrt(np.mean((off - off.mean()) ** 2))), noise, pulsation)


def leftover_faults(run: str, left: Mapping[str, Leftover]) -> list[QualityFinding]:
    """Return what the residual gives away, tap by tap."""
    found = []
    for tap, left_over in left.items():
        name, channel = TAP_NAMES[tap], pressure(tap, "rap")
        if left_over.residual > max(_TIMES * left_over.noise, _SHARE * left_over.pulsation):
            text = (
                f"residual pulsation after alignment: {name} device and bench still differ by {left_over.residual:.0f} Pa rms ({left_over.residual / MMHG:.2f} mmHg) where their "
                f"noise explains {left_over.noise:.0f} Pa, {100 * left_over.residual / left_over.pulsation:.0f} % of the pulsation: harmonics that fold back (sampling too slow), air, or a lag that "
                "is not constant. The limits of agreement of samples hold that; those of means do not"
            )
            found.append(QualityFinding("warning", text, run, channel))
    return found
