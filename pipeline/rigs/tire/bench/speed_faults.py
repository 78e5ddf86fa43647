"""Is `road_speed` the speed of the road, in m/s? Held against the wheel's rotation and the tire's size (tire.md, 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.reference import SPEED

# A tire rolls on 0.97 of its free radius; whatever is outside these is no rolling radius.
ROLLS_ON, _PLAUSIBLE = 0.9708, (0.90, 1.04)
# Of a unit by name, within that share.
_NEAR = 0.07
_UNITS = {3.6: "km/h", 2.236936: "mph", 3.280840: "ft/s", 1e3: "mm/s", 1e2: "cm/s", 60.0: "m/min", 1e-3: "km/s"}
_TURN = 2.0 * math.pi
# Radii of single runs differ by more than that (relative, and in robust standard deviations).
_ODD, _ODD_SDS = 0.01, 6.0
_AS_SET = 0.1


def speed_faults(run: BenchRun, free_radius: float | None) -> tuple[str, list[QualityFinding]]:
    """Return why a run's road_speed is not to be used (empty where it is), and what is to be said.

    Parameters
    ----------
    run
        A run.
    free_radius
        Half the nominal diameter of its tire, m; None where it is not stated.
    """
    speed, rotation = run.reference.value(SPEED), run.rotation
    if not math.isfinite(speed):
        return "", []
    if speed <= 0.0:
        text = (
            f"road_speed is {speed:.4g} m/s on the mean while the wheel turns at {rotation:.4g} rad/s: "
            + ("its sign is turned. Use 'sign: -1' in the recipe" if speed < 0 else "its sensor is dead or not connected")
        )  # fmt: skip
        return _refused(run, text)
    radius = speed / rotation
    about = free_radius if free_radius is not None else 0.3266
    ratio = radius / (ROLLS_ON * about)
    if _PLAUSIBLE[0] < radius / about < _PLAUSIBLE[1]:
        return "", _as_set(run, speed)
    told = (
        f"speed unit: road_speed over rotation is {radius:.4g} m, but a tire of free radius {about:.4g} m rolls on about "
        f"{ROLLS_ON * about:.3f} m"
    )
    for factor, unit in _UNITS.items():
        if abs(ratio / factor - 1.0) < _NEAR:
            return _refused(run, f"{told}: it looks like {unit}. Give the unit of road_speed in the recipe")
    turning = {60.0 / _TURN: "rpm of the wheel", 1.0: "rad/s of the wheel", 1.0 / _TURN: "turns of the wheel a second"}
    for value, unit in turning.items():
        if abs(radius / value - 1.0) < 0.02:
            return _refused(
                run, f"{told}: it is a rotation ({unit}) and no speed. Map the surface speed, or convert it"
            )
    for value, unit in ((ROLLS_ON * about * _TURN / 60.0, "in rpm"), (ROLLS_ON * about / _TURN, "in turns per second")):
        if abs(radius / value - 1.0) < _NEAR:
            return _refused(run, f"{told}: one of the two counts {unit}, or sample_rate is wrong")
    clock = next((k for k in (0.1, 0.25, 0.5, 2.0, 4.0, 10.0) if abs(ratio / k - 1.0) < _NEAR), None)
    if clock is not None:
        rate = run.device.rate / clock
        return _refused(
            run, f"{told}: a factor {clock:g}. Either sample_rate is {rate:g} and not {run.device.rate:g} Hz, or road_speed's gain is wrong"
        )  # fmt: skip
    if free_radius is None and 0.15 < radius < 0.7:
        return "", _as_set(run, speed)
    return _refused(run, f"{told}. Look at the unit and gain of road_speed, at sample_rate and at tire_size")


def _refused(run: BenchRun, text: str) -> tuple[str, list[QualityFinding]]:
    return text, [QualityFinding("error", text, run.name, SPEED)]


def _as_set(run: BenchRun, speed: float) -> list[QualityFinding]:
    told = run.told("nominal_speed")
    if told is None or told <= 0.0 or abs(speed / told - 1.0) <= _AS_SET:
        return []
    by = next((unit for factor, unit in _UNITS.items() if abs(told / speed / factor - 1.0) < _NEAR), "")
    why = (
        f"nominal_speed looks like {by}; give it with its unit"
        if by
        else "results are told at the nominal one; mend whichever is wrong"
    )
    text = f"road_speed is {speed:.4g} m/s and nominal_speed {told:.4g} m/s: {why}"
    return [QualityFinding("warning", text, run.name, SPEED)]


def odd_radii(runs: Sequence[BenchRun]) -> dict[str, str]:
    """Return the runs whose speed over rotation stands apart from that of the others, and what to say of each."""
    radii = {
        run.name: run.reference.value(SPEED) / run.rotation for run in runs if math.isfinite(run.reference.value(SPEED))
    }
    if len(radii) < 4:
        return {}
    values = np.array(list(radii.values()))
    middle = float(np.median(values))
    sd = 1.4826 * float(np.median(np.abs(values - middle)))
    limit = max(_ODD * middle, _ODD_SDS * sd)
    return {
        name: f"road_speed over rotation is {1e3 * radius:.1f} mm in this run and {1e3 * middle:.1f} mm in the others: slip, another tire or "
        "pressure, or a speed signal of another gain"
        for name, radius in radii.items()
        if abs(radius - middle) > limit
    }
