"""`rap.pressures`: how far the device's pressures agree with the bench's, and the circuit's hydraulics (rap.md, T1).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ConditionSpec, Experiment, Later, ParameterSpec, Settings
from pipeline.rigs.rap.conditions import CONDITIONS, channels
from pipeline.rigs.rap.pressures.equations import EQUATIONS
from pipeline.rigs.rap.references import (
    BLAND_ALTMAN_1986,
    BLAND_ALTMAN_1999,
    CARTER_KNAPP_NUTTALL_1973,
    KNAPP_CARTER_1976,
    LINNET_1993,
    RAP_2019,
)

MMHG = 133.322


class PressuresSettings(Settings):
    """What a recipe of `rap.pressures` may set."""

    gain_tolerance: float = Field(
        0.02, gt=0, lt=0.5, description="the device's gain is good where its whole interval is that close to 1"
    )
    offset_tolerance: float = Field(
        MMHG, gt=0, le=5e3, description="the device's offset is good where its whole interval is that close to 0, Pa"
    )

    device_gain_u: float = Field(
        0.02,
        ge=0,
        le=0.5,
        description="relative standard uncertainty of the device's pressure gains where no bench tells them (type B): the circuit's constants then rest on them",
    )


OPERATING = (
    ConditionSpec("channel", "", "pressure tap: access, prefilter, return or uf"),
    ConditionSpec("harmonic", "1", "multiple of the blood pump's stroke frequency"),
    ConditionSpec("flow_set", "m^3/s", "blood flow as set", read_as="mL/min"),
)
PARAMETERS = (
    ParameterSpec("lag", r"\Delta", "s", "device stamp + lag = bench time, at mid-run", "own eq. (2)", key=True),
    ParameterSpec("clock_rate", r"\rho", "1", "rate error of the device's clock against the bench's", "own eq. (2)", key=True),
    ParameterSpec("sensor_pole", r"\tau_d", "s", "time constant of the device's pressure channels", "own eq. (2)", key=True),
    ParameterSpec("gain", "g", "1", "device over bench, Deming on window means", "own eq. (10)", key=True),
    ParameterSpec("offset", "o", "Pa", "device less gain times bench, Deming on window means", "own eq. (10)", key=True),
    ParameterSpec("bias", r"\bar d", "Pa", "mean of device less bench, aligned and equalised samples", "not in the paper"),
    ParameterSpec("limit_lower", r"\bar d - 1.96 s_d", "Pa", "lower limit of agreement, aligned and equalised samples", "not in the paper"),
    ParameterSpec("limit_upper", r"\bar d + 1.96 s_d", "Pa", "upper limit of agreement, aligned and equalised samples", "not in the paper"),
    ParameterSpec("coherence", r"\gamma^2", "1", "coherence of device and bench at a line of the pump", "not in the paper"),
    ParameterSpec("r_access", "R_a", "Pa s/m^3", "resistance from reservoir to access sensor", "own eq. (3)", key=True),
    ParameterSpec("r_filter", "R_f", "Pa s/m^3", "resistance from pre-filter to return sensor", "own eq. (3)", key=True),
    ParameterSpec("r_return", "R_r", "Pa s/m^3", "resistance from return sensor to reservoir", "own eq. (3)", key=True),
    ParameterSpec("c_return", "C_2", "m^3/Pa", "compliance at the return sensor", "own eq. (4)", key=True),
    ParameterSpec("l_return", "L_r", "Pa s^2/m^3", "inertance of the return line", "own eq. (4)", key=True),
    ParameterSpec("c_uf", "C_u", "m^3/Pa", "compliance of the ultrafiltrate side", "own eq. (3)", key=True),
    ParameterSpec("k_uf", "K_{uf}", "m^3/(s Pa)", "ultrafiltration coefficient of the membrane", "own eq. (3)", key=True),
)  # fmt: skip

PRESSURES = Experiment(
    id="rap.pressures",
    title="Ultrafiltration device: agreement of pressures and hydraulics",
    summary="Clock, gain, offset and limits of agreement of the device's pressures against a bench; resistances, compliances, membrane.",
    references=(
        RAP_2019,
        BLAND_ALTMAN_1986,
        BLAND_ALTMAN_1999,
        LINNET_1993,
        KNAPP_CARTER_1976,
        CARTER_KNAPP_NUTTALL_1973,
    ),
    channels=channels(),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=PressuresSettings,
    identify=Later("pipeline.rigs.rap.pressures.identify:identify"),
    synthesize=Later("pipeline.rigs.rap.synthetic.rig:synthesize_pressures"),
    sections=Later("pipeline.rigs.rap.pressures.sections:sections"),
    methods=Later("pipeline.rigs.rap.pressures.methods:methods"),
    check=Later("pipeline.rigs.rap.pressures.check:check"),
    operating=OPERATING,
    signals=(
        Signals(
            "overlay",
            {"bench": "Pa", "corrected": "Pa", "residual": "Pa"},
            "bench pressure and the corrected one of the device",
            by="channel",
        ),
    ),
)
