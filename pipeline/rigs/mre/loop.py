"""One steady loop of force against displacement: its harmonics and the numbers read from it (mre.md 3.5).

No model of the material here, and no decision which part of a record is steady.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate

N_X, N_F = 5, 15  # harmonics of displacement and of force


@dataclass(frozen=True, eq=False)
class Loop:
    """Steady motion and force of one run: x(t) = x_mean + Re sum_h X_h exp(j h 2 pi f t), F likewise.

    Attributes
    ----------
    run, frequency
        Name of the run; fitted fundamental, Hz.
    X, F
        Harmonics 1..N_X of displacement (m) and 1..N_F of force (N), complex.
    sd_x, sd_f
        Standard deviation of the real and of the imaginary part of each, from the residual's level
        around that harmonic; shapes (N_X,) and (N_F,).
    kept
        Which force harmonics are data (False: next to a multiple of the mains frequency), (N_F,).
    x_mean, F_mean, sigma_x, sigma_f
        Means and residual standard deviations of the samples, m and N.
    n_samples, duration
        Samples used and their span, s.
    current, preload
        Mean measured coil current (A) and preload (N) of the run; None where not given.
    """

    run: str
    frequency: float
    X: np.ndarray
    F: np.ndarray
    sd_x: np.ndarray
    sd_f: np.ndarray
    kept: np.ndarray
    x_mean: float
    F_mean: float
    sigma_x: float
    sigma_f: float
    n_samples: int
    duration: float
    current: float | None = None
    preload: float | None = None

    @property
    def omega(self) -> float:
        """Angular frequency, rad/s."""
        return 2 * np.pi * self.frequency

    @property
    def amplitude(self) -> float:
        """Half peak-to-peak of the fitted displacement, m."""
        return half_range(self.X)


@dataclass(frozen=True)
class Pads:
    """Geometry for moduli: `count` pads in parallel, diameter and height in m."""

    diameter: float
    height: float
    count: float = 2.0


def half_range(coefficients: np.ndarray, points: int = 512) -> float:
    """Return half the peak-to-peak value of a harmonic series of shape (k,)."""
    raise NotImplementedError


def curve(coefficients: np.ndarray, points: int = 256) -> np.ndarray:
    """Return one cycle of the series at `points` equal phases 0..2 pi, shape (points,), without mean."""
    raise NotImplementedError


def fit_loop(
    run: str,
    time: np.ndarray,
    displacement: np.ndarray,
    force: np.ndarray,
    *,
    frequency: float | None = None,
    current: float | None = None,
    preload: float | None = None,
    mains: float = 50.0,
) -> Loop:
    """Fit the harmonics of a steady record (whole cycles are not needed; dropouts need no repair).

    `frequency` (Hz) is only a guess; the fundamental of the displacement is fitted.
    """
    raise NotImplementedError


def loop_metrics(
    loop: Loop,
    *,
    force_lag: float = 0.0,
    force_lag_sd: float = 0.0,
    run_scatter: float = 0.0,
    scatter_dof: float = float("inf"),
    pads: Pads | None = None,
) -> list[Estimate]:
    """Return the numbers read from one loop, each `at` {"run": ...}, force set right by `force_lag`.

    `stiffness_secant`, `stiffness_storage` (N/m), `damping` (N s/m), `loss_factor`, and with `pads`
    `shear_modulus_storage`, `shear_modulus_loss` (Pa); also `loop_area` (J), `amplitude` (m),
    `force_amplitude` (N). `run_scatter` (relative gain error of a run, 1 sigma) widens the intervals.
    """
    raise NotImplementedError


def half_cycle_metrics(
    run: str, displacement: np.ndarray, force: np.ndarray, *, pads: Pads | None = None
) -> list[Estimate]:
    """Return secant stiffness, loss ratio and lost work of one load-unload ramp (no steady loop)."""
    raise NotImplementedError


def group_levels(values: Sequence[float | None], tolerance: float) -> tuple[list[int], list[float]]:
    """Group measured levels (current, preload) that differ by less than `tolerance`.

    Returns the label of each value and the level of each label (mean rounded to 0.01, exactly 0 when
    within the tolerance of 0), labels in the order of rising level; None counts as 0.
    """
    raise NotImplementedError
