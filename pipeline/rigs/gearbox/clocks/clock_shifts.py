"""What single parts of a run tell about the clock of the encoder: start-up, unlocking, relocking, run-down.

Each part is a law of its own, none rests on another; what is made of them is in `alignment`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pipeline.rigs.gearbox.clocks.shift_search import FAR, Part, best_shift
from pipeline.rigs.gearbox.clocks.unlock_shift import unlock_part
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.counts import Counts, line_slopes
from pipeline.rigs.gearbox.stages.stage import Stage
from pipeline.signals.periodogram import block_means

_RATE, _WINDOW, _FEWEST = 100.0, 0.2, 50
# The parts of a run are looked for this near to what all of it tells, s; a shift that the motion as a whole tells
# roughly is right within the second.
_NEAR, _ROUGH = 0.2, 0.4
# A common shift of fewer standard errors is none.
_UNSURE = 3.0
# The brake still drags after the output turns; of the release so much before and of steady running behind is used, s.
_DRAGS, _BEFORE, _BEHIND = 0.5, 0.5, 0.8


def encoder_parts(record: Record, counts: Counts, stages: Sequence[Stage], guess: float | None = None) -> list[Part]:
    """Return the shifts of the parts of a run: first about, from all of it, then of each part near that.

    `guess` is a shift (s) that the motion as a whole tells roughly, None where it tells none.
    """
    free = _FreeMotion(record, counts, stages)
    common = free.shift(free.spans, (-FAR, FAR) if guess is None else (guess - _ROUGH, guess + _ROUGH))
    about = common.shift if common is not None else guess or 0.0
    if guess is None and common is not None and abs(about) < _UNSURE * common.sd:
        about = 0.0
    found = _parts_near(about, free, record, counts, stages)
    # What little load a run-up makes may fit at many shifts: as logged comes first.
    if guess is None and abs(about) > _NEAR:
        as_logged = _parts_near(0.0, free, record, counts, stages)
        return found if len(found) > 1 and len(as_logged) < 2 else as_logged
    return found


def _parts_near(about: float, free: _FreeMotion, record: Record, counts: Counts, stages: Sequence[Stage]) -> list[Part]:
    """Return the shifts of the parts of a run near the shift `about`, in the order of time."""
    parts = free.parts(about)
    moved = replace(counts, time=counts.time + about, gaps=tuple((a + about, b + about) for a, b in counts.gaps))
    there = [replace(stage, start=stage.start + about, end=stage.end + about) for stage in stages]
    for sos in (stage for stage in there if stage.name == "sos"):
        part = unlock_part(record, moved, there, sos)
        if part is not None:
            parts.append(replace(part, time=part.time - about, shift=part.shift + about))
    return sorted(parts, key=lambda part: part.time)


class _FreeMotion:
    """Start-up, relocking and run-down, the brake off: ``T_out = J w' + d_0 + d_1 w`` (eq. A), both sides smoothed alike."""

    def __init__(self, record: Record, counts: Counts, stages: Sequence[Stage]) -> None:
        size = max(round(record.torque.rate / _RATE), 1)
        self._time, torque = block_means(record.torque.time, record.torque["torque_out"], size)
        self._torque = _smooth(self._time, _smooth(self._time, torque))
        self._grid = np.arange(counts.time[0], counts.time[-1], 1.0 / _RATE)
        speed = line_slopes(self._grid, np.interp(self._grid, counts.time, counts.angle), _WINDOW)
        smooth = _smooth(self._grid, speed)
        self._columns = np.column_stack([np.ones_like(speed), smooth, line_slopes(self._grid, speed, _WINDOW)])
        self._gaps = counts.gaps
        self.spans = [span for span in _free(stages) if self._inside(span).sum() >= _FEWEST]

    def _inside(self, span: tuple[float, float]) -> np.ndarray:
        inside = (self._grid >= span[0]) & (self._grid <= span[1])
        for start, end in self._gaps:
            inside &= (self._grid < start - 2 * _WINDOW) | (self._grid > end + 2 * _WINDOW)
        return inside

    def shift(self, spans: Sequence[tuple[float, float]], within: tuple[float, float]) -> Part | None:
        """Return the shift that explains the output torque over `spans` best."""
        inside = np.any([self._inside(span) for span in spans], axis=0) if spans else np.zeros(1, dtype=bool)
        if inside.sum() < _FEWEST:
            return None
        return best_shift(self._grid[inside], self._columns[inside], self._torque_at, within)

    def parts(self, about: float) -> list[Part]:
        """Return the shift of each span near `about`, read twice: by inertia and drag of all spans, and by its own.

        A single span tells inertia and shift hardly apart where its acceleration changes slowly: how far the two
        readings differ is part of the error.
        """
        inside = np.any([self._inside(span) for span in self.spans], axis=0) if self.spans else np.zeros(1, dtype=bool)
        if not inside.any():
            return []
        found = np.linalg.lstsq(self._columns[inside], self._torque_at(self._grid[inside] + about), rcond=None)[0]
        driven = self._columns[:, 1:] @ found[1:]
        near = (about - _NEAR, about + _NEAR)
        out = []
        for span in self.spans:
            own = self._inside(span)
            columns = np.column_stack([np.ones(own.sum()), driven[own]])
            one = best_shift(self._grid[own], columns, self._torque_at, near)
            other = best_shift(self._grid[own], self._columns[own], self._torque_at, near)
            if found[-1] > 0 and one is not None and other is not None:
                out.append(replace(one, sd=math.hypot(max(one.sd, other.sd), one.shift - other.shift)))
        return out

    def _torque_at(self, time: np.ndarray) -> np.ndarray:
        return np.asarray(np.interp(time, self._time, self._torque))


def _free(stages: Sequence[Stage]) -> list[tuple[float, float]]:
    """Return where the speed of the shaft changes without brake, with some steady running beside it."""
    out = []
    for before, after in pairwise(stages):
        if before.name == "startup" and after.name.startswith("fos"):
            out.append((before.start + _WINDOW, min(before.end + 1.0, after.end - 0.3)))
        if before.name == "release" and after.name.startswith("fos"):
            start = max(before.start + _DRAGS, before.end - _BEFORE)
            out.append((start, min(before.end + _BEHIND, after.end - 0.3)))
        if after.name == "rundown" and before.name.startswith("fos"):
            out.append((max(after.start - 1.0, before.start), after.end - 2 * _WINDOW))
    return out


def _smooth(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smooth as a line fit smooths a slope: the slope of the integral."""
    steps = np.diff(time)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)])
    return line_slopes(time, integral, _WINDOW)
