"""The synthetic bump test (tpjb.md, section 6, runs A1 and B1): a dry bearing pressed round by a turning force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.overridden import overridden
from pipeline.rigs.tpjb.axes import pad_directions, uv
from pipeline.rigs.tpjb.bump.contact import Bearing, rest, side_normals

_FOUR: dict[str, Any] = {
    "n_pads": 4,
    "clearances": (199e-6, 203e-6, 199e-6, 203e-6),
    "rotation": np.radians(0.8),
}
_FIVE: dict[str, Any] = {
    "n_pads": 5,
    "clearances": (201e-6, 203e-6, 198e-6, 200e-6, 198e-6),
    "rotation": np.radians(-0.5),
}
BEARINGS = {"4pad": _FOUR, "5pad": _FIVE}


@dataclass(frozen=True)
class BumpTruth:
    """What the synthetic bump test is made of; every field may be overridden. SI.

    Attributes
    ----------
    bearing
        "4pad" or "5pad": sets `n_pads`, `clearances` and `rotation`, which may be given as well.
    centre_1, centre_2
        Centre of the clearance in probe plane 1 and 2, before it is normalised.
    levels, turns, rotation_frequency
        Size of the turning force (N), turns at each, turns per second (negative: clockwise).
    friction
        Coefficient of friction between pads and shaft.
    missing_side
        Number of a side (from 1) that an unbalanced weight keeps the stator away from; 0 for none.
    arc
        Part of each turn during which the force is on, 1 for all of it.
    planes
        Probe planes with sensors: "12", "1" or "2".
    """

    bearing: str = "4pad"
    n_pads: int = 4
    clearances: Sequence[float] = _FOUR["clearances"]
    rotation: float = _FOUR["rotation"]
    centre_1: Sequence[float] = (12e-6, -7e-6)
    centre_2: Sequence[float] = (18e-6, -3e-6)
    contact_stiffness: float = 1.5e9
    support_stiffness: float = 2e6
    levels: Sequence[float] = (1e3, 2e3, 4e3, 8e3)
    turns: float = 2.0
    rotation_frequency: float = 0.02
    rate: float = 50.0
    probe_noise: float = 1e-7
    force_noise: float = 20.0
    noise_memory: float = 0.0
    force_ellipticity: float = 0.0
    drift: float = 0.0
    friction: float = 0.0
    missing_side: int = 0
    arc: float = 1.0
    planes: str = "12"
    z1: float = -0.12
    z2: float = 0.12


def bump_truth(overrides: Mapping[str, Any]) -> BumpTruth:
    """Return the truth with `overrides`.

    Raises
    ------
    InputError
        If a name or the bearing is unknown (names the nearest), or pads and clearances do not match.
    """
    bearing = str(overrides.get("bearing", "4pad"))
    if bearing not in BEARINGS:
        raise InputError(f"there is no synthetic bearing '{bearing}' for the bump test; there are {listing(BEARINGS)}.")
    truth = overridden(BumpTruth(), {**BEARINGS[bearing], **overrides}, "synthetic bump test")
    if len(truth.clearances) != truth.n_pads:
        raise InputError(
            f"the synthetic bump test has {truth.n_pads} pads but {len(truth.clearances)} clearances; give one a pad."
        )
    return truth


def planes_of(truth: BumpTruth) -> dict[int, Bearing]:
    """Return the bearing as each probe plane sees it."""
    angles = pad_directions(truth.n_pads)
    normals = side_normals(angles, truth.rotation)
    found = {}
    for plane, centre in ((1, truth.centre_1), (2, truth.centre_2)):
        if str(plane) in truth.planes:
            d0 = np.asarray(centre, dtype=float)
            sides = np.asarray(truth.clearances) + normals @ d0
            found[plane] = Bearing(angles, truth.rotation, sides, d0, truth.contact_stiffness, truth.support_stiffness)
    return found


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the bump test as one run; `truth` overrides any field of `BumpTruth`."""
    known = bump_truth(truth)
    rng = np.random.default_rng(seed)
    per_level = round(known.turns / abs(known.rotation_frequency) * known.rate) if known.rotation_frequency else 5000
    n = per_level * len(known.levels)
    t = np.arange(n) / known.rate
    psi = 2 * np.pi * known.rotation_frequency * t
    size = np.repeat(np.asarray(known.levels, dtype=float), per_level)
    size = size * (((psi / (2 * np.pi)) % 1.0) <= known.arc)
    commanded = np.stack([np.cos(psi), (1 - known.force_ellipticity) * np.sin(psi)]) * size
    bearings = planes_of(known)
    acting = commanded + _weight(known)[:, None]
    channels = []
    for plane, bearing in bearings.items():
        d = _sliding(acting.T, bearing, known.friction) if known.friction else rest(acting.T, bearing).displacement
        u, v = uv(d.T + known.drift * t / t[-1])
        for name, values in (
            (f"gap_up{plane}", u),
            (f"gap_um{plane}", -u),
            (f"gap_vp{plane}", v),
            (f"gap_vm{plane}", -v),
        ):
            noise = _noise(rng, n, known.probe_noise, known.noise_memory * known.rate)
            channels.append(Channel(name, 1e-3 + values + noise, "m"))
    fu, fv = uv(commanded) + known.force_noise * rng.standard_normal((2, n))
    channels += [Channel("force_u", fu, "N"), Channel("force_v", fv, "N")]
    conditions: dict[str, Condition] = {
        "bearing": known.bearing,
        "n_pads": float(known.n_pads),
        "pad_angles": " ".join(f"{a:.6g}" for a in np.degrees(pad_directions(known.n_pads))) + " deg",
        "diameter": 0.280,
        "shaft_speed_nominal": 0.0,
        "z1": known.z1,
        "z2": known.z2,
        "test": "bump",
        "force_rotation_frequency": known.rotation_frequency,
        "clearance_nominal": 200e-6,
        "sensor_gain_u": 0.01,
        "force_gain_u": 0.005,
    }
    stream = Stream("hf", t, {channel.name: channel for channel in channels})
    return [Recording(f"bump_{known.bearing}", {"hf": stream}, conditions)]


def _noise(rng: np.random.Generator, n: int, sigma: float, memory: float) -> np.ndarray:
    """Return noise of standard deviation `sigma`, first-order with `memory` samples where that is above 0."""
    white = rng.standard_normal(n)
    if memory <= 0:
        return np.asarray(sigma * white)
    from scipy.signal import lfilter

    a = float(np.exp(-1 / memory))
    return np.asarray(sigma * lfilter([np.sqrt(1 - a * a)], [1.0, -a], white))


def _weight(truth: BumpTruth) -> np.ndarray:
    """Return the constant force, shape (2,), N, that keeps the stator off `missing_side`."""
    if not truth.missing_side:
        return np.zeros(2)
    normal = side_normals(pad_directions(truth.n_pads), truth.rotation)[truth.missing_side - 1]
    return np.asarray(-1.3 * max(truth.levels) * normal)


def _sliding(force: np.ndarray, bearing: Bearing, friction: float) -> np.ndarray:
    """Return the path of a stator that sticks and slides along the pads (Coulomb), shape (n, 2), m.

    In a corner both pads hold it; along one pad it stays until the pull exceeds friction.
    """
    normals = bearing.normals
    tangents = normals @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    free = rest(force, bearing)
    path = np.empty_like(force)
    d = free.displacement[0]
    k_s, k_p = bearing.k_s, bearing.k_p
    for sample, F in enumerate(force):
        touching = np.flatnonzero(free.touching[sample])
        if touching.size != 1:
            d = free.displacement[sample]
        else:
            i, pull = touching[0], F + k_s * bearing.neutral
            d = _along(pull, normals[i], tangents[i], bearing.sides[i], d, k_s, k_p, friction)
        path[sample] = d
    return path


def _along(
    pull: np.ndarray, n: np.ndarray, t: np.ndarray, q: float, before: np.ndarray, k_s: float, k_p: float, mu: float
) -> np.ndarray:
    """Return the next place on one side: stuck, or slid until friction holds the rest of the pull."""
    along_n = (pull @ n + k_p * q) / (k_s + k_p)
    press = max(k_p * (along_n - q), 0.0)
    driving = pull @ t - k_s * (before @ t)
    slid = max(abs(driving) - mu * press, 0.0) / k_s * np.sign(driving)
    return np.asarray(along_n * n + (before @ t + slid) * t)
