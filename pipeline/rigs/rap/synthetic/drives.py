"""What drives the circuit: speed of the blood pump, ultrafiltration, clamps and clots, tick by tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.rap.circuit.hydraulics import Circuit
from pipeline.rigs.rap.synthetic.plant import TICK, Drive

SHORTEST_RAMP, LONGEST_RAMP = 0.3, 0.5
"""How long the blood pump takes to a new speed, s."""


@dataclass(frozen=True)
class Step:
    """From the moment `time` (s) on: passages a second `speed` (Hz), ultrafiltration `uf` (m^3/s)."""

    time: float
    speed: float
    uf: float


@dataclass(frozen=True)
class Change:
    """From `start` to `end` (s) constants of the circuit are so many `times` what they are."""

    start: float
    end: float
    times: Mapping[str, float]


def wander(rng: np.random.Generator, n: int, step: float, sd: float, memory: float) -> np.ndarray:
    """Return an Ornstein-Uhlenbeck process of `n` samples `step` s apart: 1 sigma `sd`, correlation time `memory` (s)."""
    from scipy.signal import lfilter

    phi = float(np.exp(-step / memory))
    pushes = sd * rng.standard_normal(n)
    pushes[1:] *= np.sqrt(1.0 - phi * phi)
    return np.asarray(lfilter([1.0], [1.0, -phi], pushes))


def drive_of(
    steps: Sequence[Step],
    changes: Sequence[Change],
    circuit: Circuit,
    V_g: float,
    duration: float,
    scatter: tuple[float, float],
    rng: np.random.Generator,
    heparin: float = 0.0,
) -> Drive:
    """Return the drive of a run: `steps` of the pumps, `changes` of the circuit (several may hold at a time).

    `scatter` is the relative scatter of the speed (1 sigma) and its correlation time (s).
    """
    n = round(duration / TICK)
    time = np.arange(n + 1) * TICK
    speed = np.zeros(n + 1)
    uf = np.zeros(n)
    for before, step in zip([Step(0.0, 0.0, 0.0), *steps], steps, strict=False):
        ramp = rng.uniform(SHORTEST_RAMP, LONGEST_RAMP)
        share = np.clip((time - step.time) / ramp, 0.0, 1.0)
        speed = np.where(time < step.time, speed, before.speed + (step.speed - before.speed) * share)
        uf[time[:-1] >= step.time - 1e-9] = step.uf
    speed *= 1.0 + wander(rng, n + 1, TICK, *scatter)
    which, circuits = _circuits(changes, circuit, time[:-1])
    return Drive(np.maximum(speed, 0.0), np.full(n, V_g), uf, which, circuits, heparin)


def _circuits(changes: Sequence[Change], circuit: Circuit, time: np.ndarray) -> tuple[np.ndarray, list[Circuit]]:
    edges = sorted({0.0, *(c.start for c in changes), *(c.end for c in changes)})
    which = np.maximum(np.searchsorted(edges, time + 1e-9, side="right") - 1, 0)
    circuits = []
    for edge in edges:
        now = circuit
        for change in changes:
            if change.start <= edge < change.end:
                now = replace(now, **{name: getattr(now, name) * times for name, times in change.times.items()})
        circuits.append(now)
    return which, circuits
