"""What is left between device and bench once clock, pole, gain and offset are taken off: pulsation, and drift (rap.md, 5.8)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.conditions import TAP_NAMES, pressure
from pipeline.rigs.rap.pressures.agreement import Means
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.deming import Deming

# A residual that is so many times the noise of both sensors, and more than that of the pulsation, is pulsation left over.
_TIMES, _SHARE = 2.5, 0.08
# A drift of the difference over the run that is told, Pa, and that many standard errors.
_DRIFT, _SIGMAS, _FEWEST = 40.0, 6.0, 12


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


def leftover_faults(run: str, taps: Mapping[str, tuple[Aligned, Deming]]) -> list[QualityFinding]:
    """Return what the residual gives away, tap by tap."""
    found = []
    for tap, (one, line) in taps.items():
        left = leftover(one, line)
        name, channel = TAP_NAMES[tap], pressure(tap, "rap")
        if left is not None and left.residual > max(_TIMES * left.noise, _SHARE * left.pulsation):
            text = (
                f"residual pulsation after alignment: {name} device and bench still differ by {left.residual:.0f} Pa rms ({left.residual / MMHG:.2f} mmHg) where their "
                f"noise explains {left.noise:.0f} Pa, {100 * left.residual / left.pulsation:.0f} % of the pulsation: harmonics that fold back (sampling too slow), air, or a lag that "
                "is not constant. The limits of agreement of samples hold that; those of means do not"
            )
            found.append(QualityFinding("warning", text, run, channel))
        found += _drift(run, tap, line.means, line.gain, line.offset)
    return found


def _drift(run: str, tap: str, means: Means, gain: Estimate, offset: Estimate) -> list[QualityFinding]:
    """Tell a difference that drifts over the run."""
    if gain.value is None or offset.value is None or means.time.size < _FEWEST:
        return []
    off = means.device - offset.value - gain.value * means.bench
    t = means.time - means.time.mean()
    slope = float(t @ off / (t @ t))
    # Blocks of 20 s are what repeats: means of 5 s within one go together.
    error = float(np.std(off - slope * t)) / math.sqrt(float(t @ t)) * 2.0
    drift = slope * float(np.ptp(means.time))
    if abs(drift) < _DRIFT or abs(slope) < _SIGMAS * error:
        return []
    text = (
        f"residual drifts: {TAP_NAMES[tap]} device less bench changes by {drift:+.0f} Pa ({drift / MMHG:+.2f} mmHg) from start to end of the run: a zero that drifts with "
        "temperature, or air that moves. Zero again at the end and compare"
    )
    return [QualityFinding("warning", text, run, pressure(tap, "rap"))]
