"""Coefficients by linear least squares of the force on the measured displacement: the start of the fit.

Quick and without iteration, but the noise of the displacement attenuates stiffness (0.3 % at a signal to
noise ratio of 17, 14 % at 1.6), so it is a start and a check of signs, not a result.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.models import Model
from pipeline.rigs.tpjb.rotating.orbit import Orbit


def force_domain(orbit: Orbit, model: Model) -> np.ndarray:
    """Return the free coefficients of `model`, shape (k,), from one run, referred to its equilibrium.

    Fitted about the mean position, f = c + K' d + Q(d) + drift; the equilibrium d0 solves
    c + K' d0 + Q(d0) = 0, and K = J(d0). Leaving K' as it is makes kyx 10 % wrong at 36 % load.
    """
    d = orbit.displacement - orbit.displacement.mean(axis=1, keepdims=True)
    columns = np.einsum("ijn,jk->ink", law.regressors(d), model.matrix * model.scale)
    n, k = d.shape[1], model.size
    drift = np.stack([np.ones(n), orbit.tau, orbit.tau**2 - 1 / 3], axis=1)
    A = np.zeros((2, n, k + 6))
    A[:, :, :k] = columns
    A[0, :, k : k + 3] = A[1, :, k + 3 :] = drift * orbit.rotation.size
    norms = np.sqrt((A**2).sum(axis=(0, 1)))
    norms[norms == 0] = 1.0
    solution = np.linalg.lstsq((A / norms).reshape(2 * n, -1), orbit.force.reshape(-1), rcond=1e-12)[0] / norms
    theta = np.asarray(solution[:k] * model.scale)
    constant = solution[[k, k + 3]] * orbit.rotation.size
    p = model.coefficients(theta)
    equilibrium = law.equilibrium(p, -constant[:, None])
    if np.isnan(equilibrium).any():
        return theta
    centred = p.copy()
    centred[:4] = law.tangent(p, equilibrium[:, 0]).reshape(4)
    return np.asarray(np.linalg.lstsq(model.matrix / law.SCALE[:, None], centred / law.SCALE, rcond=None)[0])


def below_fold(orbits: Sequence[Orbit], model: Model, theta: np.ndarray) -> np.ndarray:
    """Return coefficients, shape (k,), with which every run has an equilibrium throughout.

    Quadratic terms are halved until no sample is past the fold.
    """
    quadratic = model.scale == law.SCALE[-1]
    for _ in range(12):
        if all(np.isfinite(model.displacement(theta, orbit.force)).all() for orbit in orbits):
            break
        theta = np.where(quadratic, 0.5 * theta, theta)
    return theta
