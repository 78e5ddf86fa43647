"""Drives whose bench could not determine the tire: no load and no force, why, what to measure; what is told is right (tire.md, 5.9)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from road_bench import TRUTH, bench

from pipeline.findings import Findings
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.road.declaration import ROAD, RoadSettings
from pipeline.rigs.tire.synthetic.motion import road_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_road
from pipeline.rigs.tire.synthetic.truth import road_truth

KMH = 1.0 / 3.6
SEED = 5
DRIVE: dict[str, Any] = {
    "duration": 24.0,
    "speeds": [[0.0, 30 * KMH], [8.0, 30 * KMH], [11.0, 48 * KMH], [16.0, 48 * KMH], [19.0, 30 * KMH]],
    "pulses": [[5.0, 1.2, 600.0]],
}
# As the bench says it (`bench.identifiability`).
ONE_SPEED = "loss factor and sensor lag both make the passage lopsided; measure at two speeds or more"
ONE_LOAD = "one load cannot tell the scale of stiffnesses and sensor gain; measure at least three loads"
DESIGNS = {
    "bench of one speed": ({"loss_factor": ONE_SPEED, "sensor_lag": ONE_SPEED}, "two speeds"),
    "bench of one load": (
        dict.fromkeys(
            ("bending_stiffness", "belt_width", "foundation_radial", "foundation_tangential", "tread_stiffness", "sensor_gain"),
            ONE_LOAD,
        ),
        "three loads",
    ),
}  # fmt: skip


@cache
def of(design: str) -> Findings:
    nulls, _ = DESIGNS[design]
    drive = synthesize_road(DRIVE, SEED)
    return ROAD.identify(drive, RoadSettings(), Context("drive", {"bench": bench(nulls=nulls)}))


@pytest.mark.parametrize("design", DESIGNS)
def test_what_the_bench_left_open_is_null_with_the_reason_and_the_advice(design: str) -> None:
    found, remedy = of(design), DESIGNS[design][1]
    for name in ("load_rms_error", "force_rms_error"):
        p = found.one(name, run="road")
        assert p.value is None
        assert p.std_error is None
        assert remedy in p.description
    assert found.verdict == "warning"
    assert remedy in " ".join([*found.reasons, *found.advice])


@pytest.mark.parametrize("design", DESIGNS)
def test_no_load_and_no_force_is_made_up_and_the_speed_holds_the_truth(design: str) -> None:
    table = of(design).arrays["revolutions"]
    for name in ("vertical_load", "longitudinal_force"):
        for column in (name, f"{name}_filtered", f"{name}_se"):
            assert table[column].isna().all()
    known = road_truth(DRIVE)
    motion = road_motion(known, np.random.default_rng((SEED, known.number)))
    rotation = np.interp(table["time"], motion.time, np.gradient(motion.angle, motion.time))
    steady = (table["time"] > 1.0) & (table["time"] < 7.0)
    off = (table["speed"] - TRUTH.R * rotation) / table["speed_se"]
    assert off[steady].abs().median() < 2.0


@pytest.mark.parametrize("design", DESIGNS)
def test_events_without_a_tire_are_true_or_not_told(design: str) -> None:
    for p in of(design).find("event_time"):
        centres = {"vertical": (5.0,), "longitudinal": (9.5, 17.5)}[str(p.at["kind"])]
        assert p.value is not None
        assert min(abs(p.value - centre) for centre in centres) < 0.5
