"""What a run of the load exchange is cut into: stages, events with their errors, and what is off the protocol.

Data only; `segmentation` finds the stages, `events` the instants.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from pipeline.recording import Level

StageName = Literal[
    "standstill",
    "startup",
    "fos",
    "fos_loaded",
    "brake",
    "sos",
    "stall",
    "release",
    "fos_after",
    "rundown",
]
EventName = Literal["startup", "brake_onset", "unlock", "sos_start", "sos_end", "relock", "rundown"]


@dataclass(frozen=True)
class Stage:
    """A stretch of one state: from `start` to `end`, s on the clock of the torques."""

    name: StageName
    start: float
    end: float

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.end - self.start


@dataclass(frozen=True)
class EventTime:
    """When something happened: `time` and its standard error `sd`, s.

    `lag` is that of the drive where it was found with the event, s, and `lag_sd` its standard error; NaN where not.
    """

    time: float
    sd: float
    lag: float = math.nan
    lag_sd: float = math.nan


@dataclass(frozen=True)
class Problem:
    """Something off the protocol: when (s), what, and how bad."""

    span: tuple[float, float]
    message: str
    level: Level = "warning"


@dataclass(frozen=True)
class Cycle:
    """One brake cycle: its events, and its stages as (start, end) in s.

    `fos` is the steady running before the brake, also where that is the `fos_after` of the cycle before.
    """

    events: Mapping[EventName, EventTime]
    stages: Mapping[StageName, tuple[float, float]]


@dataclass(frozen=True)
class Segmentation:
    """The stages of one run in the order of time, and what they leave open.

    Attributes
    ----------
    stages
        Neighbours share their boundary; a stretch that fits no stage is left out and told in `problems`.
    events
        Of the first brake cycle, by name; an event that did not happen is missing.
    complete
        Whether the sequence standstill, startup, fos, brake, sos, release, fos_after is there without
        anything that is off the protocol.
    problems
        What is off the protocol or uncertain, with times.
    speed_nominal
        Median speed of the output shaft while it turns steadily, rad/s; NaN where it never does.
    cycles
        Every brake cycle, in the order of time.
    gaps
        Where the encoder told nothing or lost counts, s: the angle has a break across them.
    """

    stages: tuple[Stage, ...]
    events: Mapping[EventName, EventTime]
    complete: bool
    problems: tuple[Problem, ...] = ()
    speed_nominal: float = float("nan")
    cycles: tuple[Cycle, ...] = ()
    gaps: tuple[tuple[float, float], ...] = ()

    @property
    def names(self) -> tuple[StageName, ...]:
        """The sequence of stages."""
        return tuple(stage.name for stage in self.stages)

    @property
    def free(self) -> tuple[tuple[str, float, float], ...]:
        """Every stretch in which the load turns forward without brake: what begins it, start and end, s.

        `startup` and `release` with the FOS behind them, `steady` where FOS goes on after a load was taken off.
        """
        out = []
        for before, after in pairwise(self.stages):
            if after.name in ("fos", "fos_after") and before.name in ("startup", "release", "fos_loaded"):
                steady = before.name == "fos_loaded"
                start = after.start if steady else before.start
                out.append(("steady" if steady else before.name, start, after.end))
        return tuple(out)

    def all(self, name: StageName) -> tuple[Stage, ...]:
        """Return every stage of that name."""
        return tuple(stage for stage in self.stages if stage.name == name)

    def stage(self, name: StageName) -> Stage | None:
        """Return the first stage of that name, None where there is none."""
        return next(iter(self.all(name)), None)
