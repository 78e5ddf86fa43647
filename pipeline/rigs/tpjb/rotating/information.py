"""What an orbit can tell at best: Fisher information of a run about the coefficients of a law."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.design import Information
from pipeline.rigs.tpjb.rotating.displacement_fit import Law


def run_information(
    law: Law,
    theta: np.ndarray,
    time: np.ndarray,
    force: np.ndarray,
    motion_noise: np.ndarray | float,
    force_noise: float,
) -> Information:
    """Return the information of one run, with its offset and drift of second degree as nuisances.

    Noise of the force counts through the compliance, as in the fit (effective variance).

    Parameters
    ----------
    theta
        Free coefficients, shape (k,), SI.
    time, force
        Stamps (s), shape (n,), and dynamic force in x and y, shape (2, n), N. Samples past the law's fold tell nothing.
    motion_noise
        Standard deviation of the displacement along x and y, m, one or shape (2,).
    force_noise
        Standard deviation of the force along either axis, N.
    """
    d = law.displacement(theta, force)
    there = np.isfinite(d).all(axis=0)
    time, force, d = time[there], force[:, there], d[:, there]
    slopes, compliance = law.slopes(theta, d, force)
    own = np.diag(np.broadcast_to(np.asarray(motion_noise, dtype=float), 2) ** 2)
    spread = own + force_noise**2 * np.einsum("ikn,jkn->nij", compliance, compliance)
    whiten = np.linalg.inv(np.linalg.cholesky(spread))
    tau = 2.0 * (time - time[0]) / (time[-1] - time[0]) - 1.0
    level = np.stack([np.ones_like(tau), tau, tau**2 - 1.0 / 3.0], axis=1)
    jacobian = np.einsum("nij,jkn->nik", whiten, slopes).reshape(-1, slopes.shape[1])
    nuisance = np.einsum("nij,nk->nijk", whiten, level).reshape(2 * time.size, -1)
    return Information.of(law.free, jacobian, 1.0, nuisance)
