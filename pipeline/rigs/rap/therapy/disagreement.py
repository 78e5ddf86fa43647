"""What level and scale disagree by, as an error of all that rests on the level (rap.md, 5.6). Not which of them is right.

A level that stands off the scale by more than both explain has an offset, another area than stated, or the scale is off: the
data do not tell which. Numbers from the level then hold the difference as a type B error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.rap.therapy.volume_against_scale import VolumeError

# Differences below are what a sound tank and scale show, m^3, beside so many standard deviations of the filter.
_SMALL, _DEVIATIONS = 5e-6, 4.0
_LEAST, _ENOUGH_TO_BEND = 10, 40


@dataclass(frozen=True, eq=False)
class Disagreement:
    """Level less scale: `final` at the end, m^3, and by how much the rates differ, `share` (1) at `time` (s), shape (n,)."""

    final: float
    time: np.ndarray
    share: np.ndarray

    @property
    def mean_share(self) -> float:
        """By how much the rates differ on the whole, as a share."""
        return float(self.share.mean()) if self.share.size else 0.0


def disagreement(error: VolumeError) -> Disagreement | None:
    """Return what level and scale disagree by; None where it is no more than their errors.

    The difference is smoothed by a parabola, so that an area that changes with the height is followed.
    """
    time, e = error.time[error.counted], error.error[error.counted]
    sd = error.sd[error.counted]
    doubt = max(_SMALL, _DEVIATIONS * (float(np.nanmedian(sd)) if np.isfinite(sd).any() else 0.0))
    final = float(error.final.value or 0.0)
    share = np.zeros(time.size)
    drifts = False
    if time.size >= _LEAST and error.rate_scale.value:
        course = np.polynomial.Polynomial.fit(time, e, 2 if time.size >= _ENOUGH_TO_BEND else 1)
        if float(np.ptp(course(time))) > doubt:
            drifts, share = True, course.deriv()(time) / error.rate_scale.value
    if not drifts and abs(final) <= doubt + 2.0 * float(error.final.std_error or 0.0):
        return None
    return Disagreement(final, time, share)


def widened(found: Estimate, half: float, remark: str) -> Estimate:
    """Return an estimate whose error holds a further standard error `half` of type B."""
    if found.value is None or found.std_error is None or found.ci95 is None or half == 0.0:
        return found
    low, high = (math.copysign(math.hypot(end - found.value, 1.96 * half), end - found.value) for end in found.ci95)
    return replace(
        found, std_error=math.hypot(found.std_error, half), type_b=math.hypot(found.type_b or 0.0, half), ci95=(found.value + low, found.value + high),
        reason="; ".join(filter(None, (found.reason, remark))),
    )  # fmt: skip
