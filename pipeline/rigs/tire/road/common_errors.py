"""What is uncertain of all revolutions of a drive alike: the bench, the pressure, the sensor's gain, the ring's shape."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.tire.road.carried_errors import parts
from pipeline.rigs.tire.road.handed_over import Carried
from pipeline.rigs.tire.road.library import WaveformLibrary
from pipeline.rigs.tire.road.revolution_fit import Forces
from pipeline.rigs.tire.road.shape_causes import ShapeCauses, shape_causes
from pipeline.rigs.tire.road.shape_error import ShapeError
from pipeline.rigs.tire.road.systematic import systematic


@dataclass(frozen=True, eq=False)
class Common:
    """What is uncertain of all revolutions of a drive alike.

    Attributes
    ----------
    load_sd, force_sd
        Standard uncertainties, N, shape (m,) each.
    gain_to_load
        What 1 % more gain of the sensor makes of the load at its median, N.
    sources
        By source: standard uncertainty of load and of force at the median of the drive, N.
    """

    load_sd: np.ndarray
    force_sd: np.ndarray
    gain_to_load: float
    sources: Mapping[str, tuple[float, float]]


def causes_of(known: WaveformLibrary | None, forces: Forces, shape: ShapeError | None) -> ShapeCauses:
    """Return what may be behind a shape that is not that of the bench's ring, at the middle of the drive."""
    fits = forces.fits
    if known is None or shape is None or not fits.any():
        return ShapeCauses(())
    load, speed, R0 = (float(np.median(v[fits])) for v in (forces.load, forces.speed, forces.resistance))
    return shape_causes(known, shape, load, speed, R0)


def common_errors(
    held: Carried,
    known: WaveformLibrary | None,
    forces: Forces,
    off: np.ndarray,
    shape: ShapeError | None,
    causes: ShapeCauses,
) -> Common:
    """Return what the bench leaves uncertain of all revolutions alike."""
    if known is None or held.tire is None or not forces.fits.any():
        nothing = np.full(len(forces), math.nan)
        return Common(nothing, nothing, math.nan, {})
    errors = systematic(known, forces.speed[forces.fits], float(np.median(forces.resistance[forces.fits])))
    state = (forces.load, forces.force, forces.speed)
    middle = tuple(np.array([np.median(values[forces.fits])]) for values in state)
    share = held.tire.correction_u
    sources = {"correction for another pressure": tuple(share * abs(float(value[0])) for value in middle[:2])}
    for source, covariance in parts(held.tire).items():
        part = replace(errors, covariance=covariance)
        sources[source] = float(part.load_sd(*middle)[0]), float(part.force_sd(*middle)[0])
    per_percent = abs(float(errors.gain_to_load(float(middle[0][0]))))
    by_gain = 100.0 * per_percent * np.abs(off) * forces.load / float(middle[0][0])
    if np.median(np.abs(off[forces.fits])) > 0.0:
        typical = float(np.median(np.abs(off[forces.fits])))
        sources["gain against the film"] = 100.0 * per_percent * typical, typical * abs(float(middle[1][0]))
    by_shape, aside = (shape.load_sd, shape.force_sd) if shape is not None else (0.0, 0.0)
    typical_load = float(middle[0][0])
    by_shape = max(by_shape, causes.load_sd / typical_load)
    aside = max(aside, causes.force_sd / typical_load)
    sources["shape that is not the ring's"] = by_shape * typical_load, aside * typical_load
    return Common(
        np.sqrt(errors.load_sd(*state) ** 2 + (share * forces.load) ** 2 + by_gain**2 + (by_shape * forces.load) ** 2),
        np.sqrt(
            errors.force_sd(*state) ** 2
            + (share * forces.force) ** 2
            + (off * forces.force) ** 2
            + (aside * forces.load) ** 2
        ),
        per_percent,
        {source: (load, force) for source, (load, force) in sources.items() if max(load, force) > 0.0},
    )
