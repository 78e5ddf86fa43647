"""The paper's numbers on compression beside what this campaign gives (mre.md section 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.findings import Published
from pipeline.recording import Recording
from pipeline.rigs.mre.axial.levels import Level, stiffening
from pipeline.rigs.mre.axial.record import pads_of
from pipeline.rigs.mre.axial.theory import Theory, theory_of
from pipeline.rigs.mre.paper import DIAMETER, HEIGHT, STIFFENING, STIFFENING_CURRENT, axial_rows

_ABOUT = 0.05  # "about +65 %"


def published(levels: Sequence[Level], recordings: Sequence[Recording]) -> list[Published]:
    """Return the rows that make sense for these pads, none for other devices; checks of the paper alone come last."""
    used = {fit.run for level in levels for fit in level.runs}
    recording = next(r for r in recordings if r.run in used)
    rows = _beside_theory(levels, theory_of(recording.conditions))
    pads = pads_of(recording)
    if pads is None or not (
        math.isclose(pads.diameter, DIAMETER, rel_tol=0.02) and math.isclose(pads.height, HEIGHT, rel_tol=0.05)
    ):
        return rows
    return [*rows, *_stiffening(levels), *_drops(levels), *axial_rows()]


def _beside_theory(levels: Sequence[Level], theory: Theory | list[str]) -> list[Published]:
    level = next((level for level in levels if level.current == 0), None)
    if isinstance(theory, list) or level is None:
        return []
    found = level.numbers["stiffness_secant"].value
    if found is None:
        return []
    near = abs(found / theory.stiffness - 1)
    far = abs(found / theory.bonded - 1)
    remark = (
        f"secant at 0 A beside E A/h by eq. (1); with faces that do not slip it would be {theory.bonded / 1e3:.4g} kN/m "
        f"(E_c = E (1 + 2 S^2), S = {theory.shape_factor:.3f}). "
    )
    remark += (
        "Near E A/h: faces that slip well, or a compressible compound."
        if near < 0.25
        else "Near the bonded value: faces that do not slip."
        if far < 0.25
        else "Near neither: partial slip, or other moduli than given."
    )
    return [
        Published(
            name="axial stiffness at 0 A and E A/h", published=theory.stiffness, found=found, unit="N/m", where="section 5.1, Fig. 9",
            agrees=near < 0.1, remark=remark,
        )
    ]  # fmt: skip


def _stiffening(levels: Sequence[Level]) -> list[Published]:
    rows = []
    for e in stiffening(levels):
        if e.value is None or abs(float(e.at["coil_current"]) - STIFFENING_CURRENT) > 0.1:
            continue
        kind = e.name.removeprefix("stiffening_")
        rows.append(
            Published(
                name=f"axial stiffening at 2 A, {kind}", published=STIFFENING, found=e.value, where="Fig. 8",
                agrees=bool(abs(e.value - STIFFENING) < _ABOUT + 1.96 * (e.std_error or 0.0)),
                remark="the paper does not say which stiffness; 'about' is taken as 5 points",
            )
        )  # fmt: skip
    return rows


def _drops(levels: Sequence[Level]) -> list[Published]:
    base, high = (
        next((lv for lv in levels if lv.current is not None and abs(lv.current - at) < 0.1), None) for at in (0.0, 2.0)
    )
    drops = [lv.numbers["unloading_drop"].value if lv is not None else None for lv in (base, high)]
    if drops[0] is None or drops[1] is None:
        return []
    return [
        Published(
            name="drop of the force when the release begins, 0 A and 2 A", published="larger at 2 A",
            found=f"{drops[0]:.3g} N, {drops[1]:.3g} N", where="section 5.1", agrees=bool(drops[1] > drops[0]), remark="",
        )
    ]  # fmt: skip
