"""Findings of a bench campaign that were handed over: which one, and what of it holds for a drive.

A drive states its own tire, pressure, sensor and divider; where these are not the bench's, the message says what is
corrected and what is withheld.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Condition, QualityFinding
from pipeline.rigs.tire.ring.ring import Ring
from pipeline.rigs.tire.ring.sensor import Sensor
from pipeline.rigs.tire.road.bench_tire import LENGTH, RADIUS, BenchTire, bench_tire, lacking
from pipeline.rigs.tire.tire_size import TireSize, tire_size

# Rolling circumference over the nominal diameter (tire.md, 3.5), and how far tires are from it (1 sd).
_CIRCUMFERENCE, _CIRCUMFERENCE_U = 3.05, 0.01
# Pressures that differ by less are the same; by more than the second the message is a warning, by more than the last
# the ring is not carried so far.
_SAME_PRESSURE, _OTHER_PRESSURE, _FAR_PRESSURE = 0.01, 0.05, 0.30
# d ln Fz/d ln p0 at the same peak (0.59/0.89, tire.md 3.5), and the share of the correction that is not known: with
# the pressure the foundation stiffens too, at most in proportion (0.09/0.59), evenly distributed.
LOAD_OVER_PRESSURE, _FOUNDATION = 0.59 / 0.89, 0.09 / 0.59 / math.sqrt(3.0)
_SAME_LENGTH = 0.02
_SAME_DIVIDER = 0.02
_SAME_SIZE = 0.003
_NO_BENCH = (
    "no bench campaign was handed over: without the tire's ring and the sensor's gain a peak tells no load. Identify "
    "tire.bench with this tire and name it under 'uses' in the recipe, or hand it over with --with."
)


@dataclass(frozen=True)
class Chosen:
    """The bench that is used, or why there is none, and what was noticed of what was handed over."""

    bench: BenchTire | None
    reason: str
    findings: tuple[QualityFinding, ...] = ()


@dataclass(frozen=True, eq=False)
class RoadTire:
    """The tire and its sensor as they are in one drive.

    Attributes
    ----------
    ring, tread, Ro, sensor
        For the forward model; the sensor's R0 is unknown (0) here, each revolution tells its own.
    pressure_ratio, pressure_u
        Pressure over the bench's, and what is uncertain of it in this drive (relative standard uncertainty).
    correction_u
        What the correction for another pressure leaves uncertain of the load, relative.
    """

    bench: BenchTire
    ring: Ring
    tread: float
    Ro: float
    sensor: Sensor
    pressure_ratio: float
    pressure_u: float
    correction_u: float


@dataclass(frozen=True, eq=False)
class Radius:
    """Effective rolling radius of a drive, m, with its standard error, and where it comes from; NaN where unknown."""

    value: float
    std_error: float
    source: str


@dataclass(frozen=True, eq=False)
class Carried:
    """What holds for one drive: its tire (None: why not in `reason`), rolling radius, what is to be said."""

    tire: RoadTire | None
    reason: str
    radius: Radius
    findings: tuple[QualityFinding, ...]


def chosen(uses: Mapping[str, Findings]) -> Chosen:
    """Return the bench campaign to use: the first of `uses` that gives a whole tire."""
    notes: list[QualityFinding] = []
    benches = {name: findings for name, findings in uses.items() if findings.experiment == "tire.bench"}
    for name, findings in uses.items():
        if name not in benches:
            why = f"the findings '{name}' ({findings.experiment}) are not used: tire.road makes use of tire.bench only."
            notes.append(QualityFinding("note", why))
    if not benches:
        told = f"what was handed over ({', '.join(uses)}) is no bench campaign, and " if uses else ""
        return Chosen(None, told + _NO_BENCH, tuple(notes))
    reasons = {name: lacking(findings) for name, findings in benches.items()}
    whole = [name for name, reason in reasons.items() if not reason]
    if not whole:
        name, reason = next(iter(reasons.items()))
        told = f"the bench campaign '{name}' gives no tire: {reason}."
        return Chosen(None, told, tuple(notes))
    for name in benches:
        if name != whole[0]:
            other = reasons[name] or f"'{whole[0]}' stands before it"
            notes.append(QualityFinding("note", f"the bench campaign '{name}' is not used: {other}."))
    bench = bench_tire(whole[0], benches[whole[0]])
    if bench.verdict == "warning":
        notes.append(QualityFinding("warning", _doubt(benches[bench.campaign])))
    return Chosen(bench, "", tuple(notes))


def carried(choice: Chosen, run: str, conditions: Mapping[str, Condition]) -> Carried:
    """Return what of the bench holds for a drive.

    Parameters
    ----------
    choice
        The bench that was chosen.
    run, conditions
        The drive's name and what its log states.

    Raises
    ------
    InputError
        If its tire size is none.
    """
    size = tire_size(conditions["tire_size"], f"run '{run}', tire_size") if conditions.get("tire_size") else None
    if choice.bench is None:
        return Carried(None, choice.reason, _nominal(size), ())
    said = _Said(run)
    bench = choice.bench
    bench_size = _size_of(bench)
    other = size is not None and bench_size is not None and abs(size.radius / bench_size.radius - 1.0) > _SAME_SIZE
    if other and size is not None and bench_size is not None:
        said.withhold(
            f"the tire is {conditions['tire_size']}, the bench '{bench.campaign}' tested {bench.size}: ring and sensor of "
            "another tire give no load. Hand over a bench campaign of this tire."
        )
        return Carried(None, said.reason, _nominal(size), tuple(said.findings))
    if size is None:
        told = f"no tire_size is stated; it is taken to be the bench's ({bench.size or 'not stated either'})."
        said.say("note" if bench.size else "warning", told)
    own = size or bench_size
    radius = _radius(bench, own)
    if own is None:
        said.withhold("neither the drive nor the bench states tire_size, which the free radius is taken from.")
        return Carried(None, said.reason, radius, tuple(said.findings))
    _same_sensor(said, bench, conditions)
    _same_divider(said, bench, conditions)
    ratio, uncertain, correction = _pressure(said, bench, conditions)
    if not math.isfinite(radius.value) or RADIUS not in bench.values:
        said.withhold(f"the bench '{bench.campaign}' gives no rolling radius, which the ring is built on.")
    if said.reason:
        return Carried(None, said.reason, radius, tuple(said.findings))
    pressure = ratio * (bench.pressure or math.nan)
    tire = _built(bench, own, pressure, conditions, ratio, uncertain, correction)
    return Carried(tire, "", radius, tuple(said.findings))


def _doubt(bench: Findings) -> str:
    """Say what the bench campaign itself is warned of."""
    told = [q.message if q.run is None else f"run {q.run}: {q.message}" for q in bench.quality if q.level == "warning"]
    told = told or [text for text in bench.reasons if "synthetic rig" not in text][-1:] or ["see its report"]
    more = f" ({len(told) - 1} more)" if len(told) > 1 else ""
    return f"the bench campaign '{bench.campaign}' itself carries a warning: {told[0].rstrip('.')}{more}."


class _Said:
    """What was said on the way; the first reason to withhold the forces stands."""

    def __init__(self, run: str) -> None:
        self.run = run
        self.reason = ""
        self.findings: list[QualityFinding] = []

    def say(self, level: str, message: str) -> None:
        """Say something that changes nothing."""
        assert level in ("note", "warning")
        self.findings.append(QualityFinding("note" if level == "note" else "warning", message, self.run))

    def withhold(self, message: str) -> None:
        """Say why there are no forces."""
        self.reason = self.reason or message
        self.findings.append(withheld(self.run, message))


def withheld(run: str, reason: str) -> QualityFinding:
    """Return what is said where load and force of a drive are withheld."""
    return QualityFinding("warning", f"no load and no force: {reason}", run)


def _size_of(bench: BenchTire) -> TireSize | None:
    try:
        return tire_size(bench.size, f"bench '{bench.campaign}', tire_size") if bench.size else None
    except InputError:
        return None


def _nominal(size: TireSize | None) -> Radius:
    if size is None:
        return Radius(math.nan, math.nan, "unknown: neither a bench campaign nor tire_size tells it")
    value = _CIRCUMFERENCE * size.diameter / (2.0 * math.pi)
    return Radius(value, _CIRCUMFERENCE_U * value, "nominal: 3.05 times the tire's diameter is one revolution")


def _radius(bench: BenchTire, size: TireSize | None) -> Radius:
    if RADIUS not in bench.values:
        return _nominal(size)
    return Radius(bench.values[RADIUS], bench.std_errors.get(RADIUS, 0.0), f"bench campaign '{bench.campaign}'")


def number_of(conditions: Mapping[str, Condition], name: str) -> float | None:
    """Return a condition that is a number, else None."""
    value = conditions.get(name)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _same_sensor(said: _Said, bench: BenchTire, conditions: Mapping[str, Condition]) -> None:
    own, theirs = number_of(conditions, "sensor_length_flex"), bench.values.get(LENGTH) or None
    if theirs is None:
        said.withhold(f"the bench '{bench.campaign}' does not tell the length of its flex sensor (sensor_length_flex).")
    elif own is not None and abs(own / theirs - 1.0) > _SAME_LENGTH:
        said.withhold(
            f"the flex sensor is {1e3 * own:.3g} mm long, the bench's {1e3 * theirs:.3g} mm: it is another sensor, whose gain "
            "the bench did not measure. State the right sensor_length_flex, or hand over a bench campaign with this sensor."
        )


def _same_divider(said: _Said, bench: BenchTire, conditions: Mapping[str, Condition]) -> None:
    for name, theirs, unit, words in (
        ("divider_resistance", bench.divider, "ohm", "resistor R1 of the divider"),
        ("supply_voltage", bench.supply, "V", "supply of the divider"),
    ):
        own = number_of(conditions, name)
        if own is not None and theirs is not None and abs(own / theirs - 1.0) > _SAME_DIVIDER:
            said.say(
                "note",
                f"the {words} is {own:.4g} {unit} in this drive and {theirs:.4g} {unit} on the bench '{bench.campaign}'; each is "
                "used for its own log, the sensor's gain is carried over in ohm.",
            )


def _pressure(said: _Said, bench: BenchTire, conditions: Mapping[str, Condition]) -> tuple[float, float, float]:
    """Return the pressure over the bench's, its own and the correction's relative uncertainty."""
    own = number_of(conditions, "inflation_pressure")
    uncertain = number_of(conditions, "pressure_u")
    uncertain = 0.01 if uncertain is None else uncertain
    if bench.pressure is None:
        said.withhold(
            f"the bench '{bench.campaign}' does not state inflation_pressure: the belt's tension, and with it the load, is unknown."
        )
        return 1.0, uncertain, 0.0
    if own is None:
        said.say(
            "warning",
            f"inflation_pressure is not stated; the bench's {_bar(bench.pressure)} is taken. A tire with 10 % less pressure reads "
            "7 % more load: measure and state it.",
        )
        return 1.0, max(uncertain, 0.05), 0.0
    ratio = own / bench.pressure
    off = ratio - 1.0
    if abs(off) <= _SAME_PRESSURE:
        return ratio, uncertain, 0.0
    read = -100.0 * LOAD_OVER_PRESSURE * off
    told = f"the calibration was made at p0 = {_bar(bench.pressure)}, now p0 = {_bar(own)} ({100 * off:+.0f} %)"
    if abs(off) > _FAR_PRESSURE:
        said.withhold(
            f"{told}: too far for the bench's ring to be carried over (uncorrected the load would read about {read:+.0f} %). Calibrate at "
            "this pressure, or mend the pressure that is stated."
        )
        return ratio, uncertain, 0.0
    said.say(
        "warning" if abs(off) > _OTHER_PRESSURE else "note",
        f"{told}; uncorrected the load would read about {read:+.0f} %, more at high loads. It is corrected by the ring's tension, which leaves "
        f"{100 * _FOUNDATION * LOAD_OVER_PRESSURE * abs(off):.1f} % uncertain (the foundation changes with the pressure too).",
    )
    return ratio, uncertain, _FOUNDATION * LOAD_OVER_PRESSURE * abs(off)


def _bar(pascal: float) -> str:
    return f"{1e-5 * pascal:.3g} bar"


def _built(
    bench: BenchTire,
    size: TireSize,
    pressure: float,
    conditions: Mapping[str, Condition],
    ratio: float,
    pressure_u: float,
    correction_u: float,
) -> RoadTire:
    v = bench.values
    ring = Ring(
        R=v[RADIUS],
        EI=v["bending_stiffness"],
        p0b=pressure * v["belt_width"],
        kw=v["foundation_radial"],
        kv=v["foundation_tangential"],
        eta=v["loss_factor"],
    )
    sensor = Sensor(
        c=v["sensor_gain"],
        R0=0.0,
        length=v[LENGTH],
        lag=v["sensor_lag"],
        VIN=number_of(conditions, "supply_voltage") or bench.supply or 3.3,
        R1=number_of(conditions, "divider_resistance") or bench.divider or 1e4,
    )
    return RoadTire(bench, ring, v["tread_stiffness"], size.radius, sensor, ratio, pressure_u, correction_u)
