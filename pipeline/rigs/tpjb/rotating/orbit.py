"""One orbit under a turning load, and how the load turns: true frequency, turns, steady stretch, dwell.

The frequency is negative for a load that turns clockwise. Harmonics stand in `harmonics`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError

# Below this share of its size in the steady turns the load counts as absent.
DWELL = 0.05
# Steady is the load where it has this share of what the same direction sees in the steady turns.
_STEADY = 0.95


@dataclass(frozen=True, eq=False)
class Orbit:
    """One run: stamps (n,), displacement (2, n) m and dynamic force (2, n) N in x and y, all finite.

    `force_noise` (N, per axis) is the standard deviation of the force signal, None where it is to be
    estimated; `shaft_frequency` (Hz) tells where the shaft's own line is expected after sampling.
    """

    run: str
    time: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    force_noise: float | None = None
    shaft_frequency: float | None = None

    @property
    def z(self) -> np.ndarray:
        """Complex displacement dx + i dy, shape (n,), m."""
        return np.asarray(self.displacement[0] + 1j * self.displacement[1])

    @property
    def step(self) -> float:
        """Median sampling interval, s."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def tau(self) -> np.ndarray:
        """Time scaled to -1..1 over the run, shape (n,)."""
        return np.asarray(2 * (self.time - self.time[0]) / (self.time[-1] - self.time[0]) - 1)

    @cached_property
    def rotation(self) -> Rotation:
        """How the load turns."""
        return rotation(self.time, self.force)

    def part(self, kept: np.ndarray) -> Orbit:
        """Return the run with the samples of a mask or of indices only."""
        return Orbit(
            self.run,
            self.time[kept],
            self.displacement[:, kept],
            self.force[:, kept],
            self.force_noise,
            self.shaft_frequency,
        )


@dataclass(frozen=True, eq=False)
class Rotation:
    """How the load vector turns.

    Attributes
    ----------
    frequency, std_error
        Turns per second, negative clockwise, and its standard error, Hz.
    turns
        Turns of the steady part.
    angle
        Force angle, unwrapped from the first sample with load on, shape (n,), rad; NaN in the dwell.
    wander
        rms departure of the angle from a uniform rotation in the steady part, rad.
    size
        Size of the load in the steady part (mean of |f|), N.
    steady, dwell
        Masks, shape (n,): the turns at full load; no load.
    """

    frequency: float
    std_error: float
    turns: float
    angle: np.ndarray
    wander: float
    size: float
    steady: np.ndarray
    dwell: np.ndarray

    @property
    def has_dwell(self) -> bool:
        """Whether the log holds the static equilibrium itself: at least 5 samples without load."""
        return int(self.dwell.sum()) >= 5


def rotation(time: np.ndarray, force: np.ndarray) -> Rotation:
    """Find the true rotation frequency from the force angle, and where the load is steady or absent.

    Parameters
    ----------
    time, force
        Stamps (s), shape (n,), and force in x and y, shape (2, n), N.

    Raises
    ------
    InputError
        If there is no force, it does not turn, or there are fewer than 8 samples at load or per turn.
    """
    f = force[0] + 1j * force[1]
    modulus = np.abs(f)
    high = _closed(modulus > 0.2 * np.quantile(modulus, 0.98)) if modulus.size else np.zeros(0, dtype=bool)
    if high.sum() < 8 or not modulus.max() > 0:
        raise InputError("the dynamic force is zero throughout: no turning load can be found in it.")
    full = _longest(high)
    t, angle = time[full], _unwrapped(time[full], f[full])
    line = np.polynomial.Polynomial.fit(t, angle, 1).convert().coef
    advance = abs(line[1]) * float(np.median(np.diff(t)))
    if abs(angle[-1] - angle[0]) < 1.5 * np.pi or advance > 2 * np.pi / 8:
        raise InputError(
            f"the dynamic force does not turn: its direction changes by {math.degrees(angle[-1] - angle[0]):.0f} deg "
            f"in {t[-1] - t[0]:.0f} s at full size; a turning load with at least 8 samples a turn was expected."
        )
    steady = _steady(time, f, full, line[1])
    t, angle = time[steady], _unwrapped(time[steady], f[steady])
    line = np.polynomial.Polynomial.fit(t, angle, 1).convert().coef
    departure = angle - line[0] - line[1] * t
    wander = float(np.sqrt(np.mean(departure**2)))
    # A wandering angle: its straight line is as uncertain as if each turn told it once.
    turns = abs(line[1]) * (t[-1] - t[0] + np.median(np.diff(t))) / (2 * np.pi)
    std_error = wander * math.sqrt(12 / max(turns, 1.0)) / (2 * np.pi * (t[-1] - t[0]))
    size = float(modulus[steady].mean())
    dwell = modulus < DWELL * size
    everywhere = np.full(time.size, np.nan)
    everywhere[~dwell] = _unwrapped(time[~dwell], f[~dwell])
    return Rotation(float(line[1] / (2 * np.pi)), std_error, float(turns), everywhere, wander, size, steady, dwell)


def _unwrapped(time: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return the angle of a turning vector without jumps, shape (n,), rad; gaps in the log are bridged at its usual speed."""
    speed = float(np.median(np.angle(f[1:] * f[:-1].conj()) / np.diff(time)))
    return np.asarray(np.unwrap(np.angle(f * np.exp(-1j * speed * time))) + speed * time)


def _steady(time: np.ndarray, f: np.ndarray, full: np.ndarray, speed: float) -> np.ndarray:
    """Return the mask of the longest stretch at full load, whatever ellipse the load describes.

    Loads that wander dip below the threshold for a while: it makes room for their scatter, and dips of
    a twentieth of a turn do not end the stretch.
    """
    t, inside = time[full], f[full]
    hole = max(round(0.05 * 2 * np.pi / (abs(speed) * float(np.median(np.diff(time))))), 3)
    for _ in range(3):
        turning = np.exp(1j * speed * (t - time[0]))
        Z = np.linalg.lstsq(np.stack([turning, turning.conj()], axis=1), inside, rcond=None)[0]
        turning = np.exp(1j * speed * (time - time[0]))
        expected = np.abs(Z[0] * turning + Z[1] * turning.conj())
        share = np.abs(f) / np.maximum(expected, DWELL * np.abs(Z).max())
        scatter = 1.4826 * float(np.median(np.abs(share[full] - np.median(share[full]))))
        steady = _longest(_closed(share > min(_STEADY, 1 - 3 * min(scatter, 0.1)), hole))
        t, inside = time[steady], f[steady]
    mask = np.zeros(time.size, dtype=bool)
    mask[steady] = True
    return mask


def _closed(mask: np.ndarray, hole: int = 3) -> np.ndarray:
    """Fill holes of up to `hole` samples between others: noise takes samples below a threshold."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    closed = mask.copy()
    for end, start in zip(edges[1:-1:2], edges[2::2], strict=True):
        if start - end <= hole:
            closed[end:start] = True
    return closed


def _longest(mask: np.ndarray) -> np.ndarray:
    """Return the indices of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    return np.arange(edges[2 * longest], edges[2 * longest + 1])
