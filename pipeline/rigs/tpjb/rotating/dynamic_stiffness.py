"""Stiffness that the dynamic test (T2) found, at the lowest frequency that it allows: what T3 is held against.

A T3 orbit is quasi-static. So the T2 values of all tones are carried to zero frequency, K + K'' f^2, where
they stand in the findings, else the synchronous values are taken as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.findings import Findings, Parameter
from pipeline.rigs.tpjb.gains import type_a

ENTRIES = ("kxx", "kxy", "kyx", "kyy")


@dataclass(frozen=True, eq=False)
class DynamicState:
    """K (N/m) at one static load (N) and speed (rad/s, or None): shape (4,) with standard errors (type A), how it was had."""

    bearing: str
    static_load: float
    speed: float | None
    stiffness: np.ndarray
    std_error: np.ndarray
    how: str


def dynamic_states(uses: Mapping[str, Findings]) -> list[DynamicState]:
    """Return the states of all dynamic campaigns that are used, by static load; empty where there is none."""
    found = []
    for findings in uses.values():
        if findings.experiment != "tpjb.dynamic":
            continue
        bearings = sorted({str(run.conditions.get("bearing", "")) for run in findings.runs if run.used})
        points = {
            (p.at.get("bearing"), p.at.get("static_load"), p.at.get("shaft_speed"))
            for p in findings.parameters
            if p.name in ENTRIES and isinstance(p.at.get("static_load"), int | float)
        }
        for bearing, load, speed in points:
            mine = [
                p
                for p in findings.parameters
                if p.name in ENTRIES
                and (p.at.get("bearing"), p.at.get("static_load"), p.at.get("shaft_speed")) == (bearing, load, speed)
            ]
            name = str(bearing) if bearing else bearings[0] if len(bearings) == 1 else ""
            state = _state(mine, name, float(load or 0.0), float(speed) if isinstance(speed, int | float) else None)
            if state is not None:
                found.append(state)
    return sorted(found, key=lambda state: (state.bearing, state.static_load))


def _state(parameters: list[Parameter], bearing: str, load: float, speed: float | None) -> DynamicState | None:
    tones = [_static(parameters, name) for name in ENTRIES]
    if all(tone is not None for tone in tones):
        values = np.array(tones, dtype=float)
        return DynamicState(bearing, load, speed, values[:, 0], values[:, 1], "dynamic test, all tones carried to 0 Hz")
    synchronous = [
        next(
            (p for p in parameters if p.name == name and p.at.get("synchronous") is True and p.value is not None), None
        )
        for name in ENTRIES
    ]
    if any(p is None for p in synchronous):
        return None
    value = np.array([p.value for p in synchronous if p is not None], dtype=float)
    error = np.array([type_a(p) or math.nan for p in synchronous if p is not None])
    return DynamicState(bearing, load, speed, value, error, "dynamic test, at shaft frequency")


def _static(parameters: list[Parameter], name: str) -> tuple[float, float] | None:
    """Return K at zero frequency and its error from the tones; None for fewer than three of them."""
    points = [
        (float(p.at["frequency"]), p.value, type_a(p))
        for p in parameters
        if p.name == name and "frequency" in p.at and p.value is not None and type_a(p)
    ]
    if len(points) < 3:
        return None
    f, K, sd = np.array(sorted(points), dtype=float).T
    columns = np.stack([np.ones_like(f), (f / f.max()) ** 2], axis=1)
    for part in (columns[:, :1], columns):
        weighted = part / sd[:, None]
        inverse = np.linalg.inv(weighted.T @ weighted)
        solution = inverse @ weighted.T @ (K / sd)
        left = (K - part @ solution) / sd
        reduced = float(left @ left) / (f.size - part.shape[1])
        if reduced < 1.0 + 2.6 * math.sqrt(2.0 / (f.size - part.shape[1])):
            break
    return float(solution[0]), math.sqrt(float(inverse[0, 0]) * max(reduced, 1.0))


def state_at(states: list[DynamicState], bearing: str, load: float | None, speed: float | None) -> DynamicState | None:
    """Return the state of that bearing, load and speed, within 2 %; None where T2 has none."""
    if load is None:
        return None
    for state in states:
        same_bearing = not bearing or not state.bearing or bearing == state.bearing
        same_speed = speed is None or state.speed is None or abs(state.speed / speed - 1.0) < 0.02
        if same_bearing and same_speed and abs(state.static_load / load - 1.0) < 0.02:
            return state
    return None
