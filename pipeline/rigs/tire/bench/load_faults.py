"""Is `vertical_load` the load on the tire, in N? Held against the load as set and against the other runs (tire.md, 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.reference import LOAD

G0 = 9.80665
_UNITS = {1.0 / G0: "kg", 1e-3: "kN", 1.0 / (1e3 * G0): "t", 0.2248089: "lbf", 0.1: "daN", 1e3: "mN"}
_NEAR = 0.05
_MOST_LOAD = 2e5  # N; the tire of an earth mover carries that
# Further from the load as set than that is told; less than the second share apart is friction of the guides or a tare.
_AS_SET, _MOST_TARE = 0.05, 0.5
# What all loads are off by together is told from here on (relative to their mean); a gain needs loads that differ by that.
_SHARED, _FEW_LOADS = 0.02, 0.2
# Runs set alike whose readings differ by more than that while their peaks do not.
_HYSTERESIS, _ALIKE_SPEED = 0.02, 0.05
# No tire's peak grows by more than that with the load, V/N: ten times the published sensitivity is kg.
_STEEP = 6e-4


def load_faults(run: BenchRun) -> list[QualityFinding]:
    """Return what is to be said of a run's vertical_load; errors where it cannot be one in N."""
    load, told = run.reference.value(LOAD), run.told("nominal_load")
    if not math.isfinite(load):
        return []
    if load <= 0.0:
        text = (
            f"vertical_load is {load:.4g} N on the mean while the tire rolls under load: "
            + ("its sign is turned. Use 'sign: -1' in the recipe" if load < 0.0 else "the cell is dead or not connected")
        )  # fmt: skip
        return [QualityFinding("error", text, run.name, LOAD)]
    if load > _MOST_LOAD:
        stated = f", where {told:.4g} N is set" if told else ""
        text = (
            f"vertical_load is {load:.4g} N on the mean{stated}: no wheel carries that. A reading in N was declared as kN, or the like: mend the unit of "
            "vertical_load in the log or in the recipe"
        )
        return [QualityFinding("error", text, run.name, LOAD)]
    if told is None or told <= 0.0:
        return _without_nominal(run, load)
    ratio = load / told
    for factor, unit in _UNITS.items():
        if abs(ratio / factor - 1.0) < _NEAR:
            text = (
                f"load looks like {unit}: vertical_load is {load:.4g} on the mean where {told:.4g} N is set. Give the unit of vertical_load in "
                "the recipe"
            )
            return [QualityFinding("error", text, run.name, LOAD)]
        if abs(ratio * factor - 1.0) < _NEAR:
            text = (
                f"nominal_load looks like {unit}: it is {told:.4g} where vertical_load is {load:.4g} N on the mean. Give it with its unit, as "
                f"'200 {unit}'"
            )
            return [QualityFinding("warning", text, run.name, LOAD)]
    off = load - told
    if abs(off) <= _AS_SET * told:
        return []
    text = f"vertical_load is {load:.5g} N on the mean where {told:.5g} N is set ({off:+.4g} N)"
    if abs(off) <= _MOST_TARE * told:
        return [QualityFinding("warning", f"{text}. {_tare(run, off)}", run.name, LOAD)]
    why = f"{text}: no load of that run can be relied on. Mend whichever is wrong"
    return [QualityFinding("error", why, run.name, LOAD)]


def _tare(run: BenchRun, off: float) -> str:
    mass = run.told("moving_mass")
    weighs = f" (moving_mass {mass:g} kg weighs {mass * G0:.0f} N)" if mass else ""
    return (
        f"A load cell at the cylinder reads the guides' friction and not the weight of beam and axle{weighs}: tare the beam mass "
        f"({abs(off) / G0:.0f} kg would do it) and measure up and down in load"
    )


def _without_nominal(run: BenchRun, load: float) -> list[QualityFinding]:
    """Judge a load that is stated nowhere else by the peak's voltage."""
    VIN, R1 = run.device.supply_voltage, run.device.divider_resistance
    level = run.waveform.level
    volts = VIN * (level + run.peak) / (R1 + level + run.peak) - VIN * level / (R1 + level)
    steepness = volts / load * 3.3 / VIN
    if steepness < _STEEP:
        return []
    text = (
        f"load looks like kg: the peak rises {1e3 * volts:.3g} mV at vertical_load {load:.4g}, {1e3 * steepness:.2g} mV per unit where "
        "tires give 0.1 to 0.2 mV/N. Give the unit of vertical_load in the recipe, and nominal_load with the runs"
    )
    return [QualityFinding("error", text, run.name, LOAD)]


@dataclass(frozen=True)
class SharedError:
    """What all loads are off by: a force (N), or a share of the load; the other is none. With what is to be said."""

    force: float
    share: float
    finding: QualityFinding


def shared_error(runs: Sequence[BenchRun]) -> SharedError | None:
    """Tell of a load cell that reads all loads wrong alike: by the weight of the beam or a zero point, or by its gain.

    The straight line of readings over loads as set tells one from the other.
    """
    pairs = np.array([
        (run.reference.value(LOAD), run.told("nominal_load"))
        for run in runs
        if math.isfinite(run.reference.value(LOAD)) and (run.told("nominal_load") or 0.0) > 0.0
    ])  # fmt: skip
    if len(pairs) < 3:
        return None
    read, told = pairs.T
    force, share = float(np.median(read - told)), float(np.median(read / told)) - 1.0
    as_force, as_share = float(np.std(read - told - force)), float(np.std(read - told * (1.0 + share)))
    if np.ptp(told) > _FEW_LOADS * told.mean() and as_share < as_force:
        if abs(share) < _SHARED or as_share > 0.5 * abs(share) * told.mean():
            return None
        text = (
            f"vertical_load is {100 * share:+.1f} % off the load as set in all runs: the gain of the load cell or its unit, or nominal_load, is wrong. "
            "Which of them, nothing here tells: every load, and what follows from it, is taken to be that uncertain. Check the cell with a known weight"
        )
        return SharedError(0.0, share, QualityFinding("warning", text, None, LOAD))
    if abs(force) < _SHARED * told.mean() or as_force > 0.5 * abs(force):
        return None
    text = (
        f"vertical_load differs from the load as set by the same {force:+.0f} N in all runs ({abs(force) / G0:.0f} kg): the weight of beam and axle, or "
        "a zero point. Tare the beam mass; until then every load, and what follows from it, may be off by that"
    )
    return SharedError(force, 0.0, QualityFinding("warning", text, None, LOAD))


def hysteresis(runs: Sequence[BenchRun]) -> list[QualityFinding]:
    """Tell of runs with the same peak whose load cell reads differently: friction of the guides, up against down in load."""
    found = []
    groups: dict[tuple[float, float], list[BenchRun]] = {}
    for run in runs:
        if math.isfinite(run.reference.value(LOAD)) and run.told("nominal_load"):
            groups.setdefault((run.nominal_load, round(run.rotation / _ALIKE_SPEED)), []).append(run)
    for (nominal, _), group in groups.items():
        if len(group) < 2 or nominal <= 0.0:
            continue
        loads = np.array([run.reference.value(LOAD) for run in group])
        peaks = np.array([run.peak for run in group])
        apart = float(np.ptp(loads)) / nominal
        if apart > _HYSTERESIS and float(np.ptp(peaks)) / float(peaks.mean()) < 0.4 * apart:
            names = " and ".join((group[int(np.argmin(loads))].name, group[int(np.argmax(loads))].name))
            text = (
                f"guide friction {0.5 * np.ptp(loads):.0f} N: {names} were set to {nominal:g} N and their peaks agree within "
                f"{100 * np.ptp(peaks) / peaks.mean():.1f} %, but vertical_load reads {loads.min():.0f} and {loads.max():.0f} N. The cell at the "
                "cylinder is not the contact: measure up and down and take the mean, or measure under the tire"
            )
            found.append(QualityFinding("warning", text, None, LOAD))
    return found
