"""Is `road_speed` the speed of the road, in m/s? Held against the wheel's rotation and the tire's size (tire.md, 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.reference import LOAD, SPEED
from pipeline.rigs.tire.bench.speed_line import expected_radius, suspected

# Nominal speeds that are off by the factor of a unit, within that share.
_NEAR, _UNITS = 0.07, {3.6: "km/h", 2.236936: "mph", 1e3: "mm/s"}
# Radii of single runs differ by more than that (relative, and in robust standard deviations).
_ODD, _ODD_SDS = 0.01, 6.0
_AS_SET = 0.1
# No drum turns as fast (m/s).
_NO_SPEED = 60.0


def exchanged(run: BenchRun, free_radius: float | None) -> list[QualityFinding]:
    """Tell of load and speed in each other's place: vertical_load over rotation is then the radius of a tire, in m/s or km/h.

    Parameters as those of `speed_faults`.
    """
    load, speed = run.reference.value(LOAD), run.reference.value(SPEED)
    if not (math.isfinite(load) and math.isfinite(speed)) or abs(speed) < _NO_SPEED:
        return []
    expected = None if free_radius is None else expected_radius(2.0 * free_radius)
    if not suspected(speed / run.rotation, expected):
        return []
    if all(suspected(load / factor / run.rotation, expected) for factor in (1.0, *_UNITS)):
        return []
    text = (
        f"vertical_load and road_speed look swapped: they read {load:.4g} and {speed:.4g} while the wheel turns at {run.rotation:.4g} rad/s. Exchange "
        "them in the recipe"
    )
    return [QualityFinding("error", text, run.name, channel) for channel in (LOAD, SPEED)]


def speed_faults(run: BenchRun, free_radius: float | None) -> list[QualityFinding]:
    """Return what is to be said of a run's road_speed; errors where it cannot be one in m/s.

    Parameters
    ----------
    run
        A run.
    free_radius
        Half the nominal diameter of its tire, m; None where it is not stated.
    """
    speed, rotation = run.reference.value(SPEED), run.rotation
    if not math.isfinite(speed):
        return []
    if speed <= 0.0:
        why = "its sign is turned. Use 'sign: -1' in the recipe" if speed < 0 else "its sensor is dead or not connected"
        return _refused(
            run, f"road_speed is {speed:.4g} m/s on the mean while the wheel turns at {rotation:.4g} rad/s: {why}"
        )
    wrong = suspected(speed / rotation, None if free_radius is None else expected_radius(2.0 * free_radius))
    if wrong:
        return _refused(
            run, f"speed unit: {wrong}. Give the unit of road_speed in the recipe, or mend sample_rate or tire_size"
        )
    return _as_set(run, speed)


def _refused(run: BenchRun, text: str) -> list[QualityFinding]:
    return [QualityFinding("error", text, run.name, SPEED)]


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
