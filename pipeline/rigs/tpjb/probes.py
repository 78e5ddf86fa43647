"""From the gap channels to the motion of the stator against the shaft: one linear map of the probes.

Which probes are sound is judged in `probe_faults`; here nothing but geometry.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError, counted, listing
from pipeline.recording import Condition, QualityFinding
from pipeline.rigs.tpjb.axes import FROM_UV, mid_plane

GAPS = tuple(f"gap_{axis}{side}{plane}" for plane in (1, 2) for axis in "uv" for side in "pm")


@dataclass(frozen=True, eq=False)
class Probes:
    """The way from gaps of shape (k, n), in the order of `names`, to motion: ``displacement @ gaps``.

    Attributes
    ----------
    names
        The k gap channels in use.
    displacement
        Shape (2, k): x and y of the middle plane, m.
    tilt
        Shape (2, k): tilt along x and y, rad; None without both planes in both directions.
    planes
        Shape (2, k) each: x and y in probe plane 1 and 2, m; only planes with both directions.
    z
        Where plane 1 and 2 stand from the middle plane, m; None where that was not given.
    unpaired
        Probes without the opposite one of their pair: their zero is their own, only changes count.
    findings
        What this map has to say of itself.
    """

    names: tuple[str, ...]
    displacement: np.ndarray
    tilt: np.ndarray | None
    planes: Mapping[int, np.ndarray]
    z: tuple[float, float] | None = None
    unpaired: tuple[str, ...] = ()
    findings: tuple[QualityFinding, ...] = ()


def probes_of(
    channels: Iterable[str],
    conditions: Mapping[str, Condition],
    excluded: Collection[str] = (),
    run: str | None = None,
) -> Probes:
    """Return the map from the gap channels of a run to the motion of the middle plane.

    The displacement along an axis is half the difference of an opposed pair; of a pair with one
    probe left, that one. Two planes are interpolated to the middle (`axes.mid_plane`), by the
    plain mean where `z1`, `z2` are not given; one plane is taken as it stands.

    Parameters
    ----------
    channels
        Channels of the run (others than gaps are passed over).
    conditions
        Of the run; `z1`, `z2` (m) are looked up.
    excluded
        Probes that are not to be used.

    Raises
    ------
    InputError
        If u or v has no probe at all, or z1 equals z2.
    """
    names = tuple(name for name in GAPS if name in set(channels) and name not in excluded)
    rows = {(axis, plane): _difference(names, axis, plane) for axis in "uv" for plane in (1, 2)}
    found = {key: row for key, row in rows.items() if row is not None}
    of_run = f"run '{run}'" if run else "the run"
    for axis in "uv":
        if not any(key[0] == axis for key in found):
            expected = listing(name for name in GAPS if name[4] == axis)
            out = f" ({listing(excluded)} left out as faulty)" if excluded else ""
            raise InputError(
                f"{of_run} has no sound probe along {axis}{out}; expected at least one of {expected}. Map the gap "
                "channels in the recipe."
            )
    both = all(key in found for key in rows)
    findings: list[QualityFinding] = []
    z = _planes_at(conditions, both, of_run, run, findings)
    planes = {p: _from_uv(found["u", p], found["v", p]) for p in (1, 2) if {("u", p), ("v", p)} <= found.keys()}
    if both:
        at = z or (-1.0, 1.0)
        displacement, tilt = mid_plane(planes[1], planes[2], *at)
    else:
        displacement, tilt = (
            _from_uv(*(np.mean([r for k, r in found.items() if k[0] == a], axis=0) for a in "uv")),
            None,
        )
        seen = listing(f"{axis} in plane {plane}" for axis, plane in found)
        text = f"probes measure {seen} only: motion of the middle plane is taken as theirs and the tilt is unknown."
        findings.append(QualityFinding("note" if len(planes) == 1 == len(found) - 1 else "warning", text, run))
    unpaired = tuple(name for name in names if opposite(name) not in names)
    if unpaired:
        have = "stands" if len(unpaired) == 1 else "stand"
        text = f"{listing(unpaired)} {have} without the opposite probe: zero and drift of the probe are not cancelled."
        findings.append(QualityFinding("note", text, run))
    return Probes(names, displacement, tilt if z else None, planes, z, unpaired, tuple(findings))


def _planes_at(
    conditions: Mapping[str, Condition], both: bool, of_run: str, run: str | None, findings: list[QualityFinding]
) -> tuple[float, float] | None:
    """Return z1 and z2 where both are given; say it where two planes need them and they are not."""
    given = {name: conditions[name] for name in ("z1", "z2") if conditions.get(name) is not None}
    for name, value in given.items():
        if isinstance(value, str | bool) or not np.isfinite(value):
            raise InputError(f"{of_run}: {name} is {value!r}; expected where the probe plane stands, in m, signed.")
    if len(given) == 2:
        if given["z1"] == given["z2"]:
            raise InputError(
                f"{of_run}: z1 and z2 are both {given['z1']:g} m; two probe planes stand at different places. Give "
                "them signed from the middle plane, for example z1: -0.12, z2: 0.12."
            )
        return float(given["z1"]), float(given["z2"])
    if both:
        text = (
            "the places z1, z2 of the probe planes are not given: the middle plane is taken as the mean of both, the "
            "tilt stays unknown. Give z1 and z2 (m, signed from the middle plane)."
        )
        findings.append(QualityFinding("warning", text, run))
    return None


def _difference(names: tuple[str, ...], axis: str, plane: int) -> np.ndarray | None:
    """Return the row, shape (k,), that gives the displacement along `axis` in `plane`; None without a probe."""
    signs = {name: sign for sign, side in ((1.0, "p"), (-1.0, "m")) if (name := f"gap_{axis}{side}{plane}") in names}
    if not signs:
        return None
    return np.array([signs.get(name, 0.0) for name in names]) / len(signs)


def _from_uv(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.asarray(FROM_UV @ np.vstack((u, v)))


def opposite(name: str) -> str:
    """Return the other probe of a pair.

    Examples
    --------
    >>> opposite("gap_up1")
    'gap_um1'
    """
    return name[:5] + ("m" if name[5] == "p" else "p") + name[6:]


def describe(probes: Probes) -> str:
    """Return how the displacement was had, for a methods text."""
    planes = "two planes" if len(probes.planes) == 2 else "one plane" if probes.planes else "different planes"
    return f"{counted(len(probes.names), 'proximity probe')} in {planes}"
