"""One drive, from its log to the numbers of every revolution: in blocks, so that memory does not follow its length."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tire.passages.device import Device, device_of
from pipeline.rigs.tire.passages.passage_faults import Course, course_of, passage_findings
from pipeline.rigs.tire.passages.revolutions import Revolutions, revolutions_of
from pipeline.rigs.tire.road.against_vehicle import compared_with, direction_of
from pipeline.rigs.tire.road.asymmetry import Asymmetry, AsymmetrySum
from pipeline.rigs.tire.road.carried_errors import calibrated
from pipeline.rigs.tire.road.common_errors import Common, causes_of, common_errors
from pipeline.rigs.tire.road.debonding import Bonding, Step, debonding
from pipeline.rigs.tire.road.declaration import RoadSettings
from pipeline.rigs.tire.road.event_centre import VERTICAL, Event
from pipeline.rigs.tire.road.events import events
from pipeline.rigs.tire.road.gain_off import gain_off, without_lost_gain
from pipeline.rigs.tire.road.handed_over import Carried, Chosen, RoadTire, carried, withheld
from pipeline.rigs.tire.road.height_ratio import LEAST_STEP, height_ratio
from pipeline.rigs.tire.road.library import WaveformLibrary, library
from pipeline.rigs.tire.road.neighbour_scatter import with_scatter
from pipeline.rigs.tire.road.noise_spectrum import NoiseSpectrum
from pipeline.rigs.tire.road.record import References, references_of
from pipeline.rigs.tire.road.reference import Comparison
from pipeline.rigs.tire.road.revolution_fit import (
    OTHER_GAIN,
    REASONS,
    Forces,
    RevolutionFit,
    between_centres,
    joined,
)
from pipeline.rigs.tire.road.rotation_only import without_forces
from pipeline.rigs.tire.road.shape_causes import ShapeCauses
from pipeline.rigs.tire.road.shape_error import ShapeError
from pipeline.rigs.tire.road.steady_steps import in_step
from pipeline.rigs.tire.road.tracking import Track, track

_BENCH = "bench"
Progress = Callable[[float], None]
# The flex sensor came off where it answers less than this share of before.
_OFF = 0.9
# R0 that differs from the bench's by more is no matter of temperature.
_OTHER_RESISTANCE = 0.10
_FEW = 0.2
# A reference that seems so many seconds off is not compared.
_APART = 0.1
# So many revolutions tell a slope.
_FEWEST = 20
REVERSED = (
    "driving makes the trailing dip deeper, not the leading one, or the wheel seems to brake at constant speed: rotation sense or sign of "
    "Fx reversed (a sensor or tire mounted the other way, a log that runs backward, or a reference with the other sign)"
)


@dataclass(frozen=True, eq=False)
class RunNumbers:
    """What one drive tells; arrays per revolution have shape (m,).

    Attributes
    ----------
    carried
        What of the bench holds for it; without a tire load and force are NaN.
    forces, speed, speed_se
        Each revolution for itself; peripheral speed Re Omega, m/s.
    common, speed_sd
        What the bench leaves uncertain of load and force, and of the speed (m/s).
    tracks
        Filtered ``load``, ``force`` (N) and ``rotation`` (rad/s).
    ratio, bonding
        The flex sensor's answer over the film's, and whether it steps; None without a film.
    comparison, direction
        With the reference channels, None where there are none; "right", "wrong" or "untold" by them or by the wheel's own
        acceleration.
    asymmetry, noise, shape_error
        Dips of some revolutions, spectrum of the noise, what the ring leaves of the mean waveform.
    causes
        What may be behind that.
    """

    run: str
    device: Device
    course: Course
    carried: Carried
    forces: Forces
    speed: np.ndarray
    speed_se: np.ndarray
    common: Common
    speed_sd: np.ndarray
    tracks: Mapping[str, Track]
    events: tuple[Event, ...]
    ratio: np.ndarray
    bonding: Bonding | None
    references: References
    comparison: Comparison | None
    direction: str
    asymmetry: Asymmetry
    noise: NoiseSpectrum | None
    shape_error: ShapeError | None
    causes: ShapeCauses
    findings: tuple[QualityFinding, ...]

    @property
    def usable(self) -> np.ndarray:
        """Which revolutions have the numbers that this drive gives, bool, shape (m,)."""
        return self.forces.fits if self.has_forces else np.isfinite(self.forces.speed)

    @property
    def passages_lost(self) -> int:
        """Passages that no sample shows or that were dropped."""
        return int(np.count_nonzero(~self.usable))

    @property
    def bandwidth(self) -> tuple[float, float]:
        """Least and most of half the revolutions in a second, Hz: what changes faster is not seen."""
        rate = self.forces.speed[np.isfinite(self.forces.speed)] / (4.0 * math.pi)
        return (float(rate.min()), float(rate.max())) if rate.size else (math.nan, math.nan)

    @property
    def came_off(self) -> Step | None:
        """When the flex sensor came off: load and force are withheld from then on."""
        return _came_off(self.bonding)

    @property
    def reversed(self) -> bool:
        """Whether forward was taken for backward: the longitudinal force is withheld then."""
        return self.direction == "wrong"

    @property
    def clocks_unsure(self) -> bool:
        """Whether the reference seems to run on another clock and was not shifted: nothing is compared then."""
        compared = self.comparison
        return compared is not None and not compared.offset_applied and abs(compared.offset) > _APART

    @property
    def dip_slope(self) -> tuple[float, float] | None:
        """Slope of the dips' asymmetry over Fx, ohm/N, and its standard error; None where the force is not known."""
        reference = self.comparison.force if self.comparison is not None else None
        force = (self.forces.force if reference is None else reference)[self.asymmetry.index]
        known = np.isfinite(force)
        if known.sum() < _FEWEST or np.ptp(force[known]) == 0.0:
            return None
        x, y = force[known] - force[known].mean(), self.asymmetry.value[known]
        slope = float(x @ (y - y.mean()) / (x @ x))
        left = y - y.mean() - slope * x
        return slope, math.sqrt(float(left @ left) / (x.size - 2) / float(x @ x))

    @property
    def has_forces(self) -> bool:
        """Whether a bench gives load and force."""
        return self.carried.tire is not None


class Libraries:
    """The libraries of a campaign: drives of one tire at one pressure share theirs."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], WaveformLibrary] = {}

    def of(self, tire: RoadTire) -> WaveformLibrary:
        """Return the library of a tire."""
        key = (tire.ring, tire.tread, tire.Ro, tire.sensor)
        if key not in self._known:
            self._known[key] = library(calibrated(tire))
        return self._known[key]


def numbers_of(
    recording: Recording, choice: Chosen, settings: RoadSettings, libraries: Libraries, progress: Progress
) -> RunNumbers:
    """Return the numbers of a drive.

    Parameters
    ----------
    recording
        Its device table is read block by block, once.
    choice
        The bench that was chosen.
    settings, libraries
        Of the campaign.
    progress
        Is told the share of the log that is done.

    Raises
    ------
    InputError
        If it has no flex sensor or no passage, is a run of the bench, or its tire size is none.
    """
    if str(recording.conditions.get("bench_or_road", "")).strip().lower() == _BENCH:
        raise InputError(
            f"run '{recording.run}' says bench_or_road: bench; it belongs to tire.bench. Put it into a campaign of that experiment."
        )
    device = device_of(recording)
    held = carried(choice, recording.run, recording.conditions)
    known = libraries.of(held.tire) if held.tire is not None else None
    forces, course, asymmetry, fit = _passed(device, known, progress)
    forces = _before_the_break(in_step(forces), course)
    ratio = _ratio(forces, held, course)
    bonding = _bonding(forces, ratio, held)
    came_off = _came_off(bonding)
    if came_off is not None:
        forces = replace(forces, fits=forces.fits & (forces.time < came_off.time))
    off = gain_off(forces)
    forces = without_lost_gain(forces, off)
    if reason := _other_resistance(held, forces) or _other_gain(forces):
        held = replace(held, tire=None, reason=reason)
        held = replace(held, findings=(*held.findings, withheld(recording.run, reason)))
        forces = replace(forces, fits=np.zeros(len(forces), dtype=bool))
    forces = between_centres(with_scatter(forces))
    references = references_of(recording)
    shape = fit.shape_error if fit is not None else None
    causes = causes_of(known, forces, shape)
    common = common_errors(held, known, forces, off, shape, causes)
    radius = held.radius
    compared = compared_with(forces, references, held, device)
    turning = rotation_known(forces)
    return RunNumbers(
        run=recording.run,
        device=device,
        course=course,
        carried=held,
        forces=forces,
        speed=np.where(turning, radius.value * forces.speed, math.nan),
        speed_se=np.where(turning, radius.value * forces.speed_se, math.nan),
        common=common,
        speed_sd=radius.std_error * forces.speed,
        tracks=_tracks(forces, held, settings),
        events=_without_steps(_events(forces, held, settings, device.span), bonding),
        ratio=ratio,
        bonding=bonding,
        references=references,
        comparison=compared,
        direction=direction_of(forces, compared, radius.value),
        asymmetry=asymmetry,
        noise=fit.noise if fit is not None else None,
        shape_error=shape,
        causes=causes,
        findings=(*held.findings, *references.findings),
    )


def _passed(
    device: Device, known: WaveformLibrary | None, progress: Progress
) -> tuple[Forces, Course, Asymmetry, RevolutionFit | None]:
    """Go through the log once."""
    fit = RevolutionFit(known) if known is not None else None
    parts: list[Forces] = []
    dips = AsymmetrySum(known)
    start, end = device.span

    def passing() -> Iterator[Revolutions]:
        for block in revolutions_of(device):
            found = fit.add(block) if fit is not None else without_forces(block)
            if found is not None:
                parts.append(found)
            dips.add(block)
            if block.times.size:
                progress((float(block.times[-1]) - start) / max(end - start, 1e-9))
            yield block

    course = course_of(passing())
    rest = fit.close() if fit is not None else None
    if rest is not None:
        parts.append(rest)
    progress(1.0)
    if not parts:
        raise InputError(_no_passage(device, course))
    forces = joined(parts)
    return forces, course, dips.close(forces), fit


def _no_passage(device: Device, course: Course) -> str:
    """Say why there is no revolution at all."""
    told = [
        q.message
        for level in ("error", "warning", "note")
        for q in passage_findings(device, course, None)
        if q.level == level
    ]
    why = f" {told[0]}" if told else ""
    return f"no passage of the sensor through the contact patch is in this log: nothing can be told of the drive.{why}"


def rotation_known(forces: Forces) -> np.ndarray:
    """Return where the rotation is known, bool, shape (m,): a waveform out of shape was cut at the wrong angles."""
    cut = forces.reason == REASONS.index("shape is not that of the ring")
    few = cut.mean() < _FEW if cut.size else False  # where all are out of shape it is the tire
    return np.asarray(np.isfinite(forces.speed) & np.isfinite(forces.speed_se) & ~(cut & few))


def _tracks(forces: Forces, held: Carried, settings: RoadSettings) -> dict[str, Track]:
    found = {}
    known = rotation_known(forces)
    if known.any():
        found["rotation"] = track(
            forces.time, forces.speed, forces.speed_se, q=settings.rotation_walk, tune=settings.tune_walk, usable=known
        )
    if held.tire is not None and forces.fits.any():
        for name, values, se in (
            ("load", forces.load, forces.load_se),
            ("force", forces.force, forces.force_se),
        ):
            found[name] = track(
                forces.time, values, se, q=settings.force_walk, tune=settings.tune_walk, usable=forces.fits
            )
    return found


def _events(forces: Forces, held: Carried, settings: RoadSettings, span: tuple[float, float]) -> tuple[Event, ...]:
    if held.tire is None or not forces.fits.any():
        return ()
    found = events(
        forces.time,
        forces.speed,
        forces.load,
        forces.load_se,
        forces.force,
        forces.force_se,
        usable=forces.fits,
        deviation=settings.event_sd,
        longitudinal=settings.longitudinal_sd,
        window=settings.event_median,
        span=span,
    )
    return tuple(found)


def _before_the_break(forces: Forces, course: Course) -> Forces:
    """Return the forces without the revolutions that reach into the time when the sensor is open or shorted, or follow it."""
    if not course.open:
        return forces
    with np.errstate(invalid="ignore"):
        whole = forces.time + math.pi / forces.speed < course.open[0][0]
    return replace(forces, fits=forces.fits & whole)


def _without_steps(found: tuple[Event, ...], bonding: Bonding | None) -> tuple[Event, ...]:
    """Return the events without those that are a step of the sensor's own gain: the load only seems to change."""
    steps = bonding.steps if bonding is not None else ()
    return tuple(
        event
        for event in found
        if event.kind != VERTICAL or not any(event.first - 1.0 < step.time < event.last + 1.0 for step in steps)
    )


def _ratio(forces: Forces, held: Carried, course: Course) -> np.ndarray:
    """Return the flex sensor's answer over the film's, shape (m,); without forces by the heights of both alone."""
    if held.tire is not None and held.tire.bench.film is not None:
        return forces.gain_ratio
    if course.film_amplitude is None:
        return np.full(len(forces), math.nan)
    return height_ratio(course.amplitude, course.film_amplitude, course.speed)


def _bonding(forces: Forces, ratio: np.ndarray, held: Carried) -> Bonding | None:
    if not np.isfinite(ratio).any():
        return None
    if held.tire is not None and held.tire.bench.film is not None:
        return debonding(forces.time, ratio)
    return debonding(forces.time, ratio, least=LEAST_STEP)


def _came_off(bonding: Bonding | None) -> Step | None:
    """Return the first step by which the flex sensor answers clearly less than the film."""
    return next((step for step in bonding.steps if step.share < _OFF), None) if bonding is not None else None


def _other_resistance(held: Carried, forces: Forces) -> str:
    """Say that R0 is far from the bench's, so that no gain of it holds; '' where it is not."""
    known = forces.resistance[np.isfinite(forces.resistance)]
    bench = held.tire.bench.resistance if held.tire is not None else None
    if bench is None or not known.size or abs(float(np.median(known)) / bench - 1.0) < _OTHER_RESISTANCE:
        return ""
    R0 = float(np.median(known))
    return (
        f"R0 is {R0:.5g} ohm here and {bench:.5g} ohm on the bench ({100 * (R0 / bench - 1.0):+.1f} %): another resistor R1, supply or "
        "sensor than stated, and the bench's gain in ohm does not hold. Check divider_resistance, supply_voltage and adc_reference."
    )


def _other_gain(forces: Forces) -> str:
    """Say that the flex sensor has lost its gain all along; '' where it has not."""
    lost = forces.reason == OTHER_GAIN
    if forces.fits.any() or not lost.any():
        return ""
    share = float(np.median(forces.gain_ratio[lost]))
    return (
        f"the flex sensor answers {100.0 * (share - 1.0):+.0f} % against the PVDF film compared with the bench: its gain, or its bond, "
        "is not that of the bench. Glue it anew and calibrate it again."
    )
