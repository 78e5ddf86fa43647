"""From amplitudes of force and displacement to the impedance H = K + i w C with its covariance (eqs 1, 2).

Ratio of coherent means over blocks: the maximum-likelihood estimate for periodic data with noise on
force and displacement (Pintelon and Schoukens). A regression of force on displacement is biased.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Impedance:
    """H at k tones, shape (k, 2, 2), N/m; rows are the force's x and y, columns the displacement's.

    Attributes
    ----------
    covariance
        Of the entries of H in the order xx, xy, yx, yy, shape (k, 4, 4), complex; real and imaginary
        part have half the diagonal as variance each.
    dof
        Degrees of freedom of that variance, shape (k, 2, 2).
    condition
        Condition number of the two displacements, each scaled to length one, shape (k,).
    force, displacement
        Mean amplitudes, shape (k, 2, 2): component by excitation; with their noise, shape (k, 2, 2).
    """

    H: np.ndarray
    covariance: np.ndarray
    dof: np.ndarray
    condition: np.ndarray
    force: np.ndarray
    displacement: np.ndarray
    force_noise: np.ndarray
    displacement_noise: np.ndarray

    @property
    def std_error(self) -> np.ndarray:
        """Standard error of the real and of the imaginary part of each entry, shape (k, 2, 2)."""
        variance = np.diagonal(self.covariance, axis1=1, axis2=2).real / 2
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)).reshape(-1, 2, 2))


def ratio_of_means(force: Sequence[np.ndarray], displacement: Sequence[np.ndarray]) -> Impedance:
    """Return H = [F_f F_a] [D_f D_a]^-1 from coherent means over blocks (eq. 2), with its covariance.

    Parameters
    ----------
    force, displacement
        Complex amplitudes of bearing force (N) and displacement (m) for each of the two excitations,
        shape (B, k, 2): blocks, tones, x and y. The excitations may differ in number of blocks, origin
        of time and size; a block may have any common factor, since F - H D does not see it.

    Notes
    -----
    With e_b = F_b - H D_b, G_m = cov of the mean of e under excitation m, and w_m = row m of D^-1:
    cov(vec H) = sum_m G_m (x) w_m w_m^H. The degrees of freedom of the sum are Satterthwaite's, with
    B - 1 for each excitation.
    """
    F = np.stack([blocks.mean(axis=0) for blocks in force], axis=2)
    D = np.stack([blocks.mean(axis=0) for blocks in displacement], axis=2)
    size = np.linalg.norm(D, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.linalg.cond(np.nan_to_num(D / size[:, None, :]))
    inverse = np.linalg.inv(np.where(condition[:, None, None] < 1e12, D, np.nan * np.eye(2)))
    H = F @ inverse
    k = H.shape[0]
    covariance = np.zeros((k, 4, 4), dtype=complex)
    parts = np.zeros((len(force), k, 4))
    for m, (F_b, D_b) in enumerate(zip(force, displacement, strict=True)):
        e = F_b - np.einsum("kij,bkj->bki", H, D_b)
        e = e - e.mean(axis=0)
        blocks = e.shape[0]
        G = np.einsum("bki,bkj->kij", e, e.conj()) / (blocks * max(blocks - 1, 1))
        w = inverse[:, m, :]
        term = np.einsum("kij,kl,kn->kiljn", G, w, w.conj()).reshape(k, 4, 4)
        covariance += term
        parts[m] = np.diagonal(term, axis1=1, axis2=2).real
    freedom = np.array([max(blocks.shape[0] - 1, 1) for blocks in force])
    squares = (parts**2 / freedom[:, None, None]).sum(axis=0)
    dof = np.divide(parts.sum(axis=0) ** 2, squares, out=np.full((k, 4), float(freedom.min())), where=squares > 0)
    return Impedance(
        H,
        covariance,
        dof.reshape(k, 2, 2),
        np.asarray(condition),
        F,
        D,
        _noise_of_mean(force),
        _noise_of_mean(displacement),
    )


def _noise_of_mean(blocks: Sequence[np.ndarray]) -> np.ndarray:
    """Return the standard deviation of each complex mean amplitude, shape (k, 2, excitations)."""
    spread = [b.std(axis=0, ddof=1) / np.sqrt(b.shape[0]) if b.shape[0] > 1 else 0 * b[0].real for b in blocks]
    return np.stack(spread, axis=2)


def bearing_force(
    force: np.ndarray, acceleration: np.ndarray, tones: np.ndarray, mass: float, stiffness: float
) -> np.ndarray:
    """Return what the film carries: F - (m_s - k_s/w^2) a, all complex amplitudes of shape (..., k, 2).

    `a` is the measured absolute acceleration of the stator: the displacement is against the shaft,
    which moves on its own bearings, so that -w^2 D is not a.
    """
    w = 2 * np.pi * tones
    return np.asarray(force - (mass - stiffness / w**2)[:, None] * acceleration)


def inertia_sensitivity(acceleration: np.ndarray, impedance: Impedance) -> np.ndarray:
    """Return -dH/d(m_s - k_s/w^2) = A D^-1, shape (k, 2, 2), from mean accelerations of the same shape."""
    return np.asarray(acceleration @ np.linalg.inv(impedance.displacement))
