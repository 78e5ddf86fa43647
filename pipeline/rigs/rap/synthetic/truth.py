"""What the synthetic device and its bench are made of (rap.md, section 6); every number may be set in a recipe.

All values are assumed; none is a finding about the real device.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

from pipeline.rigs.overridden import overridden
from pipeline.rigs.rap.circuit.hydraulics import Circuit
from pipeline.rigs.rap.circuit.pump import Pump
from pipeline.rigs.rap.conditions import TAPS
from pipeline.rigs.rap.synthetic.truth_check import RIG, check

ML_MIN = 1e-6 / 60.0


@dataclass(frozen=True)
class RigTruth:
    """The device and its bench as in all runs. SI.

    Attributes
    ----------
    R_a ... K_uf, V_g ... a
        See `Circuit` and `Pump`; `eps` has one entry a roller.
    heparin_flow
        Heparin that flows in behind the pump, m^3/s.
    speed_scatter, speed_memory
        Speed of the blood pump: relative scatter (1 sigma) and its correlation time, s.
    gain_<tap>, offset_<tap>, pole_<tap>
        The device's pressure sensors: gain, offset (Pa), time constant (s).
    bench_gain, bench_offset, bench_pole
        Those of all of the bench's pressure sensors.
    sensor_noise, adc_noise, bench_noise, device_lsb, bench_lsb, rail
        White noise (Pa) that both units of the device share, of each unit's own converter, of the bench; steps of the
        converters, and where the device's saturate (Pa, either sign).
    prot, skew
        Whether the protective unit's readings are logged, and how much later it reads, s.
    mismatches
        Where it goes astray: (tap, start s, end s, step Pa, drift Pa/s) each.
    height_<tap>
        Sensor over the level of the reservoir, m; its head is read by device and bench alike.
    device_rate, bench_rate
        Samples a second.
    device_lag, device_ppm, device_jitter
        The device starts that much later than the bench (s), its stamps grow that much slower than the bench's (1e-6),
        and are that much off (1 sigma, s). ``bench_*``, ``scale_*`` likewise, against true time.
    jitter_sampled
        Whether the samples are taken when the jittering stamps say; else evenly, and the stamps alone are off.
    meter_noise, meter_gain, meter_time, flowmeter_location
        Flow meter: white noise (m^3/s), gain, time constant (s), access or return.
    pump_encoder
        Whether the device logs the strokes a second.
    tables
        Which tables to write; all of the run if empty.
    faults
        What is wrong, see `faults.FAULTS`: names, or mappings with `kind` and what differs from its usual form.
    told
        Conditions that the logs state otherwise than they are; None leaves one out.
    """

    R_a: float = 1.4e9
    L_a: float = 1.0e8
    C_a: float = 4.0e-11
    C_1: float = 6.0e-11
    R_f: float = 1.2e9
    C_2: float = 6.0e-11
    R_r: float = 1.4e9
    L_r: float = 1.2e8
    C_u: float = 3.0e-11
    K_uf: float = 2.0835e-11
    V_g: float = 0.90e-6
    V_d0: float = 0.10e-6
    C_p: float = 2.23e-11
    w: float = 0.35
    eps: Sequence[float] = (0.06, -0.04, -0.02)
    a: float = 0.3
    heparin_flow: float = 0.0
    speed_scatter: float = 0.005
    speed_memory: float = 5.0
    gain_access: float = 1.012
    gain_prefilter: float = 1.015
    gain_return: float = 0.990
    gain_uf: float = 1.008
    offset_access: float = -60.0
    offset_prefilter: float = 80.0
    offset_return: float = 40.0
    offset_uf: float = -30.0
    pole_access: float = 0.030
    pole_prefilter: float = 0.030
    pole_return: float = 0.030
    pole_uf: float = 0.030
    bench_gain: float = 1.0
    bench_offset: float = 0.0
    bench_pole: float = 0.005
    sensor_noise: float = 20.0
    adc_noise: float = 15.0
    bench_noise: float = 10.0
    device_lsb: float = 26.0
    bench_lsb: float = 2.0
    rail: float = 53.5e3
    prot: bool = True
    skew: float = 0.010
    mismatches: Sequence[Sequence[Any]] = ()
    height_access: float = 0.0
    height_prefilter: float = 0.0
    height_return: float = 0.0
    height_uf: float = 0.0
    device_rate: float = 20.0
    bench_rate: float = 20.0
    device_lag: float = 3.37
    device_ppm: float = 40.0
    device_jitter: float = 0.002
    jitter_sampled: bool = False
    bench_ppm: float = 0.0
    bench_jitter: float = 0.0
    scale_lag: float = 1.6
    scale_ppm: float = -20.0
    scale_jitter: float = 0.002
    meter_noise: float = 1.3e-8
    meter_gain: float = 1.0
    meter_time: float = 0.5
    flowmeter_location: str = "access"
    pump_encoder: bool = False
    fluid_density: float = 1004.0
    fluid_temperature: float = 298.65
    room_temperature: float = 298.65
    uf_flow: float = 5.0 * ML_MIN
    tables: Sequence[str] = ()
    faults: Sequence[str | Mapping[str, Any]] = ()
    told: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class PressuresTruth(RigTruth):
    """R1: pump stopped, then each of `flows` (m^3/s) without and with ultrafiltration, then stopped again.

    `duration`, `zero_time`, `stop_time` in s; the rest is shared by the set-points.
    """

    flows: Sequence[float] = (60.0 * ML_MIN, 80.0 * ML_MIN, 100.0 * ML_MIN)
    duration: float = 620.0
    zero_time: float = 20.0
    stop_time: float = 12.0
    run: str = "rap_press_steps"


@dataclass(frozen=True)
class FlowTruth(RigTruth):
    """R2 and R3: each of `flows` (m^3/s) at each setting of the clamp on the access line, which makes R_a that many times.

    Attributes
    ----------
    calibration_clamps, holdout_clamps
        Settings of the clamp of either set.
    hold
        Seconds at each set-point and setting.
    tube_change
        How much V_g of the other tube differs, as a share.
    sets
        Which of calibration, holdout and tube (the hold-out with the other tube) to make.
    split
        Whether each setting of the clamp is a run of its own.
    """

    flows: Sequence[float] = (60.0 * ML_MIN, 80.0 * ML_MIN, 100.0 * ML_MIN)
    calibration_clamps: Sequence[float] = (1.0, 2.0, 4.0, 6.0)
    holdout_clamps: Sequence[float] = (1.0, 3.0, 5.0)
    hold: float = 60.0
    zero_time: float = 20.0
    stop_time: float = 10.0
    tube_change: float = -0.02
    sets: Sequence[str] = ("calibration", "holdout", "tube")
    split: bool = False
    meter_gain: float = 1.004
    uf_flow: float = 0.0


AnyTruth = TypeVar("AnyTruth", bound=RigTruth)


def truth_of(usual: AnyTruth, overrides: Mapping[str, Any]) -> AnyTruth:
    """Return `usual` with `overrides`.

    Raises
    ------
    InputError
        If a field is unknown (names the nearest), or a number makes no rig.
    """
    truth = overridden(usual, overrides, RIG)
    check(truth)
    return truth


def circuit_of(truth: RigTruth) -> Circuit:
    """Return the circuit without any clamp."""
    return Circuit(**{field.name: getattr(truth, field.name) for field in fields(Circuit)})


def pump_of(truth: RigTruth) -> Pump:
    """Return the blood pump, new."""
    return Pump(truth.V_g, truth.V_d0, truth.C_p, truth.w, tuple(float(e) for e in truth.eps), truth.a)


def per_tap(truth: RigTruth, name: str) -> tuple[float, float, float, float]:
    """Return a number of the four taps, in the order of `TAPS`."""
    access, prefilter, back, uf = (float(getattr(truth, f"{name}_{tap}")) for tap in TAPS)
    return access, prefilter, back, uf
