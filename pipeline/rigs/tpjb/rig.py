"""Channels and conditions of the bearing rig, which its experiments share, and the sources they cite."""

from __future__ import annotations

from dataclasses import replace

from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Reference

_GAP = 5e-3
_CHANNELS = (
    *(
        ChannelSpec(
            f"gap_{axis}{side}{plane}",
            "m",
            f"proximity probe of plane {plane} on the stator at {'+' if side == 'p' else '-'}{axis}",
            required=False,
            limit=_GAP,
        )
        for plane in (1, 2)
        for axis in ("u", "v")
        for side in ("p", "m")
    ),
    ChannelSpec("force_u", "N", "dynamic actuator along u (+45 deg from x), force on the stator", limit=1e5),
    ChannelSpec("force_v", "N", "dynamic actuator along v (+135 deg from x), force on the stator", limit=1e5),
    ChannelSpec("force_static", "N", "static actuator along +y, force on the stator", required=False, limit=1e6),
    *(
        ChannelSpec(f"acc_{axis}{end}", "m/s^2", f"stator acceleration along +{axis}", required=False, limit=500.0)
        for axis in ("u", "v")
        for end in ("a", "b")
    ),
    ChannelSpec("speed", "rad/s", "shaft speed", required=False, limit=2.0e4),
    ChannelSpec("torque", "N*m", "shaft torque", required=False, limit=1e6),
    ChannelSpec("temp_oil_in", "K", "oil temperature at the inlet", required=False, limit=500.0),
    ChannelSpec("temp_oil_out", "K", "oil temperature at the outlet", required=False, limit=500.0),
    *(ChannelSpec(f"temp_pad_{n}", "K", f"temperature of pad {n}", required=False, limit=600.0) for n in range(1, 7)),
    ChannelSpec("pressure_oil", "Pa", "oil supply pressure", required=False, limit=1e8),
    ChannelSpec("flow_oil", "m^3/s", "oil flow", required=False, limit=1.0),
)
CONDITIONS = (
    ConditionSpec("bearing", "", "which bearing (4pad, 5pad)"),
    ConditionSpec("n_pads", "1", "number of pads"),
    ConditionSpec(
        "pad_angles", "", "pad directions from x, for example '45 135 225 315 deg'; by default load between pads"
    ),
    ConditionSpec("diameter", "m", "journal diameter", default=0.280),
    ConditionSpec("static_load", "N", "static load W; by default the mean of force_static"),
    ConditionSpec("shaft_speed_nominal", "rad/s", "shaft speed as set"),
    ConditionSpec("stator_mass", "kg", "mass of the floating stator, from tpjb.baseline"),
    ConditionSpec("stabilizer_stiffness", "N/m", "stiffness of stabilisers and hoses, from tpjb.baseline"),
    ConditionSpec("z1", "m", "probe plane 1 from the middle plane, signed"),
    ConditionSpec("z2", "m", "probe plane 2 from the middle plane, signed"),
    ConditionSpec("test", "", "baseline, bump, dynamic or rotating"),
    ConditionSpec("excitation_tones", "", "tones of the excitation, for example '7 11 13 19 Hz'"),
    ConditionSpec("mode", "", "in_phase or antiphase; by default what the forces show"),
    ConditionSpec("force_rotation_frequency", "Hz", "turns of the force vector per second, as set"),
    ConditionSpec("load_ratio", "1", "size of the turning force over the static load, as set"),
    ConditionSpec("clearance_nominal", "m", "nominal radial clearance"),
    ConditionSpec("sensor_gain_u", "1", "relative standard uncertainty of the probes' gain (type B)"),
    ConditionSpec("force_gain_u", "1", "relative standard uncertainty of the load cells' gain (type B)"),
)

# What parameters of these experiments are told at, besides conditions.
OPERATING = (
    ConditionSpec("shaft_speed", "rad/s", "mean shaft speed"),
    ConditionSpec("frequency", "Hz", "tone of the excitation"),
    ConditionSpec("synchronous", "", "true at the shaft's frequency"),
    ConditionSpec("order", "1", "harmonic of the load's rotation"),
    ConditionSpec("plane", "1", "probe plane"),
    ConditionSpec("side", "1", "side of the clearance polygon, the pad of that number"),
)

CIULLI_FORTE_2019 = Reference(
    "ciulli2019",
    "E. Ciulli and P. Forte",
    "Nonlinear Response of Tilting Pad Journal Bearings to Harmonic Excitation",
    "Machines",
    2019,
    volume="7",
    pages="43",
)


def channels(*required: str) -> tuple[ChannelSpec, ...]:
    """Return the channels of the rig with those in `required` required, the others optional."""
    return tuple(replace(spec, required=spec.name in required) for spec in _CHANNELS)
