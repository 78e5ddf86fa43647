"""Runs whose peak is not that of their load: a sensor that lost gain, another pressure than stated, a wrong load (tire.md, 8).

The run at fault is the one without which the others agree best: a curve through all of them is bent by it, and a good
run at its end would look odd.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

Cause = Literal["sensor", "film", "pressure", "load", "unknown"]
Mark = Literal["peak", "film", "bent", "ratio"]
# Fewer runs than that do not tell which of them is odd.
_FEWEST, _FEWEST_ALIKE = 4, 3
# Further off the others' curve than that (logarithm, and standard errors of the prediction) is odd.
_ODD, _ODD_SDS = 0.03, 4.0
# Where the law of load is taken as usual, or two runs are looked for at once, only gross errors are told.
_GROSS, _GROSS_PAIR = 0.25, 0.1
# All runs agree so well that none is odd; so well agrees what is left once the odd ones are out.
_AGREED, _AGREED_REST = 0.008, 0.02
# What the law itself may miss, with and without a curvature over load; how much a peak may change with speed (lag of the sensor), per relative change of speed.
_FLOOR, _FLOOR_STRAIGHT, _LAG = 0.003, 0.008, 0.1
# The usual law of load, where there are too few to tell one.
_POWER: dict[Mark, float] = {"peak": 0.9, "film": 0.7, "ratio": 0.2, "bent": 0.03}
_ONE_LOAD, _ONE_SPEED = 0.1, 0.1
# What one of the two sensors shares of the other's departure; 10 % less pressure changes Ld by 1.4 %, such a load by 0.4 %.
_SHARED, _BENT = 0.35, 0.012


@dataclass(frozen=True)
class Marks:
    """What of a run grows with its load: flex peak (ohm), peak to peak of the film (V) or NaN, deformation length (m)."""

    run: str
    load: float
    rotation: float
    peak: float
    film: float
    bent: float

    @property
    def ratio(self) -> float:
        """Flex over film, ohm/V: at one speed it knows nothing of pressure, and little of load."""
        return self.peak / self.film


@dataclass(frozen=True)
class Odd:
    """A run off the curve of the others: by which share, and what most likely is the cause.

    "sensor" is the flex sensor, "film" the PVDF alone, whose run is good for all that the film does not enter; "unknown"
    is flex sensor or load.
    """

    run: str
    off: float
    cause: Cause
    text: str


@dataclass(frozen=True)
class _Departure:
    """By how much (logarithm) a run departs from the law of the others, the error of that, and how well those agree."""

    off: float
    error: float
    left: float


def odd_runs(marks: Sequence[Marks]) -> list[Odd]:
    """Return the runs whose sensors, load or pressure the other runs contradict."""
    found = _by_ratio(marks)
    bad = {one.run for one in found if one.cause == "sensor"}
    known = [m for m in marks if m.run not in bad and m.load > 0.0 and m.peak > 0.0]
    while True:
        odd = _oddest(known, "peak", _FEWEST)
        known = [m for m in known if m not in [one for one, _ in odd]]
        found += [_by_cause(one, off, known) for one, off in odd]
        if not odd:
            return found


def _by_ratio(marks: Sequence[Marks]) -> list[Odd]:
    """Hold flex against film among runs of one speed."""
    found: list[Odd] = []
    left = [m for m in marks if m.peak > 0.0 and m.film > 0.0]
    while left:
        alike = [m for m in left if abs(m.rotation / left[0].rotation - 1.0) < _ONE_SPEED]
        left = [m for m in left if m not in alike]
        while odd := _oddest(alike, "ratio", _FEWEST_ALIKE):
            alike = [m for m in alike if m not in [one for one, _ in odd]]
            found += filter(None, (_which(one, off, alike) for one, off in odd))
    return found


def _which(one: Marks, off: float, others: Sequence[Marks]) -> Odd | None:
    """Tell which of the two sensors changed, by the load; None where both did, as another load or pressure makes them."""
    share = 100.0 * math.expm1(off)
    said = f"flex over PVDF is {share:+.1f} % off that of the other runs at its speed"
    peak, film = _departure(one, others, "peak"), _departure(one, others, "film")
    if peak is not None and film is not None and abs(peak.off) < _SHARED * abs(film.off):
        text = (
            f"{said}, and the flex sensor's peak is as the load wants: the PVDF film's gain changed (bond, readout). Look at the film; the "
            "flex sensor's numbers stand"
        )
        return Odd(one.run, off, "film", text)
    by_load = ""
    if peak is not None and film is not None:
        if film.off * peak.off > 0.0 and abs(film.off) > _SHARED * abs(peak.off):
            return None
        by_load = f", and the PVDF is {100.0 * math.expm1(film.off):+.1f} % off what its load wants"
    text = f"{said}{by_load}: the flex sensor's gain changed (bond, ink, temperature, supply), and not the load. Look at the bond"
    return Odd(one.run, off, "sensor", text)


def _by_cause(one: Marks, off: float, others: Sequence[Marks]) -> Odd:
    """Tell a run whose peak is not that of its load, and whether pressure or load is at fault."""
    said = f"its peak is {100 * math.expm1(off):+.1f} % off that of the other runs at its load of {one.load:.0f} N"
    same_speed = [m for m in others if abs(m.rotation / one.rotation - 1.0) < _ONE_SPEED]
    film = _departure(one, same_speed, "film")
    bent = _departure(one, others, "bent")
    if film is not None and abs(film.off) < _SHARED * abs(off):
        text = f"{said}, while the PVDF is {100 * math.expm1(film.off):+.1f} % off: the flex sensor's gain changed (bond, ink, temperature, supply). Look at the bond"
        return Odd(one.run, off, "sensor", text)
    if bent is not None and abs(bent.off) > _BENT and (bent.off > 0.0) == (off > 0.0):
        text = (
            f"{said}, and its deformation length {100 * math.expm1(bent.off):+.1f} %, at the same rolling radius: another inflation pressure than "
            f"stated, about {100 * math.expm1(-off / 0.59):+.0f} %. Measure the pressure before and after each run"
        )
        return Odd(one.run, off, "pressure", text)
    if film is None:
        text = f"{said}, and no PVDF of another run at its speed tells whether the flex sensor is at fault, or its load or pressure. Repeat it"
        return Odd(one.run, off, "unknown", text)
    text = f"{said}, the PVDF with it: load cell, pressure or load as set are wrong in this run. Repeat it"
    return Odd(one.run, off, "load", text)


def _oddest(marks: Sequence[Marks], mark: Mark, fewest: int) -> list[tuple[Marks, float]]:
    """Return the one or two runs without which the others agree best, and their departures; none where all agree."""
    known = [m for m in marks if _usable(m, mark)]
    whole = _departure(known[0], known, mark) if len(known) >= fewest else None
    if whole is None or whole.left < _AGREED:
        return []
    found: list[tuple[Marks, float]] = []
    for count in (1, 2):
        if len(known) - count < max(fewest - 1, count + 1):
            break
        best: tuple[float, list[tuple[Marks, _Departure]]] = (math.inf, [])
        for out in combinations(known, count):
            rest = [m for m in known if m not in out]
            pairs = [(m, d) for m in out if (d := _departure(m, rest, mark)) is not None]
            if len(pairs) == count and pairs[0][1].left < best[0]:
                best = (pairs[0][1].left, pairs)
        left = best[0]
        least = _GROSS if len(known) - count <= _FEWEST_ALIKE - 1 else _ODD if count == 1 else _GROSS_PAIR
        rest = [m for m in known if m not in [one for one, _ in best[1]]]
        if best[1] and all(abs(d.off) > max(least, _ODD_SDS * d.error) + _lag(m, rest) for m, d in best[1]):
            found = found or [(m, d.off) for m, d in best[1]]
            if left < _AGREED_REST:
                return [(m, d.off) for m, d in best[1]]
    return found


def _lag(one: Marks, others: Sequence[Marks]) -> float:
    """Return what the sensor's lag may change in the peak of a run that has its speed for itself."""
    ratios = [max(m.rotation / one.rotation, one.rotation / m.rotation) for m in others]
    nearest = min(ratios) - 1.0
    return _LAG * nearest if nearest > _ONE_SPEED else 0.0


def _usable(m: Marks, mark: Mark) -> bool:
    value = float(getattr(m, mark))
    return math.isfinite(value) and value > 0.0


def _departure(one: Marks, others: Sequence[Marks], mark: Mark) -> _Departure | None:
    """Hold a mark of a run against a power law of load through the others, a linear change with speed in it."""
    known = [m for m in others if _usable(m, mark)]
    if len(known) < 2 or not _usable(one, mark):
        return None
    everyone = [*known, one]
    loads = [m.load for m in everyone]
    law = _columns(everyone, max(1, len(known) - 1))
    X = np.column_stack(list(law.values()))
    y = np.log([float(getattr(m, mark)) for m in everyone])
    if "load" not in law and all(load > 0.0 for load in loads):
        y = y - _POWER[mark] * np.log(loads)
    # A change with speed that no lag makes is held back like a measurement of none.
    lag = np.array([_FLOOR / _LAG if name == "speed" else 0.0 for name in law])
    A, rows = np.vstack([X[:-1], lag]), np.append(y[:-1], 0.0)
    coefficients, *_ = np.linalg.lstsq(A, rows, rcond=None)
    residual = rows - A @ coefficients
    left = math.sqrt(float(residual @ residual) / max(len(known) - X.shape[1], 1))
    leverage = float(X[-1] @ np.linalg.pinv(A.T @ A) @ X[-1])
    error = math.hypot(left, _FLOOR if "curvature" in law else _FLOOR_STRAIGHT) * math.sqrt(1.0 + leverage)
    return _Departure(float(y[-1] - X[-1] @ coefficients), error, left)


def _columns(marks: Sequence[Marks], most: int) -> dict[str, np.ndarray]:
    """Return at most so many things that a law may depend on, the most needed first."""
    columns = {"level": np.ones(len(marks))}
    loads, rotations = [m.load for m in marks], np.array([m.rotation for m in marks])
    varied = _varied(loads)
    if varied:
        columns["load"] = np.log(loads) - np.log(loads[0])
    if float(np.ptp(rotations)) > _ONE_SPEED * float(rotations.min()):
        columns["speed"] = rotations / rotations[0] - 1.0
    if varied and len({round(x, 2) for x in np.log(loads)}) >= _FEWEST:
        columns["curvature"] = columns["load"] ** 2
    return dict(list(columns.items())[:most])


def _varied(loads: Sequence[float]) -> bool:
    """Tell whether loads are known and differ enough for a law."""
    return all(math.isfinite(load) and load > 0.0 for load in loads) and float(np.ptp(np.log(loads))) > _ONE_LOAD
