"""What device and bench make of the pressures and the flow: gain, offset, noise, steps of the converters."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.recording import Channel, Stream
from pipeline.rigs.rap.circuit.hydraulics import transmembrane
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.synthetic.truth import RigTruth, per_tap

_G = 9.81
Columns = dict[str, tuple[np.ndarray, str]]
"""Channels of a table by name: values and SI unit ('' for text)."""


def stream(name: str, time: np.ndarray, columns: Mapping[str, tuple[np.ndarray, str]]) -> Stream:
    """Return a table: columns by name with their units."""
    return Stream(name, time, {key: Channel(key, values, unit) for key, (values, unit) in columns.items()})


def quantised(values: np.ndarray, step: float) -> np.ndarray:
    """Return `values` as a converter of that `step` gives them; a step of 0 changes nothing."""
    return np.asarray(step * np.round(values / step)) if step else values


def heads(truth: RigTruth) -> np.ndarray:
    """Return what a sensor over the reservoir's level reads less than the pressure at that level, Pa, shape (4,)."""
    return np.asarray(truth.fluid_density * _G * np.array(per_tap(truth, "height")))


def device_pressures(
    truth: RigTruth, ctrl: np.ndarray, prot: np.ndarray, moments: np.ndarray, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Return what the device's two units log of the pressures at their sensors, Pa: `ctrl`, `prot` of shape (n, 4).

    The sensor's own noise is common to both; each has that of its converter.
    """
    common = truth.sensor_noise * rng.standard_normal(ctrl.shape)
    offset = np.array(per_tap(truth, "offset"))
    readers = {"rap": ctrl, "prot": prot} if truth.prot else {"rap": ctrl}
    found = {}
    for reader, at_sensor in readers.items():
        own = truth.adc_noise * rng.standard_normal(ctrl.shape)
        raw = np.array(per_tap(truth, "gain")) * (at_sensor - heads(truth)) + offset + common + own
        if reader == "prot":
            raw = raw + _astray(truth, moments)
        read = np.clip(quantised(raw, truth.device_lsb), -truth.rail, truth.rail)
        found.update({pressure(tap, reader): read[:, i] for i, tap in enumerate(TAPS)})
    return found


def _astray(truth: RigTruth, moments: np.ndarray) -> np.ndarray:
    """Return how far the protective unit reads off, Pa, shape (n, 4)."""
    off = np.zeros((moments.size, len(TAPS)))
    for tap, start, end, step, drift in truth.mismatches:
        during = (moments >= start) & (moments < end)
        off[during, TAPS.index(tap)] += step + drift * (moments[during] - start)
    return off


def device_table(stamps: np.ndarray, pressures: Mapping[str, np.ndarray], truth: RigTruth) -> Stream:
    """Return the device's fast table: pressures of both units, transmembrane pressure as the device computes it."""
    columns = {name: (values, "Pa") for name, values in pressures.items()}
    tmp = transmembrane(*(pressures[pressure(tap, "rap")] for tap in ("prefilter", "return", "uf")))
    columns["tmp_rap"] = (quantised(np.asarray(tmp), truth.device_lsb), "Pa")
    return stream("device", stamps, columns)


def bench_table(truth: RigTruth, stamps: np.ndarray, at_sensor: np.ndarray, rng: np.random.Generator) -> Stream:
    """Return the bench's table: pressures and flow, from what is at its sensors, shape (n, 5)."""
    raw = truth.bench_gain * (at_sensor[:, :4] - heads(truth)) + truth.bench_offset
    read = quantised(raw + truth.bench_noise * rng.standard_normal(raw.shape), truth.bench_lsb)
    flow = truth.meter_gain * at_sensor[:, 4] + truth.meter_noise * rng.standard_normal(stamps.size)
    columns = {pressure(tap, "bench"): (read[:, i], "Pa") for i, tap in enumerate(TAPS)}
    return stream("bench", stamps, {**columns, "blood_flow_bench": (flow, "m^3/s")})
