"""Global separable fit of the dynamic model to the harmonics of all loops (mre.md section 5).

Periodic runs only; records that are not periodic go through `time_fit`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.loop import Loop

VARIANTS = ("ks", "ka", "km", "k", "ksa")


@dataclass(frozen=True)
class FitOptions:
    """How to fit.

    `force_lag` (s) is held when `fit_lag` is False; `moving_mass` (kg) is subtracted, `fit_mass` adds
    its column. `scatter` allows a run-to-run gain scatter up to `scatter_cap`.
    """

    variants: tuple[str, ...] = VARIANTS
    fit_lag: bool = True
    force_lag: float = 0.0
    fit_mass: bool = False
    moving_mass: float = 0.0
    scatter: bool = True
    scatter_cap: float = 0.02
    current_tolerance: float = 0.25
    starts: int = 8
    seed: int = 0


@dataclass(frozen=True, eq=False)
class DynamicFit:
    """One variant of the dynamic model fitted to all loops.

    Attributes
    ----------
    variant, levels, reference_current
        Which field terms; the currents (A) with field terms of their own; the current whose field
        terms are zero by definition (None: no current known).
    estimates
        `k1 s1 k2 alpha_bw rho c_bw n_bw tau force_lag run_scatter moving_mass`, `k_mr s_mr alpha_mr
        k1_mr` at {"coil_current": ...} as the variant has them, and the sums `k1_plus_k2`,
        `k2_plus_alpha_rho` (always there, with their own errors). Undetermined ones have no value.
    names, values, covariance, correlation, condition
        Of the free parameters, natural units, in one order; condition number of the column-scaled
        Jacobian.
    """

    variant: str
    loops: tuple[Loop, ...]
    levels: tuple[float, ...]
    reference_current: float | None
    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    condition: float
    chi2: float
    dof: int
    chi2_by_run: Mapping[str, float]
    nrmse_by_run: Mapping[str, float]
    rms_residual: float
    nrmse: float
    aicc: float
    bic: float
    n_data: int
    n_parameters: int
    run_scatter: float
    scatter_at_cap: bool
    rejected: bool
    at_bound: tuple[str, ...]
    undetermined: tuple[str, ...]
    starts_agreeing: tuple[int, int]

    def one(self, name: str, coil_current: float | None = None) -> Estimate:
        """Return the estimate of that name (at that current); LookupError where there is none."""
        raise NotImplementedError

    def force(self, X: np.ndarray, frequency: float, current: float | None = None) -> np.ndarray:
        """Return the modelled force harmonics (N_F,) for displacement harmonics X (m), lag included."""
        raise NotImplementedError

    def predicted(self, loop: Loop) -> np.ndarray:
        """Return the modelled force harmonics (N_F,) of one of the loops (its own motion), lag included."""
        raise NotImplementedError

    def loop_at(self, amplitude: float, frequency: float, current: float | None = None) -> Mapping[str, float]:
        """Return what `loop_metrics` names for a pure sine of that amplitude (m), no lag: model lines."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Identification:
    """All variants fitted to the same loops; `selected` is the one with the smallest BIC."""

    selected: DynamicFit
    variants: tuple[DynamicFit, ...]


def identify_loops(loops: Sequence[Loop], options: FitOptions | None = None) -> Identification:
    """Fit every variant that the currents allow and choose by BIC; one loop is enough to be called."""
    raise NotImplementedError


def leave_one_out(fit: DynamicFit, options: FitOptions | None = None) -> LeaveOneOut:
    """Refit without each run in turn."""
    raise NotImplementedError


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Fits without each run in turn.

    `values` (runs, parameters) in the order of `DynamicFit.names`, NaN where that parameter needs the
    run; `std_error` (parameters,) by the jackknife; `chi2_without` and `prediction_nrmse` by run (the
    latter NaN where the rest cannot predict it); `cv_error` over all predictable runs.
    """

    values: np.ndarray
    std_error: np.ndarray
    chi2_without: Mapping[str, float]
    prediction_nrmse: Mapping[str, float]
    cv_error: float
