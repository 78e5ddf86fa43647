"""`rap.flow`: blood flow from pump frequency and pressures, calibrated on one set of runs, tried on another (rap.md, T2).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ConditionSpec, Experiment, Later, ParameterSpec, Settings
from pipeline.rigs.rap.conditions import CONDITIONS, channels
from pipeline.rigs.rap.flow.equations import EQUATIONS
from pipeline.rigs.rap.references import RAP_2019


class FlowSettings(Settings):
    """What a recipe of `rap.flow` may set."""

    window: float = Field(10.0, ge=4, le=60, description="length of the windows, s")
    settle: float = Field(
        5.0, ge=0, le=120, description="time left out behind a start or any change of speed, clamp or UF, s"
    )
    before: float = Field(1.5, ge=0, le=120, description="time left out ahead of such a change, s")
    slowest: float = Field(0.8, gt=0.1, lt=10, description="slowest roller passages that are looked for, Hz")
    fastest: float = Field(3.5, gt=0.2, le=20, description="fastest roller passages that are looked for, Hz")
    flow_gain_u: float = Field(
        0.005,
        ge=0,
        le=0.5,
        description="relative standard uncertainty of the flow meter's gain where a run states none (type B)",
    )
    uf_gain_u: float = Field(
        0.05,
        ge=0,
        le=0.5,
        description="relative standard uncertainty of the UF rate as set or commanded: matters for a meter on the return line (type B)",
    )
    zero_u: float = Field(
        75.0,
        ge=0,
        le=1e4,
        description="standard uncertainty of a pressure's zero where no pump stop shows it, Pa (type B)",
    )
    tube_u: float = Field(
        0.02,
        ge=0,
        le=0.5,
        description="relative standard uncertainty of the stroke volume of a tube set that was not calibrated (type B)",
    )
    disagreement: float = Field(0.05, gt=0, lt=1, description="E2 and E3 further apart than that share are told")
    error_limit: float = Field(0.0912, gt=0, lt=1, description="largest relative error that is good: the paper's worst")


OPERATING = (
    ConditionSpec("estimator", "", "E0: V f, V from the lowest set-point; E1: V f; E2: pulsation; E3: mean pressures; rap: the device's own"),
    ConditionSpec("flow_set", "m^3/s", "blood flow as set", read_as="mL/min"),
)  # fmt: skip
PARAMETERS = (
    ParameterSpec("stroke_volume", "V_g", "m^3", "volume of a roller passage (E2)", "own eq. (6)", key=True, read_as="mL"),
    ParameterSpec("y0", "y_0", "m^3/(s Pa)", "flow lost for a pascal of pulsation at 2 Hz (E2)", "own eq. (6)", key=True),
    ParameterSpec("y1", "y_1", "m^3/Pa", "slope of y0 over frequency (E2)", "own eq. (6)", key=True),
    ParameterSpec("stroke_volume_mean", "V_0", "m^3", "volume of a roller passage against no pressure (E3)", "own, E3", key=True, read_as="mL"),
    ParameterSpec("pump_compliance", "C_p", "m^3/Pa", "volume of a passage lost for a pascal of back pressure, by the device's sensors (E3)", "own, E3", key=True),
    ParameterSpec("flow", r"\hat Q", "m^3/s", "estimated blood flow, mean of the windows", "own eq. (6)", read_as="mL/min"),
    ParameterSpec("flow_error_max", r"\max|e|", "1", "largest relative error of a window, (estimate - meter)/meter", "not in the paper", read_as="%"),
    ParameterSpec("flow_error_rms", "e_{rms}", "1", "relative error of the windows, root mean square", "not in the paper", read_as="%"),
)  # fmt: skip

FLOW = Experiment(
    id="rap.flow",
    title="Ultrafiltration device: blood flow from pump frequency and pressures",
    summary="Calibration and hold-out of four estimators of blood flow from roller frequency, pulsation and mean pressures.",
    references=(RAP_2019,),
    channels=channels(),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=FlowSettings,
    identify=Later("pipeline.rigs.rap.flow.identify:identify"),
    synthesize=Later("pipeline.rigs.rap.synthetic.rig:synthesize_flow"),
    sections=Later("pipeline.rigs.rap.flow.sections:sections"),
    methods=Later("pipeline.rigs.rap.flow.methods:methods"),
    check=Later("pipeline.rigs.rap.flow.check:check"),
    operating=OPERATING,
    signals=(
        Signals(
            "windows",
            {
                "metered": "m^3/s",
                "metered_error": "m^3/s",
                "own": "m^3/s",
                **dict.fromkeys(("E0", "E1", "E2", "E3"), "m^3/s"),
                "frequency": "Hz",
                "amplitude": "Pa",
            },
            "each window at its middle: flow of the meter, of the device, of the estimators; the pump's line",
        ),
    ),
)
