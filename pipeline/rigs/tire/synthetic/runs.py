"""Runs of the synthetic bench (tire.md, section 6), and what can be wrong with one (section 8)."""

from __future__ import annotations

from typing import Any

KMH = 1.0 / 3.6
# Name: load (N), speed (m/s), duration (s), number of its random stream, direction of loading.
RUNS: dict[str, tuple[float, float, float, int, int]] = {
    "load_1000": (1000.0, 10.0 * KMH, 20.0, 11, 1),
    "load_1500": (1500.0, 10.0 * KMH, 20.0, 12, 1),
    "load_2000": (2000.0, 10.0 * KMH, 20.0, 13, 1),
    "load_2500": (2500.0, 10.0 * KMH, 20.0, 14, 1),
    "load_3000": (3000.0, 10.0 * KMH, 20.0, 15, 1),
    "speed_05": (2000.0, 5.0 * KMH, 30.0, 16, 1),
    "speed_20": (2000.0, 20.0 * KMH, 15.0, 17, 1),
}
_OTHER_RUNS = {
    "load_2500_down": (2500.0, 10.0 * KMH, 20.0, 41, -1),
    "load_2000_down": (2000.0, 10.0 * KMH, 20.0, 42, -1),
    "load_1500_down": (1500.0, 10.0 * KMH, 20.0, 43, -1),
    "load_1000_down": (1000.0, 10.0 * KMH, 20.0, 44, -1),
    "speed_10": (2000.0, 10.0 * KMH, 20.0, 45, 1),
    "speed_15": (2000.0, 15.0 * KMH, 20.0, 46, 1),
    "free_spin": (0.0, 10.0 * KMH, 20.0, 47, 1),
}
BENCH_RUNS = {**RUNS, **_OTHER_RUNS}
# What is wrong with the run bad_<name> (2000 N, 10 km/h, 20 s unless it says otherwise).
VARIANTS: dict[str, dict[str, Any]] = {
    "debond": {"debond_time": 12.0},
    "broken": {"broken_time": 12.0},
    "gated": {"gated": True},
    "swapped": {"swapped": True},
    "polarity": {"polarity": -1},
    "divider": {"divider_flipped": True},
    "saturated": {"film_gain": 1300.0},
    "loss": {"loss": 0.1, "burst": 12.0},
    "packet_id": {"counter_bits": 2, "told": {"counter_bits": None}},
    "pressure": {"inflation_pressure": 1.87e5, "told": {"inflation_pressure": 2.2e5}},
    "sag": {"supply_sag": 0.1},
    "drift": {"resistance_drift": 0.03},
    "once_per_rev": {"once_per_rev": 600.0},
    "mains": {"mains": 0.03},
    "creep": {"creep": 0.08},
    "speed": {"speed_ramp": 0.2},
    "kmh": {"speed_scale": 3.6},
    "kg": {"load_scale": 1.0 / 9.80665},
    "friction": {"guide_friction": 100.0, "beam_mass": 40.0},
    "sensor_length": {"told": {"sensor_length_flex": 0.055}},
    "direction": {"time_reversed": True},
}
