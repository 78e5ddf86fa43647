"""Runs whose peak is not that of their load: a sensor that lost gain, another pressure than stated, a wrong load (tire.md, 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Cause = Literal["sensor", "pressure", "load"]
# Fewer runs than that do not tell which of them is odd.
_FEWEST = 4
# Further off the others' curve than that (relative, and in robust standard deviations) is odd.
_ODD, _ODD_SDS = 0.03, 6.0
# The film shares a change of pressure or load, and not one of the flex sensor.
_SHARED = 0.35
# 10 % less pressure raises the peak by 6 % and the deformation length by 1.4 %; as much more load the latter by 0.4 %.
_BENT = 0.012


@dataclass(frozen=True)
class Marks:
    """What of a run grows with its load: flex peak (ohm), peak to peak of the film (V) or NaN, deformation length (m)."""

    run: str
    load: float
    rotation: float
    peak: float
    film: float
    bent: float


@dataclass(frozen=True)
class Odd:
    """A run off the curve of the others: by which share, and what most likely is the cause."""

    run: str
    off: float
    cause: Cause
    text: str


def odd_runs(marks: Sequence[Marks]) -> list[Odd]:
    """Return the runs whose peak is off that of the others at their load, the oddest first.

    One after the other is taken out, as long as enough are left that agree.
    """
    known = [m for m in marks if math.isfinite(m.load) and m.load > 0.0 and m.peak > 0.0]
    found: list[Odd] = []
    while len(known) >= _FEWEST:
        off = {m.run: _off(m, [o for o in known if o is not m]) for m in known}
        worst = max(known, key=lambda m: abs(off[m.run]))
        rest = [m for m in known if m is not worst]
        left = np.array([_off(m, [o for o in rest if o is not m]) for m in rest])
        spread = 1.4826 * float(np.median(np.abs(left)))
        if abs(off[worst.run]) <= max(_ODD, _ODD_SDS * spread):
            return found
        found.append(_judged(worst, off[worst.run], rest))
        known = rest
    return found


def _off(one: Marks, others: Sequence[Marks], name: str = "peak") -> float:
    """Return by which share a mark of a run differs from the others' power law of load."""
    rows = [
        (math.log(m.load), math.log(value))
        for m in others
        if (value := getattr(m, name)) > 0.0 and math.isfinite(value)
    ]
    own = getattr(one, name)
    if len(rows) < 2 or not own > 0.0 or not math.isfinite(own):
        return math.nan
    x, y = np.array(rows).T
    if np.ptp(x) < 0.1:
        level = float(np.median(y - 0.9 * x)) if name != "bent" else float(np.median(y))
        predicted = level + (0.9 * math.log(one.load) if name != "bent" else 0.0)
    else:
        degree = 2 if len(rows) >= 5 and np.unique(np.round(x, 2)).size >= 4 else 1
        predicted = float(np.polyval(np.polyfit(x, y, degree), math.log(one.load)))
    return math.exp(math.log(own) - predicted) - 1.0


def _judged(one: Marks, off: float, others: Sequence[Marks]) -> Odd:
    same_speed = [m for m in others if abs(m.rotation / one.rotation - 1.0) < 0.1]
    film, bent = _off(one, same_speed, "film"), _off(one, others, "bent")
    said = f"its peak is {100 * off:+.1f} % off that of the other runs at its load of {one.load:.0f} N"
    cause: Cause
    if math.isfinite(film) and abs(film) < _SHARED * abs(off):
        cause = "sensor"
        why = f"while the PVDF is {100 * film:+.1f} % off: the flex sensor's gain changed (bond, ink, temperature), and not the load. Look at the bond"
    elif math.isfinite(bent) and abs(bent) > _BENT and (bent > 0.0) == (off > 0.0):
        cause = "pressure"
        why = (
            f"and its deformation length {100 * bent:+.1f} %, at the same rolling radius: another inflation pressure than stated, about "
            f"{100 * (math.exp(-math.log1p(off) / 0.59) - 1.0):+.0f} %. Measure the pressure before and after each run"
        )
    else:
        cause = "load"
        why = (
            "the PVDF with it, or no PVDF to tell: load cell, pressure or load as set are wrong in this run. Repeat it"
        )
    return Odd(one.run, off, cause, f"{said}, {why}")
