"""What the bench leaves uncertain, as one covariance of the numbers that the forward model of a drive is made of.

Type A of the ring fit, type B that all bench runs share, and the drive's own pressure; how they act on the load is in
`systematic`.
"""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.road.bench_tire import LENGTH, RADIUS
from pipeline.rigs.tire.road.handed_over import RoadTire
from pipeline.rigs.tire.road.library import UNKNOWNS, CalibratedTire, FilmResponse

# The bench's names -> the model's.
_NAMES = {
    "bending_stiffness": "EI", "belt_width": "p0b", "foundation_radial": "kw", "foundation_tangential": "kv",
    "tread_stiffness": "kt", "loss_factor": "eta", "sensor_gain": "c", "sensor_lag": "lag", LENGTH: "length",
    RADIUS: "R",
}  # fmt: skip
# The source of uncertainty that is the rolling radius itself.
_BELT = "belt_radius"
_WORDS = {
    "load_gain": "load cell of the bench", "pressure": "pressure on the bench", _BELT: "rolling radius",
    "sensor_length": "length of the sensor", "outer_radius": "free radius of the tire",
}  # fmt: skip


def calibrated(tire: RoadTire) -> CalibratedTire:
    """Return the tire for the forward model, with all that is uncertain of it."""
    least, most = tire.bench.loads
    return CalibratedTire(
        ring=tire.ring,
        kt=tire.tread,
        Ro=tire.Ro,
        sensor=tire.sensor,
        least_load=least,
        most_load=most,
        names=UNKNOWNS,
        covariance=covariance(tire),
        film=FilmResponse(*tire.bench.film) if tire.bench.film is not None else None,
    )


def covariance(tire: RoadTire) -> np.ndarray:
    """Return the covariance of the logarithms of `UNKNOWNS`, shape (k, k)."""
    return np.asarray(sum(parts(tire).values()))


def parts(tire: RoadTire) -> dict[str, np.ndarray]:
    """Return the same covariance by what it comes from, shape (k, k) each."""
    bench, k = tire.bench, len(UNKNOWNS)
    rows = [UNKNOWNS.index(_NAMES[name]) for name in bench.names]
    radius, tension = UNKNOWNS.index(_NAMES[RADIUS]), UNKNOWNS.index("p0b")
    fitted, own = np.zeros((k, k)), np.zeros((k, k))
    fitted[np.ix_(rows, rows)] = bench.covariance
    if not any(source.source == _BELT for source in bench.type_b):
        fitted[radius, radius] = (bench.std_errors.get(RADIUS, 0.0) / bench.values[RADIUS]) ** 2
    own[tension, tension] = tire.pressure_u**2
    found = {"ring fit of the bench": fitted}
    for source in bench.type_b:
        moved = np.zeros(k)
        moved[rows] = source.sensitivity
        moved[radius] = float(source.source == _BELT)
        found[_WORDS.get(source.source, source.source)] = source.relative**2 * np.outer(moved, moved)
    return {**found, "pressure of the drive": own}
