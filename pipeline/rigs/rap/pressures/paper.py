"""What RAP 2019 prints of pressures, circuit and set-points, held against itself (rap.md, section 4). No log enters.

The paper has no equation, no table, and its figures are lost: only numbers in running text are left to check.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.findings import Published
from pipeline.rigs.rap.circuit.tank import G
from pipeline.rigs.rap.therapy.outcome.paper import paper_alone as therapy_alone
from pipeline.rigs.rap.therapy.outcome.paper import row

ML, ML_MIN = 1e-6, 1e-6 / 60.0
MMHG = 133.322
DENSITY = 1004.0  # saline, kg/m^3
VISCOSITY = 0.9e-3  # water at 25 degC, Pa s


@dataclass(frozen=True)
class Printed:
    """Numbers that stand in the text of RAP 2019, SI."""

    flows: tuple[float, float, float] = (60.0 * ML_MIN, 80.0 * ML_MIN, 100.0 * ML_MIN)
    uf_rate: float = 5.0 * ML_MIN
    flow_error: float = 0.0912
    priming: float = 60.0 * ML
    filter_priming: float = 33.0 * ML
    sampling: float = 20.0


PRINTED = Printed()
# Bores of blood tubing to which the priming volume is referred (a judgement, rap.md 3.3), m.
TUBES = (4e-3, 3e-3)


def tube_inertance(length: float, bore: float, density: float = DENSITY) -> float:
    """Return L = rho l / A of a tube, Pa s^2/m^3.

    Examples
    --------
    >>> round(tube_inertance(1.0, 4e-3) / 1e7, 2)
    7.99
    """
    return density * length / (0.25 * math.pi * bore**2)


def reynolds(flow: float, bore: float, density: float = DENSITY, viscosity: float = VISCOSITY) -> float:
    """Return the Reynolds number of a mean flow (m^3/s) in a tube."""
    return 4.0 * density * flow / (math.pi * bore * viscosity)


def womersley(frequency: float, bore: float, density: float = DENSITY, viscosity: float = VISCOSITY) -> float:
    """Return the Womersley number of a pulsation (Hz) in a tube."""
    return 0.5 * bore * math.sqrt(2.0 * math.pi * frequency * density / viscosity)


def paper_alone() -> list[Published]:
    """Return the checks that need no logs: set-points (rows 4 and 6), meter (5), priming (9), sensors (11)."""
    set_points = [check for check in therapy_alone() if check.where in ("row 4", "row 6")]
    return [*set_points, _meter(), _priming(), _sensors(), _statistics()]


def _meter() -> Published:
    p = PRINTED
    shares = [100.0 * p.uf_rate / flow for flow in p.flows]
    errors = [p.flow_error * flow / ML_MIN for flow in p.flows]
    return row(
        "flow that the resistances rest on", f"worst flow error {100 * p.flow_error:.2f} %",
        "{:.2f} / {:.2f} / {:.2f} mL/min at 60 / 80 / 100 mL/min".format(*errors), None,
        "the position of the paper's meter is not stated: on the return line it reads the blood flow less the ultrafiltration, which at "
        f"{p.uf_rate / ML_MIN:g} mL/min alone is " + " / ".join(f"{s:.2f}" for s in shares) + " % of the set-points. Every resistance, compliance and "
        "inertance carries the meter's error in full",
        "row 5",
    )  # fmt: skip


def _priming() -> Published:
    p = PRINTED
    tubing = p.priming - p.filter_priming
    lengths = [tubing / (0.25 * math.pi * bore**2) for bore in TUBES]
    inertances = [tube_inertance(length, bore) for length, bore in zip(lengths, TUBES, strict=True)]
    return row(
        "priming volume", f"about {p.priming / ML:g} mL with the filter's {p.filter_priming / ML:g} mL", f"{tubing / ML:g} mL of tubing", None,
        f"{lengths[0]:.2f} m of {1e3 * TUBES[0]:g} mm tube or {lengths[1]:.2f} m of {1e3 * TUBES[1]:g} mm: inertances of {inertances[0]:.2g} and "
        f"{inertances[1]:.2g} Pa s2/m3 for all lines together. With Reynolds numbers of {reynolds(p.flows[0], TUBES[0]):.0f} to "
        f"{reynolds(p.flows[2], TUBES[0]):.0f} and a Womersley number of about {womersley(2.0, TUBES[0]):.0f} the inertance of the lines is not optional",
        "row 9",
    )  # fmt: skip


def _sensors() -> Published:
    return row(
        "pressure sensors", "three, plus one of the ultrafiltrate; later 'all three' beside the return", "4 channels", True,
        "access, pre-filter, return, ultrafiltrate: both passages agree when read so", "row 11",
    )  # fmt: skip


def _statistics() -> Published:
    head = DENSITY * G * 0.1
    return row(
        "agreement of the pressures", "good (figure lost)", "no statistic", None,
        "the paper shows return pressures and says that the others are alike; bias, limits of agreement, lag and gain are not given, so nothing found "
        f"here can confirm or contradict it. A sensor that sits 10 cm off the reservoir's level is off by {head:.0f} Pa ({head / MMHG:.1f} mmHg), not "
        "negligible beside signals of 10 to 30 mmHg",
        "test of the pressures",
    )  # fmt: skip
