"""The dirt that all logs of the ultrafiltration device share in the coverage studies, and rigs that are not the same twice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.coverage.dirt import dropouts
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.synthetic.truth import RigTruth

METER_U, BENCH_U, SCALE_U = 0.005, 0.002, 0.001
"""Relative standard uncertainties (type B) of flow meter, bench pressures and scale; the logs state them."""
UNEVEN: Mapping[str, Any] = {"device_jitter": 0.002, "bench_jitter": 0.002}
QUIET: Mapping[str, Any] = {
    "sensor_noise": 0.0, "adc_noise": 0.0, "bench_noise": 0.0, "device_lsb": 0.0, "bench_lsb": 0.0, "meter_noise": 0.0,
    "meter_gain": 1.0, "bench_gain": 1.0, "scale_noise": 0.0, "scale_gain": 1.0, "battery_noise": 0.0,
}  # fmt: skip
"""Readings without noise; the random numbers of pump and clocks stay what they are."""
_CONSTANTS = ("R_a", "R_f", "R_r", "C_1", "C_2", "L_r", "C_u", "K_uf", "V_g", "V_d0", "C_p")
_GAINS = {"flowmeter_gain_u": ("meter_gain", METER_U), "bench_gain_u": ("bench_gain", BENCH_U), "scale_gain_u": ("scale_gain", SCALE_U)}  # fmt: skip


def varied(rng: np.random.Generator, usual: RigTruth) -> dict[str, Any]:
    """Return another device of the kind: circuit and pump off by 5 %, gains by 1 %, offsets by 40 Pa, poles by 3 ms."""
    found = {name: float(getattr(usual, name) * np.exp(0.05 * rng.standard_normal())) for name in _CONSTANTS}
    for tap in TAPS:
        found[f"gain_{tap}"] = 1.0 + 0.01 * float(rng.standard_normal())
        found[f"offset_{tap}"] = 40.0 * float(rng.standard_normal())
        found[f"pole_{tap}"] = 0.030 + 0.003 * float(np.clip(rng.standard_normal(), -3.0, 3.0))
    return {**found, "device_lag": float(rng.uniform(1.5, 5.0)), "device_ppm": 40.0 * float(rng.standard_normal())}


def meters_off(rng: np.random.Generator, *conditions: str) -> dict[str, Any]:
    """Return gains drawn within the uncertainties that the logs state under these `conditions`."""
    off = {_GAINS[c][0]: 1.0 + _GAINS[c][1] * float(rng.standard_normal()) for c in conditions}
    return {**off, "told": {c: _GAINS[c][1] for c in conditions}}


def pressure_noise() -> dict[str, float]:
    """Return the coloured part of the noise (Pa, 1 sigma) of the device's and the bench's pressures."""
    return {pressure(tap, reader): sd for tap in TAPS for reader, sd in (("rap", 10.0), ("bench", 3.0))}


def lossy(recordings: list[Recording], rng: np.random.Generator, *tables: str, count: float = 3.0) -> list[Recording]:
    """Lose up to a second of samples now and then in these tables of 20 Hz."""
    found = []
    for recording in recordings:
        spoilt = replace(recording, streams={n: s for n, s in recording.streams.items() if n in tables})
        thinned = dropouts([spoilt], rng, count, longest=20, keep=1.0)[0]
        found.append(replace(recording, streams={**recording.streams, **thinned.streams}))
    return found


def label(p: Parameter) -> str:
    """Return the name of a parameter with its tap, sensor or estimator; runs and set-points count together."""
    return " ".join([p.name, *(str(p.at[key]) for key in ("channel", "source", "estimator", "set") if key in p.at)])
