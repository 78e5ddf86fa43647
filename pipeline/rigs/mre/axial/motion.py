"""How a press moved between its turns: a smooth motion in time through what the gauge tells.

A stroke is a polynomial in time of the least degree that the marks ask for (1 is a constant rate); where none
follows them, the motion is taken at the marks only. Strokes meet where they cross, or at a standstill. Readings
that are fine beside the noise of the force need no such motion: `read_finely` takes them as they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.mre.axial.gauge import Marks, marks_of, step_of
from pipeline.signals.cycles import turning_points

_DEGREES = (1, 2, 3, 4, 5, 7, 9, 11, 13)
# A motion between marks is believed if it misses them by less than this share of a step (rms), or is within
# three times what the marks themselves are uncertain by.
_MISSED = 0.15
# A stroke counts if it is at least this share of the range, and this many steps.
LEAST_STROKE, _LEAST_STEPS = 0.05, 2.5
_FEWEST_MARKS = 4
_EXACT = 1e-6
_BEAT_MEAN = 0.5
# So many readings on either side of a turn tell where it fell between two samples.
_NEAR_TURN = 10
# Marks that miss by no more than this times what the sample interval allows ask for nothing more.
_AS_EXPECTED = 1.25


@dataclass(frozen=True, eq=False)
class Stroke:
    """One stroke: direction, its marks, and the motion ``V((t - t0)/T) m`` through them.

    `coefficients` (Legendre, shape (degree + 1,)) have the covariance `covariance`; None where the motion is
    known at the marks only. `start` and `end` are times between which the turns before and after it lie.
    """

    direction: float
    marks: Marks
    start: float
    end: float
    t0: float
    scale: float
    coefficients: np.ndarray | None
    covariance: np.ndarray | None
    missed: float

    @property
    def degree(self) -> int:
        """Degree of the polynomial; 0 where there is none."""
        return 0 if self.coefficients is None else self.coefficients.size - 1

    def at(self, time: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
        """Return the displacement at times, m; beyond its marks a stroke goes on straight."""
        u = (time - self.t0) / self.scale
        inside = np.clip(u, -1.0, 1.0)
        out = np.polynomial.legendre.legval(inside, coefficients)
        if coefficients.size > 2:
            slope = np.polynomial.legendre.legder(coefficients)
            out = out + (u - inside) * np.polynomial.legendre.legval(inside, slope)
        elif coefficients.size == 2:
            out = out + (u - inside) * coefficients[1]
        return np.asarray(out)


@dataclass(frozen=True, eq=False)
class Motion:
    """Strokes of one record, and the step of the gauge (m, 0 where it is fine).

    `lowest` and `highest` bound each turn's displacement, shape (strokes + 1,): what the gauge shows there.
    Of readings taken as they are, `shift_spread` is how far all of a stroke may be off alike, shape (strokes,), and
    `turn_spread` how well each turn is known (m, 1 sigma), shape (strokes + 1,).
    """

    strokes: tuple[Stroke, ...]
    step: float
    lowest: np.ndarray
    highest: np.ndarray
    shift_spread: np.ndarray | None = None
    turn_spread: np.ndarray | None = None

    @property
    def smooth(self) -> bool:
        """Tell whether every stroke has a motion between its marks."""
        return all(stroke.coefficients is not None for stroke in self.strokes)

    @property
    def coefficients(self) -> np.ndarray:
        """All coefficients, one stroke after the other, or shifts; empty where the motion is known at marks only."""
        if self.shift_spread is not None:
            return np.zeros(self.shift_spread.size)
        if not self.smooth:
            return np.zeros(0)
        return np.concatenate([s.coefficients for s in self.strokes if s.coefficients is not None])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of `coefficients`."""
        if self.shift_spread is not None:
            return np.diag(self.shift_spread**2)
        size = self.coefficients.size
        out = np.zeros((size, size))
        at = 0
        for s in self.strokes:
            if s.covariance is not None and size:
                n = len(s.covariance)
                out[at : at + n, at : at + n] = s.covariance
                at += n
        return out

    def split(self, coefficients: np.ndarray) -> list[np.ndarray]:
        """Return the coefficients of each stroke."""
        return np.split(coefficients, np.cumsum([s.degree + 1 for s in self.strokes])[:-1])

    def crossings(self, coefficients: np.ndarray, first: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times and displacements of the turns if nothing stood still.

        The motion then begins at time `first`, goes over from stroke to stroke where they cross, and ends
        with the last mark's stroke; shape (strokes + 1,) each.
        """
        parts = self.split(coefficients)
        times = [first]
        for (s, a), (n, b) in zip(
            zip(self.strokes[:-1], parts[:-1], strict=True), zip(self.strokes[1:], parts[1:], strict=True), strict=True
        ):
            times.append(_crossing(s, a, n, b))
        times.append(self.strokes[-1].end)
        on = [0, *range(len(self.strokes))]
        d = [float(self.strokes[i].at(np.array(t), parts[i])) for i, t in zip(on, times, strict=True)]
        return np.array(times), np.array(d)


def motion_of(time: np.ndarray, x: np.ndarray) -> Motion:
    """Return the motion behind the readings `x` (m) at `time` (s), shape (n,), finite.

    Raises
    ------
    ValueError
        If there is no stroke, or one with too few marks.
    """
    step = step_of(x)
    begins, ends = _strokes(x, step)
    if not begins:
        raise ValueError("the displacement does not move")
    strokes: list[Stroke] = []
    lowest, highest = [], []
    half = 0.5 * step if step else 3 * marks_of(time, x, 0.0, 1.0).spread
    for i, (a, b) in enumerate(zip(begins, ends, strict=True)):
        direction = 1.0 if x[b] > x[a] else -1.0
        marks = marks_of(time[a : b + 1], x[a : b + 1], step, direction)
        if marks.time.size < _FEWEST_MARKS:
            raise ValueError(f"only {marks.time.size} readings tell of the stroke that begins at {time[a]:.6g} s")
        strokes.append(_stroke(direction, marks, float(time[a]), float(time[b]), step))
        for end in (a,) if i < len(begins) - 1 else (a, b):
            lowest.append(x[end] - half)
            highest.append(x[end] + half)
    return Motion(tuple(strokes), step, np.array(lowest), np.array(highest))


def _strokes(x: np.ndarray, step: float) -> tuple[list[int], list[int]]:
    """Return first and last row of each stroke; at a turn both are in the middle of the extreme reading."""
    height = max(LEAST_STROKE * float(np.ptp(x)), _LEAST_STEPS * step)
    if not np.ptp(x) > height:
        return [], []
    turns = turning_points(x, height).tolist()
    begins = [_middle(x, i, step) if i else 0 for i in turns]
    ends = [*begins[1:], x.size - 1]
    return begins, ends


def _middle(x: np.ndarray, turn: int, step: float) -> int:
    """Return the middle row of the readings that equal the one at a turn and follow each other."""
    near = np.abs(x - x[turn]) <= 0.5 * step
    first = last = turn
    while first > 0 and near[first - 1]:
        first -= 1
    while last < x.size - 1 and near[last + 1]:
        last += 1
    return (first + last) // 2


def _stroke(direction: float, marks: Marks, start: float, end: float, step: float) -> Stroke:
    t0, scale = float(marks.time.mean()), max(float(np.ptp(marks.time)) / 2, 1e-9)
    t0 = 0.5 * float(marks.time[0] + marks.time[-1])
    u = (marks.time - t0) / scale
    best: tuple[float, np.ndarray, np.ndarray, float] | None = None
    n = u.size
    for degree in _DEGREES:
        if degree + 3 > n:
            break
        V = np.polynomial.legendre.legvander(u, degree)
        c, *_ = np.linalg.lstsq(V, marks.d, rcond=None)
        r = marks.d - V @ c
        variance = float(r @ r) / (n - degree - 1)
        bic = n * math.log(max(float(r @ r) / n, (0.1 * marks.spread) ** 2)) + (degree + 1) * math.log(n)
        if best is None or bic < best[0] - 6:
            best = bic, c, V, variance
        if math.sqrt(variance) < _AS_EXPECTED * marks.spread:
            best = bic, c, V, variance
            break  # what is left is the beat of steps and samples
    if best is None:
        V = np.polynomial.legendre.legvander(u, 1)
        c, *_ = np.linalg.lstsq(V, marks.d, rcond=None)
        best = 0.0, c, V, marks.spread**2
    _, c, V, variance = best
    missed = math.sqrt(variance)
    if not marks.regular or missed > max(_MISSED * step, 3 * marks.spread):
        return Stroke(direction, marks, start, end, t0, scale, None, None, missed)
    floor = marks.spread**2
    # Steps and samples beat: marks then miss alike, one after the other, or all by the same share of an interval; the
    # rate may then be off by up to an interval over the stroke, and the stroke as a whole by as much.
    beat = n / min(max(effective_size(marks.d - V @ c, c.size), 2.0), float(n)) if variance > 0.01 * floor else 1.0
    covariance = max(variance, floor) * beat * np.linalg.inv(V.T @ V)
    # A beat is a sawtooth: it takes the mean along less than the slope.
    covariance[0] *= _BEAT_MEAN
    covariance[:, 0] *= _BEAT_MEAN
    alike = max(1 - 2 * variance / floor, 0.0)
    covariance[0, 0] += 3 * floor * alike
    covariance[1, 1] += 0.5 * floor * alike
    return Stroke(direction, marks, start, end, t0, scale, c, covariance, missed)


def _crossing(s: Stroke, a: np.ndarray, n: Stroke, b: np.ndarray) -> float:
    """Return when the motion goes over from one stroke to the next: where their straight ends cross."""
    low, high = float(s.marks.time[-1]), float(n.marks.time[0])
    (pa, va), (pb, vb) = _end(a, s.scale, 1.0), _end(b, n.scale, -1.0)
    if va == vb:
        return 0.5 * (low + high)
    at = (pb - vb * high - pa + va * low) / (va - vb)
    constant = s.degree == 1 and n.degree == 1
    return float(at) if constant or low < at < high else 0.5 * (low + high)


def _end(c: np.ndarray, scale: float, side: float) -> tuple[float, float]:
    """Return place (m) and velocity (m/s) of a Legendre series at its last (`side` 1) or first (-1) mark."""
    order = np.arange(c.size)
    sign = side**order
    return float(c @ sign), float(c @ (sign * side * order * (order + 1))) / (2 * scale)


def as_read(motion: Motion, x: np.ndarray) -> Motion:
    """Return the same strokes with the readings `x` (m) taken as exact, not as samples of a smooth motion."""
    strokes = tuple(replace(s, coefficients=None, covariance=None) for s in motion.strokes)
    turns = 0.5 * (motion.lowest + motion.highest)
    least = max(_EXACT * float(np.ptp(x)), 1e-12)
    return replace(motion, strokes=strokes, lowest=turns - least, highest=turns + least)


def read_finely(motion: Motion, time: np.ndarray, x: np.ndarray) -> Motion:
    """Return the same strokes with the readings `x` (m) at `time` (s), shape (n,), taken as they are.

    A turn falls between two samples. What all readings of a stroke are off alike, because steps and samples keep
    time with each other, stays an unknown of each stroke.
    """
    reach = [abs(rate) * float(np.median(np.diff(time))) for rate in rates(motion)]
    spreads = np.array([s.marks.spread for s in motion.strokes])
    alike = [max(1 - 2 * (s.missed / s.marks.spread) ** 2, 0.0) + 2 / s.marks.d.size for s in motion.strokes]
    turns = 0.5 * (motion.lowest + motion.highest)
    inner = np.maximum(reach[:-1], reach[1:])
    turns[1:-1] += 0.25 * inner * np.array([s.direction for s in motion.strokes[:-1]])
    spread = np.hypot(np.r_[0.5 * reach[0], 0.25 * inner, 0.5 * reach[-1]], np.r_[spreads, spreads[-1]])
    for i, before in enumerate(motion.strokes[:-1], start=1):
        meets = _meeting(time, x, before.end, before.direction * turns[i], before.direction, inner[i - 1])
        if meets is not None:
            turns[i] = meets
            spread[i] = math.hypot(0.6 * spreads[i - 1], 0.1 * inner[i - 1])
    strokes = tuple(replace(s, coefficients=None, covariance=None) for s in motion.strokes)
    return replace(
        motion, strokes=strokes, lowest=turns - 4 * spread, highest=turns + 4 * spread,
        shift_spread=spreads * np.sqrt(alike), turn_spread=spread,
    )  # fmt: skip


def _meeting(time: np.ndarray, x: np.ndarray, at: float, read: float, direction: float, reach: float) -> float | None:
    """Return where straight lines through the readings before and after a turn meet; None where the press stood.

    They must meet within half a sample's motion `reach` of what was `read` there (both m, along `direction`).
    """
    i = int(np.searchsorted(time, at))
    parts = [slice(max(i - _NEAR_TURN - 1, 0), i - 1), slice(i + 2, i + 2 + _NEAR_TURN)]
    if any(time[part].size < _NEAR_TURN for part in parts):
        return None
    (up, start), (down, end) = (np.polyfit(time[part] - time[i], direction * x[part], 1) for part in parts)
    dt = float(time[i] - time[i - 1])
    if min(up, -down) * dt < 0.3 * reach:
        return None
    place = start + up * (end - start) / (up - down)
    return direction * float(place) if abs(place - read) < 0.75 * reach else None


def rates(motion: Motion) -> Sequence[float]:
    """Return the mean rate of each stroke, m/s."""
    return [
        float((s.marks.d[-1] - s.marks.d[0]) / max(s.marks.time[-1] - s.marks.time[0], 1e-12)) for s in motion.strokes
    ]
