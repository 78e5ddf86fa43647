"""Which runs are of one tire with one pair of sensors, and what is known of it beside the signals."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import NOMINAL_U, BenchRun
from pipeline.rigs.tire.bench.declaration import BenchSettings
from pipeline.rigs.tire.bench.reference import LOAD
from pipeline.rigs.tire.conditions import CONVERTER, DIVIDER
from pipeline.rigs.tire.tire_size import tire_size

# Pressures that differ by more are two (relative); temperatures that differ by more change the gain (K).
_PRESSURE, _WARMER = 0.03, 10.0
_USUAL_LENGTH, _USUAL_PRESSURE = 0.05, 2.2e5
_LENGTHS = {"sensor_length_flex": "the flex sensor", "sensor_length_pvdf": "the PVDF film"}


@dataclass(frozen=True)
class Tire:
    """What the conditions say of tire and sensors. SI; None where no run says it.

    Attributes
    ----------
    free_radius
        Ro, half the nominal diameter of `size`.
    sensor_length, film_length, belt_width
        As stated.
    sensor_length_u, pressure_u, load_gain_u, free_radius_u
        Relative standard uncertainties, of the runs or of the settings; that of the loads is larger where they were only set.
    pressure
        Pressure of most of the runs.
    assumed
        What is taken of divider and converter because not all runs state it.
    """

    size: str | None = None
    free_radius: float | None = None
    sensor_length: float | None = None
    film_length: float | None = None
    belt_width: float | None = None
    pressure: float | None = None
    sensor_length_u: float = 0.04
    pressure_u: float = 0.01
    load_gain_u: float = 0.005
    free_radius_u: float = 0.005
    assumed: Mapping[str, float] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """Length of the flex sensor, or a usual one where it is not stated (for the highest order only), m."""
        return self.sensor_length if self.sensor_length is not None else _USUAL_LENGTH


@dataclass
class OneTire:
    """The tire, the runs that are of it, and why others are not."""

    tire: Tire
    runs: list[BenchRun] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    findings: list[QualityFinding] = field(default_factory=list)


def one_tire(runs: Sequence[BenchRun], settings: BenchSettings) -> OneTire:
    """Take the runs of the tire that most of them are of; the first wins where two are even."""
    radii: dict[str, float | None] = {}
    left_out: dict[str, str] = {}
    findings: list[QualityFinding] = []
    kept = list(runs)
    for run in runs:
        radii[run.name], problem = _free_radius(run)
        if problem:
            findings.append(QualityFinding("warning", problem, run.name))
    kept, others, radius = _alike(kept, {run.name: radii[run.name] for run in kept}, 2e-3)
    for run in others:
        left_out[run.name] = (
            f"its tire is {run.conditions.get('tire_size')}, most of the campaign's runs are of another. One campaign is one tire: put this "
            "run into a campaign of its own"
        )
    lengths: dict[str, float | None] = {}
    for name, what in _LENGTHS.items():
        kept, others, lengths[name] = _alike(kept, {run.name: run.told(name) for run in kept}, 1e-3)
        for run in others:
            left_out[run.name] = (
                f"its {name} is {1e3 * (run.told(name) or 0.0):.4g} mm, that of most runs {1e3 * (lengths[name] or 0.0):.4g} mm: {what} is another "
                "one, or the condition is wrong"
            )
    pressure = _usual([run.told("inflation_pressure") for run in kept], _PRESSURE)
    size = next((str(run.conditions["tire_size"]) for run in kept if radii[run.name] is not None), None)
    widths = [width for run in kept if (width := run.told("belt_width")) is not None]
    any_set = any(LOAD not in run.reference.means and math.isfinite(run.load) for run in kept)
    tire = Tire(
        size=size,
        free_radius=radius,
        sensor_length=lengths["sensor_length_flex"],
        film_length=lengths["sensor_length_pvdf"],
        belt_width=float(np.median(widths)) if widths else None,
        pressure=pressure,
        sensor_length_u=_most(kept, "sensor_length_u", settings.sensor_length_u),
        pressure_u=_most(kept, "pressure_u", settings.pressure_u),
        load_gain_u=max(_most(kept, "load_gain_u", settings.load_gain_u), NOMINAL_U if any_set else 0.0),
        free_radius_u=settings.free_radius_u,
        assumed={name: value for run in kept for name, value in run.device.assumed.items()},
    )
    findings += _unstated(tire, kept)
    findings += _circuit(tire, kept)
    findings += _pressures(tire, kept)
    findings += _temperatures(kept)
    return OneTire(tire, kept, left_out, findings)


def pressure_of(run: BenchRun, tire: Tire) -> float:
    """Return the inflation pressure of a run, Pa: its own, that of the others, or a usual one."""
    return run.told("inflation_pressure") or tire.pressure or _USUAL_PRESSURE


def at_usual_pressure(run: BenchRun, tire: Tire) -> bool:
    """Tell whether a run was made at the pressure of most of them."""
    told = run.told("inflation_pressure")
    return told is None or tire.pressure is None or abs(told / tire.pressure - 1.0) <= _PRESSURE


def _free_radius(run: BenchRun) -> tuple[float | None, str]:
    if "tire_size" not in run.conditions:
        return None, ""
    try:
        return tire_size(run.conditions["tire_size"], "tire_size").radius, ""
    except InputError as error:
        return None, str(error)


def _usual(values: Sequence[float | None], near: float) -> float | None:
    """Return the value that most have, within a share `near`; None where none is known."""
    known = [value for value in values if value is not None]
    if not known:
        return None
    votes = Counter({value: sum(abs(other / value - 1.0) <= near for other in known) for value in dict.fromkeys(known)})
    return votes.most_common(1)[0][0]


def _alike(
    runs: Sequence[BenchRun], values: dict[str, float | None], near: float
) -> tuple[list[BenchRun], list[BenchRun], float | None]:
    """Part the runs by whether they have the usual value or none; return it as well."""
    usual = _usual(list(values.values()), near)
    same: list[BenchRun] = []
    others: list[BenchRun] = []
    for run in runs:
        value = values[run.name]
        (same if value is None or usual is None or abs(value / usual - 1.0) <= near else others).append(run)
    return same, others, usual


def _most(runs: Sequence[BenchRun], name: str, otherwise: float) -> float:
    """Return the largest stated uncertainty, or the setting's where no run states one."""
    return max((value for run in runs if (value := run.told(name)) is not None), default=otherwise)


def _unstated(tire: Tire, runs: Sequence[BenchRun]) -> list[QualityFinding]:
    """Tell of conditions that no run states and without which numbers cannot be had."""
    lacks = {
        "tire_size": (tire.free_radius, "the free radius is then taken as the rolling radius over 0.971"),
        "sensor_length_flex": (tire.sensor_length, "it trades with the contact length: without it there is no ring fit"),
        "inflation_pressure": (tire.pressure, "it decides how the peak grows with load: belt_width is not told, and the calibration holds for an "
                                              "unknown pressure"),
    }  # fmt: skip
    return [
        QualityFinding(
            "warning", f"{name} is stated in no run: {what}. Give it in the recipe, in runs.csv or in the log"
        )
        for name, (value, what) in lacks.items()
        if value is None and runs
    ]


def _circuit(tire: Tire, runs: Sequence[BenchRun]) -> list[QualityFinding]:
    """Tell what is taken of divider and converter because runs do not state it."""
    if not tire.assumed:
        return []
    lacking = [run.name for run in runs if run.device.assumed]
    where = (
        "no run" if len(lacking) == len(runs) else f"{listing(lacking, 4)} {'does' if len(lacking) == 1 else 'do'} not"
    )
    verb = "states" if where == "no run" else "state"
    what = []
    if any(name in DIVIDER for name in tire.assumed):
        what.append("every number in ohm, and the PVDF's gain over the flex sensor")
    if any(name in CONVERTER for name in tire.assumed):
        what.append("every voltage")
    text = (
        f"{in_words(tire.assumed)} {were(tire.assumed)} taken, as {where} {verb} {'it' if len(tire.assumed) == 1 else 'them'}: {' and '.join(what)} rests on that. "
        "Give the rig's own values in the recipe, in runs.csv or in the log"
    )
    return [QualityFinding("warning", text)]


def in_words(assumed: Mapping[str, float]) -> str:
    """Return values of the circuit by name, with their units."""
    return listing([f"{name} {_VALUES[name].format(value)}" for name, value in assumed.items()], 6)


_VALUES = {"supply_voltage": "{:g} V", "divider_resistance": "{:g} ohm", "adc_reference": "{:g} V", "adc_bits": "{:g}"}


def were(names: Collection[str]) -> str:
    """Return the verb of one or several."""
    return "was" if len(names) == 1 else "were"


def _pressures(tire: Tire, runs: Sequence[BenchRun]) -> list[QualityFinding]:
    others = [run for run in runs if not at_usual_pressure(run, tire)]
    if not others or tire.pressure is None:
        return []
    told = listing([f"{run.name} ({1e-3 * (run.told('inflation_pressure') or 0.0):.0f} kPa)" for run in others], 6)
    text = (
        f"inflation pressure changed between the runs: the calibration is made at p0 = {1e-3 * tire.pressure:.0f} kPa, {told} does not enter it. "
        "10 % less pressure reads as about 7 % more load; the ring fit takes each run at its own pressure"
    )
    return [QualityFinding("warning", text)]


def _temperatures(runs: Sequence[BenchRun]) -> list[QualityFinding]:
    known = {run.name: value for run in runs if (value := run.told("liner_temperature")) is not None}
    if len(known) < 2 or max(known.values()) - min(known.values()) <= _WARMER:
        return []
    low, high = min(known, key=lambda n: known[n]), max(known, key=lambda n: known[n])
    text = (
        f"liner temperature runs from {known[low] - 273.15:.0f} degC ({low}) to {known[high] - 273.15:.0f} degC ({high}): R0's drift is removed "
        "by each revolution's mean, a drift of the gain and of the pressure cannot be. Measure all loads at one temperature"
    )
    return [QualityFinding("warning", text)]
