"""The input torque as events are told from: means over some milliseconds, its ripple, its noise. No event."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.counts import Counts
from pipeline.rigs.gearbox.stages.stage import Stage
from pipeline.signals.periodogram import block_means

BLOCK, FINE = 0.005, 0.002
"""Means of the torque over this time are fitted; where the bend is sharp, over the shorter one, s."""
STEADY = 4.0
"""Steady running that is fitted before a brake or a run-down, s."""
CLEAR = 40.0
"""A change of the torque is clear that takes this many variances away."""


def means(record: Record, span: tuple[float, float], block: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps and input torque as means over `block` s inside `span`, shape (n,) each."""
    part = record.torque.part(*span)
    if part.time.size < 3:
        return part.time, part["torque_in"]
    return block_means(part.time, part["torque_in"], max(round(block * part.rate), 1))


def turning(
    record: Record, counts: Counts, span: tuple[float, float], block: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps, means of the input torque and the output's angle, where that is known, shape (n,) each."""
    time, level = means(record, span, block)
    turned = counts.at(time)
    known = np.isfinite(turned)
    return time[known], level[known], turned[known]


def ripple(turned: np.ndarray) -> list[np.ndarray]:
    """Return a constant and the first two shaft orders over the angle."""
    return [np.ones_like(turned)] + [f(k * turned) for k in (1, 2) for f in (np.cos, np.sin)]


def memory(level: np.ndarray, turned: np.ndarray) -> float:
    """Return how many samples of a steady torque tell as little as one independent one: noise drifts."""
    base = np.column_stack(ripple(turned))
    rest = level - base @ np.linalg.lstsq(base, level, rcond=None)[0]
    return float(rest.size / effective_size(rest, base.shape[1]))


def steady_noise(record: Record, counts: Counts, stages: Sequence[Stage]) -> np.ndarray | None:
    """Return what the input torque does in FOS beside its ripple, N m, shape (m,); None where there is too little."""
    fos = next((stage for stage in stages if stage.name.startswith("fos") and stage.duration > 1.0), None)
    if fos is None:
        return None
    time, level = means(record, (max(fos.start, fos.end - STEADY), fos.end - 0.2), BLOCK)
    turned = counts.at(time)
    known = np.isfinite(turned)
    if known.sum() < 100:
        return None
    base = np.column_stack([*ripple(turned[known]), time[known] - time[known].mean()])
    return np.asarray(level[known] - base @ np.linalg.lstsq(base, level[known], rcond=None)[0])
