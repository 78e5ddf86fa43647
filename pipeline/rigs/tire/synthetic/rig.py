"""The logs of the synthetic tire (tire.md, section 6): the transmitter's and the reference's table, each on its own clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.tire.ring.sensor import divider_voltage
from pipeline.rigs.tire.synthetic import electronics
from pipeline.rigs.tire.synthetic.library import library
from pipeline.rigs.tire.synthetic.motion import Motion, bench_motion, road_motion
from pipeline.rigs.tire.synthetic.packets import received
from pipeline.rigs.tire.synthetic.runs import BENCH_RUNS, KMH, VARIANTS
from pipeline.rigs.tire.synthetic.truth import (
    BenchTruth,
    RoadTruth,
    TireTruth,
    bench_truth,
    ring_of,
    road_truth,
    varied,
)

_G0 = 9.80665
_HEIGHT_NOISE = 1e-4
_ACCELERATION_NOISE = 0.05
_VARIANT_RUN = (2000.0, 10.0 * KMH, 20.0)


def synthesize_bench(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return one recording a run of the bench; `truth` overrides any field of `BenchTruth`."""
    known = bench_truth(truth)
    return [_bench_recording(*run, seed) for run in _bench_runs(known)]


def synthesize_road(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the drive on the road; `truth` overrides any field of `RoadTruth`."""
    known = road_truth(truth)
    rng = np.random.default_rng((seed, known.number))
    motion = road_motion(known, rng)
    streams = {"device": _device(known, motion, rng), "vehicle": _vehicle(known, motion, rng)}
    return [Recording(known.run, streams, _conditions(known, {"bench_or_road": "road"}))]


def _bench_runs(truth: BenchTruth) -> Iterator[tuple[BenchTruth, str, tuple[float, float, float], int, int]]:
    """Yield truth, name, (load, speed, duration), number of the random stream and direction of loading of each run."""
    if truth.loads:
        for number, load in enumerate(truth.loads, start=101):
            yield truth, f"load_{load:g}", (load, truth.speed, truth.duration or 20.0), number, 1
    for name in () if truth.loads else truth.runs:
        load, speed, duration, number, direction = BENCH_RUNS[name]
        yield truth, name, (load, speed, truth.duration or duration), number, direction
    for name in truth.variants:
        load, speed, duration = _VARIANT_RUN
        number = 31 + list(VARIANTS).index(name) * 100
        yield varied(truth, VARIANTS[name]), f"bad_{name}", (load, speed, truth.duration or duration), number, 1


def _bench_recording(
    truth: BenchTruth, name: str, point: tuple[float, float, float], number: int, direction: int, seed: int
) -> Recording:
    rng = np.random.default_rng((seed, number))
    motion = bench_motion(truth, *point, rng)
    streams = {"device": _device(truth, motion, rng), "bench": _bench(truth, motion, direction, rng)}
    conditions: dict[str, Condition] = {"nominal_load": point[0], "nominal_speed": point[1], "bench_or_road": "bench"}
    return Recording(name, streams, _conditions(truth, conditions))


def _device(truth: TireTruth, motion: Motion, rng: np.random.Generator) -> Stream:
    """Return the transmitter's table; samples of lost packets are absent."""
    flex = electronics.flex_voltage(truth, motion, rng)
    film = electronics.film_voltage(truth, motion, rng)
    if truth.time_reversed:
        flex, film = flex[::-1], film[::-1]
    rest = float(divider_voltage(np.asarray(truth.R0), truth.supply_voltage, truth.divider_resistance))
    index, counter = received(truth, motion.time, flex, rest, rng)
    read = {"flex": electronics.codes(truth, flex)[index], "pvdf": electronics.codes(truth, film)[index]}
    if truth.swapped:
        read = {"flex": read["pvdf"], "pvdf": read["flex"]}
    found = {"sample_index": Channel("sample_index", index.astype(float), "1")}
    if truth.counter:
        found["packet_counter"] = Channel("packet_counter", counter.astype(float), "1")
    for name, values in read.items():
        channel = Channel(f"{name}_code", values, "1")
        if truth.as_voltage:
            channel = Channel(f"{name}_voltage", values * truth.adc_reference / 2**truth.adc_bits, "V")
        found[channel.name] = channel
    if truth.wheel_index:
        turns = np.floor(motion.angle / (2.0 * np.pi))
        pulse = np.diff(turns, prepend=turns[:1]) > 0.0
        found["wheel_index"] = Channel("wheel_index", pulse[index].astype(float), "1")
    return Stream("device", index / truth.rate, found)


def _bench(truth: BenchTruth, motion: Motion, direction: int, rng: np.random.Generator) -> Stream:
    stamps, moments = _reference_clock(truth, motion)
    Fz, speed = motion.at("Fz", moments), motion.at("speed", moments)
    cell = Fz + direction * truth.guide_friction - truth.beam_mass * _G0
    channels = {
        "vertical_load": truth.load_scale * (cell + truth.load_noise * _white(truth, Fz.size, rng)),
        "road_speed": truth.speed_scale * (speed + truth.speed_noise * _white(truth, Fz.size, rng)),
    }
    units = {"vertical_load": "N", "road_speed": "m/s", "hub_height": "m"}
    if truth.hub_height:
        known = library(ring_of(truth), truth.kt, truth.Ro, truth.flex_length, float(Fz.max()))
        height = np.interp(Fz, known.loads, known.heights)
        channels["hub_height"] = height + _HEIGHT_NOISE * _white(truth, Fz.size, rng)
    return Stream("bench", stamps, {name: Channel(name, values, units[name]) for name, values in channels.items()})


def _vehicle(truth: RoadTruth, motion: Motion, rng: np.random.Generator) -> Stream:
    stamps, moments = _reference_clock(truth, motion)
    n = stamps.size
    speed, Fz, Fx = (motion.at(name, moments) for name in ("speed", "Fz", "Fx"))
    acceleration = np.interp(moments, motion.time, np.gradient(motion.speed, motion.time))
    found = [
        Channel("vehicle_speed", truth.speed_scale * (speed + truth.speed_noise * _white(truth, n, rng)), "m/s"),
        Channel("longitudinal_acceleration", acceleration + _ACCELERATION_NOISE * _white(truth, n, rng), "m/s^2"),
    ]
    if truth.references:
        for name, force in (("vertical_load", Fz), ("longitudinal_force", Fx)):
            found.append(Channel(name, truth.load_scale * (force + truth.load_noise * _white(truth, n, rng)), "N"))
    return Stream("vehicle", stamps, {channel.name: channel for channel in found})


def _reference_clock(truth: TireTruth, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return the stamps of the reference table and the true moments that they stand for, s, shape (n,) each."""
    pace = 1.0 + 1e-6 * truth.reference_ppm
    lasting = motion.time[-1] - max(truth.reference_shift, 0.0)
    stamps = np.arange(int(lasting * truth.reference_rate * pace) + 1) / truth.reference_rate
    return stamps, truth.reference_shift + stamps / pace


def _white(truth: TireTruth, n: int, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(truth.noise * rng.standard_normal(n))


def _conditions(truth: TireTruth, point: Mapping[str, Condition]) -> dict[str, Condition]:
    """Return what the log tells of the run: the truth unless `told` says otherwise."""
    conditions: dict[str, Condition | None] = {
        **point,
        "inflation_pressure": truth.inflation_pressure,
        "tire_size": truth.tire_size,
        "belt_width": truth.b,
        "sensor_length_flex": truth.flex_length,
        "sensor_length_pvdf": truth.film_length,
        "supply_voltage": truth.supply_voltage,
        "divider_resistance": truth.divider_resistance,
        "adc_reference": truth.adc_reference,
        "adc_bits": float(truth.adc_bits),
        "sample_rate": truth.rate,
        "frames_per_packet": float(truth.frames_per_packet),
        "counter_bits": float(truth.counter_bits),
        "liner_temperature": 298.15,
        "gated": truth.gated,
        **truth.told,
    }
    return {name: value for name, value in conditions.items() if value is not None}
