"""Do records of several currents agree in what the field is said to leave alone? A test of the paper's assumption.

k1, s1, a_BW, rho, C, n are taken for independent of the current (mre.md 3.6). Each record is fitted on its own;
here their differences are held against their errors. Nothing is refitted, and nothing reported changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.rich.fits import RichFit

SHARED = ("k1", "tau", "alpha_bw", "rho", "c_bw", "n_bw")
_SURE = 0.01


@dataclass(frozen=True, eq=False)
class Agreement:
    """chi2 of the differences about the common values, its degrees of freedom and p; common values with errors.

    `deviations` (records, names) are (own - common) over the standard error of that difference.
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

    @property
    def agrees(self) -> bool:
        """Tell whether the differences are no more than chance (1 %)."""
        return self.p_value >= _SURE


def agreement_of(fits: Sequence[RichFit]) -> Agreement | None:
    """Compare records at different currents; None where there are fewer than two that determine anything alike."""
    good = [fit for fit in fits if fit.current is not None and not fit.batch.inadmissible and not fit.linear]
    if len({fit.current for fit in good}) < 2:
        return None
    names = tuple(n for n in SHARED if all(n in f.batch.names and n not in f.batch.undetermined for f in good))
    if not names:
        return None
    own, inverses, covariances = [], [], []
    scale = np.abs(good[0].batch.values[[good[0].batch.names.index(name) for name in names]])
    for fit in good:
        index = [fit.batch.names.index(name) for name in names]
        covariance = fit.batch.errors.covariance[np.ix_(index, index)] / np.outer(scale, scale)
        own.append(fit.batch.values[index] / scale)
        covariances.append(covariance)
        inverses.append(np.linalg.inv(covariance))
    spread = np.linalg.inv(sum(inverses))
    common = spread @ sum(w @ v for w, v in zip(inverses, own, strict=True))
    chi2 = float(sum((v - common) @ w @ (v - common) for w, v in zip(inverses, own, strict=True)))
    dof = (len(good) - 1) * len(names)
    of_difference = [np.sqrt(np.maximum(np.diag(c) - np.diag(spread), 1e-300)) for c in covariances]
    from scipy.special import gammaincc

    return Agreement(
        runs=tuple(fit.run for fit in good),
        names=names,
        chi2=chi2,
        dof=dof,
        p_value=float(gammaincc(dof / 2, chi2 / 2)),
        common=common * scale,
        common_sd=np.sqrt(np.diag(spread)) * scale,
        own=np.array(own) * scale,
        own_sd=np.array([np.sqrt(np.diag(c)) for c in covariances]) * scale,
        deviations=np.array([(v - common) / sd for v, sd in zip(own, of_difference, strict=True)]),
    )
