"""From the fit of a bearing to the parameters of the findings (tpjb.md, section 10), nulls with their reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import Covariance, propagate
from pipeline.findings import Parameter
from pipeline.rigs.tpjb.bump.bearing_fit import BearingFit
from pipeline.rigs.tpjb.bump.contact import centre_weights, side_normals
from pipeline.rigs.tpjb.bump.contact_fit import ContactFit
from pipeline.rigs.tpjb.bump.declaration import PARAMETERS

At = Mapping[str, float | str | bool]
_SPECS = {spec.name: spec for spec in PARAMETERS}
# Relative standard error beyond which a stiffness is not determined.
_VAGUE = 0.3


def parameters_of(fit: BearingFit, at: At) -> list[Parameter]:
    """Return all parameters of one bearing; `at` names it where a campaign holds several."""
    typeb = _type_b(fit, "sensor_gain_u")
    one_level = "; from one force level: that k_p holds at other forces is not checked" if _levels(fit) < 2 else ""
    method = (
        "contact law fitted to block means of all levels and planes, effective variance"
        if fit.contact is not None
        else "support function of the orbit at the largest force"
    )
    found = [
        *_per_plane(fit, at, typeb),
        *_tilts(fit, at),
        *_stiffnesses(fit, at, _type_b(fit, "sensor_gain_u", "force_gain_u") + one_level),
    ]
    return [_parameter(e, method) for e in found]


def _parameter(e: Estimate, method: str) -> Parameter:
    spec = _SPECS[e.name]
    told = (
        f"{spec.description}: {e.reason}"
        if e.value is None
        else "; ".join(t for t in (spec.description, e.reason) if t)
    )
    return Parameter(
        name=e.name,
        symbol=spec.symbol,
        value=e.value,
        std_error=e.std_error,
        ci95=e.ci95,
        unit=spec.unit,
        at=dict(e.at),
        description=told,
        source=spec.source,
        method=method,
    )


def _levels(fit: BearingFit) -> int:
    return len(fit.blocks.levels)


def _type_b(fit: BearingFit, *gains: str) -> str:
    """Return what calibration adds, from the conditions that tell it; empty where none does."""
    told = [max((_number(r.recording.conditions.get(g)) for r in fit.records), default=0.0) for g in gains]
    total = float(np.hypot.reduce(told))
    return f"interval is type A; type B: +-{100 * total:.2g} % (1 sigma, gains), all alike" if total else ""


def _number(value: float | str | bool | None) -> float:
    return abs(float(value)) if isinstance(value, int | float) else 0.0


def _per_plane(fit: BearingFit, at: At, typeb: str) -> list[Estimate]:
    found: list[Estimate] = []
    unpaired = {int(name[-1]) for record in fit.records for name in record.probes.unpaired}
    normalised = "normalised so that sum c_i n_i = 0; single side distances trade with the centre"
    for plane, polygon in fit.top.items():
        here = {**at, "plane": float(plane)}
        weights = centre_weights(polygon.normals)
        absent = list(fit.absent)
        lost = np.abs(weights[:, absent]).max(axis=1, initial=0.0) > 1e-9
        never = f"side {_sides(fit.absent)} was never touched"
        if fit.contact is None:
            found += _of_polygon(fit, here, lost, never)
            continue
        values, spread = _derived(fit.contact, plane, fit.n_pads, fit.absent)
        sd, dof = spread.std_error, spread.dof
        for axis, name in enumerate(("center_x", "center_y")):
            if lost[axis]:
                found.append(undetermined(name, f"{never}, so that the polygon is open", here))
            elif plane in unpaired:
                reason = (
                    f"a probe of plane {plane} stands without the opposite one: its zero is its own, the centre in it "
                    f"would read {1e6 * values[axis]:.4g} um"
                )
                found.append(undetermined(name, reason, here))
            else:
                found.append(
                    estimate(name, values[axis], sd[axis], dof=dof, at=here, reason=f"from the probes' zero; {typeb}")
                )
        sides = values[2 : 2 + fit.n_pads]
        keep = np.eye(fit.n_pads) - polygon.normals @ weights
        for i, c in enumerate(sides):
            there = {**here, "side": float(i + 1)}
            if np.abs(keep[i, absent]).max(initial=0.0) > 1e-9:
                found.append(undetermined("clearance", never, there))
            else:
                found.append(
                    estimate(
                        "clearance", c, sd[2 + i], dof=dof, at=there, reason=f"at zero force, {normalised}; {typeb}"
                    )
                )
        mean = values[-2]
        if absent:
            found.append(undetermined("clearance", f"{never}: no mean over all sides", here))
        else:
            found.append(
                estimate(
                    "clearance",
                    mean,
                    sd[-2],
                    dof=dof,
                    at=here,
                    reason=f"mean of all sides, cold, at zero force; {typeb}",
                )
            )
        found.append(estimate("rotation", values[-1], sd[-1], dof=dof, at=here))
    return found


def _sides(absent: Sequence[int]) -> str:
    return " and ".join(str(i + 1) for i in absent)


def _derived(contact: ContactFit, plane: int, n_pads: int, absent: Sequence[int]) -> tuple[np.ndarray, Covariance]:
    """Return centre (2), clearances (N), their mean, rotation, with their covariance."""
    bearing = contact.bearings[plane]
    names = [f"rotation_{plane}", *(f"side_{plane}_{i + 1}" for i in range(n_pads) if i not in absent)]
    rows = [contact.fit.names.index(name) for name in names]
    covariance = contact.fit.covariance
    matrix = covariance.matrix[np.ix_(rows, rows)]
    there = [i for i in range(n_pads) if i not in absent]

    def derived(p: np.ndarray) -> np.ndarray:
        normals = side_normals(bearing.pad_angles, float(p[0]))
        sides = np.zeros(n_pads)
        sides[there] = p[1:]
        centre = centre_weights(normals) @ sides
        c = sides - normals @ centre
        return np.concatenate([centre, c, [c.mean()], p[:1]])

    at = np.array([contact.fit.values[name] for name in names])
    return propagate(derived, at, Covariance(matrix, covariance.dof, covariance.method))


def _of_polygon(fit: BearingFit, here: At, lost: np.ndarray, never: str) -> list[Estimate]:
    """Return what the polygon alone tells where the contact law could not be fitted: no errors."""
    reason = f"{fit.reason or 'no contact law'}; the clearance at no force and its error are unknown"
    names = ("center_x", "center_y", "clearance", "rotation")
    return [undetermined(name, f"{never}; {reason}" if lost.any() else reason, here) for name in names]


def _tilts(fit: BearingFit, at: At) -> list[Estimate]:
    names = ("tilt_x", "tilt_y")
    if len(fit.blocks.planes) < 2:
        return [undetermined(name, "the probes measure one plane only", at) for name in names]
    places = {record.probes.z for record in fit.records}
    if None in places:
        return [undetermined(name, "the places z1, z2 of the probe planes are not given", at) for name in names]
    if len(places) > 1:
        return [undetermined(name, "the runs give different places z1, z2 of the probe planes", at) for name in names]
    unpaired = [name for record in fit.records for name in record.probes.unpaired]
    if unpaired:
        reason = f"{unpaired[0]} stands without the opposite probe: its zero is its own"
        return [undetermined(name, reason, at) for name in names]
    if fit.absent:
        return [
            undetermined(name, f"side {_sides(fit.absent)} was never touched: the centres are unknown", at)
            for name in names
        ]
    if fit.contact is None:
        return [undetermined(name, fit.reason, at) for name in names]
    z1, z2 = next(z for z in places if z is not None)
    values, spread = tilt_of(fit.contact, fit.n_pads, z1, z2)
    reason = f"difference of the centres in plane 2 and 1 over z2 - z1 = {z2 - z1:.4g} m"
    return [
        estimate(name, value, sd, dof=spread.dof, at=at, reason=reason)
        for name, value, sd in zip(names, values, spread.std_error, strict=True)
    ]


def tilt_of(contact: ContactFit, n_pads: int, z1: float, z2: float) -> tuple[np.ndarray, Covariance]:
    """Return the tilt along x and y, rad, shape (2,), with its covariance: both planes share noise of the force."""
    names = [n for p in (1, 2) for n in (f"rotation_{p}", *(f"side_{p}_{i + 1}" for i in range(n_pads)))]
    rows = [contact.fit.names.index(name) for name in names]
    covariance = contact.fit.covariance

    def tilt(p: np.ndarray) -> np.ndarray:
        centres = []
        for plane, part in zip((1, 2), np.split(p, 2), strict=True):
            normals = side_normals(contact.bearings[plane].pad_angles, float(part[0]))
            centres.append(centre_weights(normals) @ part[1:])
        return np.asarray((centres[1] - centres[0]) / (z2 - z1))

    at = np.array([contact.fit.values[name] for name in names])
    return propagate(tilt, at, Covariance(covariance.matrix[np.ix_(rows, rows)], covariance.dof, covariance.method))


def _stiffnesses(fit: BearingFit, at: At, remark: str) -> list[Estimate]:
    out = []
    for name, inner in (("contact_stiffness", "k_p"), ("support_stiffness", "k_s")):
        if fit.contact is None:
            out.append(undetermined(name, fit.reason, at))
            continue
        value, sd = fit.contact.fit.values[inner], fit.contact.fit.std_error[inner]
        if not np.isfinite(sd) or sd > _VAGUE * value:
            why = "pads were hardly pressed" if inner == "k_p" else "the stator was hardly seen sliding along a side"
            out.append(undetermined(name, f"{why}: the data do not determine it", at))
        else:
            out.append(
                estimate(name, value, sd, dof=fit.contact.fit.covariance.dof, at=at, logarithmic=True, reason=remark)
            )
    return out
