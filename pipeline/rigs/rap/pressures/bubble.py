"""Air at a transducer: its pulsation drops and comes late against the other reader's, from the start or from a moment on (rap.md, 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.conditions import TAP_NAMES, pressure
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.passages import Passages

# A delay beyond that of the other taps' sensors that is no sensor's, s.
_LATE = 0.015
# A step of the pulsation by that share, that many standard errors clear, with that many windows on either side.
_STEP, _SIGMAS, _FEWEST = 0.06, 8.0, 4
# Weaker lines of the bench tell nothing, in their standard errors.
_LEAST_LINE = 15.0
_ADVICE = "air or something soft at the transducer? Compliance changed; E2 invalid. Flush the line to the sensor"


@dataclass(frozen=True, eq=False)
class Pulsation:
    """Device over bench at the strokes, window by window (w,): middle `time` (s), what is left after the usual sensor.

    `gain` (1) is the size and `late` (s) the delay once the pole that the other taps' sensors have is taken off.
    """

    time: np.ndarray
    gain: np.ndarray
    late: np.ndarray


def pulsation_of(one: Aligned, passages: Passages, usual_pole: float, bench_pole: float) -> Pulsation | None:
    """Return how the strokes stand in the device against the bench; None where too few windows show them."""
    windows, frequency = passages.windows.of(passages.turning), passages.frequency[passages.turning]
    if not frequency.size:
        return None
    known = [np.where(one.good, values, np.nan) for values in (one.device, one.plain)]
    ours, theirs = (harmonics(one.time, values, windows, frequency, (1.0, 2.0)) for values in known)
    line, noise = np.abs(theirs.coefficients[:, 0]), theirs.errors[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.isfinite(ours.coefficients[:, 0]) & (line > _LEAST_LINE * noise)
    if found.sum() < 2 * _FEWEST:
        return None
    omega = 2.0 * np.pi * frequency[found]
    ratio = ours.coefficients[found, 0] / theirs.coefficients[found, 0]
    ratio *= (1.0 + 1j * omega * usual_pole) / (1.0 + 1j * omega * bench_pole)
    return Pulsation(windows.centre[found], np.abs(ratio), -np.angle(ratio) / omega)


def bubble_faults(
    run: str,
    alignment: Alignment,
    passages: Passages | None,
    taps: Sequence[Aligned],
) -> list[QualityFinding]:
    """Return what the device's pulsation against the bench's says of air."""
    if passages is None:
        return []
    found = []
    for one in taps:
        others = [value for name, value in alignment.pole_by_name.items() if name != one.name]
        usual = float(np.median(others)) if others else alignment.pole_by_name.get(one.name, alignment.bench_pole)
        pulsation = pulsation_of(one, passages, usual, alignment.bench_pole)
        if pulsation is not None:
            found += _told(run, one.name, pulsation, usual)
    return found


def _told(run: str, tap: str, pulsation: Pulsation, usual: float) -> list[QualityFinding]:
    """Return at most one finding on a tap: a step first, else a delay."""
    name, channel = f"the device's {TAP_NAMES.get(tap, tap)} channel", pressure(tap, "rap")
    split = best_split(pulsation.gain)
    late = float(np.median(pulsation.late))
    if split is not None:
        at, before, after = split
        moment = 0.5 * float(pulsation.time[at - 1] + pulsation.time[at])
        later = float(np.median(pulsation.late[at:]) - np.median(pulsation.late[:at]))
        text = (
            f"the pulsation of {name} changes by {100 * (after / before - 1.0):+.0f} % against the bench's near {moment:.0f} s (bench's clock), its delay by "
            f"{1e3 * later:+.1f} ms: {_ADVICE}"
        )
        return [QualityFinding("warning", text, run, channel, (moment, moment))]
    if late > _LATE:
        text = (
            f"{name} answers about {1e3 * (late + usual):.0f} ms late, the other taps' sensors {1e3 * usual:.0f} ms, and shows {100 * float(np.median(pulsation.gain)):.0f} % of "
            f"their pulsation: {_ADVICE}"
        )
        return [QualityFinding("warning", text, run, channel)]
    return []


def best_split(values: np.ndarray) -> tuple[int, float, float] | None:
    """Return where a course (n,) steps, and its means on both sides; None where it does not."""
    best: tuple[float, int] = (0.0, 0)
    for at in range(_FEWEST, values.size - _FEWEST + 1):
        before, after = values[:at], values[at:]
        error = math.hypot(before.std() / math.sqrt(before.size), after.std() / math.sqrt(after.size))
        score = abs(before.mean() - after.mean()) / max(error, 1e-6)
        best = max(best, (score, at))
    at = best[1]
    if not at:
        return None
    first, second = float(values[:at].mean()), float(values[at:].mean())
    return (at, first, second) if abs(second / first - 1.0) > _STEP and best[0] > _SIGMAS else None
