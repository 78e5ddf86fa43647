"""Circuit, sensors' poles and pump in one linear recursion, marched exactly and read at any moment (rap.md, 3.3, 3.4).

Compiled; numba is imported here. Flows are constant over a step at their mean, so that what the pump delivers over a
stroke is right to the last digit; between steps the cubic with the right slopes is read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numba as nb
import numpy as np

from pipeline.rigs.rap.circuit.hydraulics import Circuit, discrete, state_space
from pipeline.rigs.rap.circuit.pump import Pump

TICK = 0.05
"""Seconds between two entries of a `Drive`."""
# States behind the six of the circuit: mean P_pre and P_a of the pump, four poles of the device, four of the bench, meter.
_SIZE, _MEAN_PRE, _MEAN_A, _DEVICE, _BENCH, _METER = 17, 6, 7, 8, 12, 16
_PUMP_MEMORY = 1.0
GROUPS = {"device": (8, 9, 10, 11, 16), "bench": (12, 13, 14, 15, 16), "circuit": (0, 1, 2, 3, 4)}
"""What can be read: states of each group, of which the last of device and bench is the flow meter."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What drives the circuit, tick by tick; n ticks of `TICK` seconds.

    `speed` (n + 1,) roller passages a second, straight between ticks; `V_g` (n,), m^3; `uf` (n,), m^3/s; `heparin` m^3/s;
    `circuit` (n,) which of `circuits` it is.
    """

    speed: np.ndarray
    V_g: np.ndarray
    uf: np.ndarray
    circuit: np.ndarray
    circuits: Sequence[Circuit]
    heparin: float = 0.0


@dataclass(frozen=True)
class Poles:
    """Time constants (s) of the device's and the bench's four pressure sensors, of the meter; where the meter sits."""

    device: tuple[float, float, float, float]
    bench: tuple[float, float, float, float]
    meter: float
    location: str


@dataclass(frozen=True, eq=False)
class Course:
    """What came of it: `readings` by name of the request, (m, 5), and the pump's `phases` (m,) at the same moments.

    At the end of each tick: `states` (n, 6) of the circuit, and the volumes (m^3) that went since the tick before:
    `inlet`, `outlet` through the pump, (n,).
    """

    readings: dict[str, np.ndarray]
    phases: dict[str, np.ndarray]
    states: np.ndarray
    inlet: np.ndarray
    outlet: np.ndarray


def march(
    drive: Drive, pump: Pump, poles: Poles, wanted: dict[str, tuple[str, np.ndarray]], step: float = 1e-3
) -> Course:
    """March the rig from rest and read it at the moments `wanted`: name -> (group of `GROUPS`, moments in s).

    Before second 0 it stands at rest.
    """
    spaces = [_augmented(c, poles) for c in drive.circuits]
    steps = max(1, round(TICK / step))
    stepped = [discrete(A, B, TICK / steps) for A, B in spaces]
    names = list(wanted)
    moments = np.concatenate([wanted[name][1] for name in names])
    group = np.repeat(np.arange(len(names)), [wanted[name][1].size for name in names])
    order = np.argsort(moments, kind="stable")
    columns = np.array([GROUPS[wanted[name][0]] for name in names])
    out, phase = np.zeros((moments.size, columns.shape[1])), np.zeros(moments.size)
    states, volumes = np.zeros((drive.uf.size, 6)), np.zeros((drive.uf.size, 2))
    compiled: Any = _march
    compiled(
        *(np.stack(m) for m in zip(*spaces, strict=True)),
        *(np.ascontiguousarray(np.stack(m)) for m in zip(*stepped, strict=True)),
        drive.speed, drive.V_g, drive.uf, drive.circuit.astype(np.int64), drive.heparin,
        pump.V_d0, pump.C_p, pump.w, np.array(pump.eps), pump.a, steps,
        order, moments, group, columns, out, phase, states, volumes,
    )  # fmt: skip
    readings = {name: out[group == i] for i, name in enumerate(names)}
    phases = {name: phase[group == i] for i, name in enumerate(names)}
    return Course(readings, phases, states, volumes[:, 0], volumes[:, 1])


def _augmented(c: Circuit, poles: Poles) -> tuple[np.ndarray, np.ndarray]:
    A, B = np.zeros((_SIZE, _SIZE)), np.zeros((_SIZE, 3))
    A[:6, :6], B[:6] = state_space(c)
    flow = 5 if poles.location == "return" else 4
    lags = [(_MEAN_PRE, 1, _PUMP_MEMORY), (_MEAN_A, 0, _PUMP_MEMORY), (_METER, flow, poles.meter)]
    lags += [(_DEVICE + i, i, tau) for i, tau in enumerate(poles.device)]
    lags += [(_BENCH + i, i, tau) for i, tau in enumerate(poles.bench)]
    for state, source, tau in lags:
        A[state, source], A[state, state] = 1.0 / tau, -1.0 / tau
    return A, B


@nb.njit(cache=True)
def _sucked(phase: float, w: float) -> Any:
    """Share of the back suction that is over at `phase` (0 to 1) of a passage: the integral of h."""
    return 1.0 if phase >= w else (phase - w / (2.0 * np.pi) * np.sin(2.0 * np.pi * phase / w)) / w


@nb.njit(cache=True)
def _march(
    A: np.ndarray, B: np.ndarray, Ad: np.ndarray, Bd: np.ndarray, speed: np.ndarray, V_g: np.ndarray, uf: np.ndarray,
    which: np.ndarray, heparin: Any, V_d0: float, C_p: float, w: float, eps: np.ndarray, a: float, steps: int,
    order: np.ndarray, moments: np.ndarray, group: np.ndarray, columns: np.ndarray, out: np.ndarray,
    phase_out: np.ndarray, states: np.ndarray, volumes: np.ndarray,
) -> None:  # fmt: skip
    dt = 0.05 / steps
    x, new, u = np.zeros(17), np.zeros(17), np.zeros(3)
    phase, i, n = 0.0, 0, moments.size
    while i < n and moments[order[i]] < 0.0:
        i += 1
    for tick in range(uf.size):
        k = which[tick]
        Fk, Gk, Ak, Bk = Ad[k], Bd[k], A[k], B[k]
        u[2] = uf[tick]
        taken, given = 0.0, 0.0
        for j in range(steps):
            f = speed[tick] + (speed[tick + 1] - speed[tick]) * (j + 0.5) / steps
            if f > 0.0:
                V_d = V_d0 + C_p * (x[6] - x[7])
                passed = f * dt
                before, after = phase, phase + passed
                r0, r1 = int(before), int(after)
                if r0 == r1:
                    lost = (1.0 + eps[r1 % eps.size]) * (_sucked(after - r1, w) - _sucked(before - r0, w))
                else:
                    lost = (1.0 + eps[r0 % eps.size]) * (1.0 - _sucked(before - r0, w))
                    lost += (1.0 + eps[r1 % eps.size]) * _sucked(after - r1, w)
                u[1] = (V_g[tick] * passed - V_d * lost) / dt + heparin
                wave = (np.sin(2.0 * np.pi * after + 0.8) - np.sin(2.0 * np.pi * before + 0.8)) / (2.0 * np.pi * passed)
                u[0] = f * (V_g[tick] - V_d) * (1.0 - a * wave)
                phase = after
            else:
                u[0], u[1] = 0.0, 0.0
            taken += u[0] * dt
            given += u[1] * dt
            for r in range(17):
                total = 0.0
                for s in range(17):
                    total += Fk[r, s] * x[s]
                new[r] = total + Gk[r, 0] * u[0] + Gk[r, 1] * u[1] + Gk[r, 2] * u[2]
            begin = (tick * steps + j) * dt
            while i < n and moments[order[i]] < begin + dt:
                at = order[i]
                z = max((moments[at] - begin) / dt, 0.0)
                for column in range(columns.shape[1]):
                    r = columns[group[at], column]
                    left, right = 0.0, 0.0
                    for s in range(17):
                        left += Ak[r, s] * x[s]
                        right += Ak[r, s] * new[s]
                    forced = Bk[r, 0] * u[0] + Bk[r, 1] * u[1] + Bk[r, 2] * u[2]
                    left, right = (left + forced) * dt, (right + forced) * dt
                    rise = new[r] - x[r]
                    out[at, column] = x[r] + z * (
                        left + z * (3.0 * rise - 2.0 * left - right + z * (left + right - 2.0 * rise))
                    )
                phase_out[at] = phase - f * dt * (1.0 - z)
                i += 1
            for r in range(17):
                x[r] = new[r]
        for r in range(6):
            states[tick, r] = x[r]
        volumes[tick, 0], volumes[tick, 1] = taken, given
    while i < n:
        for column in range(columns.shape[1]):
            out[order[i], column] = x[columns[group[order[i]], column]]
        phase_out[order[i]] = phase
        i += 1
