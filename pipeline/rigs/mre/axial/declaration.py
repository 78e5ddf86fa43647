"""`mre.axial`: slow compression and release of a pad, force against displacement (mre.md T1).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Experiment, Later, ParameterSpec, Range, Settings
from pipeline.rigs.mre.axial.equations import EQUATIONS
from pipeline.rigs.mre.conditions import COIL_CURRENT, MICROMECHANICS, PRELOAD, SAMPLE
from pipeline.rigs.mre.references import BRANCATI_2019, GENT_LINDLEY_1959, GOLUB_PEREYRA_1973, ISMAIL_2009


class AxialSettings(Settings):
    """What a recipe of `mre.axial` may set."""

    current_tolerance: float = Field(0.25, gt=0, description="A; currents within it are one level")
    force_gain_error: float = Field(0.0, ge=0, lt=0.5, description="relative, 1 sigma; calibration of the load cell")
    displacement_gain_error: float = Field(0.0, ge=0, lt=0.5, description="relative, 1 sigma; calibration of the gauge")


CHANNELS = (
    ChannelSpec(
        "displacement_axial", "m", "compression of the pad, +; zero at first contact; a dial gauge may come in steps",
        limit=0.02,
    ),
    ChannelSpec("force_axial", "N", "force on the pad, + in compression", limit=1e5),
    ChannelSpec("current", "A", "measured coil current", required=False, limit=100.0),
    ChannelSpec("flux_density", "T", "flux density between pad and plate", required=False, limit=3.0),
    ChannelSpec("voltage", "V", "coil voltage", required=False),
    ChannelSpec("temperature", "K", "pad or core temperature", required=False, limit=500.0),
)  # fmt: skip
CONDITIONS = (
    ConditionSpec("test", "", "axial_loop"),
    COIL_CURRENT,
    PRELOAD,
    ConditionSpec("n_pads", "1", "pads in parallel", default=1.0, range=Range(1, 100, whole=True)),
    *SAMPLE,
    *MICROMECHANICS,
)
_LOOP, _OWN = "after eq. (12), C = n = 1", "not in the paper"
PARAMETERS = (
    ParameterSpec("stiffness", "k", "N/m", "linear stiffness of the loop model", _LOOP),
    ParameterSpec("stiffness_cubic", "k_3", "N/m^3", "cubic stiffness of the loop model", _LOOP),
    ParameterSpec("alpha", r"\alpha", "N", "largest hysteretic force", _LOOP),
    ParameterSpec("rho", r"\rho", "1/m", "slope of w at the origin; 1/rho is the yield displacement", _LOOP),
    ParameterSpec("stiffness_secant", r"F(d_{max})/d_{max}", "N/m", "force at the turn over displacement, offset removed", _OWN, key=True),
    ParameterSpec(
        "stiffness_slope", r"dF/dd", "N/m", "regression of the loading branch over 20 to 80 % of d_max", _OWN, key=True
    ),
    ParameterSpec("loss_ratio", "W/W_l", "1", "lost over loading work", _OWN, key=True, read_as="%"),
    ParameterSpec("unloading_drop", r"\alpha(1+w_m)", "N", "force by which the release lies below the loading", _OWN, key=True),
    ParameterSpec("stiffening_secant", r"\Delta k/k", "1", "secant stiffness relative to 0 A, less 1", "Fig. 8", key=True, read_as="%"),
    ParameterSpec("stiffening_slope", r"\Delta k/k", "1", "slope stiffness relative to 0 A, less 1", "Fig. 8", key=True, read_as="%"),
)  # fmt: skip

AXIAL = Experiment(
    id="mre.axial",
    title="Compression of magneto-rheological elastomer pads",
    summary="Secant and slope stiffness, hysteresis and stiffening by the field from slow loops of force and compression.",
    references=(BRANCATI_2019, GOLUB_PEREYRA_1973, ISMAIL_2009, GENT_LINDLEY_1959),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=AxialSettings,
    identify=Later("pipeline.rigs.mre.axial.identify:identify"),
    synthesize=Later("pipeline.rigs.mre.axial.synthetic:synthesize"),
    sections=Later("pipeline.rigs.mre.axial.sections:sections"),
    methods=Later("pipeline.rigs.mre.axial.methods:methods"),
    check=Later("pipeline.rigs.mre.axial.check:check"),
    signals=(
        Signals(
            "samples",
            {"displacement": "m", "force": "N", "residual": "N"},
            "the fit's samples; the model is force less residual",
        ),
    ),
)
