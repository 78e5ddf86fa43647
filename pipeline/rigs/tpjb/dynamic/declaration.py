"""`tpjb.dynamic`: stiffness and damping from tones below and above shaft speed (tpjb.md T2).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.rigs.experiment import Experiment, Later, ParameterSpec, Reference, Settings
from pipeline.rigs.tpjb.dynamic.equations import EQUATIONS
from pipeline.rigs.tpjb.rig import CIULLI_FORTE_2019, CONDITIONS, OPERATING, channels


class DynamicSettings(Settings):
    """What a recipe of `tpjb.dynamic` may set."""

    shaft_orders: int = Field(4, ge=0, le=12, description="orders of the shaft that are fitted along with the tones")
    displacement_lag: float | None = Field(
        None,
        description="s, how late the displacement is against the force, calibrated; 0 says it was found to be none",
    )
    least_snr: float = Field(10.0, gt=0, description="amplitude over its error below which a tone is dropped")
    largest_condition: float = Field(
        10.0, gt=1, description="condition number of the two displacements above which they are not independent"
    )
    nonlinear_share: float = Field(
        0.01, gt=0, lt=1, description="second-order products over the tones above which the bearing is called nonlinear"
    )


def _coefficients() -> tuple[ParameterSpec, ...]:
    specs = []
    for letter, unit, what, part in (("k", "N/m", "stiffness", "Re H"), ("c", "N s/m", "damping", "Im H/w")):
        for row in "xy":
            for column in "xy":
                specs.append(
                    ParameterSpec(
                        f"{letter}{row}{column}",
                        f"{letter}_{{{row}{column}}}",
                        unit,
                        f"{what}, {row} force by {column} displacement",
                        f"eqs (1), (2): {part}",
                        key=row == column,
                        key_at="synchronous",
                    )
                )
    return tuple(specs)


PARAMETERS = _coefficients()

CHILDS_HALE_1994 = Reference(
    "childs1994",
    "D. Childs and K. Hale",
    "A Test Apparatus and Facility to Identify the Rotordynamic Coefficients of High-Speed Hydrostatic Bearings",
    "Journal of Tribology",
    1994,
    volume="116",
    pages="337-344",
)
PINTELON_SCHOUKENS_2012 = Reference(
    "pintelon2012",
    "R. Pintelon and J. Schoukens",
    "System Identification: A Frequency Domain Approach",
    "Wiley, 2nd edition",
    2012,
)
DIMOND_2009 = Reference(
    "dimond2009",
    "T. W. Dimond, P. N. Sheth, P. E. Allaire and M. He",
    "Identification methods and test results for tilting pad and fixed geometry journal bearing dynamic coefficients: a review",
    "Shock and Vibration",
    2009,
    volume="16",
    pages="13-43",
)


DYNAMIC = Experiment(
    id="tpjb.dynamic",
    title="Dynamic coefficients of a tilting pad bearing",
    summary="Stiffness and damping of the oil film over frequency, and at shaft speed, from two excitations.",
    references=(CIULLI_FORTE_2019, CHILDS_HALE_1994, PINTELON_SCHOUKENS_2012, DIMOND_2009),
    channels=channels("force_u", "force_v"),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=DynamicSettings,
    identify=Later("pipeline.rigs.tpjb.dynamic.identify:identify"),
    synthesize=Later("pipeline.rigs.tpjb.dynamic.synthetic:synthesize"),
    sections=Later("pipeline.rigs.tpjb.dynamic.sections:sections"),
    methods=Later("pipeline.rigs.tpjb.dynamic.methods:methods"),
    check=Later("pipeline.rigs.tpjb.dynamic.check:check"),
    operating=OPERATING,
    builds_on=("tpjb.baseline",),
    reads_blocks=True,
)
