"""Runs of a campaign sorted by what they are, with what was noticed on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pipeline.recording import Level, QualityFinding
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.pads import Pads
from pipeline.rigs.mre.shear.cycles import Wander
from pipeline.rigs.mre.shear.operating import Held
from pipeline.rigs.mre.shear.samples import Series
from pipeline.signals.periodicity import Excitation


@dataclass(frozen=True, eq=False)
class UsableRun:
    """A run with what it may be used for; `loop` and `wander` are there for steady loops only.

    Of a steady loop `series` is what can be shown, some hundred samples less their drift; all samples are in the loop.
    `rate` is in samples a second, `begins` is when its log begins, in seconds since 1970, where the log has a date; `told_lag` how late
    the force is (s), where the run tells it.
    """

    run: str
    series: Series
    excitation: Excitation
    current: float | None
    preload: float | None
    pads: Pads | None
    sequence: float | None
    test: str
    label_frequency: float | None = None
    loop: Loop | None = None
    wander: Wander | None = None
    begins: float | None = None
    told_lag: float | None = None
    rate: float = math.nan


@dataclass
class SortedRuns:
    """Runs by what they are, those left out with reasons, and findings on the way.

    `faulty` are loops among those left out: they can be shown, not used. `backward` are loops that run the
    wrong way round, before all runs together tell why. `held` tells of every
    run where it was held.
    """

    loops: list[UsableRun] = field(default_factory=list)
    half_cycles: list[UsableRun] = field(default_factory=list)
    records: list[UsableRun] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    faulty: list[UsableRun] = field(default_factory=list)
    backward: list[UsableRun] = field(default_factory=list)
    quality: list[QualityFinding] = field(default_factory=list)
    held: list[Held] = field(default_factory=list)

    def add(self, other: SortedRuns) -> None:
        """Take in what was found of other runs."""
        for kind in ("loops", "half_cycles", "records", "faulty", "backward", "quality", "held"):
            getattr(self, kind).extend(getattr(other, kind))
        self.left_out.update(other.left_out)

    def say(self, level: Level, run: str | None, message: str, channel: str | None = None) -> None:
        """Add a finding."""
        self.quality.append(QualityFinding(level, message, run, channel))

    def leave_out(self, run: str, reason: str, channel: str | None = None) -> None:
        """Leave a run out, and say so."""
        self.left_out[run] = reason
        self.say("error", run, f"left out: {reason}", channel)

    def set_aside(self, run: str, reason: str, channel: str | None = None) -> None:
        """Leave out a run that was held for usable."""
        self.loops = [usable for usable in self.loops if usable.run != run]
        self.records = [usable for usable in self.records if usable.run != run]
        self.leave_out(run, reason, channel)

    @property
    def usable(self) -> list[UsableRun]:
        """All runs that yield something."""
        return [*self.loops, *self.half_cycles, *self.records]
