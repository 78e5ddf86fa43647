"""What the bench's ring leaves of a drive's mean waveform: a model error, which no number of revolutions averages out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# A misfit is one of the shape from so many standard errors on, and matters from this share of the signal on.
_SURE, _MATTERS = 2.0, 0.01
# Load and force (of the load) over the share of the signal that is left over: another specimen of the tire, 40 % stiffer
# in bending and foundation, leaves 5 % and makes the load 8 % wrong.
_LOAD, _FORCE = 2.0, 0.5


@dataclass(frozen=True, eq=False)
class ShapeError:
    """Mean of what the fits leave over by angle.

    Attributes
    ----------
    angle, left, left_se, signal
        rad; V: mean left over, its standard error under the drive's noise, mean signal less its mean; shape (k,) each.
    share, share_se
        rms of `left` over that of `signal`, and what noise alone makes of it.
    """

    angle: np.ndarray
    left: np.ndarray
    left_se: np.ndarray
    signal: np.ndarray
    share: float
    share_se: float

    @property
    def net(self) -> float:
        """The share that noise does not explain; 0 where it explains it all or nothing is known."""
        square = self.share**2 - self.share_se**2
        return math.sqrt(square) if square > 0.0 else 0.0

    @property
    def matters(self) -> bool:
        """Whether the ring is not that of this tire as far as the loads need it."""
        return self.net > _MATTERS and self.share > _SURE * self.share_se

    @property
    def load_sd(self) -> float:
        """Standard uncertainty of the load by it, relative."""
        return _LOAD * self.net if self.matters else 0.0

    @property
    def force_sd(self) -> float:
        """Standard uncertainty of the longitudinal force by it, as a share of the load."""
        return _FORCE * self.net if self.matters else 0.0
