"""What a list of numbers in a message means: a block of samples, or a vector.

The rule, in this order, for every field that holds a list:

1. A list that comes with a list of times of the same length is a block of samples.
2. A list that comes with a list of names (as in a JointState), or is called a covariance, is a vector.
3. A list whose length changes, or is 8 or more, is a block of samples; or more than 16 where the
   schema fixes the length (``float64[9]``, ``minItems`` = ``maxItems``).
4. A shorter list of at least 4 numbers is a block if its numbers run on from message to message as a
   sampled signal does; else, and with fewer numbers, it is a vector.

A block gives one row a sample, scalars are repeated. Lists beside a block and as long as it are
blocks too, unless rule 2 says otherwise; lists of another length are taken as vectors. A vector ``p``
gives the channels ``p.0``, ``p.1``, ...
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.ingest.mcap_log.columns import Path

LONGEST_VECTOR = 256
_SURELY_SAMPLES = 8
_SURELY_SAMPLES_IF_FIXED = 17
_MAYBE_SAMPLES = 4
_TIMES = {"t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "sampletime", "sampletimes"}
_RATES = {"fs", "rate", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency"}
_STEPS = {"dt", "step", "sampletime", "sampleinterval", "samplinginterval", "sampleperiod", "samplingperiod"}


@dataclass(frozen=True)
class Lists:
    """All lists of one field in the surveyed messages: `values` one after the other, `lengths` (m,)."""

    path: Path
    values: np.ndarray
    lengths: np.ndarray
    is_text: bool

    @property
    def constant_length(self) -> int | None:
        """The length that all messages share that have the list at all."""
        present = self.lengths[self.lengths > 0]
        return int(present[0]) if present.size and (present == present[0]).all() else None


def sampled(lists: Sequence[Lists], fixed: Mapping[Path, int]) -> tuple[set[Path], Path | None]:
    """Return the lists that are blocks of samples, and the one among them that holds their times.

    `fixed` are the lengths that the schema fixes; they hold for all fields below their path.
    """
    times = next((field for field in lists if _are_times(field)), None)
    if times is not None:
        return {field.path for field in lists if _share_length(field, times)}, times.path
    names = [field for field in lists if _are_names(field)]
    undecided = [field for field in lists if not _is_surely_vector(field, names)]
    leaders = [field for field in undecided if not field.is_text and _looks_sampled(field, fixed)]
    if not leaders:
        return set(), None

    def company(field: Lists) -> tuple[int, int]:
        return sum(_share_length(other, field) for other in undecided), field.values.size

    leader = max(leaders, key=company)
    return {field.path for field in undecided if _share_length(field, leader)}, None


def start_anew(times: Lists) -> bool:
    """Tell whether lists of times start anew in each message, so that they are no time of the run."""
    starts = (np.cumsum(times.lengths) - times.lengths)[times.lengths > 0]
    return bool(np.any(times.values[starts[1:]] <= times.values[starts[1:] - 1]))


def declares_rate(path: Path) -> bool:
    """Tell whether a scalar of this name beside blocks is the samples' rate."""
    return _word(path) in _RATES


def declares_step(path: Path) -> bool:
    """Tell whether a scalar of this name beside blocks is the time from sample to sample."""
    return _word(path) in _STEPS


def _word(path: Path) -> str:
    """Return the last part of a path in lower case, letters only."""
    return re.sub(r"[^a-z]", "", path[-1].lower()) if path else ""


def _share_length(field: Lists, leader: Lists) -> bool:
    """Tell whether two lists mostly have the same length, where a message has both."""
    both = (field.lengths > 0) & (leader.lengths > 0)
    same = np.count_nonzero(field.lengths[both] == leader.lengths[both])
    return bool(both.any()) and bool(same >= 0.9 * np.count_nonzero(both))


def _are_times(field: Lists) -> bool:
    if field.is_text or field.values.dtype == object or _word(field.path) not in _TIMES:
        return False
    owner = np.repeat(np.arange(field.lengths.size), field.lengths)
    within = owner[1:] == owner[:-1]
    return bool(within.any()) and bool(np.all(np.diff(field.values)[within] > 0))


def _are_names(field: Lists) -> bool:
    """Tell whether each message repeats the same list of different words."""
    width = field.constant_length
    if not field.is_text or width is None or width > LONGEST_VECTOR:
        return False
    rows = field.values.reshape(-1, width)
    return bool((rows == rows[0]).all()) and len(set(rows[0].tolist())) == width


def _is_surely_vector(field: Lists, names: Sequence[Lists]) -> bool:
    return "covariance" in ".".join(field.path).lower() or any(_share_length(field, other) for other in names)


def _looks_sampled(field: Lists, fixed: Mapping[Path, int]) -> bool:
    width = field.constant_length
    is_fixed = any(field.path[:n] in fixed for n in range(len(field.path) + 1))
    if width is None or width >= (_SURELY_SAMPLES_IF_FIXED if is_fixed else _SURELY_SAMPLES):
        return True
    return width >= _MAYBE_SAMPLES and _runs_on(field.values, width)


def _runs_on(values: np.ndarray, width: int) -> bool:
    """Tell whether short lists are one signal cut into pieces.

    Neighbours in the signal then differ less than samples `width` apart, also across the cut. The
    members of a vector do not: the same member of successive messages differs least.
    """
    if values.dtype == object or values.size < 4 * width or np.isnan(values).all():
        return False
    rows = values.reshape(-1, width)
    within = np.nanmean(np.abs(np.diff(rows, axis=1)))
    across = np.nanmean(np.abs(rows[1:, 0] - rows[:-1, -1]))
    apart = np.nanmean(np.abs(np.diff(rows, axis=0)))
    return bool(apart > 2.0 * within and across < 2.0 * within)
