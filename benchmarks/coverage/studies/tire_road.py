"""Coverage of `tire.road`: a drive of 45 s, identified with the findings of a bench campaign whose gauges are off.

Compared: the moments of the events. Not compared: `load_rms_error` and `force_rms_error`, which hold the log against its own reference
channels, and `packet_loss`, which is counted. Load and force of each revolution are no parameters: they stand in a table.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Findings, Parameter
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.bench.declaration import BENCH
from pipeline.rigs.tire.road.declaration import ROAD
from pipeline.rigs.tire.synthetic.rig import synthesize_bench, synthesize_road
from pipeline.rigs.tire.synthetic.truth import bench_truth, road_truth

# Relative standard uncertainties that the bench takes where a campaign states none (tire.md, 5).
_LOAD_GAIN_U, _PRESSURE_U, _LENGTH_U = 0.005, 0.01, 0.01
# Middles of the standard drive's pulses of load, and of its acceleration and braking, s.
_CENTRES = {"vertical": (18.0, 20.0, 23.0, 26.0), "longitudinal": (11.85, 32.1)}
_NEAR = 1.0
CASES = {
    "standard": Case(
        "Noise of the road of 8 mV from 30 to 400 Hz beside 1.5 mV of white noise, 3 % of the packets lost in bursts of 8, drift, clocks 20 ppm off; "
        "the bench's load cell off by 0.5 %, its pressure gauge and the drive's by 1 %, the sensor's length by 1 % (1 sigma)."
    ),
}


def campaign(case: str, seed: int) -> Campaign:
    """Return the log of a drive, the bench that it is identified with, and what is true of its events."""
    del case
    rng, known = np.random.default_rng((seed, 7)), road_truth({})
    off = rng.standard_normal(4)
    length = known.flex_length * (1.0 + _LENGTH_U * off[2])
    bench = _bench(1.0 + _LOAD_GAIN_U * off[0], 1.0 + _PRESSURE_U * off[1], length, seed)
    told = {"inflation_pressure": known.inflation_pressure * (1.0 + _PRESSURE_U * off[3]), "sensor_length_flex": length}
    drive = synthesize_road({"told": told}, seed)
    return Campaign(drive, _true, uses={"bench": bench}, label=lambda p: f"{p.name} {p.at.get('kind', '')}".strip())


def _bench(cell: float, gauge: float, length: float, seed: int) -> Findings:
    truth = bench_truth({})
    told: dict[str, Any] = {
        "inflation_pressure": gauge * truth.inflation_pressure,
        "sensor_length_flex": length,
        "sensor_length_u": _LENGTH_U,
    }
    runs = synthesize_bench({"load_scale": cell, "told": told, "duration": 10.0}, seed)
    findings: Findings = BENCH.identify(runs, BENCH.settings(), Context("bench", {}))
    return findings


def _true(p: Parameter) -> float | None:
    """Return the middle of the event that a number is of; None of what is no event of the drive."""
    if p.name != "event_time" or p.value is None:
        return None
    near = min(_CENTRES[str(p.at["kind"])], key=lambda centre: abs(centre - float(p.value or 0.0)))
    return near if abs(near - p.value) < _NEAR else None


STUDY = Study(ROAD, CASES, campaign)
