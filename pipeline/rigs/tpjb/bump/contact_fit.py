"""Sides, centre, contact and support stiffness together, from all force levels and both planes.

Each block is weighted with the noise of its displacement and, through the compliance, with that of
the force (effective variance); the force is one for both planes, so their residuals are whitened
together. Blocks during which a pad is met or left do not obey one linear law and are left out.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.least_squares import Fit, Unknown, fit
from pipeline.estimation.search import Values
from pipeline.rigs.tpjb.bump.contact import Bearing, rest, rest_on, sensitivities
from pipeline.rigs.tpjb.bump.levels import Blocks
from pipeline.rigs.tpjb.bump.weighting import force_steps, noises, odd, steady, whitening, widened_by

_ROUNDS = 12
# Relative change of the stiffnesses from round to round that no longer matters.
_SETTLED = 1e-3
_EVALUATIONS = 200
# Noise of the force, in standard deviations, that may not change which sides are pressed.
_MARGIN = 3.0
# That margin at most, as a share of the smallest force.
_MOST_MARGIN = 0.05
# Where a side is put that is never touched, m.
_FAR = 1.0
# Constant force, over the largest turning one, that is thought possible where a side was never touched.
_LOOSE = 10.0


@dataclass(frozen=True, eq=False)
class _Prior:
    """Holds the neutral points loosely where a side that is never left leaves them free: `force` over k_s, either way."""

    neutral: Mapping[int, np.ndarray]
    force: float
    k_s: float

    def rows(self, values: Values) -> np.ndarray:
        """Return the residuals of the prior."""
        at = [values[f"neutral_{axis}_{p}"] - n["xy".index(axis)] for p, n in self.neutral.items() for axis in "xy"]
        return np.array(at) / self._scale

    def slopes(self, names: Sequence[str]) -> np.ndarray:
        """Return their derivatives by the parameters `names`."""
        mine = [f"neutral_{axis}_{p}" for p in self.neutral for axis in "xy"]
        return np.array([[float(name == own) for name in names] for own in mine]) / self._scale

    @property
    def _scale(self) -> float:
        return self.force / self.k_s


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
        Factor on the standard errors for correlation in time and for steps with the force.
    steps
        Of the residual with the force, see `force_steps`.
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
    steps: np.ndarray

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
    first = next(iter(start.values()))
    prior = _Prior({p: b.neutral for p, b in start.items()}, _LOOSE * max(blocks.levels), first.k_s) if absent else None
    for _ in range(_ROUNDS):
        rests = {p: rest(blocks.force, bearing) for p, bearing in bearings.items()}
        margin = min(_MARGIN * force_noise, _MOST_MARGIN * min(blocks.levels))
        kept = steady(blocks, bearings, margin) & ~outliers
        whiten = whitening({p: r.compliance[kept] for p, r in rests.items()}, motion_noise, force_noise)
        pressed = {p: r.number[kept] for p, r in rests.items()}
        fitted = _fit(blocks.at(kept), bearings, pressed, whiten, absent, prior)
        bearings = {p: _bearing(fitted.values, p, bearing) for p, bearing in bearings.items()}
        rests = {p: rest(blocks.force, bearing) for p, bearing in bearings.items()}
        unchanged = steady(blocks, bearings, margin)
        now = (fitted.values["k_p"], fitted.values["k_s"])
        # Standard errors as the noise alone has them: they are scaled with the misfit until the fit settles.
        scale = 0.2 / max(math.sqrt(fitted.chi2 / max(fitted.dof, 1)), 1.0)
        error = [scale * fitted.std_error[name] for name in ("k_p", "k_s")]
        close = [max(_SETTLED * a, e) for a, e in zip(now, error, strict=True)]
        settled = all(abs(a - b) < limit for a, b, limit in zip(now, before, close, strict=True))
        before = now
        if settled and trimmed:
            break
        motion_noise, force_noise = noises(blocks, rests, bearings, unchanged & ~outliers, motion_noise, force_noise)
        if settled:
            outliers = unchanged & odd(blocks, rests, motion_noise, force_noise)
            trimmed = True
    steps = force_steps(blocks, rests, kept, motion_noise)
    fitted, widening = widened_by(
        fitted, fitted.residual[: 2 * len(bearings) * int(kept.sum())].reshape(int(kept.sum()), -1), steps
    )
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
        steps,
    )


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
    prior: _Prior | None,
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
        rows = np.einsum("nij,nj->ni", whiten, np.concatenate(off, axis=1)).ravel()
        return rows if prior is None else np.concatenate([rows, prior.rows(values)])

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
        weighted = np.einsum("nij,njk->nik", whiten, J[:, :, free]).reshape(-1, len(free))
        return weighted if prior is None else np.vstack([weighted, prior.slopes([unknowns[i].name for i in free])])

    return fit(residual, unknowns, jacobian=jacobian, noise="larger", max_evaluations=_EVALUATIONS)
