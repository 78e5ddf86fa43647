"""Samples that a sensor or amplifier cut off: which blocks hold them, and what is then left out.

A clipped channel bends amplitude and phase of every tone, so its blocks do not serve.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.recording import Recording, Stream
from pipeline.rigs.tpjb.dynamic import excitation, tones
from pipeline.rigs.tpjb.dynamic.record import FORCES, Record
from pipeline.rigs.tpjb.probes import GAPS, opposite

# A level is a cut when so many samples lie at it, and so many times those one step beside it.
_FEWEST, _GATHERED = 5, 4
# Share of all samples at one level from which on a channel is dead or set, not clipped.
_SET = 0.9


def leave_out_clipped(record: Record, recording: Recording) -> None:
    """Leave out blocks with clipped samples where enough remain, else the clipped channel where another serves.

    Where a force is clipped nearly everywhere, or a probe and its opposite one, no block is left and
    `record.unusable` says why.
    """
    names = list(record.amplitudes)
    marks = {name: counts for name in names if (counts := _clipped_in(recording.stream_of(name), name, record)).any()}
    marks = {name: counts > 0 for name, counts in marks.items() if (counts[record.usable] > 0).any()}
    if not marks:
        return
    every = np.any(list(marks.values()), axis=0)
    if _enough(record, every):
        for name, clipped in marks.items():
            _leave_out(record, name, clipped)
        return
    for name in [n for n in marks if n in FORCES]:
        if not _enough(record, marks[name]):
            _give_up(
                record,
                name,
                f"{name} is clipped in {np.count_nonzero(marks[name])} of {record.start.size} blocks; the force is not "
                "known there and too few blocks remain. Widen the range of the load cell's amplifier.",
            )
            return
        _leave_out(record, name, marks[name])
    for name in [n for n in marks if n not in FORCES]:
        if name not in record.amplitudes:
            continue
        other = opposite(name) if name in GAPS else name[:5] + ("b" if name[5] == "a" else "a")
        text = f"{name} is clipped in {np.count_nonzero(marks[name])} of {record.start.size} blocks"
        if other in record.amplitudes and other not in marks:
            record.say("warning", f"{text}; it is left out and {other} alone serves.", name)
            for table in (record.amplitudes, record.products, record.residual):
                del table[name]
        elif _enough(record, marks[name]):
            _leave_out(record, name, marks[name])
        else:
            _give_up(
                record,
                name,
                f"{text}, too few blocks remain, and {other} cannot stand in for it "
                f"({'clipped, too' if other in marks else 'not there'}). Widen the range of the sensor.",
            )
            return


def _give_up(record: Record, name: str, reason: str) -> None:
    record.usable[:] = False
    record.unusable = f"run '{record.run}': {reason}"
    record.say("error", f"{reason} No block of this run is used.", name)


def _leave_out(record: Record, name: str, clipped: np.ndarray) -> None:
    lost = np.flatnonzero(clipped & record.usable)
    record.usable[clipped] = False
    if lost.size:
        text = f"{name} is clipped in {lost.size} of {record.start.size} blocks; they are left out."
        record.say("warning", text, name, record.span_of(lost))


def _enough(record: Record, clipped: np.ndarray) -> bool:
    """Tell whether each excitation keeps blocks enough for an error."""
    kinds = np.array(record.kinds)
    driven = {k for k, used in zip(record.kinds, record.usable, strict=True) if used and k != excitation.QUIET}
    return all(np.count_nonzero(record.usable & ~clipped & (kinds == kind)) >= tones.LEAST_BLOCKS for kind in driven)


def _clipped_in(stream: Stream, name: str, record: Record) -> np.ndarray:
    """Return how many samples are clipped in each block, shape (B,)."""
    counts = np.zeros(record.start.size, dtype=int)
    edges = np.append(record.start, record.start[-1] + record.block.length)
    for level in cut_levels(stream, name):
        for time, (values,) in stream.blocks([name]):
            counts += np.histogram(time[values == level], edges)[0]
    return counts


def cut_levels(stream: Stream, name: str) -> Sequence[float]:
    """Return the levels at which a channel is cut off, none where it is not."""
    found = []
    for sign in (1.0, -1.0):
        top = max((float(np.nanmax(sign * v, initial=-np.inf)) for _, (v,) in stream.blocks([name])), default=-np.inf)
        if not np.isfinite(top) or top == 0.0:
            continue
        at, beside, below = 0, 0, -np.inf
        for _, (values,) in stream.blocks([name]):
            signed = sign * values
            at += int(np.count_nonzero(signed == top))
            rest = signed[signed < top]
            second = float(rest.max(initial=-np.inf))
            if second > below:
                below, beside = second, 0
            beside += int(np.count_nonzero(rest == below))
        if at >= max(_FEWEST, _GATHERED * beside) and at < _SET * stream.size:
            found.append(sign * top)
    return found
