"""What a repair of time stamps changed, in numbers that can be added up over parts of a log, and in words.

How stamps are repaired is in `stamps`, part by part of a long log in `stamp_windows`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

from pipeline.errors import counted
from pipeline.recording import QualityFinding


class Change(Protocol):
    """One kind of change to the stamps of a part of a log."""

    def joined(self, later: Self) -> Self:
        """Return the change of this part and of a later one together."""

    def told(self, where: str) -> QualityFinding:
        """Say what was changed; `where` names file and channel."""


@dataclass(frozen=True)
class RowsSorted:
    """Rows that came late were put in their place: how many, by how many rows and how much time at most; the first fall."""

    rows: int
    furthest: int
    late: float
    first: tuple[float, float]
    place: str

    def joined(self, later: RowsSorted) -> RowsSorted:
        """Return both together."""
        return replace(
            self,
            rows=self.rows + later.rows,
            furthest=max(self.furthest, later.furthest),
            late=max(self.late, later.late),
        )

    def told(self, where: str) -> QualityFinding:
        """Say it."""
        return QualityFinding(
            "note",
            f"{where}: rows stand out of order, first from {self.first[0]:.9g} to {self.first[1]:.9g} in "
            f"{self.place}; {counted(self.rows, 'row')} sorted by time, moved by up to "
            f"{counted(self.furthest, 'row')} ({self.late:.4g}). Sorted, they are as evenly spaced as the others; none is lost.",
        )


@dataclass(frozen=True)
class RowsDropped:
    """Rows were dropped where time steps backward: falls, rows lost, the first fall; `again`: all were logged before."""

    falls: int
    lost: int
    first: tuple[float, float]
    place: str
    again: bool

    def joined(self, later: RowsDropped) -> RowsDropped:
        """Return both together."""
        both = self.again and later.again
        return replace(self, falls=self.falls + later.falls, lost=self.lost + later.lost, again=both)

    @property
    def step(self) -> str:
        """The first fall in words, and how many there are."""
        times = "" if self.falls == 1 else f"{self.falls} times, first "
        return f"{times}from {self.first[0]:.9g} to {self.first[1]:.9g} in {self.place}"

    def told(self, where: str) -> QualityFinding:
        """Say it."""
        message = f"{where}: time steps backward {self.step}; {counted(self.lost, 'row')} dropped for it."
        if self.again and self.lost > 1:
            message = (
                f"{where}: {counted(self.lost, 'row')} bear times that were logged before, {self.step}: a block was written "
                "twice; it is counted once."
            )
        return QualityFinding("warning", message)


@dataclass(frozen=True)
class RepeatsDropped:
    """Rows with the time of the row before were dropped: how many of so many steps, the first."""

    rows: int
    steps: int
    first: float
    place: str

    def joined(self, later: RepeatsDropped) -> RepeatsDropped:
        """Return both together."""
        return replace(self, rows=self.rows + later.rows, steps=self.steps + later.steps)

    def told(self, where: str) -> QualityFinding:
        """Say it."""
        part = self.rows / self.steps
        return QualityFinding(
            "note" if part <= 1e-3 else "warning",
            f"{where}: {counted(self.rows, 'row')} with the time of the row before (repeated stamps, "
            f"{100 * part:.2g} %, first {self.place} at {self.first:.9g}), dropped.",
        )


@dataclass(frozen=True)
class CoarseSpread:
    """Rows that share a coarse stamp were spread: steps that repeat a stamp, of so many."""

    repeated: int
    steps: int

    def joined(self, later: CoarseSpread) -> CoarseSpread:
        """Return both together."""
        return CoarseSpread(self.repeated + later.repeated, self.steps + later.steps)

    def told(self, where: str) -> QualityFinding:
        """Say it."""
        return QualityFinding(
            "warning",
            f"{where}: time stamps are coarse, {1.0 / (1.0 - self.repeated / self.steps):.3g} rows share one on average; "
            "the samples are spread evenly between the stamps.",
        )


@dataclass(frozen=True)
class Other:
    """A change of the whole log, such as a counter that wrapped or a clock that started again: of parts there is none."""

    finding: QualityFinding

    def joined(self, later: Other) -> Other:
        """Two of them are never of one log."""
        raise AssertionError(f"two changes of one whole log: {self.finding.message} {later.finding.message}")

    def told(self, where: str) -> QualityFinding:
        """Say it."""
        del where
        return self.finding
