"""`mre.shear_rich`: one long record of shear per current, by a batch fit and an online filter (mre.md T8).

Only the declaration stands here. Without a current, any hysteretic device on a shaker goes through.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ConditionSpec, Experiment, Later, ParameterSpec, Reference, Settings
from pipeline.rigs.mre.conditions import COIL_CURRENT, MICROMECHANICS, PRELOAD, SAMPLE
from pipeline.rigs.mre.references import (
    BRANCATI_2019,
    GOLUB_PEREYRA_1973,
    ISMAIL_2009,
    KAUFMAN_1975,
    NEWEY_WEST_1987,
)
from pipeline.rigs.mre.rich.equations import EQUATIONS
from pipeline.rigs.mre.shear.declaration import CHANNELS, LAG, MASS
from pipeline.rigs.mre.shear.declaration import CONDITIONS as OF_SHEAR
from pipeline.rigs.mre.shear.declaration import PARAMETERS as OF_SHEAR_PARAMETERS

JULIER_2004 = Reference(
    "julier2004",
    "S. J. Julier and J. K. Uhlmann",
    "Unscented filtering and nonlinear estimation",
    "Proceedings of the IEEE",
    2004,
    volume="92",
    pages="401-422",
)
WAN_2000 = Reference(
    "wan2000",
    "E. A. Wan and R. van der Merwe",
    "The unscented Kalman filter for nonlinear estimation",
    "IEEE Adaptive Systems for Signal Processing, Communications, and Control Symposium",
    2000,
    pages="153-158",
)


class RichSettings(Settings):
    """What a recipe of `mre.shear_rich` may set."""

    mains_frequency: float = Field(50.0, ge=0, description="Hz; lines on its multiples are fitted along, 0 for none")
    force_lag: Literal["fit"] | Annotated[float, AfterValidator(LAG.checked)] = Field(
        "fit", description="s, how late the force is; 'fit' finds it"
    )
    moving_mass: Literal["auto", "fit"] | Annotated[float, AfterValidator(MASS.checked)] = Field(
        "auto", description="kg of untared platelet and rod; 'auto' fits it where the data ask for it"
    )
    starts: int = Field(2, ge=1, le=200, description="starts of the batch search")
    cutoff: float | None = Field(None, gt=0, description="Hz, low-pass of the batch fit; by default from x")
    online: bool = Field(True, description="run the joint Kalman filter beside the batch fit")
    online_cutoff: float = Field(
        60.0, gt=0, description="Hz, look-ahead low-pass of the filter: three times the motion"
    )


_HERE = ["k1", "s1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw", "s_mr", "k1_plus_k2", "k2_plus_alpha_rho"]
_HERE += ["force_lag", "moving_mass", "stiffness_storage", "damping"]
_SPECS = {spec.name: spec for spec in OF_SHEAR_PARAMETERS}
_OWN = {
    "k2": ParameterSpec("k2", "k_2", "N/m", "static stiffness; with a field it holds k_MR", "eq. (10)", key=True),
    "stiffness_storage": ParameterSpec(
        "stiffness_storage", "K", "N/m", "spring of a record that needs no more than spring and damper", "F = K x + C v"
    ),
    "damping": ParameterSpec("damping", "C", "N s/m", "damper of such a record", "F = K x + C v"),
}
PARAMETERS = tuple(_OWN.get(name, _SPECS[name]) for name in _HERE)
_KEPT = {"test", "frequency", "amplitude", "gap_held", "control", "moving_mass", "force_lag", "n_pads"}
CONDITIONS = (
    *(
        ConditionSpec("test", "", "shear_rich") if spec.name == "test" else spec
        for spec in OF_SHEAR
        if spec.name in _KEPT
    ),
    COIL_CURRENT,
    PRELOAD,
    *SAMPLE,
    *MICROMECHANICS,
)

SHEAR_RICH = Experiment(
    id="mre.shear_rich",
    title="Shear of magneto-rheological elastomer pads, one rich record per current",
    summary="The whole dynamic model from one chirp with swinging amplitude: batch fit, and a Kalman filter that tracks it.",
    references=(
        BRANCATI_2019,
        GOLUB_PEREYRA_1973,
        KAUFMAN_1975,
        ISMAIL_2009,
        NEWEY_WEST_1987,
        JULIER_2004,
        WAN_2000,
    ),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=RichSettings,
    identify=Later("pipeline.rigs.mre.rich.identify:identify"),
    synthesize=Later("pipeline.rigs.mre.rich.synthetic:synthesize"),
    sections=Later("pipeline.rigs.mre.rich.sections:sections"),
    methods=Later("pipeline.rigs.mre.rich.methods:methods"),
    check=Later("pipeline.rigs.mre.rich.check:check"),
    live=Later("pipeline.rigs.mre.rich.live:Live"),
    signals=(
        Signals(
            "series", {"displacement": "m", "force": "N", "model": "N"}, "a stretch of the record and the fitted model"
        ),
    ),
)
