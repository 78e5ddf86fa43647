"""Honest standard errors: what coloured residuals and run-to-run scatter do to a covariance.

Covariances for residuals that are correlated in time (effective sample size, Newey-West) or within
runs and cycles (cluster sandwich, jackknife), each with the degrees of freedom of its own error.
Resampling is in `bootstrap`, intervals in curved valleys in `profile`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Covariance:
    """A covariance matrix, shape (k, k), the degrees of freedom behind it, and how it was found."""

    matrix: np.ndarray
    dof: float = math.inf
    method: str = ""

    @property
    def std_error(self) -> np.ndarray:
        """Standard errors, shape (k,); NaN where a matrix that is none of variances gives no root."""
        variances = np.diag(self.matrix)
        return np.sqrt(np.where(variances >= 0.0, variances, np.nan))

    def intervals(self, values: np.ndarray, level: float = 0.95) -> np.ndarray:
        """Return the two-sided t intervals of `values`, shape (k, 2)."""
        half = t_quantile(self.dof, level) * self.std_error
        return np.stack([np.asarray(values) - half, np.asarray(values) + half], axis=-1)


def t_quantile(dof: float, level: float = 0.95) -> float:
    """Return the half-width, in standard errors, of a two-sided interval from Student's t.

    Examples
    --------
    >>> round(t_quantile(1), 2), round(t_quantile(math.inf), 3)
    (12.71, 1.96)
    """
    if level == 0.95 and not dof < 1e5:
        return 1.959963984540054  # spares the import
    from scipy.special import ndtri, stdtrit

    upper = 0.5 + 0.5 * level
    return float(ndtri(upper) if not math.isfinite(dof) else stdtrit(max(dof, 1.0), upper))


def autocovariance(residual: np.ndarray, lags: int) -> np.ndarray:
    """Return the autocovariance at lags 0..`lags`, shape (lags + 1,), mean removed, by FFT (biased form)."""
    centred = residual - residual.mean()
    size = 1 << math.ceil(math.log2(centred.size + lags + 1))
    spectrum = np.fft.rfft(centred, size)
    return np.asarray(np.fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[: lags + 1] / centred.size)


def effective_size(residual: np.ndarray, fitted: int = 1, least: float = 0.0) -> float:
    """Return how many independent samples carry as much on the mean as these correlated ones.

    The autocorrelation is summed over Geyer's initial monotone sequence (Statistical Science 7,
    1992, 473). Negative correlation is not rewarded: the result never exceeds the actual number.

    Parameters
    ----------
    residual
        In the order of time, shape (n,).
    fitted
        Slow columns (mean, trend, slow loads) that were fitted: each took its share of the low
        frequencies out of the residual, which is given back here.
    least
        Sums of two neighbouring autocorrelations up to this end the sequence; of few samples much above 0 is noise.

    Examples
    --------
    >>> white = np.random.default_rng(1).normal(size=4000)
    >>> effective_size(white) > 3500
    True
    >>> 70 < effective_size(np.repeat(white[:100], 40)) < 130  # each sample stands for forty
    True
    """
    n = int(residual.size)
    if n < 4:
        return float(n)
    covariance = autocovariance(residual, n // 2)
    if covariance[0] <= 0:
        return float(n)
    even = covariance.size // 2 * 2
    time = 1.0
    for _ in range(10):
        lost = fitted * time * covariance[0] / n
        correlation = (covariance[:even] + lost) / (covariance[0] + lost)
        pairs = correlation[0::2] + correlation[1::2]
        stop = int(np.argmax(pairs <= least)) if np.any(pairs <= least) else pairs.size
        before, time = time, max(2 * float(np.minimum.accumulate(pairs[:stop]).sum()) - 1, 1.0)
        if abs(time - before) < 0.01 * time or time > n / 4:
            break
    return max(n / time, 1.0)


def widened(covariance: np.ndarray, residual: np.ndarray) -> Covariance:
    """Widen a covariance that was scaled with white residuals by the residual's correlation time.

    The degrees of freedom n - k become those of the effective number of samples. Right for
    parameters that move slowly over the record (levels, trends, stiffness under a slow load); too
    wide for fast ones, where `newey_west` is the better choice.

    Parameters
    ----------
    covariance
        Of k parameters for white residuals, shape (k, k).
    residual
        In the order of time, shape (n,); NaN are left out.
    """
    kept = residual[np.isfinite(residual)]
    k = covariance.shape[0]
    dof = max(effective_size(kept, k) - k, 1.0)
    return Covariance(covariance * max((kept.size - k) / dof, 1.0), dof, "effective sample size")


def newey_west(jacobian: np.ndarray, residual: np.ndarray, lags: int | None = None) -> Covariance:
    """Return the sandwich covariance under residuals of any colour and changing variance.

    Bartlett weights (Newey and West, Econometrica 55, 1987, 703) on the scores after prewhitening by
    a first-order autoregression (Andrews and Monahan, Econometrica 60, 1992, 953); without
    prewhitening slow residuals come out up to three times too certain.

    Parameters
    ----------
    jacobian
        Of the residual, in the order of time, shape (n, k).
    residual
        At the optimum, shape (n,).
    lags
        Lags that count after prewhitening; by default 4 (n/100)^(2/9).
    """
    n, k = jacobian.shape
    lags = math.ceil(4 * (n / 100) ** (2 / 9)) if lags is None else lags
    scale = _column_norms(jacobian)
    columns = jacobian / scale
    scores = columns * residual[:, None]
    before, after = scores[:-1], scores[1:]
    # Each score by its own autoregression, its small-sample bias (Kendall 1954) mended, and held
    # below a unit root.
    memory = (before * after).sum(axis=0) / np.maximum((before**2).sum(axis=0), 1e-300)
    memory = np.clip(memory + (1 + 3 * memory) / n, -0.9, 1 - 4 / n)
    innovation = after - before * memory
    meat = innovation.T @ innovation
    for lag in range(1, min(lags, n - 2) + 1):
        product = innovation[lag:].T @ innovation[:-lag]
        meat += (1 - lag / (lags + 1)) * (product + product.T)
    recolour = 1 / (1 - memory)
    meat = meat * np.outer(recolour, recolour) * (n / max(n - k, 1))
    bread = np.linalg.inv(columns.T @ columns)
    matrix = bread @ meat @ bread / np.outer(scale, scale)
    # 0.8 n/(lags+1): Student's t then has the fixed-bandwidth quantile of Kiefer and Vogelsang (2005).
    dof = max(min(effective_size(residual, k) - k, 0.8 * n / (lags + 1)), 1.0)
    return Covariance(matrix, dof, f"Newey-West, {lags} lags, prewhitened")


def clustered(jacobian: np.ndarray, residual: np.ndarray, groups: Sequence[Hashable] | np.ndarray) -> Covariance:
    """Return the sandwich covariance for residuals that are correlated in any way within a group.

    Groups are runs or cycles. Each group's score is corrected for its own pull on the fit ("CR3",
    Bell and McCaffrey, Survey Methodology 28, 2002, 169), which makes it the linear form of the
    jackknife over groups; t with (groups - 1) degrees of freedom.

    Parameters
    ----------
    jacobian
        Of the residual, shape (n, k); columns that belong to one group only projected out before.
    residual
        Shape (n,).
    groups
        To which group each residual belongs, shape (n,).

    Raises
    ------
    ValueError
        If there are fewer than two groups, or one of them alone determines a parameter.
    """
    labels, member = np.unique(np.asarray(groups), return_inverse=True)
    if labels.size < 2:
        raise ValueError("a cluster covariance needs at least two groups")
    scale = _column_norms(jacobian)
    columns = jacobian / scale
    bread = np.linalg.inv(columns.T @ columns)
    meat = np.zeros_like(bread)
    for group in range(labels.size):
        rows = columns[member == group]
        pull = np.eye(bread.shape[0]) - rows.T @ rows @ bread
        if np.linalg.cond(pull) > 1e10:
            raise ValueError(f"group {labels[group]!r} alone determines a parameter, so its scatter cannot be told")
        score = np.linalg.solve(pull, rows.T @ residual[member == group])
        meat += np.outer(score, score)
    matrix = (labels.size - 1) / labels.size * (bread @ meat @ bread) / np.outer(scale, scale)
    return Covariance(matrix, labels.size - 1, f"sandwich over {labels.size} groups")


def jackknife(left_out: np.ndarray) -> Covariance:
    """Return the covariance from refits that each leave one group (run, cycle, setting) out.

    Parameters
    ----------
    left_out
        Estimates without group g, shape (groups, k).

    Notes
    -----
    (G-1)/G times the sum of squares about their mean (Tukey 1958), t with G - 1 degrees of freedom.

    Examples
    --------
    The jackknife of a mean is its textbook error:

    >>> x = np.array([1.0, 2.0, 4.0, 7.0])
    >>> means = np.array([[np.delete(x, i).mean()] for i in range(4)])
    >>> bool(np.isclose(jackknife(means).std_error[0], x.std(ddof=1) / 2))
    True
    """
    count = left_out.shape[0]
    if count < 2:
        raise ValueError("a jackknife needs at least two groups")
    centred = left_out - left_out.mean(axis=0)
    return Covariance((count - 1) / count * centred.T @ centred, count - 1, f"jackknife over {count} groups")


def propagate(
    function: Callable[[np.ndarray], np.ndarray | float], values: np.ndarray, covariance: Covariance
) -> tuple[np.ndarray, Covariance]:
    """Return ``function(values)`` and its covariance by the delta method.

    The function, of k values, gives a number or an array of shape (m,). It is differentiated by
    central differences of a tenth of a standard error along the principal axes of the covariance:
    so it is never asked far from what the data allow, however strongly the values are correlated.
    Where it is not finite on one side (a bound, a root of a negative number) the other side is used.

    Examples
    --------
    >>> value, spread = propagate(lambda p: p[0] * p[1], np.array([2.0, 3.0]), Covariance(np.diag([0.01, 0.04])))
    >>> float(value[0]), round(float(spread.std_error[0]), 6)  # sqrt(9 0.01 + 4 0.04)
    (6.0, 0.5)
    """
    values = np.asarray(values, dtype=float)
    centre = np.atleast_1d(np.asarray(function(values), dtype=float))
    sd = covariance.std_error
    safe = np.where(sd > 0, sd, 1.0)
    eigenvalues, vectors = np.linalg.eigh(covariance.matrix / np.outer(safe, safe))
    axes = safe[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    slopes = np.zeros((centre.size, values.size))
    for i, axis in enumerate(axes.T):
        if not axis.any():
            continue
        step = 0.1
        up = np.atleast_1d(np.asarray(function(values + step * axis), dtype=float))
        down = np.atleast_1d(np.asarray(function(values - step * axis), dtype=float))
        one_sided = np.where(np.isfinite(up), up - centre, centre - down) / step
        slopes[:, i] = np.where(np.isfinite(up) & np.isfinite(down), (up - down) / (2 * step), one_sided)
    return centre, Covariance(slopes @ slopes.T, covariance.dof, f"delta method from {covariance.method or 'a fit'}")


def _column_norms(jacobian: np.ndarray) -> np.ndarray:
    norms = np.sqrt((jacobian**2).sum(axis=0))
    return np.where(norms > 0, norms, 1.0)
