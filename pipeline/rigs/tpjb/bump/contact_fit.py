"""Sides, centre, contact and support stiffness together, from all force levels and both planes.

Each block is weighted with the noise of its displacement and, through the compliance, with that of
the force (effective variance); the force is one for both planes, so their residuals are whitened
together. Blocks during which a pad is met or left do not obey one linear law and are left out.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.least_squares import Fit, Unknown, fit
from pipeline.estimation.search import Values
from pipeline.estimation.uncertainty import Covariance, effective_size
from pipeline.rigs.tpjb.bump.contact import Bearing, Rest, rest, rest_on, sensitivities
from pipeline.rigs.tpjb.bump.geometry import Polygon
from pipeline.rigs.tpjb.bump.levels import Blocks

_ROUNDS = 12
# Relative change of the stiffnesses from round to round that no longer matters.
_SETTLED = 1e-3
_EVALUATIONS = 200
# Noise of the force, in standard deviations, that may not change which sides are pressed.
_MARGIN = 3.0
# That margin at most, as a share of the smallest force.
_MOST_MARGIN = 0.05
# Whitened residual of a block beyond which it is an outlier, per root of its number of axes.
_OUTLIER = 4.0
# Where a side is put that is never touched, m.
_FAR = 1.0


@dataclass(frozen=True, eq=False)
class ContactFit:
    """What the contact law gives.

    Attributes
    ----------
    bearings
        The fitted law of each plane.
    fit
        Parameters by name: ``side_1_3`` (plane 1, side 3), ``neutral_x_1``, ``rotation_1``, ``k_p``,
        ``k_s``; covariance widened for residuals that are correlated in time.
    kept, outliers
        Which blocks entered, and which were thrown out for their residual, shape (n,).
    predicted
        Displacement in each plane, shape (n, 2), for all blocks.
    touching
        Sides pressed in each plane, shape (n, N).
    motion_noise, force_noise
        Of a block's mean, m and N, as the residuals show them.
    widening
        Factor on the standard errors for correlation in time.
    """

    bearings: dict[int, Bearing]
    fit: Fit
    kept: np.ndarray
    outliers: np.ndarray
    predicted: dict[int, np.ndarray]
    touching: dict[int, np.ndarray]
    motion_noise: float
    force_noise: float
    widening: float

    @property
    def chi2_reduced(self) -> float:
        """Chi-square over its degrees of freedom."""
        return self.fit.chi2 / self.fit.dof if self.fit.dof > 0 else math.nan


def fit_contact(blocks: Blocks, start: Mapping[int, Bearing], absent: Collection[int] = ()) -> ContactFit:
    """Fit the contact law to all blocks.

    Parameters
    ----------
    blocks
        Those at a force level.
    start
        A first guess for each plane (`first_guess`).
    absent
        Sides, counted from 0, that were never touched: held far away.
    """
    bearings = {p: _without(bearing, absent) for p, bearing in start.items()}
    motion_noise, force_noise = max(blocks.motion_noise, 1e-12), max(blocks.force_noise, 1e-9)
    outliers = np.zeros(blocks.time.size, dtype=bool)
    trimmed, before = False, (math.nan, math.nan)
    for _ in range(_ROUNDS):
        rests = {p: rest(blocks.force, bearing) for p, bearing in bearings.items()}
        margin = min(_MARGIN * force_noise, _MOST_MARGIN * min(blocks.levels))
        kept = _steady(blocks, bearings, margin) & ~outliers
        whiten = _whitening({p: r.compliance[kept] for p, r in rests.items()}, motion_noise, force_noise)
        pressed = {p: r.number[kept] for p, r in rests.items()}
        fitted = _fit(blocks.at(kept), bearings, pressed, whiten, absent)
        bearings = {p: _bearing(fitted.values, p, bearing) for p, bearing in bearings.items()}
        rests = {p: rest(blocks.force, bearing) for p, bearing in bearings.items()}
        steady = _steady(blocks, bearings, margin)
        now = (fitted.values["k_p"], fitted.values["k_s"])
        settled = all(abs(a - b) < _SETTLED * a for a, b in zip(now, before, strict=True))
        before = now
        if settled and trimmed:
            break
        motion_noise, force_noise = _noises(blocks, rests, bearings, steady & ~outliers, motion_noise, force_noise)
        if settled:
            outliers = steady & _odd(blocks, rests, motion_noise, force_noise)
            trimmed = True
    residual = fitted.residual.reshape(int(kept.sum()), -1)
    fitted, widening = _widened(fitted, residual)
    return ContactFit(
        bearings,
        fitted,
        kept,
        outliers,
        {p: r.displacement for p, r in rests.items()},
        {p: r.touching for p, r in rests.items()},
        motion_noise,
        force_noise,
        widening,
    )


def first_guess(
    blocks: Blocks,
    polygons: Mapping[int, Mapping[int, Polygon]],
    absent: Collection[int] = (),
    pull: float = 0.0,
) -> dict[int, Bearing]:
    """Return a start from the polygons of each plane at each level: ``polygons[plane][level]``.

    Sides move outwards with the force over k_p; along a side the force is held by the support.
    `pull` is a constant force away from the absent sides, over the largest turning one.
    """
    levels = blocks.levels
    guesses = {}
    for plane, by_level in polygons.items():
        high = max(by_level)
        top = by_level[high]
        there = [i for i in range(top.n_pads) if i not in absent]
        # Levels too weak to reach every side say nothing of the growth.
        size = float(np.mean(top.clearances[there]))
        low = min(k for k, polygon in by_level.items() if polygon.clearances[there].min() > 0.7 * size or k == high)
        growth = float(np.mean((top.sides - by_level[low].sides)[there]))
        rise = levels[high] - levels[low]
        k_p = rise / growth if growth > 1e-9 and rise > 0 else 1e9
        k_s, neutral = _support(blocks, plane, top, there) or (1e-3 * k_p, top.centre)
        if absent and pull:
            neutral = neutral - pull * levels[high] / k_s * top.normals[list(absent)].mean(axis=0)
        guesses[plane] = Bearing(
            top.pad_angles, top.rotation, top.sides - levels[high] / k_p, neutral, k_p, min(k_s, 0.3 * k_p)
        )
    k_p, k_s = (float(np.median([getattr(g, name) for g in guesses.values()])) for name in ("k_p", "k_s"))
    return {p: replace(g, k_p=k_p, k_s=k_s) for p, g in guesses.items()}


def _support(blocks: Blocks, plane: int, polygon: Polygon, there: list[int]) -> tuple[float, np.ndarray] | None:
    """Return k_s and its neutral point, from blocks that lie along one side alone: t.F = k_s t.(d - s)."""
    d, normals = blocks.planes[plane], polygon.normals[there]
    gap = polygon.sides[there] - d @ normals.T
    order = np.sort(gap, axis=1)
    alone = order[:, 1] > 0.1 * float(polygon.clearances[there].mean())
    if alone.sum() < 8:
        return None
    tangents = (normals @ np.array([[0.0, 1.0], [-1.0, 0.0]]))[gap[alone].argmin(axis=1)]
    rows = np.column_stack([(d[alone] * tangents).sum(axis=1), -tangents])
    scale = np.linalg.norm(rows, axis=0)
    (k_s, x, y), *_ = np.linalg.lstsq(rows / scale, (blocks.force[alone] * tangents).sum(axis=1), rcond=None)
    k_s, x, y = k_s / scale[0], x / scale[1], y / scale[2]
    return (float(k_s), np.array([x, y]) / k_s) if k_s > 0 else None


def _names(plane: int, n: int) -> list[str]:
    return [
        f"rotation_{plane}",
        *(f"side_{plane}_{i + 1}" for i in range(n)),
        f"neutral_x_{plane}",
        f"neutral_y_{plane}",
    ]


def _bearing(values: Values, plane: int, like: Bearing) -> Bearing:
    n = like.sides.size
    return Bearing(
        like.pad_angles,
        values[f"rotation_{plane}"],
        np.array([values[f"side_{plane}_{i + 1}"] for i in range(n)]),
        np.array([values[f"neutral_x_{plane}"], values[f"neutral_y_{plane}"]]),
        values["k_p"],
        values["k_s"],
    )


def _without(bearing: Bearing, absent: Collection[int]) -> Bearing:
    sides = bearing.sides.copy()
    sides[list(absent)] = _FAR
    return replace(bearing, sides=sides)


def _fit(
    blocks: Blocks,
    bearings: Mapping[int, Bearing],
    pressed: Mapping[int, np.ndarray],
    whiten: np.ndarray,
    absent: Collection[int],
) -> Fit:
    """Fit with the sets of pressed sides held: the law is smooth then."""
    held = {f"side_{plane}_{i + 1}" for plane in bearings for i in absent}
    unknowns = []
    for plane, bearing in bearings.items():
        start = [bearing.rotation, *bearing.sides, *bearing.neutral]
        names = _names(plane, bearing.sides.size)
        unknowns += [Unknown(n, float(v), fixed=n in held) for n, v in zip(names, start, strict=True)]
    first = next(iter(bearings.values()))
    unknowns += [Unknown("k_p", first.k_p, logarithmic=True), Unknown("k_s", first.k_s, logarithmic=True)]
    columns = len(unknowns)
    free = [i for i, unknown in enumerate(unknowns) if not unknown.fixed]

    def residual(values: Values) -> np.ndarray:
        off = [
            rest_on(blocks.force, _bearing(values, p, b), pressed[p]).displacement - blocks.planes[p]
            for p, b in bearings.items()
        ]
        return np.asarray(np.einsum("nij,nj->ni", whiten, np.concatenate(off, axis=1)).ravel())

    def jacobian(values: Values) -> np.ndarray:
        J = np.zeros((blocks.time.size, 2 * len(bearings), columns))
        at = 0
        for row, (plane, like) in enumerate(bearings.items()):
            bearing = _bearing(values, plane, like)
            slopes = sensitivities(bearing, rest_on(blocks.force, bearing, pressed[plane]))
            rows, n = slice(2 * row, 2 * row + 2), bearing.sides.size
            J[:, rows, at] = slopes["rotation"]
            J[:, rows, at + 1 : at + 1 + n] = slopes["sides"]
            J[:, rows, at + 1 + n : at + 3 + n] = slopes["neutral"]
            J[:, rows, -2], J[:, rows, -1] = slopes["k_p"], slopes["k_s"]
            at += n + 3
        return np.asarray(np.einsum("nij,njk->nik", whiten, J[:, :, free]).reshape(-1, len(free)))

    return fit(residual, unknowns, jacobian=jacobian, noise="larger", max_evaluations=_EVALUATIONS)


def _steady(blocks: Blocks, bearings: Mapping[int, Bearing], margin: float) -> np.ndarray:
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


def _whitening(compliance: Mapping[int, np.ndarray], motion_noise: float, force_noise: float) -> np.ndarray:
    """Return the inverse Cholesky factors of the blocks' covariances, shape (n, 2 planes, 2 planes)."""
    J = np.concatenate(list(compliance.values()), axis=1)
    S = motion_noise**2 * np.eye(J.shape[1]) + force_noise**2 * np.einsum("nij,nkj->nik", J, J)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(S)))


def _noises(
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
        motion_noise = math.sqrt(max(_spread(at_rest) ** 2 - through**2, (0.1 * motion_noise) ** 2))
    if sliding.size >= 20:
        through = k_s * motion_noise
        force_noise = math.sqrt(max(_spread(sliding) ** 2 - through**2, (0.1 * force_noise) ** 2))
    return motion_noise, force_noise


def _spread(values: np.ndarray) -> float:
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def _odd(blocks: Blocks, rests: Mapping[int, Rest], motion_noise: float, force_noise: float) -> np.ndarray:
    """Tell which blocks lie further off than noise can put them."""
    whiten = _whitening({p: r.compliance for p, r in rests.items()}, motion_noise, force_noise)
    off = np.concatenate([rests[p].displacement - blocks.planes[p] for p in rests], axis=1)
    size = np.sqrt((np.einsum("nij,nj->ni", whiten, off) ** 2).mean(axis=1))
    return np.asarray(size > _OUTLIER)


def _widened(fitted: Fit, residual: np.ndarray) -> tuple[Fit, float]:
    """Widen the covariance by the correlation of the residuals in time, shape (blocks, axes)."""
    n = residual.shape[0]
    shares = [effective_size(column) / n for column in residual.T]
    factor = 1.0 / float(np.mean(shares))
    dof = max(n * residual.shape[1] / factor - len(fitted.names), 1.0)
    matrix = fitted.covariance.matrix * factor
    return fitted.with_covariance(Covariance(matrix, dof, "least squares, effective sample size")), math.sqrt(factor)
