"""What a block of a bump test is worth: noise of displacement and force, blocks that obey no one law, outliers."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.estimation.least_squares import Fit
from pipeline.estimation.uncertainty import Covariance, effective_size, newey_west
from pipeline.rigs.tpjb.bump.contact import Bearing, Rest, rest
from pipeline.rigs.tpjb.bump.levels import Blocks

# Whitened residual of a block beyond which it is an outlier, per root of its number of axes.
_OUTLIER = 4.0
# Share of the scatter within blocks below which the noise of their means cannot be.
_LEAST = 0.7
# Mean square of a few steps over their errors that chance allows.
_BY_CHANCE = 2.0


def steady(blocks: Blocks, bearings: Mapping[int, Bearing], margin: float) -> np.ndarray:
    """Tell which blocks press the same sides throughout, by more than `margin` (N) at both ends."""
    out = np.ones(blocks.time.size, dtype=bool)
    for bearing in bearings.values():
        middle = rest(blocks.force, bearing).touching
        for end in (-1.0, 1.0):
            there = rest(blocks.force + end * blocks.slope, bearing)
            out &= (there.touching == middle).all(axis=1)
            beyond = there.displacement @ bearing.normals.T - bearing.sides
            pressed = np.where(there.touching, bearing.k_p * beyond, np.inf)
            lifted = np.where(there.touching, np.inf, -bearing.k_s * beyond)
            out &= (np.minimum(pressed, lifted) > margin).all(axis=1)
    return out


def whitening(compliance: Mapping[int, np.ndarray], motion_noise: float, force_noise: float) -> np.ndarray:
    """Return the inverse Cholesky factors of the blocks' covariances, shape (n, 2 planes, 2 planes)."""
    J = np.concatenate(list(compliance.values()), axis=1)
    S = motion_noise**2 * np.eye(J.shape[1]) + force_noise**2 * np.einsum("nij,nkj->nik", J, J)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(S)))


def noises(
    blocks: Blocks,
    rests: Mapping[int, Rest],
    bearings: Mapping[int, Bearing],
    chosen: np.ndarray,
    motion_noise: float,
    force_noise: float,
) -> tuple[float, float]:
    """Tell the noise of displacement from corners, where force hardly matters, and that of the force from sides."""
    motion, pull = [], []
    for plane, bearing in bearings.items():
        off = blocks.planes[plane] - rests[plane].displacement
        corner = chosen & (rests[plane].touching.sum(axis=1) > 1)
        single = chosen & (rests[plane].touching.sum(axis=1) == 1)
        motion.append(off[corner].ravel())
        tangents = (bearing.normals @ np.array([[0.0, 1.0], [-1.0, 0.0]]))[rests[plane].touching[single].argmax(axis=1)]
        pull.append(bearing.k_s * (off[single] * tangents).sum(axis=1))
        motion.append((off[single] * bearing.normals[rests[plane].touching[single].argmax(axis=1)]).sum(axis=1))
    at_rest, sliding = np.concatenate(motion), np.concatenate(pull)
    k_p, k_s = (getattr(next(iter(bearings.values())), name) for name in ("k_p", "k_s"))
    if at_rest.size >= 20:
        through = force_noise / k_p
        motion_noise = math.sqrt(max(_spread(at_rest) ** 2 - through**2, (_LEAST * blocks.motion_noise) ** 2))
    if sliding.size >= 20:
        through = k_s * motion_noise
        force_noise = math.sqrt(max(_spread(sliding) ** 2 - through**2, (_LEAST * blocks.force_noise) ** 2))
    return motion_noise, force_noise


def _spread(values: np.ndarray) -> float:
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def odd(blocks: Blocks, rests: Mapping[int, Rest], motion_noise: float, force_noise: float) -> np.ndarray:
    """Tell which blocks lie further off than noise can put them."""
    whiten = whitening({p: r.compliance for p, r in rests.items()}, motion_noise, force_noise)
    off = np.concatenate([rests[p].displacement - blocks.planes[p] for p in rests], axis=1)
    size = np.sqrt((np.einsum("nij,nj->ni", whiten, off) ** 2).mean(axis=1))
    return np.asarray(size > _OUTLIER)


def force_steps(blocks: Blocks, rests: Mapping[int, Rest], kept: np.ndarray, noise: float) -> np.ndarray:
    """Return by how much the stator lies further out than the law has it, by plane and level: m and its error.

    Shape (planes, levels, 2), from the corners. A contact that is not linear shows here.
    """
    levels = range(len(blocks.levels))
    found = np.full((len(rests), len(levels), 2), np.nan)
    for row, (plane, at) in enumerate(rests.items()):
        corner = kept & (at.touching.sum(axis=1) > 1)
        middle = at.displacement.mean(axis=0)
        for k in levels:
            here = corner & (blocks.level == k)
            if here.sum() > 3:
                outward = at.displacement[here] - middle
                outward /= np.linalg.norm(outward, axis=1)[:, None]
                off = ((blocks.planes[plane] - at.displacement)[here] * outward).sum(axis=1)
                found[row, k] = off.mean(), noise / math.sqrt(here.sum())
    return found


def widened_by(fitted: Fit, residual: np.ndarray, steps: np.ndarray) -> tuple[Fit, float]:
    """Widen the covariance by what the residuals, shape (blocks, axes), are correlated in time, or by steps with the force.

    Slow noise of the probes reaches the clearances and hardly the stiffness of the support, on which the white noise of the
    force acts: each parameter is widened by its own scores (Newey and West), by no more than the residuals as a whole.

    Returns
    -------
    The fit, and the factor by which its standard errors grew in the median.
    """
    n, axes = residual.shape
    shares = [effective_size(column) / n for column in residual.T]
    in_time = 1.0 / float(np.mean(shares))
    order = np.arange(n * axes).reshape(n, axes).T.ravel()  # each axis by itself, in time
    norm = np.sqrt((fitted.jacobian**2).sum(axis=0))
    J = fitted.jacobian / np.where(norm > 0, norm, 1.0)
    plain = np.diag(np.linalg.pinv(J.T @ J)) * max(fitted.chi2 / max(fitted.dof, 1), 1.0)
    scores = np.diag(newey_west(J[order], fitted.residual[order]).matrix)
    factors = np.clip(scores / plain, 1.0, max(in_time, 1.0))
    known = steps[np.isfinite(steps).all(axis=2)]
    with_force = float(np.mean((known[:, 0] / known[:, 1]) ** 2)) if len(known) > 1 else 1.0
    if with_force > _BY_CHANCE * in_time:
        factors = np.maximum(factors, with_force)
    root = np.sqrt(factors)
    dof = max(n * axes / float(np.median(factors)) - len(fitted.names), 1.0)
    matrix = fitted.covariance.matrix * np.outer(root, root)
    method = "least squares, each parameter widened by the correlation of its scores"
    return fitted.with_covariance(Covariance(matrix, dof, method)), float(np.median(root))
