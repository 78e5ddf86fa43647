"""`mre.shear`: harmonic (or random) shear of two pads, force against displacement (mre.md T5, T6).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
Without the conditions that belong to the pads, any hysteretic device on a shaker goes through.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Experiment, Later, ParameterSpec, Range, Settings
from pipeline.rigs.mre.conditions import COIL_CURRENT, MICROMECHANICS, PRELOAD, SAMPLE, SIZE
from pipeline.rigs.mre.references import (
    BRANCATI_2019,
    GOLUB_PEREYRA_1973,
    ISMAIL_2009,
    KAUFMAN_1975,
    NEWEY_WEST_1987,
    SCHWARZ_1978,
)
from pipeline.rigs.mre.shear.equations import EQUATIONS

LAG, MASS, FREQUENCY = Range(-0.1, 0.1), Range(0, 1000), Range(0, 1e5, above=True)


class ShearSettings(Settings):
    """What a recipe of `mre.shear` may set."""

    mains_frequency: float = Field(50.0, ge=0, description="Hz; harmonics on its multiples are left out, 0 for none")
    force_lag: Literal["fit"] | Annotated[float, AfterValidator(LAG.checked)] = Field(
        "fit", description="s, how late the force is; 'fit' finds it"
    )
    moving_mass: Literal["auto", "fit"] | Annotated[float, AfterValidator(MASS.checked)] = Field(
        "auto", description="kg of untared platelet and rod; 'auto' fits it where the data ask for it"
    )
    run_scatter: bool = Field(True, description="allow a gain error that changes from run to run")
    current_tolerance: float = Field(0.25, gt=0, description="A; currents within it are one level")
    starts: int = Field(6, ge=1, le=200, description="random starts of the search")
    cutoff: float | None = Field(
        None, gt=0, description="Hz, low-pass for records that are not periodic; by default from x"
    )


CHANNELS = (
    ChannelSpec("displacement", "m", "shear of the platelet against the core, + along the push", limit=0.02),
    ChannelSpec("force", "N", "force of the shaker on the platelet, + with + displacement; both pads", limit=1e5),
    ChannelSpec("current", "A", "measured coil current", required=False, limit=100.0),
    ChannelSpec("force_axial", "N", "axial load on the pads, + in compression", required=False, limit=1e5),
    ChannelSpec("flux_density", "T", "flux density between pad and plate", required=False, limit=3.0),
    ChannelSpec("voltage", "V", "coil voltage", required=False),
    ChannelSpec("temperature", "K", "pad or core temperature", required=False, limit=500.0),
)
CONDITIONS = (
    ConditionSpec("test", "", "shear or preload (T6: stiffness against preload)"),
    COIL_CURRENT,
    PRELOAD,
    ConditionSpec("gap_held", "", "true where the gap is held and not the axial load"),
    ConditionSpec("frequency", "Hz", "frequency as set", range=FREQUENCY),
    ConditionSpec("amplitude", "m", "amplitude as set", range=SIZE),
    ConditionSpec("control", "", "displacement or force"),
    ConditionSpec("moving_mass", "kg", "mass of platelet and rod, where it was weighed", range=MASS),
    ConditionSpec("force_lag", "s", "how late the force is, where it was calibrated", range=LAG),
    ConditionSpec(
        "n_pads",
        "1",
        "pads in parallel; 2 where the pads are known and nothing else is said",
        range=Range(1, 100, whole=True),
    ),
    *SAMPLE,
    *MICROMECHANICS,
)
_OWN, _LOOPS = "not in the paper", "section 5.2"
PARAMETERS = (
    ParameterSpec("k1", "k_1", "N/m", "stiffness of the Maxwell branch", "eqs (10), (11)", key=True),
    ParameterSpec("s1", "s_1", "N s/m", "dashpot of the Maxwell branch", "eq. (11), corrected", key=True),
    ParameterSpec("tau", r"\tau", "s", "relaxation time s1/k1", "eq. (11), corrected"),
    ParameterSpec("k2", "k_2", "N/m", "static stiffness", "eq. (10)", key=True),
    ParameterSpec("alpha_bw", "a_{BW}", "N", "largest hysteretic force", "eq. (10)", key=True),
    ParameterSpec(
        "rho", r"\rho", "1/m", "slope of w at the origin; 1/rho is the yield displacement", "eq. (12)", key=True
    ),
    ParameterSpec("c_bw", "C", "1", "shape of the unloading branch", "eq. (12)", key=True),
    ParameterSpec("n_bw", "n", "1", "sharpness of yielding", "eq. (12)", key=True),
    ParameterSpec("k_mr", "k_{MR}", "N/m", "stiffness added by the field", "eq. (10)", key=True),
    ParameterSpec("s_mr", "s_{MR}", "N s/m", "viscous damping added by the field", "eq. (10)", key=True),
    ParameterSpec("k1_plus_k2", "k_1+k_2", "N/m", "sum, where only it is identified"),
    ParameterSpec("k2_plus_alpha_rho", r"k_2+a_{BW}\rho", "N/m", "sum, where only it is identified"),
    ParameterSpec("force_lag", r"\delta", "s", "how late the force is against the displacement", _OWN),
    ParameterSpec("run_scatter", "s_g", "1", "gain error from run to run, 1 sigma", _OWN, read_as="%"),
    ParameterSpec("moving_mass", "m", "kg", "untared moving mass", "eq. (10)"),
    ParameterSpec(
        "mr_effect_force",
        r"\Delta K/K",
        "1",
        "stiffness increment at equal force amplitude",
        "Fig. 17",
        key=True,
        read_as="%",
    ),
    ParameterSpec(
        "mr_effect_amplitude", r"\Delta K/K", "1", "stiffness increment at equal amplitude", _OWN, key=True, read_as="%"
    ),
    ParameterSpec("stiffness_secant", r"F_{max}/x_{max}", "N/m", "secant stiffness of the fitted loop", _LOOPS),
    ParameterSpec("stiffness_storage", "K'", "N/m", "in-phase stiffness, first harmonic", _OWN),
    ParameterSpec("damping", r"\sigma", "N s/m", "equivalent viscous damping", _LOOPS),
    ParameterSpec("loss_factor", r"\eta", "1", "K''/K'", _OWN),
    ParameterSpec("shear_modulus_storage", "G'", "Pa", "K' h/(2A)", _OWN),
    ParameterSpec("shear_modulus_loss", "G''", "Pa", "K'' h/(2A)", _OWN),
    ParameterSpec("shear_modulus_secant", "G", "Pa", "secant stiffness times h/(2A), half cycle", _OWN),
    ParameterSpec("loss_work", "W", "J", "work lost in one half cycle", _OWN),
    ParameterSpec("loss_ratio", "W/W_l", "1", "lost over loading work of one half cycle", _OWN, read_as="%"),
)

SHEAR = Experiment(
    id="mre.shear",
    title="Shear of magneto-rheological elastomer pads",
    summary="Stiffness, damping and the Bouc-Wen model with a Maxwell branch from loops of force and displacement.",
    references=(BRANCATI_2019, GOLUB_PEREYRA_1973, KAUFMAN_1975, ISMAIL_2009, SCHWARZ_1978, NEWEY_WEST_1987),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=ShearSettings,
    identify=Later("pipeline.rigs.mre.shear.identify:identify"),
    synthesize=Later("pipeline.rigs.mre.synthetic:synthesize_shear"),
    sections=Later("pipeline.rigs.mre.shear.sections:sections"),
    methods=Later("pipeline.rigs.mre.shear.methods:methods"),
    check=Later("pipeline.rigs.mre.shear.check:check"),
    advise=Later("pipeline.rigs.mre.shear.advise:advise"),
    signals=(
        Signals(
            "loops",
            {"displacement": "m", "force": "N", "model": "N", "residual": "N"},
            "the mean cycle, without means, and the model's",
        ),
    ),
)
