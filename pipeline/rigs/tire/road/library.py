"""What the flex sensor of a calibrated tire shows by load and longitudinal force: contacts solved once, by harmonics.

The ring is that of the bench's findings. Lag and film are put on later, exactly and per order: they follow the speed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.pvdf import high_pass
from pipeline.rigs.tire.ring.ring import Ring, Shape
from pipeline.rigs.tire.ring.sensor import Sensor, averaging, highest_order, lagging

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

# Names that a covariance may hold: natural logarithms of fields of the ring, the tread and the sensor.
UNKNOWNS = ("EI", "p0b", "kw", "kv", "kt", "eta", "c", "lag", "length", "R")
_LEAST_TOP = 6500.0
_LOADS = 26
# Orders above this are no curvature that a sensor on a belt shows, and 1024 bins hold twice as many.
_MOST_ORDERS = 256


@dataclass(frozen=True)
class FilmResponse:
    """A PVDF film against the flex sensor, as the bench found it (T8).

    Attributes
    ----------
    gain
        G', V/ohm.
    length, time_constant, offset_angle
        L_p, m; tau_p, s; dtheta, rad.
    """

    gain: float
    length: float
    time_constant: float
    offset_angle: float


@dataclass(frozen=True, eq=False)
class CalibratedTire:
    """A tire and its sensor as a bench found them. SI.

    Attributes
    ----------
    ring, kt, Ro, sensor
        Ring, tread springs (N/m^2), free radius (m), flex sensor and divider; R0 is a start value only.
    least_load, most_load
        Loads (N) between which the bench calibrated.
    names, covariance
        Covariance of the natural logarithms of these out of `UNKNOWNS`, shape (p, p); None: not known.
    film
        The film, None where there is none.
    """

    ring: Ring
    kt: float
    Ro: float
    sensor: Sensor
    least_load: float
    most_load: float
    names: tuple[str, ...] = ()
    covariance: np.ndarray | None = None
    film: FilmResponse | None = None

    def scaled(self, name: str, factor: float) -> CalibratedTire:
        """Return the tire with one of `UNKNOWNS` multiplied by a factor."""
        if name in ("EI", "p0b", "kw", "kv", "eta", "R"):
            return replace(self, ring=replace(self.ring, **{name: factor * getattr(self.ring, name)}))
        if name in ("c", "lag", "length"):
            return replace(self, sensor=replace(self.sensor, **{name: factor * getattr(self.sensor, name)}))
        if name == "kt":
            return replace(self, kt=factor * self.kt)
        raise ValueError(f"'{name}' is none of {', '.join(UNKNOWNS)}")


@dataclass(frozen=True, eq=False)
class WaveformLibrary:
    """Harmonics of R2 - R0 without lag, by load: those at Fx = 0 and their derivative by Fx.

    Attributes
    ----------
    tire
        What was pressed.
    top
        Highest load, N.
    peaks
        Loads (N) and R2 peaks (ohm) without lag, for start values, shape (m,) each.
    """

    tire: CalibratedTire
    top: float
    peaks: tuple[np.ndarray, np.ndarray]
    _still: PPoly = field(repr=False)
    _pushed: PPoly = field(repr=False)
    _slope: PPoly = field(repr=False)
    _slope_pushed: PPoly = field(repr=False)

    @property
    def orders(self) -> np.ndarray:
        """The orders n = 0..N, shape (N+1,)."""
        return np.arange(self._still.c.shape[2], dtype=float)

    def harmonics(self, load: np.ndarray, force: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return R2 - R0 and its derivatives by Fz and Fx, ohm and ohm/N, complex, shape (m, N+1) each.

        Parameters
        ----------
        load, force, speed
            Fz and Fx (N) and rotation (rad/s) of each revolution, shape (m,). Loads are held within the library.
        """
        Fz = np.clip(load, 0.0, self.top)
        lag = lagging(np.outer(speed, self.orders), 1.0, self.tire.sensor.lag)
        pushed = self._pushed(Fz)
        still = self._still(Fz) + force[:, None] * pushed
        slope = self._slope(Fz) + force[:, None] * self._slope_pushed(Fz)
        return lag * still, lag * slope, lag * pushed

    def film_factor(self, speed: np.ndarray) -> np.ndarray:
        """Return what turns harmonics of R2 into those of the film's voltage, V/ohm, shape (m, N+1).

        Both lengths average: near the null of the flex sensor the factor is cut, no film shows that.
        """
        film, sensor, R = self.tire.film, self.tire.sensor, self.tire.ring.R
        if film is None:
            raise ValueError("this tire has no film")
        n = self.orders
        seen = averaging(n, sensor.length, R)
        with np.errstate(divide="ignore", invalid="ignore"):
            lengths = np.where(np.abs(seen) > 0.1, averaging(n, film.length, R) / seen, 0.0)
        turned = film.gain * lengths * np.exp(1j * n * film.offset_angle)
        rate = np.outer(speed, n)
        return np.asarray(turned * high_pass(rate, 1.0, film.time_constant) / lagging(rate, 1.0, sensor.lag))


def library(tire: CalibratedTire, most: float | None = None) -> WaveformLibrary:
    """Return the library of a tire for loads from 0 to `most` (N): by default 2.2 times the bench's, at least 6500 N.

    Fx enters linearly, by a central difference of +-0.1 Fz: friction is spread like the pressure.
    """
    from scipy.interpolate import CubicSpline

    top = max(_LEAST_TOP, 2.2 * tire.most_load) if most is None else most
    loads = np.linspace(0.0, top, _LOADS + 1)
    # Half way more nodes where the contact grows fastest.
    loads = np.concatenate([loads[:1], [0.5 * loads[1]], loads[1:]])
    count = min(highest_order(tire.sensor.length, tire.ring.R), _MOST_ORDERS)
    seen = tire.sensor.c * averaging(np.arange(count + 1), tire.sensor.length, tire.ring.R)
    still, pushed = np.zeros((2, loads.size, count + 1), dtype=complex)
    sprung, start = compliance(tire.ring), None
    for i, Fz in enumerate(loads[1:], start=1):
        contact = pressed(sprung, tire.kt, tire.Ro, float(Fz), start=start)
        start, push = contact.active, 0.1 * float(Fz)
        driven, braked = (
            pressed(sprung, tire.kt, tire.Ro, float(Fz), Fx, start).shape.harmonics for Fx in (push, -push)
        )
        still[i] = seen * contact.shape.harmonics[: count + 1]
        pushed[i] = seen * (driven - braked)[: count + 1] / (2.0 * push)
    pushed[0] = pushed[1]
    by_load, by_force = CubicSpline(loads, still), CubicSpline(loads, pushed)
    peaks = np.array([Shape(row).on_grid(1024)[1].max() for row in still])
    return WaveformLibrary(
        tire, float(top), (loads, peaks), by_load, by_force, by_load.derivative(), by_force.derivative()
    )
