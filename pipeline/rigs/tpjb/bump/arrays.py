"""Tables of a bump test for the report and for whoever goes on: orbits, polygons, growth, sides. SI."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from pipeline.rigs.tpjb.bump.bearing_fit import BearingFit
from pipeline.rigs.tpjb.bump.contact import centred, corners


def arrays_of(fits: Mapping[str, BearingFit]) -> dict[str, pd.DataFrame]:
    """Return the tables by name; `bearing` tells the bearings apart."""
    tables: dict[str, list[pd.DataFrame]] = {"orbits": [], "polygons": [], "sides": [], "levels": [], "candidates": []}
    for bearing, fit in fits.items():
        for name, table in (
            ("orbits", _orbits(fit)),
            ("polygons", _polygons(fit)),
            ("sides", _sides(fit)),
            ("levels", _levels(fit)),
            (
                "candidates",
                pd.DataFrame({"n_pads": list(fit.count.misfits), "misfit": list(fit.count.misfits.values())}),
            ),
        ):
            table.insert(0, "bearing", bearing)
            tables[name].append(table)
    return {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}


def _orbits(fit: BearingFit) -> pd.DataFrame:
    blocks, parts = fit.blocks, []
    forces = np.array(blocks.levels)
    for plane, d in blocks.planes.items():
        contact = fit.contact
        model = contact.predicted[plane] if contact is not None else np.full_like(d, np.nan)
        parts.append(
            pd.DataFrame(
                {
                    "plane": plane,
                    "run": blocks.run.astype(str),
                    "time": blocks.time,
                    "level": blocks.level,
                    "force": forces[blocks.level],
                    "force_x": blocks.force[:, 0],
                    "force_y": blocks.force[:, 1],
                    "x": d[:, 0],
                    "y": d[:, 1],
                    "x_model": model[:, 0],
                    "y_model": model[:, 1],
                    "fitted": contact.kept if contact is not None else False,
                    "corner": contact.touching[plane].sum(axis=1) > 1 if contact is not None else False,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _polygons(fit: BearingFit) -> pd.DataFrame:
    """Return the corners of the polygon at no force (by the contact law) or at the largest one."""
    parts = []
    for plane, polygon in fit.top.items():
        sides, normals = polygon.sides, polygon.normals
        if fit.contact is not None:
            sides, normals = fit.contact.bearings[plane].sides, fit.contact.bearings[plane].normals
        points = corners(sides, normals) if not fit.absent else np.zeros((0, 2))
        parts.append(pd.DataFrame({"plane": plane, "x": points[:, 0], "y": points[:, 1]}))
    return pd.concat(parts, ignore_index=True)


def _sides(fit: BearingFit) -> pd.DataFrame:
    rows = []
    for plane, polygon in fit.top.items():
        bearing = fit.contact.bearings[plane] if fit.contact is not None else None
        sides = polygon.sides if bearing is None else bearing.sides
        normals = polygon.normals if bearing is None else bearing.normals
        centre, clearances = centred(np.where(sides < 0.5, sides, np.nan), normals)
        for i in range(fit.n_pads):
            rows.append(
                {
                    "plane": plane,
                    "side": i + 1,
                    "pad_angle": float(fit.pad_angles[i]),
                    "place": float(sides[i]) if i not in fit.absent else np.nan,
                    "normal_x": float(normals[i, 0]),
                    "normal_y": float(normals[i, 1]),
                    "clearance": float(clearances[i]),
                    "center_x": float(centre[0]),
                    "center_y": float(centre[1]),
                    "near": float(polygon.near[i]),
                    "touched": i not in fit.absent,
                }
            )
    return pd.DataFrame(rows)


def _levels(fit: BearingFit) -> pd.DataFrame:
    rows = []
    for plane, by_level in fit.polygons.items():
        for k, polygon in by_level.items():
            rows.append(
                {
                    "plane": plane,
                    "force": fit.blocks.levels[k],
                    "clearance": float(polygon.clearances.mean()),
                    "center_x": float(polygon.centre[0]),
                    "center_y": float(polygon.centre[1]),
                    "rotation": polygon.rotation,
                    "misfit": polygon.misfit,
                    "least_near": float(polygon.near.min()),
                    "blocks": int((fit.blocks.level == k).sum()),
                }
            )
    return pd.DataFrame(rows)
