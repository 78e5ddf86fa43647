"""What the synthetic tire, its sensors and its logs are made of (tire.md, section 6). All values are assumed.

Every field may be overridden, faults are fields too; `variants` adds runs that carry one fault each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from pipeline.errors import InputError, listing, nearest
from pipeline.rigs.overridden import overridden
from pipeline.rigs.tire.ring.ring import Ring
from pipeline.rigs.tire.synthetic.runs import BENCH_RUNS, KMH, RUNS, VARIANTS


@dataclass(frozen=True)
class TireTruth:
    """The tire, its two sensors, the transmitter and the faults. SI.

    Attributes
    ----------
    R, Ro, h, b, EI, kw, kv, kt, eta, cw, cv, inflation_pressure
        Belt radius, free outer radius, belt thickness and width; ring and tread (`ring.Ring`, `contact.pressed`).
    c, R0, flex_length, flex_lag
        Flex sensor (`sensor.Sensor`).
    film_gain, film_length, film_time_constant, film_offset_angle, film_mid
        PVDF film (`pvdf.Film`).
    rate, adc_reference, adc_bits, frames_per_packet, counter_bits, loss, burst
        Converter and radio: share of packets lost, mean length of a burst in packets.
    device_ppm, reference_ppm, reference_shift
        How much faster the clocks run (1e-6), how much later the reference table begins (s).
    noise, flex_noise, film_noise, road_noise
        Factor on all noise; white noise in V; noise from 30 to 400 Hz in V.
    resistance_drift, gain_drift, supply_sag
        Change of R0, c and supply over the run, relative.
    debond_time, debond_share, broken_time
        When (s) the flex sensor's response falls to that share; when its ink breaks. Infinite: never.
    polarity, divider_flipped, swapped, gated, gate, gated_counts, time_reversed
        Sensor bends the other way; resistor in the other leg; channels exchanged; transmitter sleeps within `gate` (V)
        of its reference, its counter then `gated_counts` time or stands; the log runs backward.
    once_per_rev, mains, creep, creep_time
        Artefacts: ohm, V at 50 Hz, share of the response that creeps and its time (s).
    silence
        From when to when (s) the radio is mute.
    as_voltage, counter, wheel_index
        Whether voltages stand in the log instead of codes; whether there is a packet counter, a pulse of the rim.
    load_scale, speed_scale
        Factors on the reference channels: wrong units.
    told
        Conditions that the log states other than they are; None leaves one out.
    """

    R: float = 0.3171
    Ro: float = 0.3266
    h: float = 0.012
    b: float = 0.21
    EI: float = 6.0
    kw: float = 6e5
    kv: float = 2e5
    kt: float = 1.2e8
    eta: float = 0.08
    cw: float = 0.0
    cv: float = 0.0
    inflation_pressure: float = 2.2e5
    tire_size: str = "245/40R18"
    c: float = 5000.0
    R0: float = 1e4
    flex_length: float = 0.05
    flex_lag: float = 1e-3
    supply_voltage: float = 3.3
    divider_resistance: float = 1e4
    film_gain: float = 200.0
    film_length: float = 0.03
    film_time_constant: float = 2e-3
    film_offset_angle: float = 0.02
    film_mid: float = 1.65
    rate: float = 12e3
    adc_reference: float = 3.3
    adc_bits: int = 12
    frames_per_packet: int = 10
    counter_bits: int = 16
    loss: float = 0.01
    burst: float = 5.0
    device_ppm: float = 20.0
    reference_ppm: float = -15.0
    reference_shift: float = 0.0
    reference_rate: float = 100.0
    noise: float = 1.0
    flex_noise: float = 1.5e-3
    film_noise: float = 3e-3
    road_noise: float = 0.0
    load_noise: float = 5.0
    speed_noise: float = 0.02
    resistance_drift: float = 0.002
    gain_drift: float = 0.0
    supply_sag: float = 0.0
    debond_time: float = math.inf
    debond_share: float = 0.55
    broken_time: float = math.inf
    polarity: int = 1
    divider_flipped: bool = False
    swapped: bool = False
    gated: bool = False
    gate: float = 0.03
    gated_counts: bool = True
    time_reversed: bool = False
    once_per_rev: float = 0.0
    mains: float = 0.0
    creep: float = 0.0
    creep_time: float = 0.06
    silence: Sequence[float] = ()
    as_voltage: bool = False
    counter: bool = True
    wheel_index: bool = False
    load_scale: float = 1.0
    speed_scale: float = 1.0
    told: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BenchTruth(TireTruth):
    """Load and speed runs on the bench.

    Attributes
    ----------
    runs, variants
        Names out of `BENCH_RUNS` and `VARIANTS`; a variant is run ``bad_<name>``.
    loads, speed, duration
        Loads (N) of runs ``load_<N>`` instead of `runs`, their speed (m/s); length of every run (s) unless 0.
    load_wave, drum_radius, speed_wander, speed_ramp
        Load and speed are not quite constant: once a turn of the drum, wander slowly, ramp over the run; relative.
    guide_friction, beam_mass
        The load cell is at the cylinder: it reads the guides' friction (N, by the direction of loading) and not the
        beam's weight (kg).
    hub_height
        Whether the hub's height is measured.
    """

    runs: Sequence[str] = tuple(RUNS)
    variants: Sequence[str] = ()
    loads: Sequence[float] = ()
    speed: float = 10.0 * KMH
    duration: float = 0.0
    load_wave: float = 0.005
    drum_radius: float = 0.6
    speed_wander: Sequence[float] = (0.002, 0.0006)
    speed_ramp: float = 0.0
    guide_friction: float = 0.0
    beam_mass: float = 0.0
    hub_height: bool = False


@dataclass(frozen=True)
class RoadTruth(TireTruth):
    """A drive on the road.

    Attributes
    ----------
    run, number
        Name of the run, number of its random stream.
    static_load, duration
        N, s.
    speeds
        Corners of the speed: (s, m/s) each, linear between, rounded over `smoothing` (s).
    driving_mass, braking_mass, transfer_mass
        Fx and Fz of this wheel per acceleration, kg: share of the driving, of the braking force, load transfer.
    pulses
        Events of the vertical load: centre (s), width (s), height (N) each, raised cosines.
    force_sign
        -1 where forward is called backward: rotation sense or sign of Fx reversed.
    references
        Whether the log holds vertical load and longitudinal force.
    """

    loss: float = 0.03
    burst: float = 8.0
    road_noise: float = 8e-3
    run: str = "road"
    number: int = 21
    static_load: float = 3500.0
    duration: float = 45.0
    speeds: Sequence[Sequence[float]] = (
        (0.0, 30.0 * KMH),
        (10.0, 30.0 * KMH),
        (13.7, 50.0 * KMH),
        (30.0, 50.0 * KMH),
        (34.2, 25.0 * KMH),
    )
    smoothing: float = 0.3
    driving_mass: float = 750.0
    braking_mass: float = 529.0
    transfer_mass: float = 159.0
    pulses: Sequence[Sequence[float]] = (
        (18.0, 1.2, 600.0),
        (20.0, 1.2, -500.0),
        (23.0, 1.6, 450.0),
        (26.0, 0.8, 200.0),
    )
    force_sign: int = 1
    references: bool = True


_Truth = TypeVar("_Truth", bound=TireTruth)


def bench_truth(overrides: Mapping[str, Any]) -> BenchTruth:
    """Return the truth of the bench with `overrides`; InputError where one is unknown or makes no rig."""
    truth = _checked(BenchTruth(), overrides)
    if truth.speed <= 0.0 or any(load < 0.0 for load in truth.loads):
        raise InputError("the synthetic tire: 'speed' needs to be above 0 m/s, 'loads' 0 N or more.")
    for names, known, what in ((truth.runs, BENCH_RUNS, "run"), (truth.variants, VARIANTS, "variant")):
        for name in names:
            if name not in known:
                raise InputError(
                    f"the synthetic tire has no {what} '{name}'.{nearest(name, known)} It has {listing(known, 40)}."
                )
    return truth


def road_truth(overrides: Mapping[str, Any]) -> RoadTruth:
    """Return the truth of the road with `overrides`; InputError where one is unknown or makes no rig."""
    truth = _checked(RoadTruth(), overrides)
    if any(len(corner) != 2 for corner in truth.speeds) or any(len(pulse) != 3 for pulse in truth.pulses):
        raise InputError(
            "the synthetic tire: each of 'speeds' needs two numbers (s, m/s), of 'pulses' three (s, s, N)."
        )
    if not truth.speeds or min(speed for _, speed in truth.speeds) <= 0.0:
        raise InputError("the synthetic tire: 'speeds' needs corners, all above 0 m/s.")
    return truth


def varied(truth: _Truth, overrides: Mapping[str, Any]) -> _Truth:
    """Return the truth of a run with a fault: `overrides` on top, what it tells on top of what is told anyway."""
    return replace(truth, **{**overrides, "told": {**truth.told, **overrides.get("told", {})}})


def ring_of(truth: TireTruth) -> Ring:
    """Return the ring of the truth."""
    return Ring(
        R=truth.R,
        EI=truth.EI,
        p0b=truth.inflation_pressure * truth.b,
        kw=truth.kw,
        kv=truth.kv,
        eta=truth.eta,
        cw=truth.cw,
        cv=truth.cv,
    )


_ABOVE_ZERO = (
    "R", "Ro", "h", "b", "EI", "kw", "kv", "kt", "inflation_pressure", "c", "R0", "flex_length", "supply_voltage",
    "divider_resistance", "film_length", "film_time_constant", "rate", "adc_reference", "adc_bits", "frames_per_packet",
    "counter_bits", "reference_rate", "creep_time",
)  # fmt: skip
_LONGEST = 600.0


def _checked(truth: _Truth, overrides: Mapping[str, Any]) -> _Truth:
    truth = overridden(truth, overrides, "synthetic tire")
    for name in _ABOVE_ZERO:
        value = getattr(truth, name)
        if not isinstance(value, int | float) or not math.isfinite(value) or value <= 0:
            raise InputError(f"'{name}' of the synthetic tire is {value!r}; expected more than 0.")
    wrong = (
        (not 0.0 <= truth.loss < 1.0, f"'loss' is {truth.loss!r}; expected a share from 0 to below 1"),
        (truth.burst < 1.0, f"'burst' is {truth.burst!r} packets; expected 1 or more"),
        (truth.flex_lag < 0.0, f"'flex_lag' is {truth.flex_lag!r} s; expected 0 or more"),
        (len(truth.silence) not in (0, 2), "'silence' needs two numbers, from and to (s)"),
        (
            not 0.0 <= getattr(truth, "duration", 0.0) <= _LONGEST,
            f"'duration' is {getattr(truth, 'duration', 0.0)!r} s; expected up to {_LONGEST:g} s",
        ),
    )
    for is_wrong, what in wrong:
        if is_wrong:
            raise InputError(f"the synthetic tire: {what}.")
    return truth
