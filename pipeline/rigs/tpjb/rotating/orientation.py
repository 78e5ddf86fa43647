"""Do force and motion point the same way? Axes that are swapped or inverted, and units that cannot be.

A film pushes back where it is pushed: in pad axes the stiffness is nearly diagonal and positive. Told
from a rough linear stiffness, without any model.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.axes import FROM_UV
from pipeline.rigs.tpjb.rotating.record import Record

STIFFNESS_RANGE = (1e7, 1e11)
# Stiffness times clearance over static load of journal bearings is about 3.
_USUAL, _PLAUSIBLE = 3.0, (0.2, 40.0)
_GAP_RANGE = (1.5e-4, 6e-3)
# By how much what was read must be multiplied, and what was taken for what.
_LENGTHS = {
    25.4: "mil taken as um",
    1 / 25.4: "um taken as mil",
    1e3: "mm taken as um",
    1e-3: "um taken as mm, or mm as m",
    1e6: "m taken as um",
    1e-6: "um taken as m",
}
_FORCES = {
    1e3: "kN taken as N",
    1e-3: "N taken as kN",
    4.448: "lbf taken as N",
    9.807: "kgf taken as N",
    1 / 4.448: "N taken as lbf",
    1 / 9.807: "N taken as kgf",
}
_STIFFNESSES = {
    1 / 25.4: "gaps in mil taken as um",
    25.4: "gaps in um taken as mil",
    1e3: "gaps in um taken as mm, or forces in kN taken as N",
    1e-3: "gaps in mm taken as um, or forces in N taken as kN",
}


@dataclass(frozen=True, eq=False)
class Orientation:
    """How motion must be mapped (x and y, shape (2, 2)) so that the film pushes back; None where it does."""

    mend: np.ndarray | None
    findings: tuple[QualityFinding, ...]


def rough_stiffness(record: Record) -> np.ndarray:
    """Return the linear stiffness that the first harmonics of force and motion mean, x and y, shape (2, 2), N/m."""
    steady = record.rotation.steady
    angle = 2 * np.pi * record.rotation.frequency * record.orbit.time[steady]
    columns = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    D, F = (
        np.linalg.lstsq(columns, vector[:, steady].T, rcond=None)[0][1:].T
        for vector in (record.orbit.displacement, record.orbit.force)
    )
    return np.asarray(F @ np.linalg.pinv(D))


def orientation_of(record: Record) -> Orientation:
    """Return how the motion of a run must be mapped, and what that means."""
    K = FROM_UV.T @ rough_stiffness(record) @ FROM_UV
    size = float(np.linalg.norm(K))
    if not size > 0 or not np.isfinite(size):
        return Orientation(None, ())
    best, chosen = -np.inf, np.eye(2)
    for swap, signs in itertools.product((False, True), itertools.product((1.0, -1.0), repeat=2)):
        P = np.diag(signs) @ (np.eye(2)[::-1] if swap else np.eye(2))
        score = float(np.trace(K @ P.T)) / size
        if score > best + 1e-9:
            best, chosen = score, P
    present = float(np.trace(K)) / size
    if np.array_equal(chosen, np.eye(2)) or present > 0.5 * best or best < 1.0:
        return Orientation(None, ())
    text = (
        f"{_name(chosen)} Motion along u and v was mended so; where the forces are wrong instead, {_otherwise(chosen)}"
    )
    return Orientation(FROM_UV @ chosen @ FROM_UV.T, (QualityFinding("warning", text, record.run),))


def _name(P: np.ndarray) -> str:
    if P[0, 0] == 0:
        if P[0, 1] == P[1, 0] == 1:
            return "x axis mirrored (kxx < 0 with kyy > 0): probe u/v swapped?"
        if P[0, 1] == P[1, 0]:
            return "y axis mirrored (kyy < 0 with kxx > 0): probe u/v swapped and both inverted?"
        return "the motion stands across the force (kxx and kyy near 0): probe u/v swapped and one of them inverted?"
    if P[0, 0] == P[1, 1]:
        return (
            "the stator seems to move against the force (kxx < 0 and kyy < 0): sign of the gaps or of the forces? Gaps "
            "at +u and +v grow when the stator moves along +u and +v."
        )
    axis = "u" if P[0, 0] < 0 else "v"
    return f"the stator seems to move against the force along {axis}: probe {axis} inverted (p and m exchanged)?"


def _otherwise(P: np.ndarray) -> str:
    if P[0, 0] == P[1, 1] == -1:
        return "all quadratic terms change their sign. Mend it in the recipe."
    return "kxy, kyx and the quadratic terms are those of mirrored axes. Mend it in the recipe."


def unit_findings(record: Record) -> list[QualityFinding]:
    """Return what sizes say of the units: gaps, forces against the ratio as set, stiffness, orbit in the clearance.

    An error where the coefficients cannot be: stiffness out of all range, an orbit beyond the clearance,
    or a size of the gaps and a stiffness that are both unheard of.
    """
    K = rough_stiffness(record)
    k = math.sqrt(abs(float(np.linalg.det(K))))
    gaps, force = _gap_slip(record), _force_slip(record)
    found = [slip for slip in (gaps, force) if slip is not None]
    if not STIFFNESS_RANGE[0] <= k <= STIFFNESS_RANGE[1]:
        text = (
            f"the stiffness is about {k:.2g} N/m, outside {STIFFNESS_RANGE[0]:.0e} to {STIFFNESS_RANGE[1]:.0e} N/m: unit of "
            f"the forces or of the gaps?{'' if found else _slip(1e9 / k, _STIFFNESSES)}"
        )
        found.append(QualityFinding("error", text, record.run))
    else:
        found += _against_clearance(record, k, gaps is not None)
    return found


def _gap_slip(record: Record) -> QualityFinding | None:
    """Compare the gaps with what proximity probes at bearings show; gaps that were zeroed tell nothing."""
    gaps = np.array(list(record.gaps.values()))
    middle = float(np.median(gaps)) if gaps.size else math.nan
    if not (gaps > 0).all() or _GAP_RANGE[0] < middle < _GAP_RANGE[1] or not middle > 0:
        return None
    text = (
        f"the gaps are {1e3 * middle:.3g} mm, which no proximity probe at a bearing shows: unit of the gap channels?"
        f"{_slip(1e-3 / middle, _LENGTHS)}"
    )
    return QualityFinding("warning", text, record.run, next(iter(record.gaps)))


def _force_slip(record: Record) -> QualityFinding | None:
    """Compare the force with the ratio and static load as set."""
    stated, load = record.conditions.get("load_ratio"), record.static_load
    if not (isinstance(stated, float | int) and stated > 0 and load):
        return None
    factor = stated * load / record.rotation.size
    if 0.8 < factor < 1.25:
        return None
    percent = " Is it in percent?" if 80 < factor < 125 else ""
    text = (
        f"the turning force is {record.rotation.size:.4g} N, {100 * record.rotation.size / load:.3g} % of the static load, "
        f"and the log says {100 * stated:.3g} %: unit of force_u and force_v, or of load_ratio?{percent}"
        f"{_slip(factor, _FORCES)} The measured force is used."
    )
    return QualityFinding("warning", text, record.run, "force_u")


def _against_clearance(record: Record, k: float, sure: bool) -> list[QualityFinding]:
    c, W = record.conditions.get("clearance_nominal"), record.static_load
    if not (isinstance(c, float | int) and c > 0):
        return []
    found = []
    d = record.orbit.displacement[:, record.rotation.steady]
    radius = float(np.hypot(*(d - d.mean(axis=1, keepdims=True))).max())
    if radius > 1.2 * c:
        text = (
            f"the orbit reaches {1e6 * radius:.3g} um from its middle, and the clearance is {1e6 * c:.3g} um: unit of the "
            "gap channels, or of clearance_nominal?"
        )
        found.append(QualityFinding("error", text, record.run))
    elif W and not _PLAUSIBLE[0] < k * c / W < _PLAUSIBLE[1]:
        text = (
            f"stiffness times clearance over static load is {k * c / W:.2g}, and bearings have about {_USUAL:g}: unit of "
            f"gaps, forces, static_load or clearance_nominal?{_slip(W * _USUAL / (k * c), _STIFFNESSES)}"
        )
        found.append(QualityFinding("error" if sure else "warning", text, record.run))
    return found


def _slip(factor: float, known: Mapping[float, str]) -> str:
    """Return which slip of units a factor looks like, as a question; empty where like none."""
    likely = min(known, key=lambda slip: abs(math.log(factor / slip)))
    return f" A factor {factor:.3g}: {known[likely]}?" if abs(math.log(factor / likely)) < 0.5 else ""
