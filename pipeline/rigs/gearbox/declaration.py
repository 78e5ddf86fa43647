"""`gearbox.load_exchange`: what load a planetary gearbox exchanges with its stages (gearbox.md, sections 1, 2, 10).

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
from pipeline.rigs.gearbox.equations import EQUATIONS


class LoadExchangeSettings(Settings):
    """What a recipe of `gearbox.load_exchange` may set."""

    torque_accuracy: float = Field(
        0.001, ge=0, lt=0.5, description="limits of error of a torque sensor as a share of its range (type B)"
    )
    slope_tolerance: float = Field(0.05, gt=0, lt=1, description="FOS slope further from 1 asks for cross-calibration")
    least_speeds: int = Field(5, ge=5, le=20, description="speeds that the drag's four parameters need")


CHANNELS = (
    ChannelSpec("torque_in", "N*m", "shaft torque motor to gearbox, + when it drives the motor's direction", limit=1e3),
    ChannelSpec("torque_out", "N*m", "shaft torque gearbox to flywheel, + when it drives the load forward", limit=1e3),
    ChannelSpec("encoder_count_out", "count", "cumulative count of the output shaft's encoder", required=False),
    ChannelSpec(
        "speed_out", "rad/s", "output speed, + in the motor's direction; where counts are missing", required=False,
        limit=2e3,
    ),
    *(
        ChannelSpec(f"acc_{place}", "m/s^2", f"acceleration of the {where}", required=False, limit=2e3)
        for place, where in (
            ("in_radial", "input shaft's bearing, radial"),
            ("in_axial", "input shaft's bearing, axial"),
            ("out_radial", "output shaft's bearing, radial"),
            ("out_axial", "output shaft's bearing, axial"),
            ("load_radial", "bearing next to the flywheel, radial"),
        )
    ),
    ChannelSpec("speed_in", "rad/s", "input speed, + in the motor's direction", required=False, limit=2e3),
    ChannelSpec("brake_force", "N", "brake actuation, cross-check of events only", required=False, limit=1e5),
)  # fmt: skip
_POSITIVE = Range(0.0, above=True)
CONDITIONS = (
    ConditionSpec("speed_nominal", "rad/s", "input speed as set; by default what the output shaft does in FOS",
                  range=_POSITIVE),
    ConditionSpec("encoder_ppr", "1", "pulses per turn of the encoder", default=128.0, range=_POSITIVE),
    ConditionSpec("encoder_decoding", "1", "edges counted per pulse: 1, 2 or 4", range=Range(1, 4, whole=True)),
    ConditionSpec("torque_range_in", "N*m", "range of the input torque sensor", range=_POSITIVE),
    ConditionSpec("torque_range_out", "N*m", "range of the output torque sensor", range=_POSITIVE),
    ConditionSpec("ramp_time", "s", "acceleration time set in the inverter", range=_POSITIVE),
    ConditionSpec("inverter_frequency", "Hz", "output frequency of the inverter", range=_POSITIVE),
    ConditionSpec("flywheel_inertia", "kg*m^2", "inertia of the flywheel where it is known", range=_POSITIVE),
    ConditionSpec("lubrication", "", "lubrication of the gears"),
    ConditionSpec("teeth", "", "teeth of sun, planet, ring, input train; output train; where it is not stated the paper's, "
                  "'60 20 100; 12 44 100', are assumed"),
    ConditionSpec("remark", "", "free text"),
)  # fmt: skip
OPERATING = (
    ConditionSpec("stage", "", "startup, fos, brake, sos, release, fos_after or rundown"),
    ConditionSpec("event", "", "startup, brake_onset, unlock, sos_start, sos_end, relock or rundown"),
    ConditionSpec("phase", "", "startup, brake rise or steady levels"),
    ConditionSpec("channel", "", "acceleration channel"),
    ConditionSpec("speed", "rad/s", "output speed in FOS"),
)


def _pair(name: str, symbol: str, unit: str, description: str, source: str) -> tuple[ParameterSpec, ...]:
    """Return a quantity of the input and of the output shaft; `{}` in name and symbol is the side."""
    return tuple(
        ParameterSpec(name.format(side), symbol.format(side), unit, f"{description}, {word}", source)
        for side, word in (("in", "input"), ("out", "output"))
    )


PARAMETERS = (
    ParameterSpec(
        "inertia_load",
        "J_L",
        "kg*m^2",
        "inertia of what turns behind the output torque sensor",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "drag_coulomb", "d_0", "N*m", "drag of the load that does not depend on speed", "not in the paper", key=True
    ),
    ParameterSpec(
        "drag_viscous", "d_1", "N*m*s/rad", "drag of the load in proportion to speed", "not in the paper", key=True
    ),
    ParameterSpec(
        "efficiency_fos", r"\eta", "1", "output over input power while locked (FOS)", "eqs (7), (8)", key=True
    ),
    ParameterSpec(
        "torque_ratio_sos",
        "T_{out}/T_{in}",
        "1",
        "output over input torque while the output stands (SOS): a reaction, no efficiency",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "power_dissipated_sos",
        "P_{diss}",
        "W",
        "input power in SOS, all of which becomes heat",
        "not in the paper",
        key=True,
    ),
    ParameterSpec("lock_torque", "M_{lock}", "N*m", "torque on the lock when it breaks", "not in the paper", key=True),
    ParameterSpec(
        "slip_torque", "M_{slip}", "N*m", "torque of the slipping gears in SOS", "not in the paper", key=True
    ),
    ParameterSpec("torque_transfer_slope", "a", "1", "slope of output over input torque", "not in the paper", key=True),
    ParameterSpec(
        "torque_transfer_intercept",
        "T_{00}",
        "N*m",
        "input torque at which the fitted line reaches zero output torque",
        "not in the paper",
    ),
    *_pair("torque_{}_nominal", "T_{{{}}}", "N*m", "mean torque over the stage", "sections 4, 5"),
    *_pair("torque_{}_peak", r"\hat T_{{{}}}", "N*m", "peak of the torque, 20 Hz zero-phase low-pass", "sections 4, 5"),
    *_pair("torque_relief_{}", r"r_{{{}}}", "1", "1 - SOS nominal / brake peak", "sections 4, 5"),
    *_pair(
        "torque_residual_{}", r"q_{{{}}}", "1", "SOS nominal / brake peak (the paper's percentages)", "sections 4, 5"
    ),
    *_pair(
        "startup_excess_{}",
        r"\Delta T_{{s,{}}}",
        "N*m",
        "start-up peak less FOS nominal; not an inertia",
        "sections 4, 5",
    ),
    ParameterSpec(
        "breakaway_drop_in", r"\Delta T_{drop}", "N*m", "brake peak less SOS nominal, input", "sections 4, 5"
    ),
    ParameterSpec(
        "breakaway_rise_in", r"\Delta T_{rise}", "N*m", "brake peak less FOS nominal, input", "sections 4, 5"
    ),
    ParameterSpec("speed_out_nominal", r"\omega_{C2}", "rad/s", "output speed in FOS", "not in the paper"),
    ParameterSpec("speed_in_sos", r"\omega_{C1}", "rad/s", "input speed in SOS", "not in the paper"),
    ParameterSpec("event_time", "t", "s", "time of an event, clock of the torques", "not in the paper"),
    ParameterSpec("vibration_rms", "a_{rms}", "m/s^2", "acceleration above 2 Hz, root mean square", "not in the paper"),
    ParameterSpec(
        "drag_locked", "T_0", "N*m", "drag to ground of the locked gearbox, at the input", "not in the paper"
    ),
    ParameterSpec("c0", "c_0", "N*m", "constant part of the locked drag", "not in the paper"),
    ParameterSpec("c_s", "c_S", "N*m", "Stribeck part of the locked drag", "not in the paper"),
    ParameterSpec("w_s", r"\omega_S", "rad/s", "Stribeck speed of the locked drag", "not in the paper"),
    ParameterSpec("b0", "b_0", "N*m*s/rad", "viscous part of the locked drag", "not in the paper"),
    ParameterSpec("slip_torque_slope", "M_v", "N*m*s/rad", "slip torque over slip speed, slope", "not in the paper"),
    ParameterSpec("slip_torque_intercept", "M_c", "N*m", "slip torque over slip speed, at no slip", "not in the paper"),
)

GONZALEZ_CRUZ_2019 = Reference(
    "gonzalezcruz2019",
    "C. A. González-Cruz and M. Ceccarelli",
    "Experimental Characterization of the Coupling Stage of a Two-Stage Planetary Gearbox in Variable Operational Conditions",
    "Machines",
    2019,
    volume="7",
    pages="45",
)
SHINBROT_1957 = Reference(
    "shinbrot1957",
    "M. Shinbrot",
    "On the analysis of linear and nonlinear systems",
    "Transactions of the ASME",
    1957,
    volume="79",
    pages="547-552",
)
WHITE_1997 = Reference(
    "white1997",
    "K. P. White",
    "An effective truncation heuristic for bias reduction in simulation output",
    "Simulation",
    1997,
    volume="69",
    pages="323-334",
)
ARMSTRONG_1994 = Reference(
    "armstrong1994",
    "B. Armstrong-Hélouvry, P. Dupont and C. Canudas de Wit",
    "A survey of models, analysis tools and compensation methods for the control of machines with friction",
    "Automatica",
    1994,
    volume="30",
    pages="1083-1138",
)

LOAD_EXCHANGE = Experiment(
    id="gearbox.load_exchange",
    title="Load exchange of a two-stage planetary gearbox",
    summary="Stages, torques, efficiency, inertia, drag, lock and slip torque of a gearbox that locks (FOS) or slips (SOS).",
    references=(GONZALEZ_CRUZ_2019, SHINBROT_1957, WHITE_1997, ARMSTRONG_1994),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=LoadExchangeSettings,
    identify=Later("pipeline.rigs.gearbox.identify:identify"),
    synthesize=Later("pipeline.rigs.gearbox.synthetic:synthesize"),
    sections=Later("pipeline.rigs.gearbox.outcome.sections:sections"),
    methods=Later("pipeline.rigs.gearbox.outcome.methods:methods"),
    check=Later("pipeline.rigs.gearbox.check:check"),
    operating=OPERATING,
    signals=(
        Signals(
            "load",
            {"measured": "N*m", "predicted": "N*m", "residual": "N*m"},
            "output torque and what inertia and drag make of the speed, means over windows",
        ),
    ),
)
