"""The runs of one tire together: rolling radius, calibration, ring and PVDF. What is told of them is decided elsewhere."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.calibration import Calibration, PeakPoint, calibrate
from pipeline.rigs.tire.bench.load_faults import hysteresis, shared_offset
from pipeline.rigs.tire.bench.outliers import Marks, Odd, odd_runs
from pipeline.rigs.tire.bench.pvdf_fit import FilmFit, FilmRun, fit_film, quiet_error
from pipeline.rigs.tire.bench.reference import HEIGHT, LOAD
from pipeline.rigs.tire.bench.ring_fit import RingFit, fit_ring
from pipeline.rigs.tire.bench.ring_run import Known, RingRun, noise_error
from pipeline.rigs.tire.bench.ring_verdict import RingVerdict, judged
from pipeline.rigs.tire.bench.same_tire import Tire, at_usual_pressure, pressure_of
from pipeline.rigs.tire.bench.speed_faults import odd_radii
from pipeline.rigs.tire.bench.speed_line import SpeedLine, expected_radius, speed_line
from pipeline.rigs.tire.passages.features import Features, features
from pipeline.rigs.tire.ring.sensor import highest_order

# Rolling radius by the tire's size instead of a measured one: so uncertain (relative).
_BY_SIZE_U = 0.01
_USUAL_RADIUS = 0.317
# A tire's rolling radius lies this close to the one by its size (relative).
_BELIEVED = 0.015
# One run in so many may be at fault where the ring does not fit; the others must be more than that.
_MOST_OUT, _FEWEST_LEFT = 4, 3
_ALONE = 4.0
_OPEN = 0.9
# Asymmetry of the dips in standard errors and over the peak, from which on it is told.
_SURE, _LOPSIDED = 5.0, 0.003


@dataclass
class Campaign:
    """Everything that was found, and why what is None could not be. SI.

    Attributes
    ----------
    radius, radius_u
        R of the ring, m, and its relative standard uncertainty; by the line, or by the tire's size.
    features
        Marks of each averaged waveform, by run.
    uncalibrated, unfitted
        Runs that are not in the calibration, in the ring fit, with the reason.
    friction
        By how much the load cell reads too much in each run, N; empty unless loading up and down tells.
    untared
        What is said of a load cell that reads all loads wrong by the same force; no load can be relied on then.
    size_doubted
        Whether the rolling radius contradicts the tire's size.
    odd, misfit
        Runs off the curve of the others; those that the others' ring does not fit.
    """

    tire: Tire
    runs: list[BenchRun]
    left_out: dict[str, str] = field(default_factory=dict)
    findings: list[QualityFinding] = field(default_factory=list)
    size_doubted: bool = False
    line: SpeedLine | None = None
    no_line: str = ""
    radius: float = _USUAL_RADIUS
    radius_u: float = _BY_SIZE_U
    features: dict[str, Features] = field(default_factory=dict)
    odd: list[Odd] = field(default_factory=list)
    calibration: Calibration | None = None
    uncalibrated: dict[str, str] = field(default_factory=dict)
    untared: str = ""
    friction: dict[str, float] = field(default_factory=dict)
    ring: RingFit | None = None
    verdict: RingVerdict | None = None
    no_ring: str = ""
    unfitted: dict[str, str] = field(default_factory=dict)
    misfit: set[str] = field(default_factory=set)
    film: FilmFit | None = None
    no_film: str = ""

    @property
    def free_radius(self) -> float:
        """Ro, m: by the tire's size where that is believed, else what a tire of this rolling radius has."""
        if self.tire.free_radius is not None and not self.size_doubted:
            return self.tire.free_radius
        return 0.5 * self.radius / expected_radius(1.0)

    def run(self, name: str) -> BenchRun:
        """Return a run by name."""
        return next(run for run in self.runs if run.name == name)


def campaign_of(tire: Tire, runs: Sequence[BenchRun]) -> Campaign:
    """Identify what the runs of one tire give together."""
    found = Campaign(tire, list(runs))
    _roll(found)
    order = highest_order(tire.length, found.radius)
    found.features = {run.name: features(run.waveform, found.radius, order) for run in runs}
    _look_for_odd(found)
    odd = {one.run for one in found.odd}
    even = [run for run in found.runs if run.name not in odd]
    offset = shared_offset(even)
    found.untared = offset[0].message if offset else ""
    found.findings += [*offset, *hysteresis(even), *_nominal(found.runs), *_mirrored(found)]
    _calibrate(found)
    _fit_ring(found)
    if found.misfit:
        _calibrate(found)
    _fit_film(found)
    return found


def _roll(found: Campaign) -> None:
    """Fit the speed line, or take the radius by the tire's size."""
    odd = odd_radii(found.runs)
    found.findings += [QualityFinding("warning", text, name, "road_speed") for name, text in odd.items()]
    points = [run.point for run in found.runs if run.name not in odd and math.isfinite(run.point.speed)]
    diameter = 2.0 * found.tire.free_radius if found.tire.free_radius is not None else None
    if points:
        found.line = speed_line(points, diameter)
        value, error = found.line.radius.value, found.line.radius.std_error
        if value is not None and error is not None:
            found.radius, found.radius_u = value, error / value
            _hold_against_size(found)
            return
    if diameter is not None:
        found.radius = expected_radius(diameter)
    reasons = list(dict.fromkeys(run.reference.why_not.get("road_speed", "") for run in found.runs))
    found.no_line = f"no run has a road_speed that can be used ({listing([r for r in reasons if r], 3)})"
    text = (
        f"{found.no_line}: the rolling radius is not told, and the ring fit takes {1e3 * found.radius:.1f} mm by the tire's size (3.05 nominal "
        f"diameters a turn), {100 * _BY_SIZE_U:g} % uncertain. Log the surface speed of drum or belt"
    )
    found.findings.append(QualityFinding("warning", text, None, "road_speed"))


def _hold_against_size(found: Campaign) -> None:
    """Doubt a tire size that the rolling radius contradicts: it sets the scale of the ring."""
    free = found.tire.free_radius
    if free is None or abs(found.radius / expected_radius(2.0 * free) - 1.0) <= _BELIEVED:
        return
    found.size_doubted = True
    text = (
        f"the tire rolls on {1e3 * found.radius:.1f} mm, and {found.tire.size} of free radius {1e3 * free:.1f} mm on about "
        f"{1e3 * expected_radius(2.0 * free):.1f} mm: tire_size or road_speed is wrong. The ring fit takes {1e3 * found.free_radius:.1f} mm as free radius instead. "
        "Read the size off the side wall"
    )
    found.findings.append(QualityFinding("warning", text))


def _look_for_odd(found: Campaign) -> None:
    """Leave out of calibration and ring fit what the other runs contradict."""
    marks = [_marks(run, found.features[run.name]) for run in found.runs if at_usual_pressure(run, found.tire)]
    found.odd = odd_runs(marks)
    for one in found.odd:
        found.uncalibrated[one.run] = found.unfitted[one.run] = one.text
        text = f"{one.text}. The run is in neither calibration nor ring fit"
        found.findings.append(QualityFinding("warning", text, one.run, "flex_code" if one.cause == "sensor" else LOAD))


def _marks(run: BenchRun, marks: Features) -> Marks:
    film = run.waveform.film
    swing = float(np.nanmax(film) - np.nanmin(film)) if film is not None and np.isfinite(film).any() else math.nan
    return Marks(run.name, run.load, run.rotation, marks.value.peak + run.lift, swing, marks.value.deformation)


def _mirrored(found: Campaign) -> list[QualityFinding]:
    """Tell of runs whose dip is deeper behind the patch: a tire's loss makes the one before it deeper in free rolling."""
    rows = []
    for run in found.runs:
        marks = found.features[run.name]
        asymmetry, error = marks.value.asymmetry, marks.asymmetry_error
        if asymmetry < -_SURE * error and asymmetry < -_LOPSIDED * marks.value.peak:
            text = (
                f"rotation sense reversed, or the wheel is driven: the trailing dip is {-asymmetry:.0f} ohm deeper than the leading one, and in free rolling the "
                "loss of the tire makes the leading one deeper. Look at the sense of rotation and the order of time"
            )
            rows.append(QualityFinding("warning", text, run.name))
    return rows


def _nominal(runs: Sequence[BenchRun]) -> list[QualityFinding]:
    """Tell of runs whose load is the one that was set."""
    without = [run for run in runs if LOAD not in run.reference.means]
    if not without:
        return []
    known = [run.name for run in without if math.isfinite(run.load)]
    unknown = [run.name for run in without if not math.isfinite(run.load)]
    found = []
    if known:
        text = f"no vertical_load that can be used in {listing(known, 6)}: nominal_load is taken for it, 2 % uncertain. Log the load cell"
        found.append(QualityFinding("warning", text, None, LOAD))
    if unknown:
        text = (
            f"neither vertical_load nor nominal_load in {listing(unknown, 6)}: these runs serve the rolling radius only. Give nominal_load in "
            "runs.csv, or log the load cell"
        )
        found.append(QualityFinding("warning", text, None, LOAD))
    return found


def _calibrate(found: Campaign) -> None:
    """Regress the peaks of the runs at the usual pressure; those at another speed are left out there."""
    points = []
    ways = [_direction(run.name) for run in found.runs]
    for run, way in zip(found.runs, ways, strict=True):
        if run.name in found.uncalibrated:
            continue
        if not at_usual_pressure(run, found.tire):
            found.uncalibrated[run.name] = "it was made at another inflation pressure"
            continue
        if not math.isfinite(run.level):
            found.uncalibrated[run.name] = "the mean of its revolution is not known, as part of it is not recorded"
            continue
        marks = found.features[run.name]
        whole = run.revolutions.whole
        points.append(
            PeakPoint(
                run.name, run.load, run.load_se, marks.value.peak + run.lift, marks.error.peak, run.nominal_load, run.rotation * found.radius,
                float(np.std(run.revolutions.amplitude[whole])) if whole.sum() > 2 else 0.0, way if min(ways) < 0 else 0,
            )
        )  # fmt: skip
    first = found.runs[0].device
    levels = [run.level for run in found.runs if math.isfinite(run.level)]
    level = float(np.mean(levels)) if levels else first.divider_resistance
    masses = [mass for run in found.runs if (mass := run.told("moving_mass")) is not None]
    found.calibration = calibrate(
        points, level, first.supply_voltage, first.divider_resistance, load_gain_u=found.tire.load_gain_u, mass=masses[0] if masses else None
    )  # fmt: skip
    found.uncalibrated.update(found.calibration.left_out)
    friction = found.calibration.friction
    if (
        friction is not None
        and friction.value is not None
        and friction.ci95 is not None
        and not friction.ci95[0] <= 0.0 <= friction.ci95[1]
    ):
        found.friction = {run.name: way * friction.value for run, way in zip(found.runs, ways, strict=True)}


def _direction(name: str) -> int:
    """Return -1 for a run whose name says that its load was reached from above, else +1."""
    return -1 if re.search(r"(?<![a-z])(down|unload\w*|ab|release)(?![a-z])", name.lower()) else 1


def _fit_ring(found: Campaign) -> None:
    """Fit the ring to all runs with a load, each at its own pressure."""
    tire = found.tire
    if found.untared:
        found.no_ring = found.untared
        return
    if tire.sensor_length is None:
        found.no_ring = "sensor_length_flex is not stated, and it trades with the contact length"
        return
    runs = []
    for run in found.runs:
        if run.name in found.unfitted:
            continue
        if not math.isfinite(run.load) or run.load <= 0.0:
            found.unfitted[run.name] = "its load is not known"
        else:
            runs.append(_ring_run(run, tire, found.friction.get(run.name, 0.0)))
    if not runs:
        found.no_ring = (
            f"no run has a load and a waveform that can be used ({listing(dict.fromkeys(found.unfitted.values()), 3)})"
        )
        return
    known = Known(
        R=found.radius,
        R_u=found.radius_u,
        Ro=found.free_radius,
        sensor_length=tire.sensor_length,
        sensor_length_u=tire.sensor_length_u,
        belt_width=tire.belt_width,
        pressure_u=tire.pressure_u,
        load_gain_u=tire.load_gain_u,
        outer_radius_u=_BY_SIZE_U if found.size_doubted or tire.free_radius is None else tire.free_radius_u,
    )
    try:
        found.ring = fit_ring(runs, known)
    except InputError as error:
        found.no_ring = str(error)
        return
    found.verdict = judged(found.ring)
    if not found.verdict.fits:
        _without_the_worst(found, runs, known)
    found.unfitted.update(found.ring.left_out)


def _without_the_worst(found: Campaign, runs: list[RingRun], known: Known) -> None:
    """Look whether the model fits once a run or two are taken out: then those are at fault and not the model."""
    left, ring = runs, found.ring
    if ring is None or not _stands_alone([run.band_chi2_reduced for run in ring.runs]):
        return
    out: list[str] = []
    while ring is not None and len(out) < max(len(runs) // _MOST_OUT, 1) and len(left) > _FEWEST_LEFT:
        worst = max(ring.runs, key=lambda run: run.band_chi2_reduced).run
        out.append(worst)
        left = [run for run in left if run.run != worst]
        ring = fit_ring(left, known, ring.values)
        verdict = judged(ring)
        if verdict.fits:
            found.ring, found.verdict = ring, verdict
            for name in out:
                text = "the ring that fits all other runs does not fit this one: creep or bond of the sensor, load or pressure are not what is stated"
                found.unfitted[name] = found.uncalibrated[name] = text
                found.misfit.add(name)
                found.findings.append(
                    QualityFinding("warning", f"{text}. The run is in neither ring fit nor calibration", name)
                )
            return


def _stands_alone(misfits: list[float]) -> bool:
    """Tell whether one run fits much worse than the others do."""
    return len(misfits) > _FEWEST_LEFT and max(misfits) > _ALONE * float(np.median(misfits))


def _ring_run(run: BenchRun, tire: Tire, friction: float) -> RingRun:
    height = HEIGHT in run.reference.means
    wave = run.waveform
    # Angles that a gated log holds in some revolutions only are those where noise opened the gate.
    recorded = wave.count > _OPEN * np.median(wave.count[wave.count > 0])
    gated = not math.isfinite(wave.level)
    return RingRun(
        run=run.name,
        theta=wave.theta,
        resistance=np.where(recorded, wave.mean, math.nan) if gated else wave.mean,
        std_error=noise_error(wave.theta, wave.mean, wave.groups, wave.std_error),
        load=run.load - friction,
        load_se=run.load_se,
        rotation=wave.speed,
        pressure=pressure_of(run, tire),
        nominal_load=run.nominal_load,
        nominal_speed=run.nominal_speed,
        hub_height=run.reference.value(HEIGHT) if height else None,
        hub_height_se=run.reference.std_error(HEIGHT) if height else None,
    )


def _fit_film(found: Campaign) -> None:
    """Fit the PVDF's rate model on all runs whose flex sensor is sound."""
    tire = found.tire
    unsound = {one.run for one in found.odd if one.cause == "sensor"} | found.misfit
    runs = [
        FilmRun(
            run.name,
            wave.speed,
            wave.mean,
            noise_error(wave.theta, wave.mean, wave.groups, wave.std_error),
            wave.film,
            quiet_error(wave.film, wave.film_se),
        )
        for run in found.runs
        if (wave := run.waveform).film is not None and wave.film_se is not None and run.name not in unsound
    ]
    if not runs:
        found.no_film = "no run has a PVDF signal that can be used"
        return
    if tire.film_length is None or tire.sensor_length is None:
        found.no_film = "the lengths of both sensors are needed: state sensor_length_flex and sensor_length_pvdf"
        return
    try:
        found.film = _film_of(runs, found)
    except InputError as error:
        found.no_film = str(error)
        return
    worst = max(found.film.runs, key=lambda run: run.nrmse).run
    if found.film.verdict != "bad" or len(found.film.runs) <= _FEWEST_LEFT:
        return
    others = _film_of([run for run in runs if run.run != worst], found)
    if others.verdict != "bad":
        found.film = others
        text = (
            "flex and PVDF contradict each other in this run and in no other: channels swapped, a bond that yields, or the log runs backward. "
            "It does not enter the PVDF check"
        )
        found.findings.append(QualityFinding("warning", text, worst, "pvdf_code"))


def _film_of(runs: list[FilmRun], found: Campaign) -> FilmFit:
    tire = found.tire
    known = found.ring is not None and found.verdict is not None and found.verdict.fits
    values = found.ring.values if found.ring is not None and known else None
    return fit_film(
        runs,
        film_length=tire.film_length or math.nan,
        flex_length=values.sensor_length if values is not None else tire.length,
        R=found.radius,
        flex_lag=values.sensor_lag if values is not None else None,
    )
