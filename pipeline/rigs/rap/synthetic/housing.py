"""Air in the housing and the battery, as the device and the bench log them (rap.md, 3.6 and 3.11)."""

from __future__ import annotations

import numpy as np

from pipeline.recording import Stream
from pipeline.rigs.rap.circuit.battery import current, energy_used, open_circuit_voltage
from pipeline.rigs.rap.circuit.thermal import housing_temperature
from pipeline.rigs.rap.synthetic.bench_run import bench_clock, device_clock
from pipeline.rigs.rap.synthetic.clocks import Clock
from pipeline.rigs.rap.synthetic.drives import wander
from pipeline.rigs.rap.synthetic.readings import Columns, quantised, stream
from pipeline.rigs.rap.synthetic.therapy_truth import TherapyTruth

_POWER_MEMORY = 30.0
_LEVEL_LSB = 0.01


def air(truth: TherapyTruth, moments: np.ndarray) -> np.ndarray:
    """Return the true temperature (K) at true `moments` (s); the device is switched on at second 0."""
    return housing_temperature(
        np.maximum(moments, 0.0), truth.temperature_initial, truth.temperature_final, truth.temperature_time
    )


def temperature_tables(truth: TherapyTruth, duration: float, rng: np.random.Generator) -> list[Stream]:
    """Return the two tables of temperature: every `temperature_step`, and once at the end."""
    readers = (
        ("device_temperature", "temperature_air_rap", device_clock(truth), truth.temperature_offset,
         truth.temperature_noise, truth.temperature_lsb),
        ("bench_temperature", "temperature_air_bench", bench_clock(truth), 0.0,
         truth.bench_temperature_noise, truth.bench_temperature_lsb),
    )  # fmt: skip
    tables = []
    for table, channel, clock, offset, noise, lsb in readers:
        stamps = _every(clock, truth.temperature_step, duration)
        read = air(truth, clock.true(stamps)) + offset + noise * rng.standard_normal(stamps.size)
        tables.append(stream(table, stamps, {channel: (quantised(read, lsb), "K")}))
    return tables


def _every(clock: Clock, step: float, duration: float) -> np.ndarray:
    last = float(clock.stamp(np.array([duration]))[0])
    regular = np.arange(0.0, last - 0.1 * step, step)
    return np.append(regular, last)


def battery_columns(truth: TherapyTruth, moments: np.ndarray, rng: np.random.Generator) -> Columns:
    """Return voltage, current and charge of the battery, once a second; its converter's losses come on top of the power."""
    load = truth.power * (1.0 + wander(rng, moments.size, 1.0, truth.power_scatter, _POWER_MEMORY))
    used = energy_used(moments, load) + truth.power * max(float(moments[0]), 0.0)
    charge = np.clip(1.0 - used / (truth.battery_efficiency * truth.battery_energy), 0.0, 1.0)
    at_rest = open_circuit_voltage(charge)
    amperes = current(load, at_rest, truth.battery_resistance)
    volts = at_rest - truth.battery_resistance * amperes
    noise = truth.battery_noise * rng.standard_normal((2, moments.size))
    return {
        "battery_voltage": (volts * (1.0 + noise[0]), "V"),
        "battery_current": (amperes * (1.0 + noise[1]), "A"),
        "battery_level": (quantised(charge, _LEVEL_LSB), "1"),
    }


def scale_table(
    truth: TherapyTruth, moments: np.ndarray, volume: np.ndarray, duration: float, rng: np.random.Generator
) -> Stream:
    """Return what the scale reads on its own clock, of the `volume` (m^3) in the tank at true `moments` (s)."""
    clock = Clock(truth.scale_lag, 1e-6 * truth.scale_ppm, truth.scale_jitter)
    stamps, at = clock.ticks(1.0, duration, rng)
    mass = truth.scale_gain * truth.fluid_density * np.interp(at, moments, volume) + truth.scale_tare
    return stream("scale", stamps, {"uf_mass_scale": (mass + truth.scale_noise * rng.standard_normal(at.size), "kg")})
