"""Coverage of `tire.bench`: seven runs of 10 s of a bench whose gauges are off and which does not repeat itself.

The truth of a run's own numbers (peak, dips, lengths) is the noise-free waveform at its own pressure and gain; R0 that of the
middle of the run; of the calibration the quadratic through the true peaks at the campaign's loads. Not compared: `pvdf_nrmse` and
`packet_loss` describe a log and have no interval. The bound of the ring's numbers takes scatter, gauges and priors as they are and
the coloured noise as none. Wide on purpose: the loss factor and the tangential foundation carry a rotation that is uneven within
the turn by 1e-4 at 10 km/h (drum, imbalance), which would pass for loss; these wheels turn evenly, and no run can tell. The
peaks' errors hold that a wave of the load which runs in step with the drum may repeat from turn to turn; here it averages out.
How far loads, gains and pressures differ between runs is told as the mean of its square over all that is likely, since few runs
tell it badly: on average that makes the ring's errors about a tenth too large, those of the sensor's gain most.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.tire.bench.declaration import BENCH, BenchSettings
from pipeline.rigs.tire.bench.ring_information import Bench, information_of
from pipeline.rigs.tire.bench.ring_model import NAMES, SIZES, RingModel, Unknowns
from pipeline.rigs.tire.bench.ring_run import Known, Scatter
from pipeline.rigs.tire.ring.contact import Compliance, compliance, pressed
from pipeline.rigs.tire.ring.sensor import Sensor, flex_shape, voltage_slope
from pipeline.rigs.tire.ring.shape_lengths import Lengths, lengths
from pipeline.rigs.tire.synthetic.rig import synthesize_bench
from pipeline.rigs.tire.synthetic.runs import KMH, RUNS
from pipeline.rigs.tire.synthetic.truth import bench_truth, ring_of

_DURATION = 10.0
# Relative standard uncertainties of what all runs share, as the settings have them; what differs from run to run, unseen.
_LOAD_GAIN_U, _PRESSURE_U, _LENGTH_U, _RADIUS_U = 0.005, 0.01, 0.04, 0.005
_LOAD_SCATTER, _GAIN_SCATTER, _PRESSURE_SCATTER = 0.002, 0.002, 0.003
_COLOURED = 1e-3
_TRUTH = bench_truth({})
_LOADS = (1000.0, 1500.0, 2000.0, 2500.0, 3000.0)
_MARKS = {
    "peak_resistance": "peak", "dip_leading": "dip_leading", "dip_trailing": "dip_trailing",
    "deformation_length": "deformation", "slope_length": "slope", "zero_length": "zero",
}  # fmt: skip
CASES = {
    "standard": Case(
        "Load cell off by 0.5 %, pressure gauge by 1 %, sensor lengths by 4 %, free radius by 0.5 % (1 sigma); from run to run load and gain differ "
        "by 0.2 %, pressure by 0.3 %; white noise and 1 mV from 30 to 400 Hz, waves of load and speed, drift, 0.5 to 3 % of the packets lost in "
        "bursts, clocks within 20 ppm, converter of 12 bits."
    ),
    "gauges exact": Case("The same with exact load cell, pressure gauge and free radius: what is left is type A."),
    "no scatter": Case("The same with exact gauges, and runs that repeat themselves."),
}


class _Own(NamedTuple):
    """What is true of one run: load over what the cell reads of it, factors on gain and pressure."""

    load: float
    gain: float
    pressure: float


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of a campaign and what is true of them."""
    rng = np.random.default_rng((seed, 7))
    off = rng.standard_normal(5)
    ppm = rng.uniform(-20.0, 20.0, 2)
    dirt: dict[str, Any] = {
        "duration": _DURATION, "road_noise": _COLOURED, "device_ppm": ppm[0], "reference_ppm": ppm[1], "loss": rng.uniform(0.005, 0.03),
    }  # fmt: skip
    told: dict[str, Any] = {
        "inflation_pressure": _TRUTH.inflation_pressure,
        "sensor_length_flex": _TRUTH.flex_length * (1.0 + _LENGTH_U * off[0]),
        "sensor_length_pvdf": _TRUTH.film_length * (1.0 + _LENGTH_U * off[1]),
    }
    cell = 1.0
    if case == "standard":
        cell += _LOAD_GAIN_U * off[2]
        told["inflation_pressure"] *= 1.0 + _PRESSURE_U * off[3]
        # The free radius is half the nominal diameter: a tire that is told 1 mm wider would have one 0.4 mm larger.
        told["tire_size"] = f"{round(245.0 + _RADIUS_U * off[4] * _TRUTH.Ro / 0.4e-3)}/40R18"
    logs: list[Recording] = []
    own: dict[str, _Own] = {}
    for run in RUNS:
        z = rng.standard_normal(3) * (case != "no scatter")
        # In steps, so that runs share the contacts that were solved.
        pressure = 1.0 + 1e-3 * round(1e3 * _PRESSURE_SCATTER * z[2])
        own[run] = _Own(1.0 + _LOAD_SCATTER * z[0], 1.0 + _GAIN_SCATTER * z[1], pressure)
        unseen = {
            "runs": [run], "load_scale": cell / own[run].load, "c": _TRUTH.c * own[run].gain, "told": told,
            "inflation_pressure": _TRUTH.inflation_pressure * pressure,
        }  # fmt: skip
        logs += synthesize_bench({**dirt, **unseen}, seed)
    exact = {} if case == "standard" else {"load_gain_u": 1e-6, "pressure_u": 1e-6, "free_radius_u": 1e-6}
    bounds = _bounds(case)
    return Campaign(
        logs, lambda p: _true(p, own), BenchSettings(**exact), bound=lambda p: None if p.at else bounds.get(p.name)
    )


def _true(p: Parameter, own: Mapping[str, _Own]) -> float | None:
    if p.name in _MARKS:
        run = str(p.at["run"]) if "run" in p.at else _run_at(float(p.at["load"]), float(p.at["speed"]))
        load, speed = RUNS[run][:2]
        value = float(getattr(_marks(load, speed, own[run].pressure), _MARKS[p.name]))
        return value if p.name.endswith("length") else own[run].gain * value
    if p.name == "sensor_resistance":
        return _TRUTH.R0 * (1.0 + 0.5 * _TRUTH.resistance_drift)
    return true_of_all(p)


def true_of_all(p: Parameter) -> float | None:
    """Return the truth of a number of the tire, the same in all campaigns of its usual loads; None of what a run has for itself."""
    return _shared().get((p.name, float(p.at.get("load", 0.0))))


def _run_at(load: float, speed: float) -> str:
    return next(run for run, (F, v, *_) in RUNS.items() if load == F and abs(speed - v) < 1e-6)


def _marks(load: float, speed: float, pressure: float) -> Lengths:
    contact = pressed(_ring(round(pressure, 6)), _TRUTH.kt, _TRUTH.Ro, load)
    sensor = Sensor(_TRUTH.c, 0.0, _TRUTH.flex_length, _TRUTH.flex_lag)
    return lengths(flex_shape(contact.shape, sensor, _TRUTH.R, speed / _TRUTH.R), _TRUTH.R)


@lru_cache(maxsize=32)
def _ring(pressure: float) -> Compliance:
    return compliance(ring_of(bench_truth({"inflation_pressure": pressure * _TRUTH.inflation_pressure})), 4096)


@lru_cache(maxsize=1)
def _shared() -> dict[tuple[str, float], float]:
    """Return the truth of what all runs share, by name and load (0 where there is none)."""
    t = _TRUTH
    found = {(name, 0.0): value for name, value in _values(t.flex_length).items()}
    found |= {
        ("rolling_radius", 0.0): t.R,
        ("pvdf_gain", 0.0): t.film_gain * t.h / (2.0 * t.c),
        ("pvdf_time_constant", 0.0): t.film_time_constant,
        ("pvdf_offset_angle", 0.0): t.film_offset_angle,
    }
    ring, sensor, peaks = compliance(ring_of(t), 8192), Sensor(t.c, 0.0, t.flex_length, t.flex_lag), []
    for load in _LOADS:
        contact = pressed(ring, t.kt, t.Ro, load)
        found["contact_length", load] = contact.length
        near = flex_shape(contact.shape, sensor, t.R, 10.0 * KMH / t.R).at(np.linspace(-0.02, 0.02, 401))
        peaks.append(float(near.max()))
    a2, a1, a0 = np.polyfit(_LOADS, peaks, 2)
    found |= {(f"calibration_{k}", 0.0): float(value) for k, value in enumerate((a0, a1, a2))}
    middle = 0.5 * (_LOADS[0] + _LOADS[-1])
    level = np.asarray(t.R0 + np.polyval([a2, a1, a0], middle))
    slope = voltage_slope(level, t.supply_voltage, t.divider_resistance)
    found["load_sensitivity", 0.0] = float(slope) * float(a1 + 2.0 * a2 * middle)
    return found


def _values(length: float) -> dict[str, float]:
    t = _TRUTH
    return {
        "bending_stiffness": t.EI, "belt_width": t.b, "foundation_radial": t.kw, "foundation_tangential": t.kv, "tread_stiffness": t.kt,
        "sensor_gain": t.c, "loss_factor": t.eta, "sensor_lag": t.flex_lag, "sensor_length": length,
    }  # fmt: skip


@lru_cache(maxsize=4)
def _bounds(case: str) -> dict[str, float]:
    """Return the Cramér-Rao bound of the ring's numbers, SI."""
    t, bins = _TRUTH, 1024
    values = Unknowns(**_values(t.flex_length))
    samples = _DURATION * t.rate / bins
    step = t.adc_reference / 2**t.adc_bits
    slope = float(voltage_slope(np.asarray(t.R0), t.supply_voltage, t.divider_resistance))
    noise = float(np.hypot(t.flex_noise, step / np.sqrt(12.0))) / slope / np.sqrt(samples)
    bench = Bench(
        noise,
        t.load_noise / 2000.0 / np.sqrt(0.25 * _DURATION * t.reference_rate),
        t.R0,
        t.supply_voltage,
        t.divider_resistance,
        bins,
    )
    known = Known(t.R, 0.0, t.Ro, t.flex_length, _LENGTH_U)
    runs = [bench.run(values, known, load, speed, t.inflation_pressure) for load, speed, *_ in RUNS.values()]
    scatter = Scatter() if case == "no scatter" else Scatter(_LOAD_SCATTER, _GAIN_SCATTER, _PRESSURE_SCATTER)
    model = RingModel(runs, known, scatter)
    x = np.zeros(model.size)
    x[: len(NAMES)] = values.coordinates()
    sources = np.array([_PRESSURE_U, _LOAD_GAIN_U, 0.0, _RADIUS_U]) * (case == "standard")
    sd = np.sqrt(np.diag(information_of(model, x).covariance(sources)))
    return {name: float(s) * SIZES.get(name, abs(getattr(values, name))) for name, s in zip(NAMES, sd, strict=True)}


STUDY = Study(BENCH, CASES, campaign)
