"""Coverage of `tpjb.rotating`: two static loads with two load ratios each, or one with three and one with one.

Harmonics of the orbit are held against those of the same run without noise, drift and
runout; THD against that of the true law under a circular load of the run's size. The bound has white noise only: the line of the
shaft's runout, which folds into the band, is left out of it. Where a linear law suffices (3 % of load) its coefficients
are held against the bound of the quadratic one. THD comes out by up to one standard error low at the largest ratio: the
simulated load always has the same backward part, for which its error stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from benchmarks.coverage.study import Campaign, Case, Study
from benchmarks.coverage.tpjb_logs import CELL_GAIN, PROBE_GAIN, as_logged
from pipeline.estimation.design import Information
from pipeline.findings import Parameter
from pipeline.rigs.tpjb.rotating.declaration import ROTATING, RotatingSettings
from pipeline.rigs.tpjb.rotating.harmonics import harmonics
from pipeline.rigs.tpjb.rotating.information import run_information
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.linear_limit import model_distortion
from pipeline.rigs.tpjb.rotating.models import M5, M6
from pipeline.rigs.tpjb.rotating.record import record_of
from pipeline.rigs.tpjb.rotating.synthetic import CAMPAIGNS, RUNS, RotatingTruth, synthesize
from pipeline.rigs.tpjb.truth import bearing

_UNTRUE = {"probe_noise": 0.0, "force_noise": 0.0, "drift": 0.0, "runout": 0.0}
_DIRT = (
    "load that wanders in size, angle and along each axis (correlated over 8 to 50 s), thermal drift, runout of the shaft, "
    "probe noise 0.1 um, force noise 15 N, 0.1 % of the rows lost, 10 us of jitter, gains of probes off by 1 % and of "
    "load cells by 0.5 %"
)


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of a campaign and what is true of them."""
    name = "5pad" if case == "5pad" else "4pad"
    overrides: dict[str, Any] = {"campaign": name, "no_dwell": case == "no dwell"}
    if case == "no dwell":
        overrides["runs"] = ("A4", "A5")
    names: Sequence[str] = overrides.get("runs", CAMPAIGNS[name])
    gains = case == "standard"
    recordings = as_logged(synthesize(overrides, seed), seed, gains=gains)
    bounds = _bounds(case, tuple(names))

    def bound(parameter: Parameter) -> float | None:
        least = bounds.get((parameter.name, parameter.at.get("static_load")))
        if least is None or parameter.value is None:
            return None
        power = 2 if parameter.unit == "N/m^2" else 1
        return math.hypot(least, abs(parameter.value) * math.hypot(power * PROBE_GAIN, CELL_GAIN) * gains)

    return Campaign(recordings, _truth(names, overrides, seed), bound=bound, label=_label)


@cache
def _bounds(case: str, names: tuple[str, ...]) -> dict[tuple[str, object], float]:
    """Return the Cramér-Rao bound of each coefficient by static load: white noise of probes and force, all else known."""
    usual = RotatingTruth()
    clean = synthesize({"runs": names, "no_dwell": case == "no dwell", **_UNTRUE}, 0)
    told: dict[float, Information] = {}
    for recording, name in zip(clean, names, strict=True):
        made, orbit = bearing(RUNS[name].bearing), record_of(recording, RotatingSettings()).orbit
        law = M6 if made.n_pads == 5 else M5
        p = np.array([*made.stiffness, *made.quadratic])
        theta = np.array([p[COEFFICIENTS.index(free)] for free in law.free])
        own = run_information(law, theta, orbit.time, orbit.force, 0.5 * usual.probe_noise, usual.force_noise)
        told[made.static_load] = told[made.static_load] + own if made.static_load in told else own
    return {(name, load): one.std_error(name) for load, one in told.items() for name in one.names}


def _truth(names: Sequence[str], overrides: dict[str, Any], seed: int) -> Callable[[Parameter], float | None]:
    runs = [RUNS[name] for name in names]
    laws = {
        made.static_load: np.array([*made.stiffness, *made.quadratic]) for made in (bearing(r.bearing) for r in runs)
    }
    limits = {load: _limit(p, load) for load, p in laws.items()}
    clean = {r.run: record_of(r, RotatingSettings()) for r in synthesize({**overrides, **_UNTRUE}, seed)}
    own = {run.name: laws[bearing(run.bearing).static_load] for run in runs}

    def truth(parameter: Parameter) -> float | None:
        if parameter.name in COEFFICIENTS:
            return float(laws[float(parameter.at["static_load"])][COEFFICIENTS.index(parameter.name)])
        if parameter.name == "linear_limit":
            return limits[float(parameter.at["static_load"])]
        record = clean[str(parameter.at["run"])]
        if parameter.name == "thd":
            return float(model_distortion(own[record.run], record.rotation.size)[0])
        steady = record.orbit.part(record.rotation.steady)
        motion = harmonics(steady.time, steady.displacement, record.rotation.frequency)
        along = motion.x if parameter.name.endswith("x") else motion.y
        return float(abs(along[round(float(parameter.at["order"])) - 1]))

    return truth


def _limit(p: np.ndarray, static_load: float, level: float = 0.05) -> float:
    """Return the load ratio at which a circular load makes the orbit's distortion reach the level."""
    ratios = np.linspace(0.02, 0.4, 2000)
    thd, _ = model_distortion(p, ratios * static_load)
    return float(np.interp(level, thd[np.isfinite(thd)], ratios[np.isfinite(thd)]))


def _label(parameter: Parameter) -> str:
    order = parameter.at.get("order")
    return f"{parameter.name} {order:g}X" if isinstance(order, float) else parameter.name


STUDY = Study(
    ROTATING,
    {
        "standard": Case(f"four-pad bearing, two static loads with two load ratios each: {_DIRT}"),
        "gains known": Case("the same with all gains right: type A alone"),
        "5pad": Case(
            "five-pad bearing, three load ratios at one static load and one at another; the same dirt, gains right"
        ),
        "no dwell": Case(
            "four-pad bearing, two load ratios without a stretch at zero force; the same dirt, gains right"
        ),
    },
    campaign,
)
