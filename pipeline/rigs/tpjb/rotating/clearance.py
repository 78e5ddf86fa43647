"""The clearance polygon and centre that a bump test found, in the middle plane of the bearing.

Without the findings of `tpjb.bump` there is none, and orbits count from the probes' zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.tpjb.axes import mid_plane
from pipeline.rigs.tpjb.conditions import pad_angles_of


@dataclass(frozen=True, eq=False)
class Clearance:
    """Centre (x, y) in the probes' zero, m, mean clearance, m, and outline about the centre (columns x, y)."""

    centre: np.ndarray
    radius: float
    outline: pd.DataFrame


def clearances_of(uses: Mapping[str, Findings], recordings: Sequence[Recording]) -> dict[str, Clearance]:
    """Return the clearance by bearing ("" where the runs name none), from the bump findings that are used."""
    bumps = [findings for findings in uses.values() if findings.experiment == "tpjb.bump"]
    found: dict[str, Clearance] = {}
    for recording in recordings:
        bearing = str(recording.conditions.get("bearing", ""))
        if bearing in found:
            continue
        for findings in bumps:
            clearance = _clearance(findings, recording, bearing)
            if clearance is not None:
                found[bearing] = clearance
                break
    return found


def _clearance(findings: Findings, recording: Recording, bearing: str) -> Clearance | None:
    tested = {run.conditions.get("bearing") for run in findings.runs if run.used}
    if bearing and tested and bearing not in tested and tested != {None}:
        return None
    planes = {}
    for plane in (1.0, 2.0):
        centre = [_value(findings, f"center_{axis}", plane) for axis in "xy"]
        if all(value is not None for value in centre):
            planes[plane] = np.array(centre, dtype=float)
    if not planes:
        return None
    if len(planes) == 2:
        z1, z2 = (recording.conditions.get(name) for name in ("z1", "z2"))
        known = isinstance(z1, int | float) and isinstance(z2, int | float) and z1 != z2
        at = (float(z1), float(z2)) if known and z1 is not None and z2 is not None else (-1.0, 1.0)
        middle, _ = mid_plane(planes[1.0][:, None], planes[2.0][:, None], *at)
        centre_xy = middle[:, 0]
    else:
        centre_xy = next(iter(planes.values()))
    try:
        angles = pad_angles_of(recording)
    except InputError:
        return None
    if angles is None:
        return None
    sides = [_side(findings, number) for number in range(1, angles.size + 1)]
    turned = [_value(findings, "rotation", plane) for plane in planes]
    rotation = float(np.mean([value for value in turned if value is not None] or [0.0]))
    if any(side is None for side in sides):
        return None
    distances = np.array(sides, dtype=float)
    return Clearance(centre_xy, float(distances.mean()), outline_of(angles + math.pi + rotation, distances))


def outline_of(normals: np.ndarray, distances: np.ndarray) -> pd.DataFrame:
    """Return the corners, columns x and y, of the polygon n_i d <= c_i about its centre.

    Parameters
    ----------
    normals
        Directions of the sides, rad, shape (N,).
    distances
        c_i, m, shape (N,).
    """
    order = np.argsort(normals % (2.0 * math.pi))
    angle, c = normals[order], distances[order]
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = [np.linalg.solve(np.stack([n[i], n[i - 1]]), [c[i], c[i - 1]]) for i in range(angle.size)]
    return pd.DataFrame(np.array(corners), columns=["x", "y"])


def _value(findings: Findings, name: str, plane: float) -> float | None:
    found = [p for p in findings.parameters if p.name == name and p.at.get("plane") == plane and "side" not in p.at]
    return found[0].value if found else None


def _side(findings: Findings, side: int) -> float | None:
    """Return the clearance of a side, the mean of the planes that tell it."""
    values = [
        p.value
        for p in findings.parameters
        if p.name == "clearance" and p.at.get("side") == float(side) and p.value is not None
    ]
    return float(np.mean(values)) if values else None
