"""Where the fit of the contact law starts: stiffnesses and sides read off the polygons and the slides."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from pipeline.rigs.tpjb.bump.contact import Bearing
from pipeline.rigs.tpjb.bump.geometry import Polygon
from pipeline.rigs.tpjb.bump.levels import Blocks


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
