"""All logs of one bearing together: number of pads, force levels, polygons, contact law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tpjb.axes import pad_directions
from pipeline.rigs.tpjb.bump.contact_fit import ContactFit, fit_contact
from pipeline.rigs.tpjb.bump.declaration import BumpSettings
from pipeline.rigs.tpjb.bump.geometry import Count, Polygon, count_pads, fit_polygon
from pipeline.rigs.tpjb.bump.levels import Blocks, blocks_of, joined, with_levels
from pipeline.rigs.tpjb.bump.record import Record, UnusableError
from pipeline.rigs.tpjb.bump.start import first_guess
from pipeline.rigs.tpjb.conditions import n_pads_of, pad_angles_of

CANDIDATES = (3, 4, 5, 6, 7)
# How much worse than the best number of pads the stated one may fit, and by how much of the orbit's size.
_CONTRADICTED = (4.0, 0.005)
# A side nearer to the middle than this share of the others was never touched.
_TOUCHED = 0.5
_FEWEST_PRESSED = 3
# Share of the blocks that must obey the contact law.
_LEAST_KEPT = 0.3
_FEWEST_BLOCKS = 40
_MOST_BLOCKS = 5000


@dataclass(frozen=True, eq=False)
class BearingFit:
    """What the logs of one bearing give.

    Attributes
    ----------
    stated
        Number of pads that settings or runs state, None where they state none.
    count
        How other numbers of pads fit the orbit.
    blocks
        Those at a force level.
    polygons
        ``polygons[plane][level]``, at the force of that level.
    absent
        Sides, from 0, that were never touched.
    contact
        None where it could not be fitted; `reason` says why.
    contradiction
        Says where the orbit shows another number of pads than stated.
    """

    records: tuple[Record, ...]
    pad_angles: np.ndarray
    stated: int | None
    count: Count
    blocks: Blocks
    polygons: dict[int, dict[int, Polygon]]
    absent: tuple[int, ...]
    contact: ContactFit | None
    reason: str = ""
    contradiction: str = ""

    @property
    def n_pads(self) -> int:
        """Number of sides that was used."""
        return int(self.pad_angles.size)

    @property
    def top(self) -> dict[int, Polygon]:
        """The polygons of the largest force, by plane."""
        return {plane: by_level[max(by_level)] for plane, by_level in self.polygons.items()}


@dataclass(frozen=True, eq=False)
class Pads:
    """Blocks of the logs of one bearing and how many pads their orbit shows; `near` is what lies at a side, m."""

    blocks: Blocks
    near: float
    stated: int | None
    count: Count
    angles: np.ndarray

    @property
    def contradiction(self) -> str:
        """Say where the orbit shows another number of pads than stated; '' where it does not."""
        if self.stated in (None, self.angles.size):
            return ""
        shown = ", ".join(f"{n}: {1e6 * misfit:.3g} um" for n, misfit in self.count.misfits.items())
        return (
            f"n_pads is {self.stated} but the orbit has {self.angles.size} sides (rms distance from a polygon of so many sides: "
            f"{shown}); {self.angles.size} is used."
        )


def pads_of(records: Sequence[Record], settings: BumpSettings) -> Pads:
    """Gather the logs of one bearing and count its pads.

    Raises
    ------
    UnusableError
        If no force was held long enough, or the orbit is no polygon.
    InputError
        If the runs contradict one another about the pads.
    """
    parts = [blocks_of(r.samples, r.rotation, settings.block_angle) for r in records]
    parts = [part for part in parts if part.time.size]
    if sum(part.time.size for part in parts) < _FEWEST_BLOCKS:
        raise UnusableError("too little of the turning force is left; a full turn at a steady force is needed at least")
    blocks = joined(with_levels(parts, settings.level_tolerance))
    blocks = blocks.at(blocks.level >= 0)
    if not blocks.planes or blocks.time.size < _FEWEST_BLOCKS:
        raise UnusableError("at no force the log holds half a turn or more; hold each force for a full turn at least")
    blocks = blocks.at(np.arange(blocks.time.size) % (1 + blocks.time.size // _MOST_BLOCKS) == 0)
    near = max(settings.near, 3 * blocks.motion_noise)
    orbit = _top_orbit(blocks)
    stated = _stated(records, settings)
    count = count_pads(orbit, sorted({*CANDIDATES, *([stated] if stated else [])}), near)
    return Pads(blocks, near, stated, count, _pad_angles(records, stated, count, orbit))


def fit_bearing(records: Sequence[Record], settings: BumpSettings) -> BearingFit:
    """Fit all logs of one bearing; raises as `pads_of`."""
    pads = pads_of(records, settings)
    blocks, angles, near = pads.blocks, pads.angles, pads.near
    levels = range(len(blocks.levels))
    polygons = {
        plane: {k: fit_polygon(d[blocks.level == k], angles, near) for k in levels}
        for plane, d in blocks.planes.items()
    }
    absent = _absent({plane: by_level[max(by_level)] for plane, by_level in polygons.items()})
    contact, absent, reason = _contact(blocks, polygons, absent)
    return BearingFit(
        tuple(records), angles, pads.stated, pads.count, blocks, polygons, absent, contact, reason, pads.contradiction
    )


def _top_orbit(blocks: Blocks) -> np.ndarray:
    d = next(iter(blocks.planes.values()))
    return np.asarray(d[blocks.level == blocks.level.max()])


def _stated(records: Sequence[Record], settings: BumpSettings) -> int | None:
    if settings.n_pads is not None:
        return settings.n_pads
    numbers = {}
    for record in records:
        angles = pad_angles_of(record.recording)
        number = n_pads_of(record.recording) or (None if angles is None else int(angles.size))
        if number is not None:
            numbers[number] = record.recording.run
    if len(numbers) > 1:
        told = ", ".join(f"'{run}' {n}" for n, run in numbers.items())
        raise InputError(
            f"the runs state different numbers of pads for one bearing ({told}): name 'bearing' in each run."
        )
    return next(iter(numbers), None)


def _pad_angles(records: Sequence[Record], stated: int | None, count: Count, orbit: np.ndarray) -> np.ndarray:
    """Return the directions of the pads: as stated unless the orbit clearly shows another number."""
    if count.found is None:
        raise UnusableError(
            "the orbit is no polygon of 3 to 7 sides: the force may be too small to press the shaft against the pads, or "
            "there is oil in the bearing. Raise the force until the orbit no longer changes"
        )
    if stated is None:
        return pad_directions(count.found)
    times, share = _CONTRADICTED
    misfit, best = count.misfits[stated], min(count.misfits.values())
    if (
        count.found not in (None, stated)
        and misfit > times * best
        and misfit > share * float(np.ptp(orbit, axis=0).max())
    ):
        return pad_directions(count.found)
    told = [pad_angles_of(record.recording) for record in records]
    fitting = [angles for angles in told if angles is not None and angles.size == stated]
    return fitting[0] if fitting else pad_directions(stated)


def _absent(top: dict[int, Polygon]) -> tuple[int, ...]:
    """Return the sides that the stator never reached: the polygon found there is cut short by the orbit's edge.

    Of a pair that is too narrow, it is the one on the wrong side of the probes' zero.
    """
    found: set[int] = set()
    for polygon in top.values():
        typical = float(np.quantile(polygon.clearances, 0.75))
        if polygon.clearances.min() >= _TOUCHED * typical:
            continue
        short = [i for i in range(polygon.n_pads) if polygon.sides[i] < 0.3 * float(np.max(polygon.sides))]
        found |= set(short or np.flatnonzero(polygon.clearances < _TOUCHED * typical).tolist())
    return tuple(sorted(found))


def _contact(
    blocks: Blocks, polygons: dict[int, dict[int, Polygon]], absent: tuple[int, ...]
) -> tuple[ContactFit | None, tuple[int, ...], str]:
    """Fit the contact law; again without sides that turn out never to be pressed."""
    n_pads = next(iter(next(iter(polygons.values())).values())).n_pads
    for _ in range(3):
        if n_pads - len(absent) < 2:
            return None, absent, "fewer than two sides were touched"
        found, reason = _best_fit(blocks, polygons, absent)
        if found is None:
            return None, absent, reason
        pressed = np.min([touching[found.kept].sum(axis=0) for touching in found.touching.values()], axis=0)
        never = tuple(i for i in range(n_pads) if pressed[i] < _FEWEST_PRESSED)
        if set(never) <= set(absent):
            return found, absent, ""
        absent = tuple(sorted({*absent, *never}))
    return found, absent, ""


def _best_fit(
    blocks: Blocks, polygons: dict[int, dict[int, Polygon]], absent: tuple[int, ...]
) -> tuple[ContactFit | None, str]:
    """Fit from one start, or where a side is missing with and without a pull away from it; more blocks win."""
    tried: list[ContactFit] = []
    reason = "too few blocks obey it"
    for pull in (0.0, 1.5) if absent else (0.0,):
        try:
            found = fit_contact(blocks, first_guess(blocks, polygons, absent, pull), absent)
        except (InputError, np.linalg.LinAlgError) as error:
            reason = str(error).rstrip(".")
            continue
        if math.isfinite(found.chi2_reduced) and found.kept.mean() > _LEAST_KEPT:
            tried.append(found)
    best = max(tried, key=lambda found: int(found.kept.sum()), default=None)
    return best, f"the contact law could not be fitted: {reason}"
