"""How the stator lies against the pads of a bearing without oil: the contact law, force to displacement.

Plain physics. The sides of the clearance polygon stand at ``n_i . d = q_i``; a pad pressed by more
than that gives way with k_p, and a soft support k_s pulls towards its neutral point s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np


def side_normals(pad_angles: np.ndarray, rotation: float | np.ndarray) -> np.ndarray:
    """Return the outward normals of the sides, shape (N, 2), or (m, N, 2) for m rotations.

    A pad in the direction p of the stator meets the shaft where the stator has moved along -p;
    `rotation` (rad, anticlockwise) turns all of them.
    """
    angle = np.asarray(pad_angles) + np.asarray(rotation)[..., None]
    return -np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@dataclass(frozen=True, eq=False)
class Bearing:
    """A clearance polygon with its compliance. SI.

    Attributes
    ----------
    pad_angles
        Directions of the pads, rad from x, shape (N,).
    rotation
        alpha, turn of the bearing against the probes, rad.
    sides
        q_i, where side i stands along its normal, from the zero of the probes, shape (N,), m.
    neutral
        s, where the support pulls to, shape (2,), m.
    k_p, k_s
        Stiffness of a pad's contact and of the support, N/m.
    """

    pad_angles: np.ndarray
    rotation: float
    sides: np.ndarray
    neutral: np.ndarray
    k_p: float
    k_s: float

    @property
    def normals(self) -> np.ndarray:
        """Outward normals of the sides, shape (N, 2)."""
        return side_normals(self.pad_angles, self.rotation)


@dataclass(frozen=True, eq=False)
class Rest:
    """Where the stator rests under each of n forces.

    Attributes
    ----------
    displacement
        d, shape (n, 2), m.
    touching
        Which sides are pressed, shape (n, N).
    compliance
        dd/dF, shape (n, 2, 2), m/N.
    number
        Of the set of pressed sides among `contact_sets`, shape (n,).
    """

    displacement: np.ndarray
    touching: np.ndarray
    compliance: np.ndarray
    number: np.ndarray


def contact_sets(normals: np.ndarray) -> list[tuple[int, ...]]:
    """Return the sets of sides that may be pressed together: none, each one, pairs that are not opposed."""
    n = normals.shape[0]
    pairs = [(i, j) for i, j in combinations(range(n), 2) if normals[i] @ normals[j] > -0.95]
    return [(), *((i,) for i in range(n)), *pairs]


def rest(force: np.ndarray, bearing: Bearing) -> Rest:
    """Return where the stator rests: the least of the potential over every set of pressed sides.

    ``U = k_s |d-s|^2/2 - F.d + k_p/2 sum max(0, n_i.d - q_i)^2`` (tpjb.md, section 3, T1 geometry).
    Iterating on one active set cycles; here each set is solved and the least potential kept.

    Parameters
    ----------
    force
        F, shape (n, 2), N.
    """
    normals = bearing.normals
    best = np.full(force.shape[0], np.inf)
    number = np.zeros(force.shape[0], dtype=int)
    for i, (pull, compliance) in enumerate(zip(*_linear_laws(bearing), strict=True)):
        trial = (force + pull) @ compliance
        pressed = np.maximum(trial @ normals.T - bearing.sides, 0.0)
        away = trial - bearing.neutral
        potential = (
            0.5 * bearing.k_s * np.einsum("ni,ni->n", away, away)
            - np.einsum("ni,ni->n", force, trial)
            + 0.5 * bearing.k_p * np.einsum("ni,ni->n", pressed, pressed)
        )
        less = potential < best
        best[less], number[less] = potential[less], i
    return rest_on(force, bearing, number)


def rest_on(force: np.ndarray, bearing: Bearing, number: np.ndarray) -> Rest:
    """Return where the stator rests if the sets of pressed sides are given, by `number`, shape (n,)."""
    pulls, compliances = _linear_laws(bearing)
    compliance = compliances[number]
    d = np.einsum("ni,nij->nj", force + pulls[number], compliance)
    return Rest(d, _members(bearing.normals)[number], compliance, number)


def _linear_laws(bearing: Bearing) -> tuple[np.ndarray, np.ndarray]:
    """Return for each contact set the pull (N) that adds to the force, and the compliance: d = C (F + pull)."""
    normals, member = bearing.normals, _members(bearing.normals).astype(float)
    stiffness = bearing.k_s * np.eye(2) + bearing.k_p * np.einsum("sk,ki,kj->sij", member, normals, normals)
    pulls = bearing.k_s * bearing.neutral + bearing.k_p * (member * bearing.sides) @ normals
    return pulls, np.linalg.inv(stiffness)


def _members(normals: np.ndarray) -> np.ndarray:
    """Return which sides belong to each contact set, shape (sets, N)."""
    sets = contact_sets(normals)
    member = np.zeros((len(sets), normals.shape[0]), dtype=bool)
    for i, group in enumerate(sets):
        member[i, list(group)] = True
    return member


def sensitivities(bearing: Bearing, at: Rest) -> dict[str, np.ndarray]:
    """Return the derivatives of the displacement, each of shape (n, 2) or (n, 2, count).

    Keys: `sides` (N), `neutral` (2), `rotation`, `k_p`, `k_s`; the pressed sides stay the same.
    """
    normals = bearing.normals
    tangents = normals @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    M, d, touching = at.compliance, at.displacement, at.touching.astype(float)
    pressed = touching * (d @ normals.T - bearing.sides)
    slide = touching * (d @ tangents.T)
    turned = -(pressed @ tangents) - slide @ normals
    return {
        "sides": bearing.k_p * np.einsum("nij,kj,nk->nik", M, normals, touching),
        "neutral": bearing.k_s * M,
        "rotation": bearing.k_p * np.einsum("nij,nj->ni", M, turned),
        "k_p": -np.einsum("nij,nj->ni", M, pressed @ normals),
        "k_s": np.einsum("nij,nj->ni", M, bearing.neutral - d),
    }


def centred(sides: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the centre d0, shape (2,), and the clearances c_i, shape (N,), with ``sum c_i n_i = 0``.

    Side distances and centre trade off: a shift of the centre by e changes every c_i by -n_i.e. This
    normalisation (tpjb.md, section 5, T1 step 4) takes the first harmonic out of the clearances.
    """
    to_centre = centre_weights(normals)
    centre = to_centre @ sides
    return centre, sides - normals @ centre


def centre_weights(normals: np.ndarray) -> np.ndarray:
    """Return the matrix, shape (2, N), that gives the centre from the places of the sides."""
    return np.asarray(np.linalg.solve(normals.T @ normals, normals.T))


def corners(sides: Sequence[float] | np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the corners of the polygon ``n_i . d <= q_i`` in anticlockwise order, shape (m, 2).

    Empty where the sides do not close.
    """
    sides = np.asarray(sides, dtype=float)
    size = float(np.abs(sides).max(initial=0.0)) or 1.0
    found = []
    for i, j in combinations(range(len(sides)), 2):
        pair = normals[[i, j]]
        if abs(np.linalg.det(pair)) < 1e-6:
            continue
        point = np.linalg.solve(pair, sides[[i, j]])
        if (normals @ point <= sides + 1e-9 * size).all():
            found.append(point)
    if len(found) < 3:
        return np.zeros((0, 2))
    points = np.array(found)
    middle = points.mean(axis=0)
    return points[np.argsort(np.arctan2(*(points - middle).T[::-1]))]
