"""From a recording to signals by channel name, each on the clock of the source that wrote it (rap.md, sections 1 and 11).

Device, bench and scale have clocks of their own; which is whose, the name of the channel decides. Nothing here joins
them: `alignment` finds how the clocks stand to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Recording


@dataclass(frozen=True)
class Signal:
    """One channel without its missing samples: `time` (n,) in s on its own clock, `values` (n,) in SI."""

    name: str
    time: np.ndarray
    values: np.ndarray

    @cached_property
    def rate(self) -> float:
        """Samples a second, from the median step, Hz; NaN for fewer than two samples."""
        return float(1.0 / np.median(np.diff(self.time))) if self.time.size > 1 else float("nan")


@dataclass(frozen=True)
class Entry:
    """A row of a list of events: moment (s, device's clock) and what was written there."""

    time: float
    text: str


def signal(recording: Recording, name: str) -> Signal | None:
    """Return a numeric channel without missing samples; None where the run lacks it or has no sample of it."""
    if name not in recording:
        return None
    time, values = recording.signal(name)
    if values.dtype.kind not in "fiub":
        return None
    found = np.isfinite(values)
    return Signal(name, time[found], values[found]) if found.any() else None


def needed(recording: Recording, name: str, purpose: str) -> Signal:
    """Return a channel as `signal` does.

    Raises
    ------
    InputError
        If the run lacks it; `purpose` says what it is needed for.
    """
    found = signal(recording, name)
    if found is None:
        has = "no number in" if name in recording else "no channel"
        raise InputError(
            f"run '{recording.run}' has {has} '{name}', which {purpose} needs. Name it in the recipe, under 'channels'."
        )
    return found


def entries(recording: Recording, name: str) -> list[Entry]:
    """Return the rows of a text channel that hold a word, in order of time; empty where the run lacks it."""
    if name not in recording:
        return []
    time, values = recording.signal(name)
    words = [(float(t), str(v).strip()) for t, v in zip(time, values, strict=True) if v is not None]
    return [Entry(t, word) for t, word in words if word and word.lower() != "nan"]
