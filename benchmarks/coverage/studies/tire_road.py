"""Coverage of `tire.road`: a drive of 45 s, identified with the findings of a bench campaign whose gauges are off.

Compared: the moments of the events; and of the table of revolutions, whose tracks are no parameters, load, longitudinal force
and speed (raw and filtered) of the revolutions nearest to seven moments: steady, driving, braking, in and after a pulse. Not
compared: `load_rms_error` and `force_rms_error`, which hold the log against its own reference channels, and `packet_loss`, which
is counted. Ten benches take turns: what the bench's gauges leave in load and force is one of ten draws, beside the drive's own.

Where the wheel drives or brakes hard (moments 11.8 and 32.1 s) the speed is still off by half a standard error, the same way each
time. The moments of longitudinal events are told with an error twice too large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Findings, Parameter
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.bench.declaration import BENCH
from pipeline.rigs.tire.road.declaration import ROAD, RoadSettings
from pipeline.rigs.tire.synthetic.motion import Motion, road_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_bench, synthesize_road
from pipeline.rigs.tire.synthetic.truth import bench_truth, road_truth

# Relative standard uncertainties that the bench takes where a campaign states none (tire.md, 5).
_LOAD_GAIN_U, _PRESSURE_U, _LENGTH_U = 0.005, 0.01, 0.01
# Middles of the standard drive's pulses of load, and of its acceleration and braking, s.
_CENTRES = {"vertical": (18.0, 20.0, 23.0, 26.0), "longitudinal": (11.85, 32.1)}
_NEAR = 1.0
# Moments (s) at which the tracks are held against the truth, and what they are the tracks of.
_MOMENTS = (5.0, 11.8, 16.0, 20.0, 28.0, 32.1, 40.0)
_TRACKS = ("vertical_load", "longitudinal_force", "speed")
_UNITS = {"speed": "m/s"}
_BENCHES = 10
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
    bench, length = _bench(seed % _BENCHES)
    told = {
        "inflation_pressure": known.inflation_pressure * (1.0 + _PRESSURE_U * rng.standard_normal()),
        "sensor_length_flex": length,
    }
    drive = synthesize_road({"told": told}, seed)
    motion = road_motion(known, np.random.default_rng((seed, known.number)))
    return Campaign(
        drive,
        lambda p: _true(p, motion),
        uses={"bench": bench},
        label=lambda p: f"{p.name} {p.at.get('kind', '')}".strip(),
    )


@lru_cache(maxsize=_BENCHES)
def _bench(seed: int) -> tuple[Findings, float]:
    """Return the findings of a bench and the length (m) that it was told of the flex sensor."""
    truth, off = bench_truth({}), np.random.default_rng((seed, 8)).standard_normal(3)
    cell, gauge = 1.0 + _LOAD_GAIN_U * off[0], 1.0 + _PRESSURE_U * off[1]
    length = truth.flex_length * (1.0 + _LENGTH_U * off[2])
    told: dict[str, Any] = {
        "inflation_pressure": gauge * truth.inflation_pressure,
        "sensor_length_flex": length,
        "sensor_length_u": _LENGTH_U,
    }
    runs = synthesize_bench({"load_scale": cell, "told": told, "duration": 10.0}, seed)
    findings: Findings = BENCH.identify(runs, BENCH.settings(), Context("bench", {}))
    return findings, length


def _with_samples(recordings: Sequence[Recording], settings: RoadSettings, context: Context) -> Findings:
    """Identify, and tell the tracks at some moments as parameters."""
    found: Findings = ROAD.identify(recordings, settings, context)
    table = found.arrays["revolutions"]
    samples = []
    for moment in _MOMENTS:
        row = table.iloc[int(np.argmin(np.abs(table["time"].to_numpy() - moment)))]
        for name in _TRACKS:
            for suffix in ("", "_filtered"):
                value, error = float(row[name + suffix]), float(row[f"{name}_se{suffix}"])
                known = np.isfinite(value) and np.isfinite(error)
                samples.append(
                    Parameter(
                        name=name + suffix, symbol="", value=value if known else None, std_error=error if known else None,
                        ci95=(value - 1.96 * error, value + 1.96 * error) if known else None, unit=_UNITS.get(name, "N"),
                        at={"moment": moment, "time": float(row["time"])}, description="revolution nearest to a moment",
                    )
                )  # fmt: skip
    return found.model_copy(update={"parameters": [*found.parameters, *samples]})


def _true(p: Parameter, motion: Motion) -> float | None:
    """Return the middle of the event that a number is of, or the track's truth; None of what is neither."""
    if "moment" in p.at:
        return _of_track(p.name.removesuffix("_filtered"), float(p.at["time"]), motion)
    if p.name != "event_time" or p.value is None:
        return None
    near = min(_CENTRES[str(p.at["kind"])], key=lambda centre: abs(centre - float(p.value or 0.0)))
    return near if abs(near - p.value) < _NEAR else None


def _of_track(name: str, time: float, motion: Motion) -> float:
    """Return what was true at a passage: load and force there, peripheral speed on the mean from the passage before to that behind."""
    if name == "speed":
        angle = float(np.interp(time, motion.time, motion.angle))
        ends = np.interp([angle - 2.0 * np.pi, angle + 2.0 * np.pi], motion.angle, motion.time)
        return float(road_truth({}).R * 4.0 * np.pi / (ends[1] - ends[0]))
    return float(motion.at("Fz" if name == "vertical_load" else "Fx", np.array([time]))[0])


STUDY = Study(replace(ROAD, identify=_with_samples), CASES, campaign)
