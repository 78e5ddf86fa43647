"""Rows that stand out of order by a little: messages that came late, publishers that were merged.

They are told from rows with wrong stamps by what sorting yields: steady times here, a double row and a hole there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.ingest.blocks import Block, rows_of

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


def reordered(blocks: Iterator[Block], order: np.ndarray) -> Iterator[Block]:
    """Yield the rows of blocks in `order` (n,); what is held back is no more than rows are moved by."""
    complete = np.maximum.accumulate(order)  # the last row of the file that the first rows need
    held: Block = {}
    begin = given = seen = 0
    for block in blocks:
        held = {name: np.concatenate((held[name], values)) for name, values in block.items()} if held else dict(block)
        seen += rows_of(block)
        stop = int(np.searchsorted(complete, seen))
        rows = order[given:stop] - begin
        if rows.size:
            yield {name: values[rows] for name, values in held.items()}
        given = stop
        keep = int(order[given:].min()) if given < order.size else seen
        held = {name: values[keep - begin :] for name, values in held.items()}
        begin = keep
