"""Do records that ought to agree agree, and if not: is it as one gain that is off would make it?

Each record was fitted on its own; here their values are held against their covariances. Nothing is refitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.rich.fits import RichFit

# What the gain of a record's force multiplies; tau, rho, C, n and the lag it leaves alone.
OF_FORCE = frozenset({"k1", "k2", "alpha_bw", "s_mr"})
_SURE = 0.01
# A gain takes so much off chi2, is at least so large, and leaves no more than chance, or so much a degree of freedom.
_GAIN_SURE, _LEAST_GAIN, _CHANCE, _REST = 25.0, 2e-3, 1e-4, 3.0
_APART = 3.0  # standard errors


_SYMBOLS = {"alpha_bw": "a_BW", "c_bw": "C", "n_bw": "n", "s_mr": "s_MR", "force_lag": "lag"}


def symbol(name: str) -> str:
    """Return how prose writes a parameter."""
    return _SYMBOLS.get(name, name)


@dataclass(frozen=True, eq=False)
class Comparison:
    """chi2 of the differences about the common values, its degrees of freedom and p.

    `own`, `own_sd`, `deviations` have shape (records, names), `common` and `common_sd` (names,); deviations are
    (own - common) over the standard error of that difference. `gains` are by run, relative to the others, where
    one factor on the force makes the records agree, else empty; `gain_sd` is the error of one of them.
    """

    runs: tuple[str, ...]
    names: tuple[str, ...]
    chi2: float
    dof: int
    p_value: float
    common: np.ndarray
    common_sd: np.ndarray
    own: np.ndarray
    own_sd: np.ndarray
    deviations: np.ndarray
    gains: dict[str, float]
    gain_sd: float

    @property
    def agrees(self) -> bool:
        """Tell whether the differences are no more than chance (1 %)."""
        return self.p_value >= _SURE

    @property
    def apart(self) -> tuple[str, ...]:
        """Names that differ by themselves, the surest first; the surest alone where none does."""
        mean = (self.own / self.own_sd**2).sum(axis=0) / (1 / self.own_sd**2).sum(axis=0)
        worst = np.abs((self.own - mean) / self.own_sd).max(axis=0)
        limit = min(_APART, float(worst.max()))
        return tuple(self.names[i] for i in np.argsort(-worst) if worst[i] >= limit)


def compared(fits: Sequence[RichFit], names: Sequence[str]) -> Comparison:
    """Compare the values of these parameters over records that all determine them."""
    index = [[fit.batch.names.index(name) for name in names] for fit in fits]
    scale = np.abs(fits[0].batch.values[index[0]])
    own = np.array([fit.batch.values[i] / scale for fit, i in zip(fits, index, strict=True)])
    spreads = [
        fit.batch.errors.covariance[np.ix_(i, i)] / np.outer(scale, scale) for fit, i in zip(fits, index, strict=True)
    ]
    weights = [np.linalg.inv(spread) for spread in spreads]
    chi2, common, spread = _about_common(own, weights, [])
    dof = (len(fits) - 1) * len(names)
    p_value = _chance(chi2, dof)
    sd = [np.sqrt(np.maximum(np.diag(s) - np.diag(spread), 1e-300)) for s in spreads]
    gains, gain_sd = _gains([fit.run for fit in fits], names, own, weights, chi2) if p_value < _SURE else ({}, 0.0)
    return Comparison(
        runs=tuple(fit.run for fit in fits),
        names=tuple(names),
        chi2=chi2,
        dof=dof,
        p_value=p_value,
        common=common * scale,
        common_sd=np.sqrt(np.diag(spread)) * scale,
        own=own * scale,
        own_sd=np.array([np.sqrt(np.diag(s)) for s in spreads]) * scale,
        deviations=(own - common) / np.array(sd),
        gains=gains,
        gain_sd=gain_sd,
    )


def _chance(chi2: float, dof: int) -> float:
    from scipy.special import gammaincc

    return float(gammaincc(dof / 2, chi2 / 2))


def _about_common(
    own: np.ndarray, weights: Sequence[np.ndarray], free: Sequence[tuple[int, np.ndarray]]
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return chi2, common values and factors, and their covariance; `free` are (record, column) of a factor each."""
    size = own.shape[1]
    normal, right = np.zeros((size + len(free),) * 2), np.zeros(size + len(free))
    designs = []
    for i, weight in enumerate(weights):
        design = np.hstack([np.eye(size), *((c if j == i else 0 * c)[:, None] for j, c in free)])
        designs.append(design)
        normal += design.T @ weight @ design
        right += design.T @ weight @ own[i]
    spread = np.linalg.inv(normal)
    values = spread @ right
    left = [v - design @ values for v, design in zip(own, designs, strict=True)]
    return float(sum(v @ w @ v for v, w in zip(left, weights, strict=True))), values, spread


def _gains(
    runs: Sequence[str], names: Sequence[str], own: np.ndarray, weights: Sequence[np.ndarray], chi2: float
) -> tuple[dict[str, float], float]:
    """Return the gains that make the records agree: of one record if that will do, else of all but the first."""
    force = np.array([name in OF_FORCE for name in names])
    if force.sum() < 2 or force.all():
        return {}, 0.0
    column = np.where(force, np.median(own, axis=0), 0.0)
    singles = [[i] for i in range(len(runs))]
    groups = [singles, [list(range(1, len(runs)))]] if len(runs) > 2 else [singles]
    for tries in groups:
        best: tuple[float, dict[str, float], float] | None = None
        for group in tries:
            left, values, spread = _about_common(own, weights, [(i, column) for i in group])
            found = dict(zip((runs[i] for i in group), values[len(names) :].tolist(), strict=True))
            # A change of the field's doing may lie near: gains must leave nearly nothing of the differences.
            dof = (len(runs) - 1) * len(names) - len(group)
            nothing_left = _chance(left, dof) >= _CHANCE or left < _REST * dof
            seen = chi2 - left > _GAIN_SURE * len(group) and max(map(abs, found.values())) > _LEAST_GAIN
            if seen and nothing_left and (best is None or left < best[0]):
                best = left, found, float(np.sqrt(np.diag(spread)[len(names) :]).max())
        if best is not None:
            return best[1], best[2]
    return {}, 0.0
