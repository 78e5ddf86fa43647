"""Which blocks of a run serve, under which excitation; the others are named with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.tpjb.dynamic import excitation
from pipeline.rigs.tpjb.dynamic.clipping import leave_out_clipped
from pipeline.rigs.tpjb.dynamic.record import Record, read_amplitudes


def read_record(recording: Recording, channels: Sequence[str], orders: int, *, still: bool = False) -> Record:
    """Read one run (see `record.read_amplitudes`) and sort its blocks.

    Raises
    ------
    InputError
        If the run has no tone or is too short for the blocks.
    """
    record = read_amplitudes(recording, channels, orders, still=still)
    sort_blocks(record)
    leave_out_clipped(record, recording)
    return record


def sort_blocks(record: Record) -> None:
    """Tell the excitation of each block, and which blocks are left out and why."""
    names = list(record.amplitudes)
    residual = np.stack([record.residual[name] for name in names], axis=1)
    whole = np.isfinite(residual).all(axis=1)
    force = np.where(whole[:, None, None], record.force, 0.0)
    record.kinds = excitation.excitation_of(force[:, :, 0], force[:, :, 1])
    loud = np.array([kind != excitation.QUIET for kind in record.kinds])
    record.usable = whole & loud
    if (lost := np.flatnonzero(~whole)).size:
        record.say(
            "warning", f"{lost.size} blocks hold too few samples; they are left out.", None, record.span_of(lost)
        )
    size = np.array([np.sqrt(np.mean(np.nan_to_num(np.abs(record.amplitudes[name])) ** 2)) for name in names])
    odd = excitation.odd_blocks(names, residual, size, record.usable)
    for block in odd:
        record.usable[block.block] = False
    unlike = excitation.unlike_drive(record.force, record.kinds, record.usable)
    record.usable[unlike] = False
    switch = _switches(record.kinds, record.usable)
    across = [b for b in [*(o.block for o in odd), *unlike] if b in switch]
    if across:
        text = f"the excitation changes within {len(across)} of {record.start.size} blocks; they are left out."
        record.say("note", text, None, record.span_of(across))
    _say_odd(record, [block for block in odd if block.block not in across])
    if left := [b for b in unlike if b not in across]:
        text = f"the drive differs in size in {len(left)} blocks; they are left out."
        record.say("warning", text, None, record.span_of(left))


def _say_odd(record: Record, odd: Sequence[excitation.OddBlock]) -> None:
    """Name odd blocks, those of one channel and kind together."""
    alike: dict[tuple[str, bool], list[excitation.OddBlock]] = {}
    for block in odd:
        alike.setdefault((block.channel, block.reason.startswith("holds no")), []).append(block)
    for (channel, _), blocks in alike.items():
        which = "the block is" if len(blocks) == 1 else f"so it is in {len(blocks)} blocks; they are"
        record.say(
            "warning",
            f"{channel} {blocks[0].reason}; {which} left out.",
            channel,
            record.span_of([block.block for block in blocks]),
        )


def _switches(kinds: Sequence[str], usable: np.ndarray) -> set[int]:
    """Return the blocks that have usable blocks of different kinds, or the log's end, beside them."""
    out = set()
    for b in range(len(kinds)):
        before = next((kinds[i] for i in range(b - 1, -1, -1) if usable[i]), "")
        after = next((kinds[i] for i in range(b + 1, len(kinds)) if usable[i]), "")
        if before != after:
            out.add(b)
    return out
