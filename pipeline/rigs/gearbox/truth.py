"""What the synthetic gearbox is made of (gearbox.md, section 6), its campaign g1-g8 and its faulty rigs.

All values are assumed so that the published torques come out; none is a finding about the real gearbox.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.errors import InputError, listing, nearest
from pipeline.rigs.gearbox.model.teeth import teeth_of
from pipeline.rigs.overridden import overridden

RPM = 2.0 * math.pi / 60.0
RUNS = {"g1": 60.0, "g2": 90.0, "g3": 120.0, "g4": 120.0, "g5": 150.0, "g6": 180.0, "g7": 210.0, "g8": 240.0}
"""Nominal speed of each run, rpm."""

_LOSSLESS = 1.0 / 0.5443
FIXTURES: dict[str, Mapping[str, Any]] = {
    "x1_decoding": {"encoder_decoding": 1, "encoder_rate": 62.5},
    "swapped_torques": {"swap_torques": True},
    # The load of the sheet, seen by a box without load-proportional drag: only the sensor's gain differs from it.
    "gain_error": {
        "a": 1.0,
        "gain_out": 0.55,
        "J_L": 0.0195 * _LOSSLESS,
        "J_gb": 0.0006 * _LOSSLESS,
        "d0": 0.2467 * _LOSSLESS,
        "d1": 0.004244 * _LOSSLESS,
        "brake_capacity": 1.3 * _LOSSLESS,
    },
    "encoder_dropout": {"dropout_start": 7.0, "dropout_time": 0.4},
    "no_standstill": {"log_start": 3.0},
    "weak_brake": {"brake_capacity": 0.4},
    "board_clocks": {"encoder_ppm": 200.0, "encoder_shift": 0.3, "vibration_ppm": -200.0, "vibration_shift": -0.3},
    "three_times_noise": {"noise": 3.0},
}


@dataclass(frozen=True)
class GearboxTruth:
    """The synthetic rig and its logs; every field may be overridden. SI.

    Attributes
    ----------
    fixture
        Name of a faulty rig in `FIXTURES`; other overrides come on top.
    runs, speeds
        Runs of `RUNS` to make; or nominal speeds (rad/s) instead, of runs named r1, r2, ...
    a ... M_e
        Constants of the equations of motion, see `dynamics.Plant`.
    M_lock, M_lock_slope, lock_scatter
        Lock torque at 120 rpm, its change per rpm, and its relative scatter from run to run (1 sigma).
    ramp_start, ramp_time, brake_on, brake_rise, brake_capacity, brake_off, brake_fall, rundown_start, rundown_time, duration
        The cycle, s and N m.
    brakes
        Other brakings instead of that one: (on, off, capacity) each, in the order of time.
    teeth
        As `teeth.teeth_of` reads them; only vibration shows them.
    noise
        Scale of all random noise of torques and vibration.
    torque_noise, drift_in, drift_out, drift_memory
        White noise and first-order drift of the torques, 1 sigma, N m; correlation time of the drift, s.
    ripple_in, ripple_out
        Amplitude once per turn of that shaft, N m; 0.6 of it twice per turn.
    offset_in, offset_out, offset_change_in, offset_change_out
        Zero offsets at the start and how much they change to the end, N m.
    gain_in, gain_out, torque_span, torque_bits, swap_torques
        Torque sensors: gain, span of the converter (N m, saturates), its bits, wires crossed.
    encoder_ppr, encoder_decoding, encoder_rate, encoder_log_rate, speed_only
        Encoder; with `encoder_log_rate` each count is logged again at that rate (Hz) until the next;
        `speed_only` logs differences of counts as a speed.
    encoder_jitter
        Largest error of the encoder's time stamps, s.
    dropout_start, dropout_time, dropout_lost
        The counter stays frozen for a while; pulses meanwhile may be lost.
    modulation, creep
        Depth of the modulation of mesh 1 by passing planets; slip (rad/s) of the locked gears that only vibration shows.
    vibration
        Whether there is a vibration board.
    encoder_ppm, encoder_shift, vibration_ppm, vibration_shift
        Clocks of the other boards against that of the torques: how much faster (1e-6), and how much later they start (s).
    log_start
        When the logs begin, s of the cycle.
    """

    fixture: str = ""
    runs: Sequence[str] = tuple(RUNS)
    speeds: Sequence[float] = ()
    a: float = 0.5443
    J_L: float = 0.0195
    J_gb: float = 0.0006
    J_1: float = 0.0012
    J_m: float = 0.0015
    k_d: float = 0.40
    d0: float = 0.2467
    d1: float = 0.004244
    c0: float = 0.10
    c_s: float = 0.406
    w_s: float = 17.08
    b0: float = 0.004
    h0: float = 0.3236
    h1: float = 0.00501
    M_c: float = 0.5388
    M_v: float = 0.0390
    s_s: float = 2.0
    M_e: float = 0.85
    M_lock: float = 1.7835
    M_lock_slope: float = 0.003902
    lock_scatter: float = 0.01
    ramp_start: float = 2.0
    ramp_time: float = 2.05
    brakes: Sequence[Sequence[float]] = ()
    brake_on: float = 10.0
    brake_rise: float = 0.15
    brake_capacity: float = 1.3
    brake_off: float = 20.0
    brake_fall: float = 0.3
    rundown_start: float = 29.0
    rundown_time: float = 1.0
    duration: float = 30.0
    noise: float = 1.0
    torque_noise: float = 0.02
    drift_in: float = 0.012
    drift_out: float = 0.008
    drift_memory: float = 0.05
    ripple_in: float = 0.03
    ripple_out: float = 0.015
    offset_in: float = 0.012
    offset_out: float = -0.008
    offset_change_in: float = 0.0
    offset_change_out: float = 0.0
    gain_in: float = 1.0
    gain_out: float = 1.0
    torque_span: float = 20.0
    torque_bits: int = 14
    swap_torques: bool = False
    torque_rate: float = 2000.0
    encoder_ppr: int = 128
    encoder_decoding: int = 4
    encoder_rate: float = 125.0
    encoder_log_rate: float = 0.0
    encoder_jitter: float = 0.0
    speed_only: bool = False
    dropout_start: float = 0.0
    dropout_time: float = 0.0
    dropout_lost: bool = False
    vibration: bool = True
    vibration_rate: float = 2500.0
    modulation: float = 0.0
    creep: float = 0.0
    encoder_ppm: float = 0.0
    encoder_shift: float = 0.0
    vibration_ppm: float = 0.0
    vibration_shift: float = 0.0
    log_start: float = 0.0
    teeth: str = "60 20 100; 12 44 100"


def gearbox_truth(overrides: Mapping[str, Any]) -> GearboxTruth:
    """Return the truth with `overrides`.

    Raises
    ------
    InputError
        If a field, a fixture or a run is unknown (names the nearest), or a number makes no rig.
    """
    fixture = str(overrides.get("fixture", ""))
    if fixture and fixture not in FIXTURES:
        raise InputError(
            f"the synthetic gearbox has no fixture '{fixture}'.{nearest(fixture, FIXTURES)} It has {listing(FIXTURES)}."
        )
    truth = overridden(GearboxTruth(), {**FIXTURES.get(fixture, {}), **overrides}, "synthetic gearbox")
    _checked(truth)
    return truth


_ABOVE_ZERO = (
    "J_L", "J_gb", "J_1", "J_m", "k_d", "w_s", "s_s", "M_lock", "ramp_time", "brake_rise", "brake_fall", "rundown_time",
    "duration", "drift_memory", "torque_span", "torque_bits", "torque_rate", "encoder_ppr", "encoder_rate", "vibration_rate",
)  # fmt: skip
_ZERO_OR_MORE = (
    "d0", "d1", "c0", "c_s", "b0", "h0", "h1", "M_c", "M_v", "M_e", "M_lock_slope", "lock_scatter", "ramp_start",
    "brake_capacity", "noise", "torque_noise", "drift_in", "drift_out", "dropout_time", "encoder_log_rate",
    "encoder_jitter", "creep", "log_start",
)  # fmt: skip
_LONGEST = 300.0


def _checked(truth: GearboxTruth) -> None:
    for name in (*_ABOVE_ZERO, *_ZERO_OR_MORE):
        value, least = getattr(truth, name), "more than 0" if name in _ABOVE_ZERO else "0 or more"
        if (
            not isinstance(value, int | float)
            or not math.isfinite(value)
            or value < 0
            or (value == 0 and name in _ABOVE_ZERO)
        ):
            raise InputError(f"'{name}' of the synthetic gearbox is {value!r}; expected {least}.")
    for run in truth.runs:
        if run not in RUNS:
            raise InputError(f"the synthetic gearbox has no run '{run}'; it has {listing(RUNS)}.{nearest(run, RUNS)}")
    wrong = (
        (
            not 0.0 < truth.a <= 1.0,
            f"'a' is {truth.a!r}; expected more than 0 up to 1: it can transmit no more than all",
        ),
        (
            truth.encoder_decoding not in (1, 2, 4),
            f"'encoder_decoding' is {truth.encoder_decoding!r}; expected 1, 2 or 4",
        ),
        (
            any(len(b) != 3 for b in truth.brakes),
            "each of 'brakes' needs three numbers: on (s), off (s), capacity (N m)",
        ),
        (truth.duration > _LONGEST, f"'duration' is {truth.duration!r} s; expected up to {_LONGEST:g} s"),
        (
            truth.log_start >= truth.duration,
            f"'log_start' is {truth.log_start!r} s, after the end at {truth.duration:g} s",
        ),
        (
            truth.encoder_jitter >= 0.5 / truth.encoder_rate,
            f"'encoder_jitter' is {truth.encoder_jitter!r} s, half a period of the encoder or more",
        ),
        (any(not speed > 0.0 for speed in truth.speeds), "'speeds' need numbers above 0, rad/s"),
    )
    for is_wrong, what in wrong:
        if is_wrong:
            raise InputError(f"the synthetic gearbox: {what}.")
    teeth_of(truth.teeth, "'teeth' of the synthetic gearbox")


def speeds_of(truth: GearboxTruth) -> dict[str, float]:
    """Return the nominal speed of each run, rad/s."""
    if truth.speeds:
        return {f"r{i}": float(speed) for i, speed in enumerate(truth.speeds, start=1)}
    return {run: RUNS[run] * RPM for run in truth.runs}
