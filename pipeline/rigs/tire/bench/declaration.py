"""`tire.bench`: what an intelligent tire's ring, sensors and load calibration are (tire.md, sections 1, 2, 10).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import Experiment, Later, ParameterSpec, Settings
from pipeline.rigs.tire.bench.equations import EQUATIONS
from pipeline.rigs.tire.conditions import CONDITIONS, OPERATING, channels
from pipeline.rigs.tire.references import BRAUN_2011, BREGLIO_2019, FIELLER_1954, FYFE_MUNCK_1997, GONG_1993


class BenchSettings(Settings):
    """What a recipe of `tire.bench` may set."""

    pressure_u: float = Field(
        0.01,
        ge=0,
        le=0.2,
        description="relative standard uncertainty of the inflation pressure where a run states none (type B)",
    )
    load_gain_u: float = Field(
        0.005,
        ge=0,
        le=0.2,
        description="relative standard uncertainty of the load cell's gain where a run states none (type B)",
    )
    sensor_length_u: float = Field(
        0.04,
        gt=0,
        le=0.2,
        description="relative standard uncertainty of the flex sensor's length where a run states none: prior of the ring fit",
    )
    free_radius_u: float = Field(
        0.005,
        ge=0,
        le=0.1,
        description="relative standard uncertainty of the free radius, half the nominal diameter of tire_size (type B)",
    )


_FIT = "not in the paper"
_WAVE = "not in the paper"
PARAMETERS = (
    ParameterSpec("rolling_radius", "R_e", "m", "effective rolling radius: surface speed over rotation", "Fig. 9b", key=True),
    ParameterSpec("bending_stiffness", "EI", "N m^2", "bending stiffness of the belt", _FIT, key=True),
    ParameterSpec("belt_width", "b", "m", "width of the belt on which the pressure acts", _FIT, key=True),
    ParameterSpec("foundation_radial", "k_w", "N/m^2", "radial foundation stiffness per metre of belt", _FIT, key=True),
    ParameterSpec("foundation_tangential", "k_v", "N/m^2", "tangential foundation stiffness per metre of belt", _FIT, key=True),
    ParameterSpec("tread_stiffness", "k_t", "N/m^2", "radial stiffness of the tread per metre of belt", _FIT, key=True),
    ParameterSpec("loss_factor", r"\eta", "1", "loss factor of the foundation", _FIT, key=True),
    ParameterSpec("sensor_gain", "c", "ohm m", "gain of the flex sensor: R2 = R0 + c k", "eq. (3)", key=True),
    ParameterSpec("sensor_lag", r"\tau_f", "s", "first-order lag of the flex sensor", "not in the paper", key=True),
    ParameterSpec("sensor_resistance", "R_0", "ohm", "resistance of the mounted flex sensor, mean of a revolution", "eq. (3)"),
    ParameterSpec("contact_length", "L_c", "m", "contact length, where the road presses; from the ring fit", "not in the paper", key=True),
    ParameterSpec("deformation_length", "L_d", "m", "deformation length: between the two dips; no contact length", _WAVE),
    ParameterSpec("slope_length", "L_{slope}", "m", "between the steepest slopes; no contact length", _WAVE),
    ParameterSpec("zero_length", "L_{zero}", "m", "between the zero crossings of k; no contact length", _WAVE),
    ParameterSpec("peak_resistance", r"\Delta R_{2,peak}", "ohm", "peak over the mean of the revolution", "not in the paper"),
    ParameterSpec("dip_leading", r"\Delta R_{2,lead}", "ohm", "dip before the peak over the mean of the revolution", "not in the paper"),
    ParameterSpec("dip_trailing", r"\Delta R_{2,trail}", "ohm", "dip behind the peak over the mean of the revolution", "not in the paper"),
    ParameterSpec("load_sensitivity", "dV/dF_z", "V/N", "slope of the peak's voltage over load at mid-range", "section 3", key=True),
    ParameterSpec("calibration_0", "a_0", "ohm", "peak over load: constant", "not in the paper"),
    ParameterSpec("calibration_1", "a_1", "ohm/N", "peak over load: slope at no load", "not in the paper"),
    ParameterSpec("calibration_2", "a_2", "ohm/N^2", "peak over load: curvature", "not in the paper"),
    ParameterSpec("pvdf_gain", "G'", "V/ohm", "gain of the PVDF over the flex sensor, G h/(2c)", "not in the paper"),
    ParameterSpec("pvdf_time_constant", r"\tau_p", "s", "time constant of the PVDF's readout", "not in the paper"),
    ParameterSpec("pvdf_offset_angle", r"\Delta\theta", "rad", "angle by which the PVDF runs ahead of the flex sensor", "not in the paper"),
    ParameterSpec("pvdf_nrmse", "NRMSE", "1", "rms of PVDF measured less predicted from flex, over its own rms", "not in the paper"),
    ParameterSpec("packet_loss", "p", "1", "share of the radio's packets that are missing", "not in the paper"),
)  # fmt: skip

BENCH = Experiment(
    id="tire.bench",
    title="Intelligent tire on the bench: ring, sensors and load calibration",
    summary="Ring stiffnesses, contact length, rolling radius and load calibration of a tire with a flex sensor and a PVDF film.",
    references=(BREGLIO_2019, GONG_1993, FYFE_MUNCK_1997, BRAUN_2011, FIELLER_1954),
    channels=channels(),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=BenchSettings,
    identify=Later("pipeline.rigs.tire.bench.identify:identify"),
    synthesize=Later("pipeline.rigs.tire.synthetic.rig:synthesize_bench"),
    sections=Later("pipeline.rigs.tire.bench.sections:sections"),
    methods=Later("pipeline.rigs.tire.bench.methods:methods"),
    check=Later("pipeline.rigs.tire.bench.check:check"),
    operating=OPERATING,
    advise=Later("pipeline.rigs.tire.bench.advise:advise"),
    signals=(
        Signals(
            "waveforms",
            {"change": "ohm", "std_error": "ohm", "model": "ohm", "voltage": "V"},
            "the mean revolution at its mean speed, and the ring's",
        ),
        Signals(
            "revolutions", {"speed": "rad/s", "peak": "ohm", "peak_se": "ohm"}, "each revolution: rotation and peak"
        ),
    ),
)
