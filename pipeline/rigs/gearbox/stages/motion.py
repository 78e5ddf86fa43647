"""What the output shaft does, told from counts alone: it stands, moves, or runs at nominal speed.

What a standing or a running shaft means (standstill or SOS, FOS or loaded) is told in `segmentation`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.rigs.gearbox.stages.counts import Counts, edges

State = Literal["zero", "moving", "nominal"]
# Nominal is within 2 % or three robust standard deviations of the median of what is above 0.8 of top speed.
_FAST, _BAND, _SIGMAS = 0.8, 0.02, 3.0
# Shorter runs between two of the same state belong to them, s.
_SHORTEST = 0.15
# A stand at the end of the record lasts this long to be one, s.
_LAST = 0.3
# A loaded drive droops by so much; what slows down further has left nominal speed.
_DROOP = 0.12


@dataclass(frozen=True)
class Span:
    """A stretch in one state, s; `speed` is the median over it, rad/s."""

    state: State
    start: float
    end: float
    speed: float


def nominal_speed(speed: np.ndarray, top: float) -> tuple[float, float]:
    """Return the nominal speed and the half-width of its band, rad/s; NaN where nothing turns."""
    fast = speed[speed > _FAST * top] if top > 0 else speed[:0]
    if not fast.size:
        return float("nan"), float("nan")
    nominal = float(np.median(fast))
    sigma = 1.4826 * float(np.median(np.abs(fast - nominal)))
    return nominal, max(_BAND * nominal, _SIGMAS * sigma)


def steady_speed(counts: Counts, spans: Sequence[Span]) -> float:
    """Return the slope of a straight line through the angle of the longest run at nominal speed, rad/s."""
    longest = max((span for span in spans if span.state == "nominal"), key=lambda span: span.end - span.start)
    cut = min(0.5, 0.2 * (longest.end - longest.start))
    speed, _ = counts.rate(longest.start + cut, longest.end - cut)
    return longest.speed if math.isnan(speed) else speed


def spans_of(counts: Counts) -> tuple[list[Span], float]:
    """Return what the shaft does from the first to the last sample, without holes, and its nominal speed, rad/s."""
    speed = counts.speed()
    nominal, band = nominal_speed(speed, counts.top)
    time = counts.time
    state = np.where(np.abs(speed - nominal) < band, 2, 1)
    for start, end in _standing(counts):
        state[(time >= start) & (time <= end)] = 0
    bounds = np.flatnonzero(np.diff(state)) + 1
    first = np.concatenate([[0], bounds])
    starts = np.concatenate([[time[0]], 0.5 * (time[bounds - 1] + time[bounds])])
    ends = np.concatenate([starts[1:], [time[-1]]])
    runs = [(int(state[i]), float(a), float(b)) for i, a, b in zip(first, starts, ends, strict=True)]
    runs = _ending(_joined(runs, time, speed, nominal))
    names: tuple[State, State, State] = ("zero", "moving", "nominal")
    return [Span(names[s], a, b, _median(time, speed, a, b)) for s, a, b in runs], nominal


def _standing(counts: Counts) -> list[tuple[float, float]]:
    """Return the stretches without a count, s."""
    at, _ = edges(counts)
    marks = np.concatenate([[counts.time[0]], at, [counts.time[-1]]])
    long = np.flatnonzero(np.diff(marks) > counts.still)
    out = []
    for start, end in zip(marks[long], marks[long + 1], strict=True):
        # Where the counter told nothing, nothing is known: what is left on either side may still be a stand.
        inside = [gap for gap in counts.gaps if gap[1] > start and gap[0] < end]
        bounds = [start, *(t for gap in inside for t in gap), end]
        out += [(float(a), float(b)) for a, b in zip(bounds[::2], bounds[1::2], strict=True) if b - a > counts.still]
    return out


def _ending(runs: list[tuple[int, float, float]]) -> list[tuple[int, float, float]]:
    """Mend the ends of a record: one count beside a stand is no motion, a short stand after a run-down none yet."""
    if len(runs) > 1 and runs[-1][0] == 1 and runs[-2][0] == 0 and runs[-1][2] - runs[-1][1] < _SHORTEST:
        runs = [*runs[:-2], (0, runs[-2][1], runs[-1][2])]
    if len(runs) > 1 and runs[0][0] == 1 and runs[1][0] == 0 and runs[0][2] - runs[0][1] < _SHORTEST:
        runs = [(0, runs[0][1], runs[1][2]), *runs[2:]]
    if len(runs) > 1 and runs[-1][0] == 0 and runs[-2][0] == 1 and runs[-1][2] - runs[-1][1] < _LAST:
        return [*runs[:-2], (1, runs[-2][1], runs[-1][2])]
    return runs


def _joined(
    runs: list[tuple[int, float, float]], time: np.ndarray, speed: np.ndarray, nominal: float
) -> list[tuple[int, float, float]]:
    """Give short runs, and dips of a loaded drive, to the neighbours that agree."""
    changed = True
    while changed:
        changed = False
        for i in range(len(runs)):
            state, start, end = runs[i]
            before = runs[i - 1][0] if i else None
            after = runs[i + 1][0] if i + 1 < len(runs) else None
            if state == 0:
                continue
            short = end - start < _SHORTEST
            dip = state == 1 and before == after == 2 and _least(time, speed, start, end) > (1 - _DROOP) * nominal
            if dip or (short and before == after and before is not None):
                new = 2 if dip else before
            elif short and state == 2 and 1 in (before, after):
                new = 1
            else:
                continue
            if new == state:
                continue
            runs[i] = (int(new or 0), start, end)
            runs, changed = _coalesced(runs), True
            break
    return runs


def _coalesced(runs: list[tuple[int, float, float]]) -> list[tuple[int, float, float]]:
    out = [runs[0]]
    for state, start, end in runs[1:]:
        if state == out[-1][0]:
            out[-1] = (state, out[-1][1], end)
        else:
            out.append((state, start, end))
    return out


def _least(time: np.ndarray, speed: np.ndarray, start: float, end: float) -> float:
    inside = speed[(time >= start) & (time <= end)]
    return float(inside.min()) if inside.size else 0.0


def _median(time: np.ndarray, speed: np.ndarray, start: float, end: float) -> float:
    inside = speed[(time >= start) & (time <= end)]
    return float(np.median(inside)) if inside.size else float("nan")
