"""What the runs of one tire gave together. The steps that fill it stand in modules of their own; `together` orders them."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.calibration import Calibration
from pipeline.rigs.tire.bench.outliers import Odd
from pipeline.rigs.tire.bench.pvdf_fit import FilmFit
from pipeline.rigs.tire.bench.ring_fit import RingFit
from pipeline.rigs.tire.bench.ring_verdict import RingVerdict
from pipeline.rigs.tire.bench.same_tire import Tire
from pipeline.rigs.tire.bench.speed_line import SpeedLine, expected_radius
from pipeline.rigs.tire.passages.features import Features

# Rolling radius by the tire's size instead of a measured one: so uncertain (relative).
BY_SIZE_U = 0.01
_USUAL_RADIUS = 0.317


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
    clock_u
        Relative doubt of the transmitter's clock, by the tire's size or the bench's clock; 0 where there is none.
    odd, misfit
        Runs off the curve of the others; those that the others' ring does not fit.
    doubted
        Runs whose R2 is not believed, with the reason: nothing in ohm is told of them.
    circuit_doubt
        Why no R2 of the campaign is believed; empty where it is.
    unbonded
        Runs in which flex sensor and PVDF contradict each other.
    mirrored
        Runs of which it is not known which dip leads, with the reason.
    """

    tire: Tire
    runs: list[BenchRun]
    left_out: dict[str, str] = field(default_factory=dict)
    findings: list[QualityFinding] = field(default_factory=list)
    size_doubted: bool = False
    clock_u: float = 0.0
    line: SpeedLine | None = None
    no_line: str = ""
    radius: float = _USUAL_RADIUS
    radius_u: float = BY_SIZE_U
    features: dict[str, Features] = field(default_factory=dict)
    odd: list[Odd] = field(default_factory=list)
    doubted: dict[str, str] = field(default_factory=dict)
    circuit_doubt: str = ""
    mirrored: dict[str, str] = field(default_factory=dict)
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
    unbonded: set[str] = field(default_factory=set)
    no_film: str = ""

    @property
    def free_radius_u(self) -> float:
        """Relative standard uncertainty of `free_radius`."""
        if self.tire.free_radius is not None and not self.size_doubted:
            return self.tire.free_radius_u
        return max(BY_SIZE_U, self.radius_u if self.size_doubted else 0.0)

    @property
    def free_radius(self) -> float:
        """Ro, m: by the tire's size where that is believed, else what a tire of this rolling radius has."""
        if self.tire.free_radius is not None and not self.size_doubted:
            return self.tire.free_radius
        return 0.5 * self.radius / expected_radius(1.0)

    def run(self, name: str) -> BenchRun:
        """Return a run by name."""
        return next(run for run in self.runs if run.name == name)
