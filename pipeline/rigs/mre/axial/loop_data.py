"""What is fitted of one record and what a fit of the loop model is; `loop_fit` makes the one from the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import Covariance, t_quantile
from pipeline.rigs.mre.axial.loop import LoopModel
from pipeline.rigs.mre.axial.motion import Motion


@dataclass(frozen=True, eq=False)
class LoopData:
    """Samples of one record: time (s) and force (N), shape (n,), and the motion behind the gauge.

    `extra` are further linear columns, shape (n, j), such as a drift. `d_read` are the readings (m), used where the
    motion is not smooth. `start_spread` is how well first contact is known, m; 0 for to within a sample.
    """

    time: np.ndarray
    force: np.ndarray
    motion: Motion
    extra: np.ndarray
    extra_names: tuple[str, ...] = ()
    d_read: np.ndarray | None = None
    start_spread: float = 0.0


@dataclass(frozen=True, eq=False)
class Path:
    """Displacement from the first turn (m) and stroke of each sample, shape (n,), and the turns."""

    d: np.ndarray
    stroke: np.ndarray
    turns: np.ndarray
    times: np.ndarray


@dataclass(frozen=True, eq=False)
class LoopFit:
    """A fitted loop.

    Attributes
    ----------
    data, path, model, offset
        What was fitted; F_off in N.
    z, covariance
        All unknowns [ln rho, standing turns, k, k3, alpha, F_off, extra, motion] and their covariance.
    residual, sigma
        Of the force, N, shape (n,); its standard deviation.
    standing
        Which turns the press stood still at.
    effective
        How many independent samples the residual amounts to.
    rhos, chi2
        Misfit over sigma^2 along rho, all linear unknowns refitted, shape (m,) each.
    conditional
        Linear unknowns [k, k3, alpha, F_off, ...] at each of `rhos`, shape (m, p), and their standard errors.
    elastic
        Fit without hysteresis: (k, k3, F_off), their standard errors, and the misfit over sigma^2.
    """

    data: LoopData
    path: Path
    model: LoopModel
    offset: float
    z: np.ndarray
    covariance: Covariance
    residual: np.ndarray
    sigma: float
    standing: tuple[int, ...]
    effective: float
    rhos: np.ndarray
    chi2: np.ndarray
    conditional: np.ndarray
    conditional_error: np.ndarray
    elastic: tuple[np.ndarray, np.ndarray, float]
    unpack: Callable[[np.ndarray], tuple[LoopModel, np.ndarray]]

    @property
    def n(self) -> int:
        """Number of force samples."""
        return int(self.residual.size)

    @property
    def dof(self) -> float:
        """Degrees of freedom, of independent samples."""
        return float(max(self.effective - 5 - self.data.extra.shape[1], 1.0))


def within(fit: LoopFit, dof: float, level: float = 0.95) -> np.ndarray:
    """Return which of `fit.rhos` the data allow, shape (m,)."""
    return np.asarray(fit.chi2 <= fit.chi2.min() + t_quantile(dof, level) ** 2)
