"""An endurance test of the gearbox: seven speeds over and over for weeks, with wear, warm and cold days, faulty runs, a bad day.

Logs are written for a campaign of a project; how long each stage takes is for `rigfit` to tell. One accelerometer stands for
five, so that a thousand runs of 30 s stay below 3 GB.

    python -m benchmarks.many_gearbox FOLDER [RUNS] [--one-speed] [--bad SHARE] [--without-vibration]
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.truth import FIXTURES, RPM, GearboxTruth

SPEEDS = (60.0, 90.0, 120.0, 150.0, 180.0, 210.0, 240.0)
"""Nominal speeds in turn, rpm."""
A_DAY = 28
WEAR_DRAG, WEAR_LOCK = 0.08, -0.08
"""How much c0 (N m) and, as a share, the lock torque change from the first run to the last."""
BAD_GAIN = 0.9
"""Gain of the output torque on the bad day."""
_FIRST_DAY = 1_767_571_200.0  # 5 January 2026, s since 1970
_VISCOSITY = -0.008  # of the locked drag, a kelvin
_FAULTS = (
    "swapped_torques",
    "encoder_dropout",
    "no_standstill",
    "weak_brake",
    "board_clocks",
    "three_times_noise",
    "gain_error",
)


@dataclass(frozen=True)
class Planned:
    """One run of the endurance test: its name, when it begins (s since 1970), what it was told to be, its fault or '', its seed."""

    name: str
    begins: float
    overrides: Mapping[str, Any]
    fault: str
    seed: int


def planned(
    runs: int, *, bad: float = 0.02, one_speed: bool = False, vibration: bool = True, **overrides: Any
) -> Iterator[Planned]:
    """Yield the runs of an endurance test; `bad` is the share of faulty ones, other overrides hold for all."""
    known, rng = GearboxTruth(), np.random.default_rng(2026)
    days = max(math.ceil(runs / A_DAY), 1)
    weather = np.random.default_rng(7).normal(0.0, 3.0, days)
    for day in range(1, days):
        weather[day] = 0.6 * weather[day - 1] + 0.8 * weather[day]
    for i in range(runs):
        day, worn = i // A_DAY, i / max(runs - 1, 1)
        warmth = float(weather[day]) + 4.0 * (1.0 - math.exp(-(i % A_DAY) / 6.0))
        drag = math.exp(_VISCOSITY * warmth) * (1.0 + 0.02 * rng.standard_normal())
        truth: dict[str, Any] = {
            "speeds": [(120.0 if one_speed else SPEEDS[i % len(SPEEDS)]) * RPM],
            "c0": known.c0 * drag + WEAR_DRAG * worn,
            "c_s": known.c_s * drag,
            "d0": known.d0 * (1.0 + 0.005 * rng.standard_normal()),
            "M_lock": known.M_lock * (1.0 + WEAR_LOCK * worn),
            "vibration": vibration,
            **overrides,
        }
        if days > 2 and day == 2 * days // 3:
            truth["gain_out"] = BAD_GAIN
        fault = _FAULTS[int(rng.integers(len(_FAULTS)))] if rng.random() < bad else ""
        if fault:
            truth |= FIXTURES[fault]
        begins = _FIRST_DAY + 86400.0 * day + 8 * 3600.0 + 900.0 * (i % A_DAY)
        yield Planned(f"run{i + 1:04d}", begins, truth, fault, 1000 + i)


def recording_of(one: Planned) -> Recording:
    """Return the log of one run, with one accelerometer."""
    (recording,) = synthesize(one.overrides, one.seed)
    streams = dict(recording.streams)
    if "vibration" in streams:
        felt = streams["vibration"]
        streams["vibration"] = replace(felt, channels={"acc_in_radial": felt.channels["acc_in_radial"]})
    return Recording(
        one.name, streams, recording.conditions, provenance=replace(recording.provenance, begins=one.begins)
    )


def write(folder: Path, plan: Iterator[Planned]) -> int:
    """Write the logs of all runs as MCAP into `folder`; return their bytes."""
    from pipeline.ingest.mcap_log import writer

    folder.mkdir(parents=True, exist_ok=True)
    size = 0
    for one in plan:
        recording = recording_of(one)
        path = folder / f"{one.name}.mcap"
        made_up = {**recording.conditions, "synthetic": True}
        start = round(1e9 * one.begins)
        writer.write(replace(recording, conditions=made_up), path, samples_per_message=500, start=start)
        size += path.stat().st_size
    return size


def main() -> None:
    said = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    said.add_argument("folder", type=Path)
    said.add_argument("runs", type=int, nargs="?", default=1000)
    said.add_argument("--one-speed", action="store_true")
    said.add_argument("--without-vibration", action="store_true")
    said.add_argument("--bad", type=float, default=0.02)
    told = said.parse_args()
    plan = planned(told.runs, bad=told.bad, one_speed=told.one_speed, vibration=not told.without_vibration)
    print(f"{write(told.folder, plan) / 1e6:.0f} MB in {told.folder}")


if __name__ == "__main__":
    main()
