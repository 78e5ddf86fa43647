"""The synthetic rig under a rotating load (tpjb.md, section 6, T3): logs with known truth, as the rig stores them.

A force vector of constant size turns slowly round a stator in static equilibrium; every second the mean of
each channel is stored. Not a dynamic simulation: at 0.01 Hz damping turns the vector by 0.03 deg only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.errors import InputError, listing, nearest
from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.overridden import overridden
from pipeline.rigs.tpjb.axes import pad_directions, uv, xy
from pipeline.rigs.tpjb.truth import CLEARANCE, SHAFT_SPEED, Bearing, bearing

Z1, Z2 = -0.12, 0.12
# Centre of the clearance polygon in the probes' own zero, by probe plane, (x, y), m.
CENTRES = ((12e-6, -7e-6), (18e-6, -3e-6))
_REST_GAP = 1e-3


@dataclass(frozen=True)
class RotatingRun:
    """One run: name, synthetic bearing, force over static load; `law` is "polynomial" or "pads"."""

    name: str
    bearing: str
    ratio: float
    law: str = "polynomial"


RUNS = {
    "A4": RotatingRun("A4_L1_36", "4pad-L1", 0.36),
    "A5": RotatingRun("A5_L1_18", "4pad-L1", 0.18),
    "A6": RotatingRun("A6_L2_17", "4pad-L2", 0.17),
    "A7": RotatingRun("A7_L2_3", "4pad-L2", 0.03),
    "A8": RotatingRun("A8_L1_36", "4pad-L1", 0.36, "pads"),
    "B3": RotatingRun("B3_L3_26", "5pad-L3", 0.26),
    "B4": RotatingRun("B4_L3_13", "5pad-L3", 0.13),
    "B5": RotatingRun("B5_L3_5", "5pad-L3", 0.05),
    "B6": RotatingRun("B6_L2_3", "5pad-L2", 0.03),
}
CAMPAIGNS = {"4pad": ("A4", "A5", "A6", "A7"), "5pad": ("B3", "B4", "B5", "B6"), "pads": ("A8",)}


@dataclass(frozen=True)
class RotatingTruth:
    """What the synthetic rig is made of; every field may be overridden. SI.

    Attributes
    ----------
    campaign
        "4pad" (A4-A7), "5pad" (B3-B6) or "pads" (A8).
    runs
        Other runs instead: names as A4, or mappings with the fields of `RotatingRun`.
    truth
        "pads" gives every run the exponential law of two pads, which no quadratic law follows.
    no_dwell
        Leave out the still stretches and the ramps, as in the paper's logs.
    turns, rotation_frequency, rate
        Whole turns at full force, their frequency (Hz), and how many means are stored a second.
    jitter, missing
        Error of the time stamps (s, 1 sigma) and share of rows that are missing.
    friction
        Coulomb friction of stabilisers and seals (N) against the motion, which the load cells carry too.
    delay
        How late the stored forces are (s).
    swap_uv
        Probes u and v connected the wrong way round.
    probe_noise, force_noise
        Of one stored value, 1 sigma.
    force_unrest
        Scale of all that load control leaves: angle, size, backward turning part, wander of each axis.
    drift, runout
        Scale of the thermal drift, and amplitude of the shaft's runout before averaging (m).
    """

    campaign: str = "4pad"
    runs: Sequence[str | Mapping[str, Any]] = ()
    truth: str = "polynomial"
    no_dwell: bool = False
    turns: float = 5.0
    rotation_frequency: float = 0.01 * 1.0013
    rate: float = 1.0
    jitter: float = 0.0
    missing: float = 0.0
    friction: float = 0.0
    delay: float = 0.0
    swap_uv: bool = False
    probe_noise: float = 1e-7
    force_noise: float = 15.0
    force_unrest: float = 1.0
    drift: float = 1.0
    runout: float = 4e-6


def rotating_truth(overrides: Mapping[str, Any]) -> RotatingTruth:
    """Return the truth with `overrides`.

    Raises
    ------
    InputError
        If a name is unknown; names the nearest.
    """
    truth = overridden(RotatingTruth(), overrides, "synthetic rig of tpjb.rotating")
    if truth.truth not in ("polynomial", "pads"):
        raise InputError(f"truth '{truth.truth}' of the synthetic rig: expected polynomial or pads.")
    if not truth.runs and truth.campaign not in CAMPAIGNS:
        raise InputError(
            f"campaign '{truth.campaign}' of the synthetic rig: expected {listing(CAMPAIGNS)}."
            f"{nearest(truth.campaign, CAMPAIGNS)}"
        )
    return truth


def rotating_runs(truth: RotatingTruth) -> list[RotatingRun]:
    """Return the runs of the campaign."""
    chosen: list[RotatingRun] = []
    for entry in truth.runs or CAMPAIGNS[truth.campaign]:
        if isinstance(entry, str):
            if entry not in RUNS:
                raise InputError(
                    f"the synthetic rig has no run '{entry}'; it has {listing(RUNS)}.{nearest(entry, RUNS)}"
                )
            chosen.append(RUNS[entry])
        else:
            try:
                chosen.append(RotatingRun(**entry))
            except TypeError as error:
                raise InputError(
                    f"run {dict(entry)} of the synthetic rig: expected {listing(f.name for f in fields(RotatingRun))}."
                ) from error
    return [replace(run, law="pads") for run in chosen] if truth.truth == "pads" else chosen


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return one recording a run; `truth` overrides any field of `RotatingTruth`."""
    known = rotating_truth(truth)
    runs = rotating_runs(known)
    seeds = np.random.SeedSequence(seed).spawn(len(runs))
    return [_recording(known, run, np.random.default_rng(s)) for run, s in zip(runs, seeds, strict=True)]


def motion(run: RotatingRun, force: np.ndarray) -> np.ndarray:
    """Return the displacement from equilibrium (m) under the dynamic force (N), shape (2, n) both, x and y."""
    from pipeline.rigs.tpjb.rotating.law import equilibrium

    made = bearing(run.bearing)
    if run.law == "pads":
        return xy(*_pads(made, uv(force)))
    return equilibrium(np.array([*made.stiffness, *made.quadratic]), force)


def _pads(made: Bearing, force: np.ndarray) -> np.ndarray:
    """Two pads, each with f = Wp (exp(q/c0) - 1) in its own direction: q of shape (2, n)."""
    carried = made.static_load / math.sqrt(2.0)
    return np.asarray(carried / made.stiffness[0] * np.log1p(force / carried))


def _wander(rng: np.random.Generator, n: int, step: float, sd: float, memory: float) -> np.ndarray:
    """First-order autoregression with standard deviation `sd` and correlation time `memory` (s), shape (n,)."""
    from scipy.signal import lfilter

    phi = math.exp(-step / memory)
    innovation = rng.standard_normal(n) * sd * math.sqrt(1.0 - phi**2)
    innovation[:1] = sd * rng.standard_normal(1)
    return np.asarray(lfilter([1.0], [1.0, -phi], innovation))


def _force(truth: RotatingTruth, run: RotatingRun, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the true dynamic force (N), x and y, shape (2, n): envelope, turning vector, what control leaves."""
    size = run.ratio * bearing(run.bearing).static_load
    n, step, unrest = time.size, 1.0 / truth.rate, truth.force_unrest
    turning = truth.turns / 0.01  # s at full force, planned for the nominal frequency
    ramp = np.interp(time, np.cumsum([60.0, 40.0, turning, 40.0]), [0.0, 1.0, 1.0, 0.0])
    envelope = np.ones(n) if truth.no_dwell else ramp
    angle = 2.0 * math.pi * truth.rotation_frequency * time + rng.uniform(0.0, 2.0 * math.pi)
    angle = angle + unrest * _wander(rng, n, step, 0.004, 30.0)
    forward = (1.0 + unrest * _wander(rng, n, step, 0.003, 50.0)) * np.exp(1j * angle)
    backward = 0.004 * unrest * np.exp(-1j * (angle + 0.5))
    axes = unrest * np.vstack([_wander(rng, n, step, 40.0, 8.0), _wander(rng, n, step, 40.0, 8.0)])
    vector = size * (forward + backward)
    return np.asarray(envelope * (np.vstack([vector.real, vector.imag]) + axes))


def _recording(truth: RotatingTruth, run: RotatingRun, rng: np.random.Generator) -> Recording:
    made = bearing(run.bearing)
    turning = truth.turns / 0.01
    n = round((turning if truth.no_dwell else turning + 200.0) * truth.rate)
    time = (np.arange(n) + 0.5) / truth.rate
    force = _force(truth, run, time, rng)
    d = motion(run, force)
    if np.isnan(d).any():
        raise InputError(
            f"run '{run.name}' of the synthetic rig: at a load ratio of {run.ratio:g} the law of {run.bearing} is past its "
            "fold and has no equilibrium; choose a smaller ratio."
        )
    if truth.friction:
        velocity = np.gradient(d, time, axis=1)
        force = force + truth.friction * velocity / np.maximum(np.hypot(*velocity), 1e-12)
    tau = 2.0 * time / (n / truth.rate) - 1.0
    d = d + truth.drift * (np.outer([0.4e-6, -0.24e-6], tau) + np.outer([1e-7, 0.5e-7], tau**2))
    d = d + _runout(truth, time, rng) + np.array(made.equilibrium)[:, None]
    if truth.delay:
        force = np.vstack([np.interp(time - truth.delay, time, component) for component in force])
    columns = {**_gaps(truth, d, rng), **_loads(truth, made, force, rng)}
    columns["speed"] = (np.round(SHAFT_SPEED + 0.02 * rng.standard_normal(n), 4), "rad/s")
    warming = 1.0 - np.exp(-time / 400.0)
    columns["temp_oil_in"] = (np.round(313.15 + 0.1 * rng.standard_normal(n), 2), "K")
    columns["temp_oil_out"] = (np.round(327.15 + 1.5 * warming + 0.1 * rng.standard_normal(n), 2), "K")
    stamps = time + truth.jitter * rng.standard_normal(n) if truth.jitter else time
    kept = rng.random(n) >= truth.missing
    channels = {name: Channel(name, values[kept], unit) for name, (values, unit) in columns.items()}
    return Recording(run.name, {"lf": Stream("lf", stamps[kept], channels)}, _conditions(run, made))


def _runout(truth: RotatingTruth, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return what averaging leaves of the shaft's once-per-turn motion, x and y, shape (2, n), m."""
    shaft = SHAFT_SPEED / (2.0 * math.pi)
    phase = np.cumsum(0.15 / math.sqrt(truth.rate) * rng.standard_normal(time.size))
    left = truth.runout * abs(np.sinc(shaft / truth.rate))
    angle = 2.0 * math.pi * shaft * time + phase + rng.uniform(0.0, 2.0 * math.pi)
    return np.asarray(left * np.vstack([np.cos(angle), np.sin(angle)]))


def _gaps(truth: RotatingTruth, d: np.ndarray, rng: np.random.Generator) -> dict[str, tuple[np.ndarray, str]]:
    columns = {}
    for plane, centre in enumerate(CENTRES, start=1):
        u, v = uv(d + np.array(centre)[:, None])
        for side, along in {"up": u, "um": -u, "vp": v, "vm": -v}.items():
            seen = (("v" if side[0] == "u" else "u") + side[1]) if truth.swap_uv else side
            noise = truth.probe_noise * rng.standard_normal(d.shape[1])
            columns[f"gap_{seen}{plane}"] = (np.round(_REST_GAP + along + noise, 10), "m")
    return dict(sorted(columns.items()))


def _loads(
    truth: RotatingTruth, made: Bearing, force: np.ndarray, rng: np.random.Generator
) -> dict[str, tuple[np.ndarray, str]]:
    n = force.shape[1]
    u, v = (np.round(part + truth.force_noise * rng.standard_normal(n)) for part in uv(force))
    static = np.round(made.static_load + 30.0 * rng.standard_normal(n))
    return {"force_u": (u, "N"), "force_v": (v, "N"), "force_static": (static, "N")}


def _conditions(run: RotatingRun, made: Bearing) -> dict[str, Condition]:
    directions = " ".join(f"{math.degrees(angle):g}" for angle in pad_directions(made.n_pads))
    return {
        "bearing": f"{made.n_pads}pad",
        "n_pads": float(made.n_pads),
        "pad_angles": f"{directions} deg",
        "diameter": 0.280,
        "static_load": made.static_load,
        "shaft_speed_nominal": SHAFT_SPEED,
        "stator_mass": 900.0,
        "stabilizer_stiffness": 5e6,
        "z1": Z1,
        "z2": Z2,
        "test": "rotating",
        "force_rotation_frequency": 0.01,
        "load_ratio": run.ratio,
        "clearance_nominal": CLEARANCE,
        "sensor_gain_u": 0.01,
        "force_gain_u": 0.005,
    }
