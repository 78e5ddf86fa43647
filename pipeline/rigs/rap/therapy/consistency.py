"""Are the filter's errors as large as it says? Mean of the normalised innovation squared, its colour, what to widen by (5.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_LAGS = 60
_LEAST = 60
# Mean of chi^2 with one degree of freedom below the gate of 9, and its median: the innovations passed over are missing.
_MEAN_BELOW_GATE = 0.9733
_MEDIAN = 0.4549
_BAND = (0.9, 1.1)
# Variance of a level, over what was expected, from which it is told; less noise than expected is no fault.
_EXPECTED = 1.2


@dataclass(frozen=True, eq=False)
class Consistency:
    """Test of the innovations of a filter.

    Attributes
    ----------
    mean_nis
        Mean innovation^2/S of the levels used; `first_mean_nis` before the noise of the level was adapted.
    band
        Where it should lie.
    autocorrelation
        Of the innovations over their standard deviation, lags 1 to k.
    noise_factor
        By what the variance of a level was multiplied for the mean NIS to be 1; 1 where it was as expected.
    widening
        Factor on standard errors for innovations that are correlated.
    rescale
        Factor on the variance of a level that the innovations ask for.
    """

    n: int
    mean_nis: float
    band: tuple[float, float]
    autocorrelation: np.ndarray
    noise_factor: float
    widening: float
    rescale: float

    @property
    def tested(self) -> bool:
        """Whether there were enough innovations."""
        return self.n >= _LEAST

    @property
    def passed(self) -> bool:
        """Whether the filter holds with the noise it was given, and its innovations are white."""
        as_expected = self.noise_factor < _EXPECTED and self.mean_nis <= self.band[1]
        return self.tested and as_expected and self.widening < 1.3

    @property
    def verdict(self) -> str:
        """What the test says, in a sentence without its stop."""
        if not self.tested:
            return f"the filter's errors are not tested: {self.n} innovations"
        told = f"mean NIS {self.mean_nis:.2f}"
        if self.noise_factor != 1.0:
            told = (
                f"a level scatters by {math.sqrt(self.noise_factor):.2f} times what was expected; with that noise the "
                f"mean NIS is {self.mean_nis:.2f}"
            )
        if self.widening >= 1.3:
            first = float(self.autocorrelation[0]) if self.autocorrelation.size else 0.0
            told += (
                f"; innovations are correlated (lag 1: {first:.2f}), so the errors are widened by {self.widening:.1f}"
            )
        return told


def consistency(y: np.ndarray, gated: np.ndarray, noise_factor: float = 1.0) -> Consistency:
    """Test innovations divided by their standard deviation, shape (n,), with those passed over marked.

    Examples
    --------
    >>> white = np.random.default_rng(0).normal(size=5000)
    >>> told = consistency(white, np.abs(white) > 3.0)
    >>> told.passed, round(told.mean_nis, 1)
    (True, 1.0)
    """
    from pipeline.estimation.uncertainty import autocovariance, effective_size

    used = y[~gated]
    n = int(used.size)
    if n < _LEAST:
        return Consistency(n, math.nan, _BAND, np.zeros(0), noise_factor, 1.0, 1.0)
    mean = float((used**2).mean()) / _MEAN_BELOW_GATE
    # Where many were passed over, the mean of those left tells too little: the median of all is used.
    robust = float(np.median(y**2)) / _MEDIAN
    rescale = mean if 0.5 < mean < 2.0 else robust
    covariance = autocovariance(used, min(_LAGS, n // 4))
    ratio = n / effective_size(used)
    spread = 1.96 * math.sqrt(2.0 / n)
    band = (min(_BAND[0], 1.0 - spread), max(_BAND[1], 1.0 + spread))
    return Consistency(
        n=n,
        mean_nis=mean,
        band=band,
        autocorrelation=covariance[1:] / covariance[0],
        noise_factor=noise_factor,
        widening=math.sqrt(ratio) if ratio > 1.2 else 1.0,
        rescale=rescale,
    )
