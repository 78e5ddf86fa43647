"""`mre.hold`: axial force and flux density against the coil current at a fixed gap, held level by level (mre.md T2, T4, T7).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import (
    ChannelSpec,
    ConditionSpec,
    Experiment,
    Later,
    ParameterSpec,
    Range,
    Reference,
    Settings,
)
from pipeline.rigs.mre.conditions import MICROMECHANICS, PRELOAD, SAMPLE
from pipeline.rigs.mre.hold.equations import EQUATIONS
from pipeline.rigs.mre.references import BRANCATI_2019, GOLUB_PEREYRA_1973, KAUFMAN_1975

HURVICH_TSAI_1989 = Reference(
    "hurvich1989",
    "C. M. Hurvich and C.-L. Tsai",
    "Regression and time series model selection in small samples",
    "Biometrika",
    1989,
    volume="76",
    pages="297-307",
)


class HoldSettings(Settings):
    """What a recipe of `mre.hold` may set."""

    settle: float = Field(
        3.0, ge=0, description="s at the start of each hold that do not enter; at most half of the hold"
    )
    remanence_limit: float = Field(5e-3, gt=0, description="T, flux density left at 0 A that is warned of")
    heating_limit: float = Field(15.0, gt=0, description="K, heating of the coil that is warned of")
    gap_limit: float = Field(1.2e-5, gt=0, description="m, motion of the gap that is warned of; 1.2e-5 is 12 µm")


CHANNELS = (
    ChannelSpec("current", "A", "measured coil current, not the set-point", limit=100.0),
    ChannelSpec("force_axial", "N", "axial force on the pad, + in compression", required=False, limit=1e5),
    ChannelSpec("flux_density", "T", "flux density between pad and plate", required=False, limit=3.0),
    ChannelSpec(
        "displacement_axial", "m", "compression of the pad (gap), + in compression", required=False, limit=0.02
    ),
    ChannelSpec("voltage", "V", "coil voltage", required=False, limit=1000.0),
    ChannelSpec("temperature", "K", "pad or core temperature", required=False, limit=500.0),
)
CONDITIONS = (
    ConditionSpec("test", "", "hold_sweep, field_map (field without force) or blank (spacer in place of the pad)"),
    PRELOAD,
    ConditionSpec("gap_held", "", "true where the gap is held and not the axial load"),
    ConditionSpec(
        "gap_closed_for",
        "s",
        "how long the gap had been closed when the log began; relaxation counts from then",
        range=Range(0, 1e9),
    ),
    ConditionSpec("n_pads", "1", "pads in parallel", range=Range(1, 100, whole=True)),
    ConditionSpec(
        "force_gain_error",
        "1",
        "relative standard uncertainty of the force's calibration (an FSR: 0.1)",
        range=Range(0, 1),
    ),
    *SAMPLE,
    *MICROMECHANICS,
)
_OWN = "not in the paper"
PARAMETERS = (
    ParameterSpec(
        "force_initial",
        "F_0",
        "N",
        "axial force at 0 A and 10 s after the gap was closed (the start of the log unless the conditions tell)",
        _OWN,
        key=True,
    ),
    ParameterSpec("force_gain", "a", "1", "limit of the relative increment of the force", _OWN, key=True),
    ParameterSpec(
        "saturation_current", "I_s", "A", "saturation current; a/I_s is the relative slope at 0 A", _OWN, key=True
    ),
    ParameterSpec(
        "sharpness",
        "p",
        "1",
        "sharpness of the bend: 1 as Froehlich and Kennelly, 2 to 3 as a hyperbolic tangent, large straight and then flat",
        _OWN,
        key=True,
    ),
    ParameterSpec(
        "relaxation", "r", "1", "share of the force lost in each decade of time", _OWN, key=True, read_as="%"
    ),
    ParameterSpec(
        "force_increment",
        r"\Delta F/F_0",
        "1",
        "force at a current over that at 0 A, less 1, relaxation taken out",
        _OWN,
        key=True,
        read_as="%",
    ),
    ParameterSpec("flux_slope", "s_0", "T/A", "slope of the flux density at 0 A", _OWN, key=True),
    ParameterSpec("flux_saturation", "B_s", "T", "limit of the flux density", _OWN, key=True),
    ParameterSpec("remanence", "b", "T", "flux density at 0 A of a sweep direction", _OWN),
)

HOLD = Experiment(
    id="mre.hold",
    title="Force and field of magneto-rheological pads held at coil currents",
    summary="Saturating law, relaxation and increments of the axial force at a fixed gap, and the field map.",
    references=(BRANCATI_2019, GOLUB_PEREYRA_1973, KAUFMAN_1975, HURVICH_TSAI_1989),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=HoldSettings,
    identify=Later("pipeline.rigs.mre.hold.identify:identify"),
    synthesize=Later("pipeline.rigs.mre.hold.synthetic:synthesize"),
    sections=Later("pipeline.rigs.mre.hold.sections:sections"),
    methods=Later("pipeline.rigs.mre.hold.methods:methods"),
    check=Later("pipeline.rigs.mre.hold.check:check"),
    operating=(
        ConditionSpec("coil_current", "A", "level of the measured coil current"),
        ConditionSpec("sweep", "", "up or down"),
    ),
    signals=(Signals("series", {"force": "N", "model": "N"}, "axial force and its steady part with relaxation"),),
)
