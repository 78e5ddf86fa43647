"""Separable fit of the dynamic model to records that are not periodic (random, chirp), sample by sample.

Periodic runs go through `harmonic_fit`, which is faster and treats noise on x better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Record:
    """Displacement (m) and force (N) over time (s), shape (n,) each; current (A) where known."""

    run: str
    time: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    current: float | None = None


@dataclass(frozen=True)
class TimeOptions:
    """How to fit: `cutoff` (Hz) of the zero-phase low-pass on x and F, None = from the spectrum of x.

    `viscous` adds a column x' (s_MR); `drift` a straight line per run.
    """

    cutoff: float | None = None
    drift: bool = False
    viscous: bool = False
    fit_lag: bool = True
    force_lag: float = 0.0
    fit_mass: bool = False
    starts: int = 4
    seed: int = 0


@dataclass(frozen=True, eq=False)
class TimeFit:
    """The model fitted to whole records, and how the fit of the first half predicts the second.

    `estimates` as in `harmonic_fit.DynamicFit`; `time`, `displacement`, `force`, `model` per run are
    the filtered series that were compared; `effective_fraction` is the effective over the actual
    number of residuals.
    """

    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    condition: float
    at_bound: tuple[str, ...]
    undetermined: tuple[str, ...]
    rms_residual: float
    nrmse: float
    nrmse_first_half: float
    nrmse_second_half: float
    nrmse_by_run: Mapping[str, float]
    n_data: int
    n_parameters: int
    aicc: float
    bic: float
    effective_fraction: float
    cutoff: float
    series: Mapping[str, Mapping[str, np.ndarray]]


def fit_records(records: Sequence[Record], options: TimeOptions | None = None) -> TimeFit:
    """Fit the model to one or more records (model of 3.6; one current, or field terms per current)."""
    raise NotImplementedError
