"""One run from its recording to all that the campaign needs of it, small and without samples: what is done on many cores at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, overload

from pipeline.errors import InputError
from pipeline.recording import Condition, QualityFinding, Recording
from pipeline.rigs.gearbox.faults import errors_of, input_faults
from pipeline.rigs.gearbox.outcome.sampled import drawn_of, work_of
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_faults import run_faults, speed_faults
from pipeline.rigs.gearbox.run_numbers import RunNumbers, numbers_of
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers, vibration_of

if TYPE_CHECKING:
    import pandas as pd

SECONDS = 0.4
"""About what one run costs one core, s."""


@dataclass(frozen=True, eq=False)
class Told:
    """What one run told.

    Attributes
    ----------
    begins
        When its log began, s since 1970; None where it does not say.
    numbers, vibration
        Without samples; `numbers` is None where the run is left out.
    left_out
        Why it is.
    quality
        What was noticed.
    work
        Work of its stages, see `sampled.work_of`.
    drawn
        What is drawn of it, see `sampled.drawn_of`; empty where it is not.
    """

    run: str
    conditions: Mapping[str, Condition]
    begins: float | None = None
    numbers: RunNumbers | None = None
    vibration: VibrationNumbers = field(default_factory=VibrationNumbers)
    left_out: str = ""
    quality: tuple[QualityFinding, ...] = ()
    work: Sequence[Mapping[str, Any]] = ()
    drawn: Mapping[str, pd.DataFrame] = field(default_factory=dict)


def told_by(recording: Recording, drawn: bool) -> Told:
    """Find the numbers of one run, or why it has none; with what is drawn of it where `drawn`."""
    run, conditions, begins = recording.run, dict(recording.conditions), recording.provenance.begins
    try:
        record = record_of(recording)
    except InputError as error:
        found = QualityFinding("error", f"left out: {error}", run)
        return Told(run, conditions, begins, left_out=str(error), quality=(found,))
    noticed = [*record.findings, *input_faults(record)]
    numbers: RunNumbers | None = None
    vibration = VibrationNumbers()
    if not errors_of(noticed):
        numbers = numbers_of(record)
        noticed += speed_faults(numbers)
    if numbers is not None and not errors_of(noticed):
        vibration = vibration_of(numbers)
        noticed += run_faults(numbers, vibration)
    errors = errors_of(noticed)
    if errors or numbers is None:
        return Told(run, conditions, begins, left_out=errors[0], quality=tuple(noticed))
    tables = drawn_of(numbers, vibration) if drawn else {}
    return Told(
        run,
        conditions,
        begins,
        numbers.emptied(),
        vibration.emptied(),
        quality=tuple(noticed),
        work=work_of(numbers),
        drawn=tables,
    )


class Tasks(Sequence[tuple[Recording, bool]]):
    """Arguments of `told_by` for many runs, each recording opened when it is its turn: one at a time is in memory."""

    def __init__(self, recordings: Sequence[Recording], drawn: bool) -> None:
        self._recordings, self._drawn = recordings, drawn

    @overload
    def __getitem__(self, index: int) -> tuple[Recording, bool]: ...
    @overload
    def __getitem__(self, index: slice) -> Tasks: ...
    def __getitem__(self, index: int | slice) -> tuple[Recording, bool] | Tasks:
        if isinstance(index, slice):
            return Tasks(self._recordings[index], self._drawn)
        return self._recordings[index], self._drawn

    def __iter__(self) -> Iterator[tuple[Recording, bool]]:
        return ((recording, self._drawn) for recording in self._recordings)

    def __len__(self) -> int:
        return len(self._recordings)
