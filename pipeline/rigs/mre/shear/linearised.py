"""A fit of the dynamic model, linear about its optimum: what leaving runs out, or another column, would gain.

A few products of matrices instead of a fit for every set of runs; what it finds is to be confirmed by a fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.scatter import GainVectors, Scatter, estimate_scatter, gain_vectors, whitening
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.dynamic_model import HarmonicModel, real_rows

# Less scatter than this no rig has: what is left below it is not believed as the scale of a test.
LEAST_SCATTER = 3e-4


@dataclass(frozen=True)
class ColumnTest:
    """Columns added to a model: their coefficients and whether chance would give them.

    Attributes
    ----------
    coefficients, std_error
        Of the columns, and their standard errors, shape (k,).
    scatter
        Run scatter (1 sigma, relative) that is left with them.
    deviance
        -2 ln(restricted likelihood) with them; compare for equal numbers of columns only.
    chance
        Probability that k columns chosen beforehand gain as much where only scatter and noise are.
    """

    coefficients: np.ndarray
    std_error: np.ndarray
    scatter: float
    deviance: float
    chance: float


class Linearised:
    """Whitened residual, Jacobian (m, p) and gain vectors of a fit without run scatter."""

    def __init__(self, fit: DynamicFit, scatter_cap: float, mass: bool = False) -> None:
        """`mass` adds the column of an untared mass, so that it is not taken for something else."""
        added = mass and not fit.layout.mass
        layout = replace(fit.layout, mass=True) if added else fit.layout
        model = HarmonicModel(fit.loops, layout, fit.held_lag, tuple(fit.noise[loop.run] for loop in fit.loops))
        q = np.r_[np.log(fit.values[:2]), fit.values[2 : model.n_shape]]
        # The mass stands behind u, x, w.
        c = np.insert(fit.values[model.n_shape :], 3, 0.0) if added else fit.values[model.n_shape :]
        A, dA = model(q)
        jacobian = model.whitened(real_rows(np.hstack([(dA @ c).T, A])))
        norms = np.linalg.norm(jacobian, axis=0)
        self.jacobian = jacobian / np.where(norms > 0, norms, 1.0)
        self.residual = model.whitened(model.real_data - real_rows(A @ c))
        self.gains = gain_vectors(model.whitened(model.real_data) - self.residual, model.groups)
        self.groups, self.cap = model.groups, scatter_cap

    def deviance_at(self, fit: DynamicFit) -> float:
        """Return -2 ln(likelihood) of the fit itself at its run scatter, constants left out."""
        return fit.chi2 + float(np.log1p(fit.run_scatter**2 * self.gains.squares).sum())

    def without(self, runs: Sequence[int]) -> float:
        """Return chi2 per degree of freedom of the other runs, no run scatter, refitted to first order."""
        kept = ~np.isin(self.groups, runs)
        dof = int(kept.sum()) - self.jacobian.shape[1]
        return _chi2(self.residual[kept], self.jacobian[kept]) / dof if dof > 0 else np.inf

    def ranked_gains(self, sets: Sequence[tuple[int, ...]], scatter: float) -> list[tuple[int, ...]]:
        """Return sets of runs by how much chi2 falls with gains of their own, the most first."""
        whiten = whitening(self.gains, max(scatter, LEAST_SCATTER))
        basis, _ = np.linalg.qr(whiten(self.jacobian))
        Z, r = self.gains.shrunk(max(scatter, LEAST_SCATTER)), whiten(self.residual)
        taken = Z.across(basis)  # what the parameters take of each gain
        G = np.diag(Z.squares) - taken @ taken.T
        b = Z.across(r) - taken @ (basis.T @ r)

        def fall(chosen: tuple[int, ...]) -> float:
            own = list(chosen)
            return float(b[own] @ np.linalg.lstsq(G[np.ix_(own, own)], b[own], rcond=1e-9)[0])

        return sorted(sets, key=fall, reverse=True)

    def test_gains(self, own: Sequence[int], beside: Sequence[int] = ()) -> ColumnTest:
        """Test gains of their own for the runs `own`, where the runs `beside` have theirs already."""
        return self._test(self.gains.columns(own), list(beside), [*own, *beside])

    def test_trend(self, order: np.ndarray) -> ColumnTest:
        """Test a gain that changes linearly with `order`, shape (runs,)."""
        return self._test(self.gains.along(order)[:, None], [], [])

    def _test(self, columns: np.ndarray, beside: list[int], freed: list[int]) -> ColumnTest:
        """F-test of columns; the scale is what is left with them, of scatter and noise."""
        from scipy.special import fdtrc

        before = np.c_[self.jacobian, self.gains.columns(beside)]
        J = np.c_[before, columns]
        V = self.gains.without(freed)
        left: Scatter = estimate_scatter(self.residual, V, J, cap=self.cap)
        whiten = whitening(self.gains, max(left.value, LEAST_SCATTER))
        r, J_w = whiten(self.residual), whiten(J)
        rest, k = _chi2(r, J_w), columns.shape[1]
        noise = max(rest / max(r.size - J.shape[1], 1), 1.0)
        gained = (_chi2(r, whiten(before)) - rest) / noise
        scale = np.linalg.norm(J_w, axis=0)
        inverse = np.linalg.pinv(J_w / scale, rcond=1e-10)
        coefficients = (inverse @ r / scale)[-k:]
        sd = (np.linalg.norm(inverse, axis=1) / scale)[-k:] * np.sqrt(noise)
        dof = self._contrasts(V, J)
        chance = float(fdtrc(k, dof, max(gained, 0.0) / k)) if dof > 0.5 else 1.0
        return ColumnTest(coefficients, sd, left.value, left.deviance, chance)

    def _contrasts(self, V: GainVectors, J: np.ndarray) -> float:
        """Return how many differences of gain the parameters leave to be seen, were they as large as the cap."""
        whiten = whitening(V, self.cap)
        basis, _ = np.linalg.qr(whiten(J))
        seen = V.shrunk(self.cap)
        own, taken = self.cap**2 * seen.squares, self.cap * seen.across(basis)
        overlap = taken.T @ taken
        return float((own**2).sum() - 2 * (own * (taken**2).sum(axis=1)).sum() + (overlap**2).sum())


def _chi2(residual: np.ndarray, jacobian: np.ndarray) -> float:
    norms = np.linalg.norm(jacobian, axis=0)
    J = jacobian / np.where(norms > 0, norms, 1.0)
    left = residual - J @ np.linalg.lstsq(J, residual, rcond=1e-10)[0]
    return float(left @ left)
