"""What RAP 2019 prints of blood flow, held against itself (rap.md, section 4, row 5). No log enters."""

from __future__ import annotations

from pipeline.findings import Published
from pipeline.rigs.rap.therapy.outcome.paper import paper_alone as therapy_alone
from pipeline.rigs.rap.therapy.outcome.paper import row

ML_MIN = 1e-6 / 60.0
SET_POINTS = (60.0 * ML_MIN, 80.0 * ML_MIN, 100.0 * ML_MIN)
UF_RATE = 5.0 * ML_MIN
WORST_ERROR = 0.0912


def paper_alone() -> list[Published]:
    """Return the checks of the paper's flow error, and the arithmetic notes beside its set-points (rows 4 to 6)."""
    notes = [check for check in therapy_alone() if check.where in ("row 4", "row 6")]
    return [_in_flow(), _on_the_return_line(), *notes]


def _in_flow() -> Published:
    errors = [WORST_ERROR * flow / ML_MIN for flow in SET_POINTS]
    return row(
        "worst flow error", f"{100 * WORST_ERROR:.2f} %", "{:.2f} / {:.2f} / {:.2f} mL/min at 60 / 80 / 100 mL/min".format(*errors), None,
        "neither the set-point of the worst error nor the reference (meter or set value), its sign or its denominator is stated; an acceptance limit is not "
        "in the text. Taken here as |estimate - meter|/meter",
        "row 5",
    )  # fmt: skip


def _on_the_return_line() -> Published:
    shares = [100.0 * UF_RATE / flow for flow in SET_POINTS]
    return row(
        "position of the flow meter", "not stated", "{:.2f} / {:.2f} / {:.2f} % of 60 / 80 / 100 mL/min".format(*shares), None,
        f"a meter on the return line reads Q_b - Q_uf: {UF_RATE / ML_MIN:g} mL/min of UF alone make an error of that size, so {100 * WORST_ERROR:.2f} % cannot be "
        "interpreted without the meter's position and whether UF ran",
        "row 5",
    )  # fmt: skip
