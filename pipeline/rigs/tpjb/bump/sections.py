"""What the report of a bump test shows: orbits in their polygons, growth with the force, sides, alignment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Outline,
    Panel,
    Points,
    Rule,
    Section,
    Status,
    Table,
    Text,
    Value,
)
from pipeline.rigs.tpjb.bump.answers import all_round, converged, left_over, spread, steady, three_digits, value_of

if TYPE_CHECKING:
    import pandas as pd

X, Y = Axis("x, horizontal", "m"), Axis("y, vertical", "m")
_FORCE = Axis("size of the turning force", "N")
# A pad is drawn as a block: half its length, its gap to the side and its thickness over the clearance.
_PAD_LENGTH, _PAD_GAP, _PAD_THICKNESS = 0.4, 0.06, 0.1
_PAD_LABEL = 0.12  # from the block to the middle of its name, once more along x, where names are long


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters of the report."""
    bearings = list(findings.arrays["orbits"]["bearing"].unique())
    chapters = [
        Section("clearance", "Clearance polygon", [b for name in bearings for b in _clearance(findings, name)]),
        Section("growth", "Growth with the force", [b for name in bearings for b in _growth(findings, name)]),
        Section("alignment", "Alignment", [_alignment(findings)]),
        Section(
            "contact", "How well the contact law holds", [b for name in bearings for b in _residuals(findings, name)]
        ),
    ]
    return [chapter for chapter in chapters if chapter.blocks]


def _of(findings: Findings, table: str, bearing: str) -> pd.DataFrame:
    whole: pd.DataFrame = findings.arrays[table]
    return whole.loc[whole["bearing"] == bearing]


def _title(text: str, bearing: str) -> str:
    return f"{text}, bearing {bearing}" if bearing else text


def _clearance(findings: Findings, bearing: str) -> list[Figure | Table | Text]:
    orbits, sides = _of(findings, "orbits", bearing), _of(findings, "sides", bearing)
    polygons = _of(findings, "polygons", bearing)
    panels = []
    for plane in sorted(orbits["plane"].unique()):
        orbit, side = orbits[orbits["plane"] == plane], sides[sides["plane"] == plane]
        corner = polygons[polygons["plane"] == plane]
        marks: list[Mark] = []
        if len(corner):
            marks.append(Outline(corner["x"].to_numpy(), corner["y"].to_numpy(), "reference", "clearance at no force"))
        marks += _pads(side)
        for k, level in enumerate(sorted(orbit["level"].unique())):
            part = orbit[orbit["level"] == level]
            marks.append(Line(*_broken(part), k, _newtons(part["force"].iloc[0])))
        if side["center_x"].notna().all():
            marks.append(
                Points(side["center_x"].to_numpy()[:1], side["center_y"].to_numpy()[:1], "reference", "centre")
            )
        panels.append(Panel(marks, X, Y, f"plane {plane}", equal=True))
    figure = Figure(
        f"orbits_{bearing}" if bearing else "orbits",
        _title("Orbits in the clearance", bearing),
        f"Does the stator go all round the clearance? {all_round(findings, bearing, sides)} Displacement of the stator against "
        "the shaft, from the zero of the probes; one colour a force. The tinted polygon is the clearance at no force, the blocks "
        "are the pads, drawn at the side where the stator meets them (opposite to where they stand on the stator).",
        "orbits at each force inside the clearance polygon with the pads, one panel a probe plane, equal axes",
        panels,
        columns=2,
    )
    told = (
        "What is observable: the centre, the rotation, the mean clearance and N − 3 differences between N pads. A shift of the "
        "centre and the first harmonic of the side distances look alike, so the distances are normalised: weighted with the "
        "normals of the sides they add up to zero. With four pads the two of an opposed pair are then equal by definition, and only their common width is measured."
    )
    return [figure, *_corner(orbits, polygons, bearing), _sides_table(findings, bearing, sides), Text([told])]


def _broken(part: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return the orbit with a break where blocks are missing."""
    x, y, time = part["x"].to_numpy(), part["y"].to_numpy(), part["time"].to_numpy()
    if time.size < 3:
        return x, y
    far = np.flatnonzero(np.abs(np.diff(time)) > 5 * np.median(np.abs(np.diff(time)))) + 1
    return np.insert(x, far, np.nan), np.insert(y, far, np.nan)


def _pads(side: pd.DataFrame) -> list[Mark]:
    """Return each pad as a block outside its side, with its number."""
    marks: list[Mark] = []
    labels: list[np.ndarray] = []
    shown = side[side["touched"]].to_dict("records")
    for row in shown:
        n = np.array([row["normal_x"], row["normal_y"]])
        t = np.array([-n[1], n[0]])
        centre = np.array([row["center_x"], row["center_y"]])
        c = row["clearance"] if math.isfinite(row["clearance"]) else abs(row["place"])
        foot = n * row["place"] + t * (float(t @ centre) if np.isfinite(centre).all() else 0.0)
        inner, outer, half = _PAD_GAP * c * n, (_PAD_GAP + _PAD_THICKNESS) * c * n, _PAD_LENGTH * c * t
        block = foot + np.array([inner - half, inner + half, outer + half, outer - half])
        marks.append(Outline(block[:, 0], block[:, 1], "reference"))
        labels.append(foot + (_PAD_GAP + _PAD_THICKNESS + _PAD_LABEL * (1.0 + abs(n[0]))) * c * n)
    if labels:
        x, y = np.array(labels).T
        marks.append(Points(x, y, "reference", texts=[f"pad {row['side']}" for row in shown], bare=True))
    return marks


def _corner(orbits: pd.DataFrame, polygons: pd.DataFrame, bearing: str) -> list[Figure]:
    """Return the orbits near the uppermost corner of each plane, where they grow with the force."""
    panels = []
    grown: list[str] = []
    for plane in sorted(orbits["plane"].unique()):
        orbit, corner = orbits[orbits["plane"] == plane], polygons[polygons["plane"] == plane]
        if corner.empty:
            return []
        points = corner[["x", "y"]].to_numpy()
        at = points[points[:, 1].argmax()]
        beyond = orbit[["x", "y"]].to_numpy() - at
        reach = 2.0 * max(float(beyond[:, 1].max()), 1e-7)
        near = (np.abs(beyond) < reach).all(axis=1)
        marks: list[Mark] = []
        for k, (level, part) in enumerate(orbit.groupby("level")):
            shown = beyond[near & (orbit["level"] == level).to_numpy()]
            marks.append(Points(shown[:, 0], shown[:, 1], k, _newtons(part["force"].iloc[0])))
        tops = orbit.assign(top=beyond[:, 1])[near].groupby("level").agg({"force": "first", "top": "max"})
        if len(tops) > 1:
            (first, low), (last, high) = tops.iloc[0], tops.iloc[-1]
            grown.append(f"{1e6 * (high - low):.1f} um from {_newtons(first)} to {_newtons(last)} in plane {plane}")
        place = int(points[:, 1].argmax())
        for other in (points[place - 1], points[(place + 1) % len(points)]):
            way = (other - at) / np.linalg.norm(other - at) * reach
            marks.append(Line(np.array([0.0, way[0]]), np.array([0.0, way[1]]), "reference", "sides at no force"))
        panels.append(
            Panel(marks, Axis("x from the corner", "m"), Axis("y from the corner", "m"), f"plane {plane}", equal=True)
        )
    answer = (
        f"The orbit reaches further by {listing(grown, 4)}."
        if grown
        else "There is one force only, so that nothing is told."
    )
    return [
        Figure(
            f"corner_{bearing}" if bearing else "corner",
            _title("Growth at the upper corner", bearing),
            f"What does more force add? {answer} Block means near the uppermost corner of the polygon: there the stator sinks "
            "into both pads, and the corner of the orbit becomes an arc.",
            "orbits near one corner, enlarged, one colour a force, one panel a plane, equal axes",
            panels,
            columns=2,
        )
    ]


def _newtons(force: float) -> str:
    return f"{force / 1000:.3g} kN" if force >= 1000 * 0.95 else f"{force:.3g} N"


def _sides_table(findings: Findings, bearing: str, sides: pd.DataFrame) -> Table:
    rows: list[list[Cell]] = []
    for row in sides.to_dict("records"):
        found = value_of(findings, "clearance", bearing, plane=float(row["plane"]), side=float(row["side"]))
        touched: Cell = Status("touched", "ok") if row["touched"] else Status("never touched", "warning")
        rows.append([f"{row['plane']}", f"{row['side']}", row["pad_angle"], found, three_digits(row["near"]), touched])
    for plane in sorted(sides["plane"].unique()):
        mean = value_of(findings, "clearance", bearing, plane=float(plane))
        rows.append([f"{plane}", "mean", None, mean, None, ""])
    return Table(
        f"sides_{bearing}" if bearing else "sides",
        _title("Cold assembled clearance, side by side", bearing),
        f"How wide is it? {spread(sides)} Distance of each side from the centre at no force, normalised. Side i is where the "
        "stator meets pad i; the share is that of the samples close to the side at the largest force.",
        [
            Column("plane"),
            Column("side"),
            Column("pad direction", "rad"),
            Column("clearance", "m"),
            Column("samples at the side", "%"),
            Column("seen"),
        ],
        rows,
    )


def _growth(findings: Findings, bearing: str) -> list[Figure | Table]:
    levels = _of(findings, "levels", bearing)
    blocks: list[Figure | Table] = []
    k_p = value_of(findings, "contact_stiffness", bearing)
    zeros = {int(p): value_of(findings, "clearance", bearing, plane=float(p)) for p in sorted(levels["plane"].unique())}
    known = {p: zero.value for p, zero in zeros.items() if zero is not None and zero.value is not None}
    if levels["force"].nunique() > 1 and known:
        marks: list[Mark] = []
        for plane, zero in known.items():
            part = levels[levels["plane"] == plane]
            grown = part["clearance"].to_numpy() - zero
            marks.append(Points(part["force"].to_numpy(), grown, plane - 1, f"polygon, plane {plane}"))
        if k_p is not None and k_p.value:
            force = np.array([0.0, levels["force"].max()])
            marks.append(Line(force, force / k_p.value, "model", "compliance of a pad, F/k_p"))
        blocks.append(
            Figure(
                f"growth_{bearing}" if bearing else "growth",
                _title("Growth of the clearance with the force", bearing),
                f"Has the polygon converged? {converged(findings, levels, k_p)} Points: mean clearance of the polygon laid round "
                "the orbit at each force, less that at no force; those of the planes lie over each other where they agree. "
                "Line: one pad pressed by the whole force. Points lie below it where the support carries a part of the force; a "
                "straight line through them would give too small a clearance at no force.",
                "growth of the mean clearance over the force, one colour a plane, with the contact's compliance",
                [Panel(marks, _FORCE, Axis("mean clearance less that at no force", "m"))],
            )
        )
    rows: list[list[Cell]] = [
        [
            str(row["plane"]),
            row["force"],
            row["clearance"],
            row["center_x"],
            row["center_y"],
            row["rotation"],
            three_digits(row["misfit"]),
            three_digits(row["least_near"]),
        ]
        for row in levels.to_dict("records")
    ]
    blocks.append(
        Table(
            f"levels_{bearing}" if bearing else "levels",
            _title("Polygon at each force", bearing),
            f"Is it the same polygon at every force? {steady(levels)} As the polygon stands in the orbit, compliance included. "
            "The last column is the share of the samples at the side that has fewest.",
            [
                Column("plane"),
                Column("force", "N"),
                Column("mean clearance", "m"),
                Column("centre x", "m"),
                Column("centre y", "m"),
                Column("rotation", "rad"),
                Column("rms distance", "m"),
                Column("fewest at a side", "%"),
            ],
            rows,
        )
    )
    return blocks


def _alignment(findings: Findings) -> Table:
    limit = float(findings.settings.get("alignment_limit", 100e-6))
    rows: list[list[Cell]] = []
    answers: list[str] = []
    for p in (q for q in findings.parameters if q.name == "tilt_x"):
        other = findings.one("tilt_y", **p.at)
        name = f" {p.at['bearing']}" if "bearing" in p.at else ""
        for q, axis in ((p, "x"), (other, "y")):
            rows.append([f"tilt along {axis}{name}", Value(q.value, q.std_error, q.ci95), limit, _held(q.value, limit)])
        if p.value is None or other.value is None:
            continue
        size = math.hypot(p.value, other.value)
        sd = (
            math.hypot(p.value * (p.std_error or 0.0), other.value * (other.std_error or 0.0)) / size
            if size > 0
            else 0.0
        )
        rows.append([f"size{name}", Value(size, sd), limit, _held(size, limit)])
        side = "within" if size <= limit else "beyond"
        answers.append(f"tilt{name} is {1e6 * size:.3g} µrad, {side} the limit of {1e6 * limit:.3g} µrad")
    answer = f"The {'; the '.join(answers)}." if answers else "It cannot be told, see the parameters."
    return Table(
        "alignment",
        "Tilt of the bearing against the shaft",
        f"Does the bearing stand square to the shaft? {answer} Difference of the centres in the two probe planes over their "
        "distance.",
        [Column("tilt"), Column("found", "rad"), Column("limit", "rad"), Column("verdict")],
        rows,
    )


def _held(value: float | None, limit: float) -> Status:
    if value is None:
        return Status("not determined", "warning")
    return Status("within", "ok") if abs(value) <= limit else Status("beyond", "warning")


def _residuals(findings: Findings, bearing: str) -> list[Figure]:
    orbits = _of(findings, "orbits", bearing)
    shown = orbits[orbits["fitted"].astype(bool)]
    if shown.empty:
        return []
    panels = []
    for plane in sorted(shown["plane"].unique()):
        part = shown[(shown["plane"] == plane) & shown["corner"].astype(bool)]
        marks: list[Mark] = [
            Points(part["time"].to_numpy(), (part[axis] - part[f"{axis}_model"]).to_numpy(), k, axis)
            for k, axis in enumerate("xy")
        ]
        panels.append(
            Panel([*marks, Rule(y=0.0)], Axis("time", "s"), Axis("measured less model", "m"), f"plane {plane}")
        )
    return [
        Figure(
            f"residuals_{bearing}" if bearing else "residuals",
            _title("What the contact law leaves", bearing),
            f"Is only noise left? {left_over(findings, panels)} Block means while two pads hold the stator, where noise of the "
            "force hardly moves it. Steps with the force would be a contact that is not linear, a slope would be drift.",
            "residual displacement over time, one panel a plane",
            panels,
            columns=1,
            share_x=True,
        )
    ]
