"""What the paper says of force and field at a fixed gap beside what these logs give (mre.md section 4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pipeline.findings import Published
from pipeline.recording import Recording
from pipeline.rigs.mre import paper
from pipeline.rigs.mre.hold.analysis import Analysed
from pipeline.rigs.mre.hold.blank import pole_pull
from pipeline.rigs.mre.hold.field_fit import FieldFit

_ROUNDING = 0.02  # what "about" may mean


def published(
    analysed: Sequence[Analysed], fields: Mapping[str, FieldFit], recordings: Sequence[Recording]
) -> list[Published]:
    """Return the rows that make sense for these pads, none for others."""
    if not any(_papers_pads(recording) for recording in recordings):
        return []
    rows: list[Published] = []
    for found in analysed[:1]:
        rows += _increments(found)
    for field in list(fields.values())[:1]:
        rows += _flux(field)
    return [*rows, *paper.hold_rows()]


def _papers_pads(recording: Recording) -> bool:
    diameter, height = (recording.conditions.get(name) for name in ("pad_diameter", "pad_height"))
    return (
        isinstance(diameter, float)
        and isinstance(height, float)
        and math.isclose(diameter, paper.DIAMETER, rel_tol=0.02)
        and math.isclose(height, paper.HEIGHT, rel_tol=0.05)
    )


def _increments(found: Analysed) -> list[Published]:
    top = float(found.rows.current.max())
    rows: list[Published] = []
    if top >= paper.INCREMENT_CURRENT - 0.1:
        value, sd = found.fit.increment(paper.INCREMENT_CURRENT)
        rows.append(
            Published(
                name="force increment at 6 A, gap held",
                published=paper.FORCE_INCREMENT,
                found=value,
                where="Fig. 10",
                agrees=bool(abs(value - paper.FORCE_INCREMENT) <= _ROUNDING + 1.96 * sd),
                remark="relaxation taken out; the paper tells neither how long it waited nor whether it swept back",
            )
        )
    if top >= paper.STIFFENING_CURRENT:
        value, sd = found.fit.increment(paper.STIFFENING_CURRENT)
        ratio = f"{paper.STIFFENING / value:.2g}" if value > 0 else "not told"
        rows.append(
            Published(
                name="axial stiffening at 2 A beside the force increment at 2 A",
                published=paper.STIFFENING,
                found=value,
                where="Figs 8, 10",
                agrees=bool(abs(value - paper.STIFFENING) <= _ROUNDING + 1.96 * sd),
                remark=f"ratio {ratio}: at a fixed gap force follows stiffness, so both cannot be one quantity; pull of the poles, "
                "relaxation and a gap that gives are the suspects",
            )
        )
    state = found.saturation.state
    seen = state == "seen"
    p = found.saturation.fit.p
    sharp = bool(seen and 5.0 < found.saturation.fit.I_s < 7.0 and p > 5)
    rows.append(
        Published(
            name="shape of the force against current",
            published="straight to 6 A, then no further",
            found=f"bends at {found.saturation.fit.I_s:.2f} A, sharpness {p:.3g}" if seen else f"saturation {state}",
            where="Fig. 10",
            agrees=sharp if seen else None,
            remark="straight, then flat needs a sharpness p of 8 or more; the law of Froehlich and Kennelly has 1, a hyperbolic tangent about 2.5",
        )
    )
    return rows


def _flux(field: FieldFit) -> list[Published]:
    if float(abs(field.current).max()) < paper.INCREMENT_CURRENT - 0.1:
        return []
    value, sd = field.flux_at(paper.INCREMENT_CURRENT)
    return [
        Published(
            name="flux density at 6 A",
            published=paper.FLUX,
            found=value,
            unit="T",
            where="section 5.2",
            agrees=bool(abs(value - paper.FLUX) <= 0.05 + 1.96 * sd),
            remark="the paper says what the coil is able to give",
        ),
        Published(
            name="pull of the poles at 6 A on the area of a pad",
            published=None,
            found=float(pole_pull(value, paper.AREA)),
            unit="N",
            where="Fig. 10",
            agrees=None,
            remark="B^2 A/(2 μ_0) with the flux density measured here: an upper limit of what the load cell sees beside the pad",
        ),
    ]
