"""From the fit of a bearing to the parameters of the findings (tpjb.md, section 10), nulls with their reasons."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import Covariance, propagate
from pipeline.findings import Parameter
from pipeline.rigs.tpjb.bump.bearing_fit import BearingFit
from pipeline.rigs.tpjb.bump.contact import centre_weights, side_normals
from pipeline.rigs.tpjb.bump.contact_fit import ContactFit
from pipeline.rigs.tpjb.bump.declaration import PARAMETERS
from pipeline.rigs.tpjb.bump.faults import friction_of
from pipeline.rigs.tpjb.gains import Gains, gains_of, with_type_b

At = Mapping[str, float | str | bool]
_SPECS = {spec.name: spec for spec in PARAMETERS}
# Relative standard error beyond which a stiffness is not determined.
_VAGUE = 0.3
# Powers of the gains of probes and load cells that a number goes with; lengths and angles over z2 - z1 take the probes' alone.
_POWERS = {"rotation": (0.0, 0.0), "contact_stiffness": (1.0, 1.0), "support_stiffness": (1.0, 1.0)}


def parameters_of(fit: BearingFit, at: At, condemned: str = "") -> list[Parameter]:
    """Return all parameters of one bearing; `at` names it where a campaign holds several.

    `condemned` says why none of them means anything; they are all undetermined then.
    """
    one_level = "from one force level: that k_p holds at other forces is not checked" if _levels(fit) < 2 else ""
    method = (
        "contact law fitted to block means of all levels and planes, effective variance"
        if fit.contact is not None
        else "support function of the orbit at the largest force"
    )
    found = [
        *_per_plane(fit, at),
        *_tilts(fit, at),
        *_stiffnesses(fit, at, one_level),
    ]
    gains = gains_of(record.recording.conditions for record in fit.records)
    return [_parameter(undetermined(e.name, condemned, e.at) if condemned else e, method, gains) for e in found]


def _parameter(e: Estimate, method: str, gains: Gains) -> Parameter:
    spec, powers = _SPECS[e.name], _POWERS.get(e.name, (1.0, 0.0))
    told = (
        f"{spec.description}: {e.reason}"
        if e.value is None
        else "; ".join(t for t in (spec.description, e.reason, gains.text(*powers)) if t)
    )
    found = Parameter(
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
    return with_type_b(found, gains.share(*powers) * abs(e.value or 0.0))


def _levels(fit: BearingFit) -> int:
    return len(fit.blocks.levels)


def _per_plane(fit: BearingFit, at: At) -> list[Estimate]:
    found: list[Estimate] = []
    for plane, polygon in fit.top.items():
        here = {**at, "plane": float(plane)}
        if fit.contact is None:
            names = ("center_x", "center_y", "clearance", "rotation")
            found += [
                undetermined(name, f"{fit.reason}: the place of the sides at no force is unknown", here)
                for name in names
            ]
            continue
        unknown = _unknown_sides(fit, plane)
        values, spread = _derived(fit.contact, plane, fit.n_pads, unknown)
        sd, dof = spread.std_error, spread.dof
        weights = centre_weights(polygon.normals)
        to_sides = np.vstack(
            [weights, np.eye(fit.n_pads) - polygon.normals @ weights, np.full(fit.n_pads, 1 / fit.n_pads)]
        )
        lost = np.abs(to_sides[:, unknown]).max(axis=1, initial=0.0) > 1e-9
        never = _why(fit, unknown)
        for row, name, there, remark in _rows(fit.n_pads, here):
            own_zero = _own_zero(fit, plane) if name.startswith("center") else ""
            if lost[row]:
                found.append(undetermined(name, never, there))
            elif own_zero:
                found.append(
                    undetermined(name, f"{own_zero}; the centre in it would read {1e6 * values[row]:.4g} um", there)
                )
            else:
                found.append(estimate(name, values[row], sd[row], dof=dof, at=there, reason=remark))
        found.append(estimate("rotation", values[-1], sd[-1], dof=dof, at=here))
    return found


def _rows(n_pads: int, here: At) -> Iterator[tuple[int, str, At, str]]:
    """Yield row of `_derived`, name, operating point and remark of centre, clearances and their mean."""
    normalised = "at no force, normalised so that sum c_i n_i = 0: single side distances trade with the centre"
    yield 0, "center_x", here, "from the probes' zero"
    yield 1, "center_y", here, "from the probes' zero"
    for i in range(n_pads):
        yield 2 + i, "clearance", {**here, "side": float(i + 1)}, normalised
    yield 2 + n_pads, "clearance", here, "mean of all sides, cold assembled, at no force"


def _unknown_sides(fit: BearingFit, plane: int) -> list[int]:
    """Return the sides, from 0, whose place is not determined: never touched, or never left."""
    assert fit.contact is not None
    sd = fit.contact.fit.std_error
    # Known no better than the indentation by a force like the largest one: any constant force would move it so far.
    limit = max(fit.blocks.levels) / fit.contact.fit.values["k_p"]
    loose = [i for i in range(fit.n_pads) if not sd.get(f"side_{plane}_{i + 1}", math.inf) < limit]
    return sorted({*fit.absent, *loose})


def _why(fit: BearingFit, unknown: Sequence[int]) -> str:
    loose = [i for i in unknown if i not in fit.absent]
    never = f"side {_sides(fit.absent)} was never touched" if fit.absent else ""
    always = (
        f"the place of side {_sides(loose)} cannot be told from a constant force, since it was always pressed"
        if loose
        else ""
    )
    return "; ".join(t for t in (never, always) if t)


def _own_zero(fit: BearingFit, plane: int) -> str:
    alone = [name for r in fit.records for name in r.probes.unpaired if name.endswith(str(plane))]
    return f"{alone[0]} stands without the opposite probe, so that its zero is its own" if alone else ""


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
        mu = friction_of(fit, fit.contact) if inner == "k_s" else 0.0
        if mu:
            why = f"friction of about {mu:.3f} holds the stator along the sides; it would read {value:.4g} N/m"
            out.append(undetermined(name, why, at))
        elif not np.isfinite(sd) or sd > _VAGUE * value:
            why = "pads were hardly pressed" if inner == "k_p" else "the stator was hardly seen sliding along a side"
            out.append(undetermined(name, f"{why}: the data do not determine it", at))
        else:
            out.append(
                estimate(name, value, sd, dof=fit.contact.fit.covariance.dof, at=at, logarithmic=True, reason=remark)
            )
    return out
