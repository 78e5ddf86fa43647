"""Orbits of the synthetic bearings under a turning load, and the truth behind them."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.orbit import Orbit
from pipeline.rigs.tpjb.rotating.record import record_of
from pipeline.rigs.tpjb.rotating.synthetic import RUNS, synthesize
from pipeline.rigs.tpjb.truth import bearing


def coefficients(**given: float) -> np.ndarray:
    """Return the ten coefficients, shape (10,), those not given zero."""
    p = np.zeros(10)
    for name, value in given.items():
        p[COEFFICIENTS.index(name)] = value
    return p


def truth(name: str) -> np.ndarray:
    """Return the ten coefficients of a synthetic bearing, or of that of a run (A4)."""
    made = bearing(RUNS[name].bearing if name in RUNS else name)
    return np.array([*made.stiffness, *made.quadratic])


def static_load(run: str) -> float:
    """Return the static load of a run, N."""
    return bearing(RUNS[run].bearing).static_load


def circle(size: float, samples: int = 256) -> np.ndarray:
    """Return a turning force of constant size, shape (2, samples)."""
    angle = 2 * np.pi * np.arange(samples) / samples
    return size * np.stack([np.cos(angle), np.sin(angle)])


def turning_parts(d: np.ndarray) -> np.ndarray:
    """Return Z_k of an orbit on whole turns, shape (2, n), in the order of `numpy.fft.fftfreq`."""
    return np.fft.fft(d[0] + 1j * d[1]) / d.shape[1]


def orbits(*runs: str, seed: int = 1, **overrides: Any) -> list[Orbit]:
    """Return runs of the synthetic rig (A4 to A8, B3 to B6) as orbits."""
    recordings = synthesize({"runs": runs, **overrides}, seed)
    return [record_of(recording, RotatingSettings()).orbit for recording in recordings]
