"""The brake's own signal, where it is logged, against what torques and counts say of the brake (gearbox.md, sections 1 and 5.1).

A cross-check only: no stage and no event is moved by it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.stage import Problem, Stage
from pipeline.signals.periodogram import block_means

_RATE = 100.0
# The brake is on above this share of its range, for so long at the least (s); the range must be so many times the noise.
_ON, _LEAST, _CLEAR = 0.25, 0.1, 8.0
# The force comes on with the load it makes, and the output turns soon after it is gone: within this, s.
_AGREE = 0.5


def brake_faults(record: Record, stages: Sequence[Stage]) -> list[Problem]:
    """Return how `brake_force` agrees with the stages: a note where it does, warnings where it does not."""
    if record.brake_force is None:
        return []
    span = record.brake_force.span
    pulls = brakings(record)
    if not pulls:
        text = "brake_force does not change in this run: it is not connected, or no brake was used; it checks nothing"
        return [Problem(span, text)]
    loaded = _loaded(stages)
    problems, apart = list[Problem](), list[float]()
    for start, end in pulls:
        met = [span for span in loaded if span[0] < end + _AGREE and span[1] > start - _AGREE]
        if not met:
            text = f"brake_force shows the brake on from {start:.2f} to {end:.2f} s, but neither torques nor counts show a load then"
            problems.append(Problem((start, end), text))
            continue
        late = met[0][0] - start, met[-1][1] - end
        apart += late
        if max(abs(late[0]), abs(late[1])) > _AGREE:
            text = (
                f"brake_force has the brake on from {start:.2f} to {end:.2f} s, the stages from {met[0][0]:.2f} to "
                f"{met[-1][1]:.2f} s: the clock of brake_force, or an event, is wrong"
            )
            problems.append(Problem((start, end), text))
    for stage in stages:
        if stage.name == "sos" and not any(a < stage.end and b > stage.start for a, b in pulls):
            text = f"the output is held from {stage.start:.2f} to {stage.end:.2f} s without any brake_force"
            problems.append(Problem((stage.start, stage.end), text))
    if not problems:
        text = (
            f"brake_force agrees with the events: the brake comes and goes within {max(map(abs, apart)):.2f} s of them"
        )
        problems.append(Problem(span, text, "note"))
    return problems


def _loaded(stages: Sequence[Stage]) -> list[tuple[float, float]]:
    """Return the stretches in which the stages say that the brake is on, s; neighbours are one."""
    out: list[tuple[float, float]] = []
    for stage in stages:
        if stage.name not in ("brake", "sos", "stall", "fos_loaded"):
            continue
        start = out.pop()[0] if out and out[-1][1] > stage.start - 1e-6 else stage.start
        out.append((start, stage.end))
    return out


def brakings(record: Record) -> list[tuple[float, float]]:
    """Return when the brake was on by its own signal, s; empty where there is none or it does not change."""
    log = record.brake_force
    if log is None:
        return []
    time, force = block_means(log.time, log["brake_force"], max(round(log.rate / _RATE), 1))
    force = np.abs(force)
    low, high = float(np.percentile(force, 1)), float(np.percentile(force, 99))
    noise = 1.4826 * float(np.median(np.abs(np.diff(force))))
    if high - low <= max(_CLEAR * noise, 1e-9):
        return []
    on = np.concatenate([[False], force > low + _ON * (high - low), [False]])
    changes = np.flatnonzero(np.diff(on.astype(int)))
    ends = [
        (float(time[a]), float(time[min(b, time.size - 1)])) for a, b in zip(changes[::2], changes[1::2], strict=True)
    ]
    return [(a, b) for a, b in ends if b - a >= _LEAST]
