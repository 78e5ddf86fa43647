"""Orbits of known bearings under a turning load, as tpjb.md section 6 makes them (in x and y, without probes)."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.orbit import Orbit
from pipeline.rigs.tpjb.truth import bearing

FREQUENCY = 0.01 * 1.0013


def truth(name: str) -> np.ndarray:
    """Return the ten coefficients of a synthetic bearing."""
    made = bearing(name)
    return np.array([*made.stiffness, *made.quadratic])


def circle(size: float, samples: int = 256) -> np.ndarray:
    """Return a turning force of constant size, shape (2, samples)."""
    angle = 2 * np.pi * np.arange(samples) / samples
    return size * np.stack([np.cos(angle), np.sin(angle)])


def _wander(rng: np.random.Generator, n: int, sigma: float, memory: float) -> np.ndarray:
    keep = np.exp(-1 / memory)
    out = np.empty(n)
    out[0] = rng.normal()
    for i in range(1, n):
        out[i] = keep * out[i - 1] + np.sqrt(1 - keep**2) * rng.normal()
    return sigma * out


def synthetic_orbit(name: str, ratio: float, seed: int, dwell: bool = True, noise: float = 1e-7) -> Orbit:
    """Return one run of a synthetic bearing at the load ratio `ratio`; `noise` is that of a probe, m."""
    rng = np.random.default_rng(seed)
    made = bearing(name)
    size = ratio * made.static_load
    t = np.arange(700) + 0.5
    envelope = np.interp(t, [60, 100, 600, 640], [0, 1, 1, 0])
    angle = 2 * np.pi * FREQUENCY * t + _wander(rng, t.size, 0.004, 30)
    modulus = size * (1 + _wander(rng, t.size, 0.003, 50))
    f = modulus * np.exp(1j * angle) + 0.004 * size * np.exp(-1j * (angle - 0.5))
    f += _wander(rng, t.size, 40, 8) + 1j * _wander(rng, t.size, 40, 8)
    f *= envelope
    force = np.stack([f.real, f.imag])
    tau = 2 * (t - t[0]) / (t[-1] - t[0]) - 1
    d = law.equilibrium(truth(name), force)
    d = d + np.outer([0.4e-6, -0.24e-6], tau) + np.outer([1e-7, 0.5e-7], tau**2)
    shaft = 2 * np.pi * 16.667 * t + np.cumsum(rng.normal(0, 0.15, t.size))
    d += 4e-6 * 0.01654 * np.stack([np.cos(shaft), np.sin(shaft)])
    d += rng.normal(0, noise / 2, d.shape)
    measured = np.round(force + rng.normal(0, 15, force.shape))
    kept = slice(None) if dwell else (t > 100) & (t < 600)
    return Orbit(f"{name}-{100 * ratio:g}%", t[kept], d[:, kept], measured[:, kept], shaft_frequency=1000 / 60)
