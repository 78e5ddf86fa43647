"""What a fit of the dynamic model yields: parameters with errors, quality, and the model to evaluate.

Made by `harmonic_fit`; nothing is fitted here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.estimation.scatter import Scatter
from pipeline.rigs.mre.model.dynamic_model import HarmonicColumns, Layout, Shape
from pipeline.rigs.mre.model.fit_errors import Errors
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics


@dataclass(frozen=True)
class VariantFit:
    """How one variant fits: for the comparison of models.

    `chi2` is the weighted sum of squares without run scatter; `aicc` and `bic` allow each variant the
    scatter that suits it best (mains harmonics left out). `rms_residual` (N) and `nrmse` are over all runs.
    """

    variant: str
    n_parameters: int
    n_data: int
    chi2: float
    dof: int
    deviance: float
    aicc: float
    bic: float
    rms_residual: float
    nrmse: float


@dataclass(frozen=True, eq=False)
class DynamicFit:
    """One variant of the dynamic model fitted to all loops.

    Attributes
    ----------
    layout, reference_current
        Which field terms and the currents (A) that the loops were grouped into; the current whose field
        terms are zero by definition (None: no current known). Where that is not 0 A, k2 stands for
        k2 + k_MR there.
    estimates
        `tau rho c_bw n_bw force_lag k1 s1 k2 alpha_bw moving_mass run_scatter`, `k_mr s_mr` at
        {"coil_current": ...} as the variant has them, and the sums `k1_plus_k2`, `k2_plus_alpha_rho`
        with their own errors. `ka`, `ksa` tell alpha_bw, `km` k1, at every current. Undetermined ones
        have no value.
    names, values, errors, information, correlation, condition
        Of the free parameters, natural units, in one order: `information` is the Fisher information of these runs, with
        their noise and run scatter; condition number of the column-scaled Jacobian.
    statements
        What is determined and what is not, in plain sentences.
    chi2, dof, chi2_by_run, gain_by_run, nrmse_by_run
        Weighted sum of squares (run scatter accounted for) and degrees of freedom; per run chi2 over
        its number of data *without* scatter, the run's estimated relative gain error, and rms misfit
        over rms of the measured force about its mean.
    scatter, noise
        Run scatter; whitening matrix of each run's rows (real parts of the kept harmonics, then imaginary).
    rejected, inadmissible, at_bound
        Whether the residual is no noise even with scatter; determined parameters whose sign is
        impossible (k1, k2, alpha_bw < 0); parameters at a bound.
    starts_agreeing
        Starts that ended in this optimum, and starts tried.
    """

    loops: tuple[Loop, ...]
    layout: Layout
    reference_current: float | None
    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    values: np.ndarray
    held_lag: float | None
    errors: Errors
    information: np.ndarray
    correlation: np.ndarray
    condition: float
    statements: tuple[str, ...]
    undetermined: tuple[str, ...]
    at_bound: tuple[str, ...]
    inadmissible: tuple[str, ...]
    chi2: float
    dof: int
    chi2_by_run: Mapping[str, float]
    gain_by_run: Mapping[str, float]
    nrmse_by_run: Mapping[str, float]
    rms_residual: float
    nrmse: float
    n_data: int
    scatter: Scatter
    noise: Mapping[str, np.ndarray]
    rejected: bool
    starts_agreeing: tuple[int, int]

    @property
    def variant(self) -> str:
        """ks, ka, km, k, ksa, or base where there is one current only."""
        return self.layout.variant

    @property
    def levels(self) -> tuple[float, ...]:
        """Currents (A) that the loops were grouped into."""
        return self.layout.levels

    @property
    def run_scatter(self) -> float:
        """Relative gain error of one run, 1 sigma."""
        return self.scatter.value

    @property
    def n_parameters(self) -> int:
        """Free parameters, nonlinear and linear."""
        return len(self.names)

    @property
    def force_lag(self) -> Estimate:
        """The lag, fitted or held (then without error)."""
        if self.held_lag is None:
            return self.one("force_lag")
        return Estimate("force_lag", self.held_lag, 0.0, (self.held_lag, self.held_lag), reason="given")

    def one(self, name: str, coil_current: float | None = None) -> Estimate:
        """Return the estimate of that name (at that current); LookupError where there is none."""
        at = {} if coil_current is None else {"coil_current": coil_current}
        found = [e for e in self.estimates if e.name == name and dict(e.at) == at]
        if len(found) != 1:
            raise LookupError(f"{len(found)} estimates are called '{name}' at {at}")
        return found[0]

    def level_of(self, current: float | None) -> int:
        """Return the index of the level nearest to a current (A); the reference where it is None."""
        if current is None or self.reference_current is None:
            return self.layout.reference
        return int(np.argmin(np.abs(np.array(self.levels) - current)))

    def force(
        self, X: np.ndarray, frequency: float, current: float | None = None, values: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the modelled force harmonics (N_F,) for displacement harmonics X (m), lag included.

        `values` replaces the fitted parameters (in the order of `names`).
        """
        values = self.values if values is None else values
        nonlinear = len(self.names) - len(self.layout.terms)
        lag = float(values[4]) if self.held_lag is None else self.held_lag
        level = self.level_of(current)
        prepared = HarmonicColumns(np.asarray(X, dtype=complex)[None], np.array([frequency]))
        columns, _ = prepared(Shape(*(float(v) for v in values[:4])))
        F = np.zeros(prepared.orders.size, dtype=complex)
        for term, coefficient in zip(self.layout.terms, values[nonlinear:], strict=True):
            if term.level in (None, level):
                F += coefficient * columns[term.column][0]
        return np.asarray(F * np.exp(-1j * prepared.angular[0] * lag))

    def predicted(self, loop: Loop) -> np.ndarray:
        """Return the modelled force harmonics (N_F,) for the motion of a loop, lag included."""
        return self.force(loop.X, loop.frequency, loop.current)

    def loop_at(self, loop: Loop, amplitude: float, frequency: float) -> Mapping[str, float]:
        """Return what `loop_metrics` names for the motion of a loop at another amplitude (m) and frequency (Hz), no lag.

        The motion keeps its harmonics: they move the loss by some per cent.
        """
        X = loop.X * (amplitude / loop.amplitude)
        F = self.force(X, frequency, loop.current)
        # A lag that the data leave open is taken out of no measured loop either.
        lag = (self.force_lag.value or 0.0) if self.held_lag is None else self.held_lag
        moved = replace(loop, frequency=frequency, X=X, F=F)
        return {e.name: float(e.value or 0.0) for e in loop_metrics(moved, force_lag=lag)}
