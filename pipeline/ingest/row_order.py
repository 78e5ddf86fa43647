"""Rows that stand out of order by a little: messages that came late, publishers that were merged.

They are told from rows with wrong stamps by what sorting yields: steady times here, a double row and a hole there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from pipeline.ingest.blocks import Block, rows_of


class Rows(Protocol):
    """A number of each row of a log, in memory or not; asked for a part at a time."""

    def __getitem__(self, rows: slice, /) -> np.ndarray:
        """Return those of some rows."""


# A row is moved by at most so many rows, and by at most this part of the log.
_REACH, _PART = 1000, 0.1
# Steps that sorting yields are between these multiples of the usual one, or as uneven as elsewhere in the log.
_SHORT, _LONG = 0.6, 1.5


def sorted_rows(time: np.ndarray) -> np.ndarray | None:
    """Return the order (n,) in which rows with these times (n,) increase; None where sorting would not mend them."""
    order = np.argsort(time, kind="stable")
    moved = order != np.arange(time.size)
    if np.abs(order - np.arange(time.size)).max(initial=0) > min(_REACH, _PART * time.size):
        return None
    steps = np.diff(time[order])
    touched = moved[:-1] | moved[1:]
    elsewhere = steps[~touched]
    usual = float(np.median(elsewhere if elsewhere.size >= 10 else steps))
    shortest, longest = _SHORT * usual, _LONG * usual
    if elsewhere.size >= 10:
        shortest = min(shortest, float(np.quantile(elsewhere, 0.01)))
        longest = max(longest, float(np.quantile(elsewhere, 0.99)))
    even = (steps[touched] > 0) & (steps[touched] >= shortest) & (steps[touched] <= longest)
    return order if even.all() else None


def reordered(blocks: Iterator[Block], order: Rows) -> Iterator[Block]:
    """Yield the rows of blocks in `order` (n,); what is held back is no more than rows are moved by."""
    held: Block = {}
    gone = np.zeros(0, dtype=bool)  # which of the rows held were given
    begin = given = seen = 0
    for block in blocks:
        held = {name: np.concatenate((held[name], values)) for name, values in block.items()} if held else dict(block)
        gone = np.concatenate((gone, np.zeros(rows_of(block), dtype=bool)))
        seen += rows_of(block)
        ahead = order[given:seen]
        # Only rows of the file that were read, with all that come before them.
        rows = ahead[: int(np.searchsorted(np.maximum.accumulate(ahead), seen))] - begin
        if rows.size:
            yield {name: values[rows] for name, values in held.items()}
        given += rows.size
        gone[rows] = True
        keep = gone.size if gone.all() else int(np.argmin(gone))
        held, gone = {name: values[keep:] for name, values in held.items()}, gone[keep:]
        begin += keep
