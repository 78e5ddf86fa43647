"""Up to which load does the bearing count as linear: harmonic distortion of the orbit against the load ratio.

What the load's own harmonics explain is taken out first, and the noise of the bins as well. Distortion of a
linear bearing is 0 whatever its coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.harmonics import ORDERS, Harmonics, circularity, harmonics
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit
from pipeline.rigs.tpjb.rotating.orbit import Orbit

LEVEL, MARGINAL = 0.05, 0.025
_SAMPLES = 64
_RATIOS = (0.02, 0.4)
_DRAWS = 200
# A load that is no circle mixes other products into 2X: what its backward part over the forward one costs.
_ELLIPTIC = 0.5


@dataclass(frozen=True, eq=False)
class Distortion:
    """Harmonic distortion of one run.

    Attributes
    ----------
    value, std_error
        THD_nl: what the linear bearing and the load's harmonics do not explain, over 1X. The error
        holds noise and what a load that is no circle makes of it.
    floor
        What noise alone would show (already taken off `value`).
    raw
        Distortion of the displacement as it stands.
    load
        Distortion of the load; above a third of `value` the verdict is weak.
    amplitude
        1X amplitude of the displacement, m: root of |Z_1|^2 + |Z_-1|^2.
    nonlinear
        Harmonics of d - K^-1 f.
    """

    value: float
    std_error: float
    floor: float
    raw: float
    load: float
    amplitude: float
    nonlinear: Harmonics

    @property
    def verdict(self) -> str:
        """Return "linear", "marginal" or "nonlinear" (2.5 and 5 %)."""
        return "linear" if self.value < MARGINAL else "marginal" if self.value < LEVEL else "nonlinear"


def nonlinear_distortion(orbit: Orbit, K: np.ndarray) -> Distortion:
    """Return the harmonic distortion of a run's steady turns that is the bearing's own.

    THD_nl = sqrt(sum |Z_k(d - K^-1 f)|^2 - noise) / sqrt(|Z_1|^2 + |Z_-1|^2), 2 <= |k| <= 6 (tpjb.md
    section 5, linear limit).

    Parameters
    ----------
    K
        Stiffness at the equilibrium, shape (2, 2), N/m: from the best model or from a dynamic test.

    Raises
    ------
    InputError
        If fewer than 1.5 turns are steady.
    """
    steady = orbit.part(orbit.rotation.steady)
    frequency = orbit.rotation.frequency
    motion = harmonics(steady.time, steady.displacement, frequency)
    load = harmonics(steady.time, steady.force, frequency)
    own = harmonics(steady.time, steady.displacement - np.linalg.solve(K, steady.force), frequency)
    higher = np.abs(own.k) > 1
    # Two sides of each order see the same noise: one level for all higher bins is steadier than ten.
    variance = float(np.mean(own.sigma[higher] ** 2))
    bins = int(higher.sum())
    power = float((np.abs(own.Z[higher]) ** 2).sum())
    first = float((np.abs(motion.Z[~higher]) ** 2).sum())
    net = max(power - bins * variance, 0.0)
    # |Z + n|^2 has the variance 2 |Z|^2 s^2 + s^4; s^2 itself is known from four lines an order.
    spread = math.sqrt(2 * net * variance + 1.25 * bins * variance**2)
    value = math.sqrt(net / first)
    floor = math.sqrt(bins * variance / first)
    by_noise = spread / (2 * math.sqrt(first * net)) if net > spread else math.sqrt(spread / first)
    std_error = math.hypot(by_noise, _ELLIPTIC * circularity(load) * value)
    return Distortion(value, std_error, floor, motion.distortion(), load.distortion(), math.sqrt(first), own)


def model_distortion(p: np.ndarray, size: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """Return distortion and 1X amplitude (m) of the orbit under a circular load, shapes of `size` (N).

    Parameters
    ----------
    p
        Coefficients, shape (10,), or (10, ...) that broadcasts with `size`.

    Returns
    -------
    NaN where the load passes the fold.
    """
    angle = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    size = np.asarray(size, dtype=float)[..., None]
    d = law.equilibrium(p[..., None] if p.ndim > 1 else p, np.stack([size * np.cos(angle), size * np.sin(angle)]))
    Z = np.fft.fft(d[0] + 1j * d[1], axis=-1) / _SAMPLES
    first = np.abs(Z[..., 1]) ** 2 + np.abs(Z[..., -1]) ** 2
    higher = (np.abs(Z[..., 2 : ORDERS + 1]) ** 2).sum(axis=-1) + (np.abs(Z[..., -ORDERS:-1]) ** 2).sum(axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):  # an orbit of no size has no distortion
        return np.asarray(np.sqrt(higher / first)), np.asarray(np.sqrt(first))


@dataclass(frozen=True)
class Limit:
    """Load ratio at which the distortion reaches a level; None with the reason where it cannot be told.

    `displacement` is the 1X amplitude there, m; `extrapolated` tells that no run went as far.
    """

    level: float
    ratio: float | None
    std_error: float | None = None
    ci95: tuple[float, float] | None = None
    displacement: float | None = None
    extrapolated: bool = False
    reason: str = ""


def linear_limit(fit: ModelFit, static_load: float, level: float = LEVEL, seed: int = 0) -> Limit:
    """Return the load ratio at which the model's orbit reaches a distortion, with the error from draws.

    Parameters
    ----------
    fit
        The best model; coefficients are drawn from its covariance.
    static_load
        W, N.
    level
        Of THD, 0.05 by default.
    """
    if fit.model.is_linear:
        return Limit(level, None, reason=f"{fit.name} is linear: the orbits show no distortion to extrapolate from")
    ratio = float(ratio_at(fit.p, static_load, level))
    largest = max(orbit.rotation.size for orbit in fit.orbits) / static_load
    if not math.isfinite(ratio):
        return Limit(
            level, None, reason=f"the model stays below {100 * level:g} % up to a load ratio of {_RATIOS[1]:g}"
        )
    rng = np.random.default_rng(seed)
    scale = fit.model.scale
    draws = rng.multivariate_normal(
        fit.theta / scale, fit.covariance.matrix / np.outer(scale, scale), size=_DRAWS, method="svd"
    )
    drawn = ratio_at(fit.model.matrix @ (draws * scale).T, static_load, level)
    told = np.isfinite(drawn)
    _, amplitude = model_distortion(fit.p, ratio * static_load)
    if told.mean() < 0.9:
        return Limit(level, None, reason="the coefficients are too uncertain to tell where the orbit bends")
    error = float(drawn[told].std(ddof=1))
    half = t_quantile(fit.covariance.dof) * error
    return Limit(level, ratio, error, (ratio - half, ratio + half), float(amplitude), ratio > 1.02 * largest)


def ratio_at(p: np.ndarray, static_load: float, level: float) -> np.ndarray:
    """Return the load ratio of a distortion by halving, shape p.shape[1:]; infinite above 0.4, NaN past the fold.

    Distortion rises with the load up to the fold, so a load past it counts as above the level.
    """
    shape = p.shape[1:]
    low, high = (np.full(shape, ratio) for ratio in _RATIOS)

    def above(ratio: np.ndarray) -> np.ndarray:
        value, _ = model_distortion(p, ratio * static_load)
        return np.asarray(~(value < level))

    found = above(high)
    for _ in range(16):
        middle = 0.5 * (low + high)
        over = above(middle)
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    middle = np.where(found, 0.5 * (low + high), np.inf)
    folds = found & np.isnan(model_distortion(p, 1.001 * np.where(found, middle, 0.0) * static_load)[0])
    return np.asarray(np.where(folds, np.nan, middle))
