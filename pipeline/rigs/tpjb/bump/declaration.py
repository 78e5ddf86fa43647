"""`tpjb.bump`: clearance, centre, alignment and contact stiffness of a dry bearing pressed all round (tpjb.md T1).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import Experiment, Later, ParameterSpec, Reference, Settings
from pipeline.rigs.tpjb.bump.equations import EQUATIONS
from pipeline.rigs.tpjb.rig import CIULLI_FORTE_2019, CONDITIONS, OPERATING, channels


class BumpSettings(Settings):
    """What a recipe of `tpjb.bump` may set."""

    n_pads: int | None = Field(None, ge=3, le=12, description="pads; by default as the runs say, else as found")
    alignment_limit: float = Field(100e-6, gt=0, description="rad, tilt between shaft and bearing that is allowed")
    near: float = Field(0.5e-6, gt=0, description="m, samples within it of a side lie at that side")
    least_share: float = Field(0.05, gt=0, lt=1, description="share of the samples that each side must have")
    growth_limit: float = Field(1e-9, gt=0, description="m/N, growth of the mean clearance that counts as none")
    level_tolerance: float = Field(0.05, gt=0, lt=0.5, description="relative, forces within it are one level")
    block_angle: float = Field(
        0.035, gt=0, lt=0.5, description="rad of turn of the force that is averaged into a block"
    )
    rotation_limit: float = Field(0.21, gt=0, description="rad, rotation beyond which the pad angles are doubted")


PARAMETERS = (
    ParameterSpec("center_x", "d_{0x}", "m", "centre of the clearance polygon, horizontal", "Fig. 5", key=True),
    ParameterSpec("center_y", "d_{0y}", "m", "centre of the clearance polygon, vertical", "Fig. 5", key=True),
    ParameterSpec(
        "clearance",
        "c",
        "m",
        "distance of a side from the centre; without side the mean of all",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "rotation",
        r"\alpha",
        "rad",
        "turn of the polygon against the pad angles, anticlockwise",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "tilt_x",
        r"\theta_x",
        "rad",
        "slope of the bearing's axis against the shaft, horizontal",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "tilt_y",
        r"\theta_y",
        "rad",
        "slope of the bearing's axis against the shaft, vertical",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "contact_stiffness", "k_p", "N/m", "stiffness of the contact of one pad", "not in the paper", key=True
    ),
    ParameterSpec(
        "support_stiffness", "k_s", "N/m", "stiffness of stabilisers and hoses", "not in the paper", key=True
    ),
)

OREAR_1982 = Reference(
    "orear1982",
    "J. Orear",
    "Least squares when both variables have uncertainties",
    "American Journal of Physics",
    1982,
    volume="50",
    pages="912-916",
)
GEYER_1992 = Reference(
    "geyer1992",
    "C. J. Geyer",
    "Practical Markov chain Monte Carlo",
    "Statistical Science",
    1992,
    volume="7",
    pages="473-483",
)


BUMP = Experiment(
    id="tpjb.bump",
    title="Bump test of a tilting pad bearing",
    summary="Clearance polygon, centre, alignment and contact stiffness from a turning force on the dry bearing.",
    references=(CIULLI_FORTE_2019, OREAR_1982, GEYER_1992),
    channels=channels("force_u", "force_v"),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=BumpSettings,
    identify=Later("pipeline.rigs.tpjb.bump.identify:identify"),
    synthesize=Later("pipeline.rigs.tpjb.bump.synthetic:synthesize"),
    sections=Later("pipeline.rigs.tpjb.bump.sections:sections"),
    methods=Later("pipeline.rigs.tpjb.bump.methods:methods"),
    check=Later("pipeline.rigs.tpjb.bump.check:check"),
    operating=OPERATING,
    signals=(
        Signals(
            "orbits",
            {"force_x": "N", "force_y": "N", "x": "m", "y": "m", "x_model": "m", "y_model": "m"},
            "force and journal motion, means over an angle of turn, and the polygon's motion",
            by="plane",
        ),
    ),
)
