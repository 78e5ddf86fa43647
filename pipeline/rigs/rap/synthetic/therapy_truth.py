"""What the synthetic therapies are made of besides the rig: tank, housing, battery, faults (rap.md, section 6)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from pipeline.errors import InputError, listing, nearest
from pipeline.rigs.rap.circuit.tank import EchoModel, Tank
from pipeline.rigs.rap.synthetic.truth import ML_MIN, RigTruth, truth_of
from pipeline.rigs.rap.synthetic.truth_check import RIG

RUNS = ("rap_therapy_312", "rap_tank_motion", "rap_faults")
# What a clot, a clamp or a disconnection does to the circuit, and the alarm that it should give.
EPISODES: dict[str, tuple[str, float]] = {
    "ACCESS_OCCLUDED": ("R_a", 4.0),
    "FILTER_COAGULATION": ("R_f", 2.5),
    "RETURN_OCCLUDED": ("R_r", 2.5),
    "RETURN_DISCONNECTED": ("R_r", 0.2),
    "ACCESS_DISCONNECTED": ("R_a", 0.2),
    "MEMBRANE_COAGULATION": ("K_uf", 0.5),
}
INJECTIONS = {"AIR": "air_detected", "BLOOD_LEAK": "blood_leak_detected", "EMERGENCY_STOP": "estop_pressed"}
"""Alarms that a sensor or a key gives, and the channel that shows it."""


@dataclass(frozen=True)
class TherapyTruth(RigTruth):
    """R4 (therapy), R5 (motion of the tank) and R6 (faults). SI; angles in rad.

    Attributes
    ----------
    runs
        Which of `RUNS` to make.
    blood_flow, duration, zero_time, stop_time
        Set-point (m^3/s); seconds with the pumps on, before and after, of R4.
    wear, fouling
        Share of V_g lost, and rise of the membrane's resistance, at 5 h of therapy.
    pump_gain, pump_gain_scatter, pump_gain_memory
        Ultrafiltrate pump: what it gives over what it is asked for, its wander (1 sigma) and correlation time, s.
    closed_loop, loop_time, loop_least, loop_most
        Whether the device regulates the volume by the level; within which time (s), and the limits of the command.
    tank_lx ... echo
        See `Tank`.
    initial_volume
        What is in the tank at the start of R4, m^3.
    level_noise, level_lsb, level_offset, wild_echoes
        Ultrasonic sensor: 1 sigma, step, how much too high it puts the level (m); share of echoes that are anything.
    pitch, roll, accel_noise
        How the tank stands in R4; accelerometer's noise (m/s^2).
    temperature_initial, temperature_final, temperature_time
        Air in housing and tank, eq. 7.
    temperature_offset, temperature_noise, temperature_lsb, temperature_step
        The device's sensor (K) and how often it is logged (s); ``bench_temperature_*`` the bench's.
    scale_noise, scale_gain, scale_tare
        Scale: 1 sigma (kg), gain, what it reads of an empty tank (kg).
    power, power_scatter, battery_energy, battery_efficiency, battery_resistance, battery_noise
        Mean power (W) and its relative scatter; the battery (J, 1, ohm); relative noise of voltage and current.
    motion_duration, motion_volume, motion_pitch, motion_period, motion_pitch_scatter, motion_roll_scatter, motion_memory
        R5: s, m^3 at the start, amplitude and period (s) of the pitching, what is added at random, its correlation time.
    walking_every, walking_time, walking_accel, slosh
        R5: a bout of walking every so often (s) and so long; its accelerations (m/s^2) and waves (m), 1 sigma.
    faults_duration, episodes, pauses
        R6: s; (alarm, start, end) of each of `EPISODES`; (start, end) of each pause.
    injections
        R6: (alarm, start, end) of each of `INJECTIONS`; the device stops its pumps at once.
    fault_mismatches
        R6: as `mismatches`, on top of these.
    alarm_delay, alarm_reaction
        R6: how late the device logs an alarm (s), and whether it stops its pumps then.
    """

    runs: Sequence[str] = RUNS
    blood_flow: float = 80.0 * ML_MIN
    duration: float = 18720.0
    zero_time: float = 20.0
    stop_time: float = 10.0
    wear: float = 0.03
    fouling: float = 0.25
    meter_gain: float = 1.004
    heparin_flow: float = 2e-6 / 3600.0
    pump_gain: float = 0.97
    pump_gain_scatter: float = 0.01
    pump_gain_memory: float = 3600.0
    closed_loop: bool = True
    loop_time: float = 600.0
    loop_least: float = 0.8
    loop_most: float = 1.2
    tank_lx: float = 0.120
    tank_ly: float = 0.0705
    tank_height: float = 0.260
    tank_blind_level: float = 0.010
    level_sensor_z: float = 0.285
    level_sensor_dx: float = 0.035
    level_sensor_dy: float = 0.0
    echo_reference_temperature: float = 293.15
    echo_model: str = "axis"
    initial_volume: float = 0.0
    level_noise: float = 1e-3
    level_lsb: float = 0.25e-3
    level_offset: float = 0.0
    wild_echoes: float = 0.02
    pitch: float = math.radians(1.5)
    roll: float = math.radians(-0.8)
    accel_noise: float = 0.03
    temperature_initial: float = 298.15
    temperature_final: float = 303.15
    temperature_time: float = 1200.0
    temperature_offset: float = 0.8
    temperature_noise: float = 0.25
    temperature_lsb: float = 0.125
    temperature_step: float = 600.0
    bench_temperature_noise: float = 0.05
    bench_temperature_lsb: float = 0.1
    scale_noise: float = 1e-3
    scale_gain: float = 1.0
    scale_tare: float = 0.0
    power: float = 13.9
    power_scatter: float = 0.02
    battery_energy: float = 75.5 * 3600.0
    battery_efficiency: float = 0.97
    battery_resistance: float = 0.15
    battery_noise: float = 0.01
    motion_duration: float = 7200.0
    motion_volume: float = 0.3e-3
    motion_pitch: float = math.radians(5.0)
    motion_period: float = 120.0
    motion_pitch_scatter: float = math.radians(3.0)
    motion_roll_scatter: float = math.radians(2.0)
    motion_memory: float = 20.0
    walking_every: float = 600.0
    walking_time: float = 60.0
    walking_accel: float = 1.5
    slosh: float = 6e-3
    faults_duration: float = 1500.0
    episodes: Sequence[Sequence[Any]] = (
        ("ACCESS_OCCLUDED", 200.0, 230.0),
        ("FILTER_COAGULATION", 330.0, 360.0),
        ("RETURN_OCCLUDED", 460.0, 490.0),
        ("RETURN_DISCONNECTED", 590.0, 620.0),
        ("ACCESS_DISCONNECTED", 720.0, 750.0),
        ("MEMBRANE_COAGULATION", 850.0, 900.0),
    )
    pauses: Sequence[Sequence[float]] = ((1000.0, 1100.0), (1200.0, 1345.0))
    injections: Sequence[Sequence[Any]] = ()
    fault_mismatches: Sequence[Sequence[Any]] = (
        ("prefilter", 130.0, 160.0, 500.0, 0.0),
        ("return", 1400.0, 1490.0, 0.0, 5.0),
    )
    alarm_delay: float = 1.5
    alarm_reaction: bool = False


def therapy_truth(overrides: Mapping[str, Any]) -> TherapyTruth:
    """Return the truth of the therapies with `overrides`.

    Raises
    ------
    InputError
        If a field, a run or an alarm is unknown (names the nearest), or a number makes no rig.
    """
    truth = truth_of(TherapyTruth(), overrides)
    known = [(truth.runs, RUNS, "run"), ([e[0] for e in truth.episodes], tuple(EPISODES), "episode"),
             ([i[0] for i in truth.injections], tuple(INJECTIONS), "injection"),
             ([truth.echo_model], ("axis", "specular"), "echo model")]  # fmt: skip
    for names, all_names, what in known:
        for name in names:
            if name not in all_names:
                raise InputError(
                    f"the {RIG} has no {what} '{name}'.{nearest(str(name), all_names)} It has {listing(all_names)}."
                )
    return truth


def tank_of(truth: TherapyTruth) -> Tank:
    """Return the tank with its ultrasonic sensor."""
    echo: EchoModel = "specular" if truth.echo_model == "specular" else "axis"
    return Tank(
        truth.tank_lx, truth.tank_ly, truth.tank_height, truth.level_sensor_z, truth.level_sensor_dx,
        truth.level_sensor_dy, truth.tank_blind_level, truth.echo_reference_temperature, echo,
    )  # fmt: skip


TANK_CONDITIONS = tuple(
    field.name for field in fields(TherapyTruth) if field.name.startswith(("tank_", "level_sensor_", "echo_"))
)
"""Fields that are conditions of the same name."""
