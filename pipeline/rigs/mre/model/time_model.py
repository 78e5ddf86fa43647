"""The dynamic model along records as a separable problem: columns of all segments, offsets, mains lines.

No search and no statistics here: those are in `time_fit`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.separable import Slopes, linear_fit
from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.mre.model.dynamic_model import FIELD_TERMS, Shape, search_space
from pipeline.rigs.mre.model.time_columns import Segment, largest_excursion, segment_columns
from pipeline.rigs.mre.pads import group_levels
from pipeline.signals.spectra import hum

# Of the polynomial for a drifting mean of the force, and how many times chance its gain must be.
_DRIFT_DEGREE, _DRIFT_SURE = 3, 12.0


@dataclass(frozen=True)
class TimeOptions:
    """How to fit.

    `cutoff` (Hz) of the zero-phase low-pass on x, None = from its spectrum. `viscous` adds a column
    x' shared by all records (at one current it is s_MR). `fit_mass` adds the inertia of a moving mass,
    `moving_mass` (kg) is one that is known and taken out. `drift` is the degree of a polynomial for the force's
    mean in each segment; a cubic is taken where the residual asks for it. Lines of the `mains` (Hz, 0 for
    none) that stand out of the residual are fitted along.
    """

    cutoff: float | None = None
    drift: int = 0
    viscous: bool = False
    fit_lag: bool = True
    force_lag: float = 0.0
    fit_mass: bool = False
    moving_mass: float = 0.0
    mains: float = 50.0
    current_tolerance: float = 0.25
    starts: int = 4
    seed: int = 0


class TimeModel:
    """Columns of all segments, on all or some of their rows.

    `terms` are (column, current level or None for all); `nuisance` holds the offset and `drift` of every
    segment and the mains lines, shape (rows of all segments, columns); the first `n_slow` of its columns
    cannot be extrapolated, where there is a drift.
    """

    def __init__(self, segments: Sequence[Segment], options: TimeOptions, rows: np.ndarray | None = None) -> None:
        self.segments, self.options = tuple(segments), options
        labels, levels = group_levels([part.current for part in segments], options.current_tolerance)
        self.labels, self.levels = labels, tuple(levels)
        self.reference = int(np.argmin(np.abs(levels)))
        self.segment_of_row = np.repeat(np.arange(len(segments)), [part.time.size for part in segments])
        self.usable = np.concatenate([part.usable for part in segments])
        self.first_half = np.concatenate([part.first_half for part in segments])
        self.rows = np.ones(self.usable.size, dtype=bool) if rows is None else rows
        self.force = np.concatenate([part.force - options.moving_mass * part.acceleration for part in segments])
        self.n_shape = 5 if options.fit_lag else 4
        shared = [("u", None), ("x", None), ("w", None)]
        shared += [("v", None)] * options.viscous + [("m", None)] * options.fit_mass
        others = sorted(set(labels) - {self.reference})
        self.terms = [*shared, *((column, level) for level in others for column in FIELD_TERMS["ks"])]
        self.nuisance = self._slow(options.drift)
        self.n_slow = self.nuisance.shape[1] if options.drift else 0
        lower, upper = search_space(largest_excursion(segments))
        self.lower, self.upper = lower[: self.n_shape], upper[: self.n_shape]

    def _slow(self, degree: int) -> np.ndarray:
        """Return a polynomial of that degree for every segment, shape (rows, columns)."""
        member = self.segment_of_row[:, None] == np.arange(len(self.segments))
        position = np.concatenate([np.linspace(-1, 1, part.time.size) for part in self.segments])
        powers = np.polynomial.legendre.legvander(position, degree)
        return np.hstack([member * powers[:, [k]] for k in range(degree + 1)])

    def restricted(self, rows: np.ndarray) -> TimeModel:
        """Return the model on some rows only; offsets without any row are left out."""
        other = TimeModel(self.segments, self.options, rows)
        seen = np.abs(self.nuisance[rows]).max(axis=0) > 0
        other.nuisance, other.n_slow = self.nuisance[:, seen], int(seen[: self.n_slow].sum())
        return other

    def __call__(self, q: np.ndarray) -> tuple[np.ndarray, Slopes]:
        """Return A (rows, terms + nuisance) and the function c -> d(A c)/dq (rows, n_shape)."""
        shape = Shape.of(q, self.options.force_lag)
        A = np.zeros((int(self.rows.sum()), len(self.terms) + self.nuisance.shape[1]))
        A[:, len(self.terms) :] = self.nuisance[self.rows]
        parts: list[tuple[slice, int, np.ndarray, list[dict[str, np.ndarray]]]] = []
        start = 0
        for i, segment in enumerate(self.segments):
            kept = np.flatnonzero(self.rows[self.segment_of_row == i])
            if kept.size == 0:
                continue
            columns, slopes = segment_columns(segment, shape, int(kept[-1]) + 1)
            rows = slice(start, start + kept.size)
            start = rows.stop
            for j, (name, level) in enumerate(self.terms):
                if level in (None, self.labels[i]):
                    A[rows, j] = columns[name][kept]
            parts.append((rows, self.labels[i], kept, slopes))

        def slopes_of(c: np.ndarray) -> np.ndarray:
            out = np.zeros((A.shape[0], self.n_shape))
            for rows, label, kept, slopes in parts:
                for k in range(self.n_shape):
                    for (name, level), coefficient in zip(self.terms, c, strict=False):
                        if name in slopes[k] and level in (None, label):
                            out[rows, k] += coefficient * slopes[k][name][kept]
            return out

        return A, slopes_of

    @property
    def data(self) -> np.ndarray:
        """Measured force at the rows."""
        return np.asarray(self.force[self.rows])

    def add_drift(self, residual: np.ndarray) -> None:
        """Let the mean force drift as a cubic if that takes far more out of the residual (usable rows) than chance."""
        slow = self._slow(_DRIFT_DEGREE)
        rest = linear_fit(slow[self.usable], residual).residual
        gained = 1 - float(rest @ rest) / float(residual @ residual)
        terms = slow.shape[1] - len(self.segments)
        if gained * effective_size(rest, slow.shape[1]) > _DRIFT_SURE * terms * (1 - gained):
            self.nuisance, self.n_slow = slow, slow.shape[1]

    def add_hum(self, residual: np.ndarray) -> None:
        """Add a sine for every mains line that stands out of the residual (of the usable rows) of a segment."""
        if self.options.mains <= 0:
            return
        time = np.concatenate([part.time for part in self.segments])
        lines = []
        for i in range(len(self.segments)):
            here = self.segment_of_row[self.usable] == i
            for line in hum(time[self.usable][here], residual[here], self.options.mains):
                if line.present:
                    exact = _refined_line(time[self.usable][here], residual[here], line.frequency)
                    turn = np.where(self.segment_of_row == i, np.exp(2j * np.pi * exact * time), 0)
                    lines += [turn.real, turn.imag]
        if lines:
            self.nuisance = np.column_stack([self.nuisance, *lines])


def _refined_line(time: np.ndarray, residual: np.ndarray, frequency: float) -> float:
    """Return the frequency (Hz) of a line by its phase advance between the halves of the record."""
    halves = (slice(None, time.size // 2), slice(time.size // 2, None))
    for _ in range(3):
        first, second = (np.exp(-2j * np.pi * frequency * time[half]) @ residual[half] for half in halves)
        apart = time[halves[1]].mean() - time[halves[0]].mean()
        frequency += float(np.angle(second * np.conj(first))) / (2 * np.pi * apart)
    return frequency
