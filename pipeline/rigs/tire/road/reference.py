"""Load, force and speed of a drive against the reference channels of the car, revolution by revolution (tire.md, 5.11).

A reference is averaged over the revolution. Speed is the tire's peripheral speed: under driving or braking it is not
the car's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.road.clock_offset import ClockOffset, Pair, clock_offset, correlation
from pipeline.rigs.tire.road.revolution_fit import Forces

_G0 = 9.80665
_FEWEST = 10
_SURE = 5.0
# Revolutions on either side that tell the wheel's acceleration.
_AROUND = 4
# Unit -> what a reference speed in it is of the speed in m/s; None: over the rotation in rad/s instead.
_SPEED_UNITS = {"m/s": 1.0, "km/h": 3.6, "mph": 2.2369, "knots": 1.9438}
_ROTATION_UNITS = {"rad/s": 1.0, "rpm": 30.0 / math.pi, "Hz (turns per second)": 0.5 / math.pi}
_LOAD_UNITS = {"N": 1.0, "kg": 1.0 / _G0, "kN": 1e-3, "lbf": 0.224809}
_NEAR = 0.15
# Range of the reference speed over the tire's that is no slip; correlation from which two signals are the same.
_NOT_SLIP, _ALIKE = 0.15, 0.7


@dataclass(frozen=True, eq=False)
class ReferenceTable:
    """The car's table, on its own clock: time (s, rising) and channels of the same shape, None where there is none.

    Attributes
    ----------
    load, force
        Fz and Fx of this wheel, N.
    speed, acceleration
        Of the car, m/s and m/s^2.
    """

    time: np.ndarray
    load: np.ndarray | None = None
    force: np.ndarray | None = None
    speed: np.ndarray | None = None
    acceleration: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """A drive against its references.

    Attributes
    ----------
    clock
        Offset of the reference's clock.
    load, force, speed
        References over each revolution (N, N, m/s), shape (m,), NaN outside of the table; None without the channel or
        where its unit is another.
    load_rms, load_bias, force_rms, force_bias, speed_rms
        Unfiltered revolutions that fit against them; NaN where there is nothing to compare.
    slip_driving, slip_braking
        Peripheral speed over the car's less 1, medians under |Fx| above a third of its largest; NaN where it never acts.
    direction
        "right", "wrong" (driving deepens the trailing dip) or "untold"; `direction_verdict` in words.
    speed_unit, load_unit
        What the reference looks like; "" where that cannot be told.
    remarks
        Sentences for the reader.
    follows
        Whether the reference speed goes with the rotation: otherwise the tables do not belong together in time, and
        nothing is compared.
    """

    clock: ClockOffset
    load: np.ndarray | None
    force: np.ndarray | None
    speed: np.ndarray | None
    load_rms: float
    load_bias: float
    force_rms: float
    force_bias: float
    speed_rms: float
    slip_driving: float
    slip_braking: float
    n: int
    direction: str
    direction_verdict: str
    speed_unit: str
    load_unit: str
    remarks: tuple[str, ...]
    follows: bool = True

    @property
    def offset(self) -> float:
        """Seconds that are added to the reference's stamps, in the middle of the drive."""
        return self.clock.offset

    @property
    def offset_se(self) -> float:
        """Standard error of `offset`, s."""
        return self.clock.std_error

    @property
    def offset_applied(self) -> bool:
        """Whether the reference was shifted by it."""
        return self.clock.applies

    @property
    def offset_verdict(self) -> str:
        """What stands behind the offset."""
        return self.clock.verdict


def compare(forces: Forces, table: ReferenceTable, Re: float, duration: float) -> Comparison:
    """Return how the revolutions of a drive stand against its references.

    Parameters
    ----------
    forces
        Revolutions of the whole drive; those that do not fit are left out.
    table
        The car's channels.
    Re
        Rolling radius, m.
    duration
        Of the drive, s: clocks are not looked for farther apart than a quarter of it.
    """
    time, turn = forces.time, 2.0 * np.pi / forces.speed
    # T2's rotation is the mean from the passage before to the one behind: twice as long as that of the load.
    over = {
        "load": _averaged(table.time, table.load, turn),
        "force": _averaged(table.time, table.force, turn),
        "acceleration": _averaged(table.time, table.acceleration, turn),
        "speed": _averaged(table.time, table.speed, 2.0 * turn),
    }
    load, force = (np.where(forces.fits, values, np.nan) for values in (forces.load, forces.force))
    clock = clock_offset(time, _pairs(forces, load, force, over), min(10.0, 0.25 * duration))
    at = time - clock.at(time)
    seen = {name: None if found is None else found(at) for name, found in over.items()}
    remarks: list[str] = []
    follows = _goes_with(seen["speed"], forces.speed) or any(
        one is not None and correlation(values, one) > _ALIKE
        for values, one in ((load, seen["load"]), (force, seen["force"]))
    )
    if not follows:
        seen = dict.fromkeys(seen, None)
        remarks.append(
            "the reference speed does not go with the rotation: the tables of transmitter and vehicle do not belong together in time "
            "(a logger that started again, clocks far apart, another drive?). Nothing is compared with the vehicle's channels."
        )
    speed_unit = _unit(seen["speed"], Re * forces.speed, _SPEED_UNITS)
    if seen["speed"] is not None and speed_unit == "":
        speed_unit = _unit(seen["speed"], forces.speed, _ROTATION_UNITS) or _odd_speed(seen["speed"], Re * forces.speed)
    load_unit = _unit(seen["load"], load, _LOAD_UNITS)
    if load_unit not in ("N", ""):
        remarks.append(
            f"vertical_load looks like {load_unit}, not N: it is not compared. State its unit in the recipe."
        )
    reference_speed = seen["speed"] if speed_unit == "m/s" else None
    reference_load = seen["load"] if load_unit in ("N", "") else None
    reference_force = seen["force"] if load_unit in ("N", "") else None
    direction, told = _direction(force, forces, seen["force"], seen["acceleration"], Re)
    load_rms, load_bias, n = _differences(load, reference_load)
    force_rms, force_bias, _ = _differences(force, reference_force)
    speed_rms, _, _ = _differences(Re * forces.speed, reference_speed)
    driving, braking = _slips(force, Re * forces.speed, reference_speed)
    if direction != "wrong" and (math.isfinite(driving) or math.isfinite(braking)):
        found = [
            f"{100 * s:+.1f} % {what}" for s, what in ((driving, "driving"), (braking, "braking")) if math.isfinite(s)
        ]
        remarks.append(
            f"the tire's peripheral speed against the car's is {' and '.join(found)}: slip, not an error of the rotation."
        )
    return Comparison(
        clock, reference_load, reference_force, reference_speed, load_rms, load_bias, force_rms, force_bias, speed_rms,
        driving, braking, n, direction, told, speed_unit, load_unit, tuple(remarks), follows,
    )  # fmt: skip


def own_direction(forces: Forces, Re: float) -> tuple[str, str]:
    """Return "right", "wrong" or "untold" and a sentence, by the drive alone: Fx has to go with the rotation's change."""
    return _direction(np.where(forces.fits, forces.force, np.nan), forces, None, None, Re)


def _pairs(
    forces: Forces, load: np.ndarray, force: np.ndarray, over: dict[str, Callable[[np.ndarray], np.ndarray] | None]
) -> list[Pair]:
    """Return what tells the clocks' offset; slip goes with the acceleration and would pass for an offset of the speed."""
    pairs = []
    if over["load"] is not None:
        pairs.append(Pair(load, over["load"]))
    if over["force"] is not None:
        pairs.append(Pair(force, over["force"]))
    elif over["acceleration"] is not None:
        pairs.append(Pair(force, over["acceleration"]))
    if over["speed"] is not None and np.isfinite(force).sum() >= _FEWEST:
        pairs.append(Pair(forces.speed, over["speed"], forces.speed * force))
    return pairs


def _averaged(
    time: np.ndarray, values: np.ndarray | None, spans: np.ndarray
) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return a function of moments (s, shape (m,)) that averages a channel over `spans` (s) about them.

    NaN where the span reaches outside of the table or over a hole in it that is longer than the span.
    """
    if values is None:
        return None
    known = np.isfinite(values) & np.isfinite(time)
    t, x = time[known], values[known]
    if t.size < 2:
        return None
    sums = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t))])
    holes = np.diff(t)

    def average(at: np.ndarray) -> np.ndarray:
        half = 0.5 * spans if spans.size == at.size else np.full(at.size, 0.5 * float(np.median(spans)))
        low, high = at - half, at + half
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = (_integral(high, t, x, sums) - _integral(low, t, x, sums)) / (high - low)
        hole = holes[np.clip(np.searchsorted(t, at) - 1, 0, holes.size - 1)]
        inside = (low >= t[0]) & (high <= t[-1]) & (hole < np.maximum(2.0 * half, 3.0 * np.median(holes)))
        return np.asarray(np.where(inside, mean, np.nan))

    return average


def _integral(at: np.ndarray, t: np.ndarray, x: np.ndarray, sums: np.ndarray) -> np.ndarray:
    """Return the integral of a piecewise straight signal from its beginning, shape (m,)."""
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    ahead = at - t[i]
    slope = (x[i + 1] - x[i]) / (t[i + 1] - t[i])
    return np.asarray(sums[i] + ahead * (x[i] + 0.5 * slope * ahead))


def _unit(reference: np.ndarray | None, values: np.ndarray, units: dict[str, float]) -> str:
    """Return the unit in which the reference fits the values; "" where none does or nothing is known."""
    if reference is None:
        return ""
    known = np.isfinite(reference) & np.isfinite(values) & (np.abs(values) > 0.0)
    if np.count_nonzero(known) < _FEWEST:
        return ""
    ratio = float(np.median(reference[known] / values[known]))
    return next((unit for unit, factor in units.items() if abs(ratio / factor - 1.0) < _NEAR), "")


def _goes_with(reference: np.ndarray | None, rotation: np.ndarray) -> bool:
    """Tell whether a reference speed is in one proportion to the rotation, as far as slip allows; True where untold."""
    if reference is None:
        return True
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(reference / rotation)
    logs = logs[np.isfinite(logs)]
    if logs.size < _FEWEST:
        return True
    low, high = np.percentile(logs, [10.0, 90.0])
    return float(high - low) < _NOT_SLIP


def _odd_speed(reference: np.ndarray, values: np.ndarray) -> str:
    known = np.isfinite(reference) & np.isfinite(values)
    if np.count_nonzero(known) < _FEWEST:
        return ""
    return f"{np.median(reference[known] / values[known]):.3g} times m/s"


def _differences(values: np.ndarray, reference: np.ndarray | None) -> tuple[float, float, int]:
    """Return rms and mean of values less reference, and how many there are."""
    if reference is None:
        return math.nan, math.nan, 0
    left = (values - reference)[np.isfinite(values) & np.isfinite(reference)]
    if left.size < _FEWEST:
        return math.nan, math.nan, int(left.size)
    return float(np.sqrt(np.mean(left**2))), float(left.mean()), int(left.size)


def _slips(force: np.ndarray, speed: np.ndarray, reference: np.ndarray | None) -> tuple[float, float]:
    """Return peripheral over reference speed less 1 under driving and under braking, each less that of free rolling."""
    if reference is None:
        return math.nan, math.nan
    with np.errstate(invalid="ignore", divide="ignore"):
        over = np.where(reference > 0.5, speed / reference - 1.0, np.nan)
    known = np.isfinite(over) & np.isfinite(force)
    if np.count_nonzero(known) < _FEWEST:
        return math.nan, math.nan
    limit = np.abs(force[known]).max() / 3.0
    free = known & (np.abs(force) < limit / 2.0)
    level = float(np.median(over[free])) if np.count_nonzero(free) >= _FEWEST else 0.0
    found = []
    for acting in (known & (force > limit), known & (force < -limit)):
        enough = np.count_nonzero(acting) >= _FEWEST and limit > 100.0
        found.append(float(np.median(over[acting])) - level if enough else math.nan)
    return found[0], found[1]


def _direction(
    force: np.ndarray,
    forces: Forces,
    reference: np.ndarray | None,
    acceleration: np.ndarray | None,
    Re: float,
) -> tuple[str, str]:
    """Tell whether Fx has the sign of what drives the car: the reference, its acceleration, or the wheel's own."""
    own = np.full(forces.time.size, np.nan)
    if forces.time.size > 2 * _AROUND:
        change = forces.speed[2 * _AROUND :] - forces.speed[: -2 * _AROUND]
        own[_AROUND:-_AROUND] = Re * change / (forces.time[2 * _AROUND :] - forces.time[: -2 * _AROUND])
    for what, against in (
        ("longitudinal_force", reference),
        ("longitudinal_acceleration", acceleration),
        ("the wheel's own acceleration", own),
    ):
        if against is None:
            continue
        slope, error = _slope(against, force)
        if not math.isfinite(slope) or abs(slope) < _SURE * error:
            continue
        if slope > 0.0:
            return "right", f"Fx goes with {what}"
        return "wrong", f"Fx goes against {what}: driving deepens the trailing dip"
    return "untold", "nothing drives or brakes enough to tell"


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the slope of y over x and its standard error, widened by the autocorrelation of what is left over."""
    from pipeline.estimation.uncertainty import effective_size

    known = np.isfinite(x) & np.isfinite(y)
    if np.count_nonzero(known) < _FEWEST:
        return math.nan, math.nan
    a, b = x[known] - x[known].mean(), y[known] - y[known].mean()
    square = float(a @ a)
    if not square > 0.0:
        return math.nan, math.nan
    slope = float(a @ b) / square
    left = b - slope * a
    widened = left.size / max(effective_size(left), 1.0)
    return slope, math.sqrt(float(left @ left) / max(left.size - 2, 1) * widened / square)
