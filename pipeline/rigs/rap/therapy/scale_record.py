"""What the scale weighed as a volume: tare, density, touches and drift (rap.md, 5.6 and section 8)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.tables import Signal

_TOUCH = 20e-3
_COUNT, _SIDE = 15, 30
# Readings of a touch at most; a longer one is a change.
_TOUCHED_FOR = 90


@dataclass(frozen=True, eq=False)
class Weighed:
    """Volume by the scale, on the scale's clock; arrays (n,).

    Attributes
    ----------
    volume, good
        (mass - tare)/density, m^3, and where it may be used: not while the scale was being touched.
    noise
        Scatter of one reading, m^3.
    tare_known
        Whether the tare was stated; else the reading at the start counts as empty.
    steps
        Jumps of the reading, (moment s, m^3), those of emptyings included.
    """

    time: np.ndarray
    volume: np.ndarray
    good: np.ndarray
    noise: float
    density: float
    tare: float
    tare_known: bool
    steps: tuple[tuple[float, float], ...]
    problems: tuple[QualityFinding, ...]


def weighed(scale: Signal, density: float, tare: float | None = None) -> Weighed:
    """Return the scale's volume.

    Parameters
    ----------
    scale
        `uf_mass_scale`, kg, on the scale's clock.
    density
        Of the ultrafiltrate, kg/m^3.
    tare
        What the scale reads with an empty tank, kg; without it the volume counts from the first readings.

    Raises
    ------
    InputError
        If there are fewer than a minute's readings, or they never change.
    """
    if scale.time.size < 60 or scale.time[-1] - scale.time[0] < 60.0:
        raise InputError(
            f"uf_mass_scale has {scale.time.size} readings; a minute of them is the least for a comparison."
        )
    if not np.ptp(scale.values) > 0.0:
        raise InputError(
            f"uf_mass_scale reads {scale.values[0]:.4g} kg throughout; the scale is frozen or was not connected."
        )
    problems: list[QualityFinding] = []
    mass = scale.values
    known = tare is not None
    start = float(np.median(mass[:_COUNT]))
    if tare is None:
        tare = start
        text = f"mass_tare is not stated: the first readings of the scale ({1e3 * start:.0f} g) count as the volume at its start."
        problems.append(QualityFinding("note", text, channel="uf_mass_scale"))
    elif start < tare - 20e-3:
        text = f"the scale reads {1e3 * start:.0f} g at its start, less than mass_tare ({1e3 * tare:.0f} g). Check the tare."
        problems.append(QualityFinding("warning", text, channel="uf_mass_scale"))
    if np.median(np.abs(mass)) > 20.0:
        text = f"the scale reads {np.median(mass):.0f} kg; is it in grams? The tank holds 2.2 kg."
        problems.append(QualityFinding("error", text, channel="uf_mass_scale"))
    good, steps = _touched(scale.time, mass)
    off = np.flatnonzero(~good)
    touches = np.split(off, np.flatnonzero(np.diff(off) > _COUNT) + 1) if off.size else []
    for touch in [t for t in touches if t.size >= 5][:5]:
        span = (float(scale.time[touch[0]]), float(scale.time[touch[-1]]))
        text = f"scale disturbed for {span[1] - span[0]:.0f} s, by up to {1e3 * np.abs(mass[touch] - np.interp(touch, np.flatnonzero(good), mass[good])).max():.0f} g; these readings are not used."
        problems.append(QualityFinding("warning", text, channel="uf_mass_scale", span=span))
    second = np.diff(mass, 2)
    noise = 1.4826 * float(np.median(np.abs(second - np.median(second)))) / np.sqrt(6.0)
    resolution = np.diff(np.unique(mass))
    least = float(resolution.min()) / np.sqrt(12.0) if resolution.size else 0.0
    return Weighed(
        time=scale.time,
        volume=(mass - tare) / density,
        good=good,
        noise=max(noise, least) / density,
        density=density,
        tare=tare,
        tare_known=known,
        steps=tuple((t, m / density) for t, m in steps),
        problems=tuple(problems),
    )


def without_touches(
    scale: Weighed, emptied: tuple[float, ...], reach: float
) -> tuple[Weighed, tuple[QualityFinding, ...]]:
    """Return the scale with the lasting jumps taken out that no emptying (s, scale's clock, +- `reach`) explains."""
    volume = scale.volume.copy()
    problems = []
    for t, step in scale.steps:
        if any(abs(t - e) < reach for e in emptied):
            continue
        volume[scale.time >= t] -= step
        text = (
            f"scale disturbed: it jumps by {1e6 * step:+.0f} mL without a change of the level; the jump is taken out."
        )
        problems.append(QualityFinding("warning", text, channel="uf_mass_scale", span=(t, t)))
    return replace(scale, volume=volume), tuple(problems)


def _touched(time: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, list[tuple[float, float]]]:
    """Return which readings may be used (n,), and lasting jumps of more than 20 g: (moment, kg)."""
    from scipy.ndimage import median_filter

    if mass.size < 4 * _TOUCHED_FOR:
        return np.ones(mass.size, dtype=bool), []
    steady = median_filter(mass, 2 * _TOUCHED_FOR + 1, mode="nearest")
    off = np.abs(mass - steady)
    spread = max(1.4826 * float(np.median(off)), 1e-4)
    good = off < max(8.0 * spread, 0.25 * _TOUCH)
    fast = np.flatnonzero(np.abs(np.diff(steady)) > 0.5 * _TOUCH)
    steps: list[tuple[float, float]] = []
    groups = np.split(fast, np.flatnonzero(np.diff(fast) > 2 * _COUNT) + 1) if fast.size else []
    for group in groups:
        a, b = int(group[0]), int(group[-1]) + 1
        # What runs in meanwhile is no jump: two groups of readings before it tell the slope.
        first, second = mass[max(a - 2 * _SIDE, 0) : max(a - _SIDE, 1)], mass[max(a - _SIDE, 0) : a + 1]
        rise = float(np.median(second) - np.median(first)) if a >= 2 * _SIDE else 0.0
        after = float(np.median(mass[b : b + _SIDE]))
        step = after - float(np.median(second)) - rise * (_SIDE + b - a) / _SIDE
        if abs(step) > _TOUCH:
            steps.append((float(time[b]), step))
    return good, steps
