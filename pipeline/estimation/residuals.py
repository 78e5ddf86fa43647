"""Is what the model leaves over only noise? Tests on residuals, each with a number and a verdict.

A small p-value says that a departure exists, not that it matters: with 10^5 samples every model of a
real rig is rejected. So each verdict also tells the size of the departure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import autocovariance, effective_size

# Below it a departure is called one; 1 in 100 good residuals are then called bad.
SIGNIFICANCE = 0.01


@dataclass(frozen=True)
class Check:
    """One test: its statistic, the p-value of "only noise", whether it passes, and what that means."""

    name: str
    statistic: float
    p_value: float
    passed: bool
    verdict: str


def runs_test(residual: np.ndarray) -> Check:
    """Test whether signs change as often as by chance (Wald and Wolfowitz 1940); statistic is z.

    `residual` has shape (n,), in the order of time or of the variable that the model may have wrong.
    NaN and values equal to the median are left out.

    Examples
    --------
    >>> runs_test(np.sin(np.linspace(0, 6, 60))).passed
    False
    """
    kept = residual[np.isfinite(residual)]
    above = (kept - np.median(kept))[kept != np.median(kept)] > 0 if kept.size else np.zeros(0, dtype=bool)
    first, second = int(above.sum()), int((~above).sum())
    n = first + second
    if first < 2 or second < 2 or n < 10:
        return _untested("runs", n, 10)
    runs = 1 + int(np.count_nonzero(above[1:] != above[:-1]))
    expected = 1 + 2 * first * second / n
    spread = math.sqrt((expected - 1) * (expected - 2) / (n - 1))
    z = (runs - expected) / spread
    p = _two_sided(z)
    if p >= SIGNIFICANCE:
        return Check("runs", z, p, True, f"signs change as by chance ({runs} runs, {expected:.0f} expected)")
    word = "seldom: the model misses a slow part" if z < 0 else "often: the residual oscillates from sample to sample"
    return Check("runs", z, p, False, f"signs change too {word} ({runs} runs, {expected:.0f} expected)")


def whiteness(residual: np.ndarray, fitted: int = 0, lags: int | None = None) -> Check:
    """Test the first autocorrelations together (Ljung and Box, Biometrika 65, 1978, 297); statistic is Q.

    Parameters
    ----------
    residual
        In the order of time, shape (n,); NaN are closed up.
    fitted
        Parameters fitted to these samples; degrees of freedom are lags minus these, at least 1.
    lags
        By default min(10, n/5).
    """
    kept = residual[np.isfinite(residual)]
    n = kept.size
    if n < 12 or not kept.std() > 0:
        return _untested("whiteness", n, 12)
    lags = min(10, n // 5) if lags is None else min(lags, n - 1)
    covariance = autocovariance(kept, lags)
    correlation = covariance[1:] / covariance[0]
    q = float(n * (n + 2) * (correlation**2 / (n - np.arange(1, lags + 1))).sum())
    p = _chi2_above(q, max(lags - fitted, 1))
    if p >= SIGNIFICANCE:
        return Check("whiteness", q, p, True, f"not correlated in time (lag 1: {correlation[0]:+.2f})")
    effective = effective_size(kept)
    verdict = f"correlated in time (lag 1: {correlation[0]:+.2f}); {n} samples count as {effective:.0f}"
    return Check("whiteness", q, p, False, verdict)


def chi_square(chi2: float, dof: int) -> Check:
    """Test the sum of squared residuals over their *known* sigma; statistic is chi2/dof.

    Too small is told as well: sigma is then overstated or the model fits noise.

    Examples
    --------
    >>> chi_square(103.0, 100).verdict
    'residuals are as large as the noise (chi2/dof 1.03)'
    """
    if dof < 1:
        return _untested("chi-square", dof, 1)
    reduced = chi2 / dof
    above = _chi2_above(chi2, dof)
    p = min(1.0, 2 * min(above, 1 - above))
    if p >= SIGNIFICANCE:
        return Check("chi-square", reduced, p, True, f"residuals are as large as the noise (chi2/dof {reduced:.3g})")
    ratio = math.sqrt(reduced)
    if reduced > 1:
        verdict = (
            f"residuals are {ratio:.3g} times the noise (chi2/dof {reduced:.3g}): the model does not hold everything"
        )
    else:
        verdict = f"residuals are only {ratio:.3g} of the noise (chi2/dof {reduced:.3g}): the noise is overstated"
    return Check("chi-square", reduced, p, False, verdict)


def normality(residual: np.ndarray) -> Check:
    """Test skewness and kurtosis together (D'Agostino and Pearson, Biometrika 60, 1973, 613).

    Statistic is K^2. The p-value holds for uncorrelated residuals: test `whiteness` first.
    """
    kept = residual[np.isfinite(residual)]
    if kept.size < 20 or not kept.std() > 0:
        return _untested("normality", kept.size, 20)
    from scipy.stats import normaltest

    result = normaltest(kept)
    k2, p = float(result.statistic), float(result.pvalue)
    z = (kept - kept.mean()) / kept.std()
    skewness, excess = float((z**3).mean()), float((z**4).mean() - 3)
    numbers = f"skewness {skewness:+.2f}, excess kurtosis {excess:+.2f}"
    if p >= SIGNIFICANCE:
        return Check("normality", k2, p, True, f"normally distributed ({numbers})")
    form = (
        "lopsided"
        if abs(skewness) > max(0.5, excess / 4)
        else "heavy-tailed"
        if excess > 0
        else "flat, as a sine or a limit"
    )
    return Check("normality", k2, p, False, f"not normally distributed: {form} ({numbers})")


def _untested(name: str, have: int, need: int) -> Check:
    return Check(name, math.nan, math.nan, True, f"not tested: {have} usable residuals, at least {need} needed")


def _two_sided(z: float) -> float:
    return math.erfc(abs(z) / math.sqrt(2))


def _chi2_above(chi2: float, dof: float) -> float:
    from scipy.special import chdtrc

    return float(chdtrc(dof, chi2))
