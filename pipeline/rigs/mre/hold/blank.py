"""Pull of the poles: from a blank test (a spacer in place of the pad, T7), and the bound B^2 A / (2 mu0) from the field."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.hold.record import Record

MU0 = 4e-7 * math.pi


@dataclass(frozen=True, eq=False)
class Blank:
    """Force of a blank test above that at 0 A, N, by level of the current (A, rising), with standard errors.

    The remanence makes the way down differ: +1 up and -1 down have a table (current, pull, error) of their own where both were swept. `zero_error` is the
    standard error of the level at 0 A, common to all.
    """

    run: str
    zero_error: float
    ways: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]

    def _of(self, way: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.ways.get(way) or next(iter(self.ways.values()))

    def at(self, current: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return the pull at currents reached upwards (+1) or downwards (-1), straight between the levels, N."""
        up, down = (np.interp(np.abs(current), *self._of(way)[:2]) for way in (1, -1))
        return np.asarray(np.where(np.asarray(direction) < 0, down, up))

    def error_at(self, current: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return its standard error, N."""
        up, down = (np.interp(np.abs(current), self._of(way)[0], self._of(way)[2]) for way in (1, -1))
        return np.asarray(np.where(np.asarray(direction) < 0, down, up))

    @property
    def largest(self) -> tuple[float, float]:
        """The largest current, A, and the pull there, N."""
        current, pull, _ = self._of(1)
        return float(current[-1]), float(pull[-1])


def blank_of(record: Record) -> Blank | None:
    """Return the pull of a blank test; None where force or a level near 0 A is missing."""
    means = record.of("force_axial")
    if means is None:
        return None
    there = np.isfinite(means.mean)
    level, force, direction = np.abs(record.level[there]), means.mean[there], record.direction[there]
    variance = (means.spread**2 / np.maximum(means.count, 1))[there]
    if not level.size or level.min() > 0.1:
        return None
    zero = int(level.argmin())
    ways: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    top = int(level.argmax())
    for way in (1, -1):
        rows = np.flatnonzero(direction == way)
        if rows.size and np.ptp(level[rows]) > 0.5 * np.ptp(level):
            rows = np.union1d(rows, [top])  # the turn belongs to both ways
            rows = rows[np.argsort(level[rows], kind="stable")]
            ways[way] = (level[rows], force[rows] - force[zero], np.sqrt(variance[rows]))
    return Blank(record.run, float(np.sqrt(variance[zero])), ways) if ways else None


def pole_pull(flux: np.ndarray | float, area: float) -> np.ndarray:
    """Return B^2 A/(2 mu0), N: the pull between two poles of that area (m^2) at B (T).

    Examples
    --------
    >>> round(float(pole_pull(0.8, 1.963495e-3)))
    500
    """
    return np.asarray(np.asarray(flux, dtype=float) ** 2 * area / (2 * MU0))
