"""The load calibration of a campaign: which runs enter it, and whether it can be relied on."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import listing
from pipeline.estimation.estimate import undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.calibration import calibrate
from pipeline.rigs.tire.bench.calibration_points import PeakPoint
from pipeline.rigs.tire.bench.calibration_scatter import Repeat
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.reference import LOAD
from pipeline.rigs.tire.bench.same_tire import at_usual_pressure

# Names of runs that tell the way of loading: load_2000_down; u2000 beside d2000.
_DOWN = re.compile(r"(?<![a-z])(down|unload\w*|ab|release)(?![a-z])")
# Deviations that the ring fit finds between runs: load, gain, pressure.
_DEVIATIONS = 3
_UP_SHORT, _DOWN_SHORT = re.compile(r"(?<![a-z])u_?\d"), re.compile(r"(?<![a-z])d_?\d")


def nominal_loads(runs: Sequence[BenchRun]) -> list[QualityFinding]:
    """Tell of runs whose load is the one that was set."""
    without = [run for run in runs if LOAD not in run.reference.means]
    if not without:
        return []
    known = [run.name for run in without if math.isfinite(run.load)]
    unknown = [run.name for run in without if not math.isfinite(run.load)]
    found = []
    if known:
        text = f"no vertical_load that can be used in {listing(known, 6)}: nominal_load is taken for it, 2 % uncertain. Log the load cell"
        found.append(QualityFinding("warning", text, None, LOAD))
    if unknown:
        text = (
            f"neither vertical_load nor nominal_load in {listing(unknown, 6)}: these runs serve the rolling radius only. Give nominal_load in "
            "runs.csv, or log the load cell"
        )
        found.append(QualityFinding("warning", text, None, LOAD))
    return found


def calibrate_peaks(found: Campaign) -> None:
    """Regress the peaks of the runs at the usual pressure; those at another speed are left out there."""
    points = []
    ways = _directions([run.name for run in found.runs])
    for run, way in zip(found.runs, ways, strict=True):
        if run.name in found.uncalibrated:
            continue
        if not at_usual_pressure(run, found.tire):
            found.uncalibrated[run.name] = "it was made at another inflation pressure"
            continue
        if not math.isfinite(run.level):
            found.uncalibrated[run.name] = "the mean of its revolution is not known, as part of it is not recorded"
            continue
        marks = found.features[run.name]
        whole = run.revolutions.whole
        points.append(
            PeakPoint(
                run.name, run.load, run.load_se, marks.value.peak + run.lift, marks.error.peak, run.nominal_load, run.rotation * found.radius,
                float(np.std(run.revolutions.amplitude[whole])) if whole.sum() > 2 else 0.0, way if min(ways) < 0 else 0,
            )
        )  # fmt: skip
    first = found.runs[0].device
    levels = [run.level for run in found.runs if math.isfinite(run.level)]
    level = float(np.mean(levels)) if levels else first.divider_resistance
    masses = [mass for run in found.runs if (mass := run.told("moving_mass")) is not None]
    found.calibration = calibrate(
        points, level, first.supply_voltage, first.divider_resistance, load_gain_u=found.tire.load_gain_u, mass=masses[0] if masses else None,
        repeat=_repeat(found),
    )  # fmt: skip
    found.uncalibrated.update(found.calibration.left_out)
    friction = found.calibration.friction
    if (
        friction is not None
        and friction.value is not None
        and friction.ci95 is not None
        and not friction.ci95[0] <= 0.0 <= friction.ci95[1]
    ):
        found.friction = {run.name: way * friction.value for run, way in zip(found.runs, ways, strict=True)}


def _repeat(found: Campaign) -> Repeat | None:
    """Return how well the runs repeat as the ring fit has it: three deviations from so many runs."""
    if found.ring is None or found.verdict is None or not found.verdict.fits or not found.ring.scatter.size > 0.0:
        return None
    scatter = found.ring.scatter
    return Repeat(scatter.load, scatter.gain, scatter.pressure, len(found.ring.runs) - _DEVIATIONS)


def _directions(names: Sequence[str]) -> list[int]:
    """Return -1 for the runs whose names say that their load was reached from above, else +1."""
    short = any(_UP_SHORT.search(name.lower()) for name in names)
    return [-1 if _DOWN.search(name.lower()) or (short and _DOWN_SHORT.search(name.lower())) else 1 for name in names]


def withdraw_doubtful(found: Campaign) -> None:
    """Take the curve back where loads or resistances that it rests on are not believed."""
    known = found.calibration
    none_believed = all(run.name in found.doubted for run in found.runs)
    why = (
        found.untared
        or found.circuit_doubt
        or _off_zero(found)
        or (next(iter(found.doubted.values())) if none_believed else "")
    )
    if known is None or not why:
        return
    none = {name: undetermined(name, why) for name in known.estimates}
    found.calibration = replace(
        known, curve=None, reason=why, estimates=none, residuals=np.full(len(known.points), math.nan), lack_of_fit=None, remarks=()
    )  # fmt: skip


def _off_zero(found: Campaign) -> str:
    """Doubt a load cell that shows a load where there is no peak, where the ring does not fit on its loads either."""
    if found.calibration is None or found.calibration.offset is None or found.verdict is None or found.verdict.fits:
        return ""
    return (
        f"the peaks over load point to no peak at {found.calibration.offset:.0f} N instead of 0 N, and the ring model does not fit on these loads: the load "
        "cell seems not to be tared. Tare it, and state nominal_load"
    )
