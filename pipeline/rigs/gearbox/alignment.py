"""Bring the encoder's and the vibration board's clock to that of the torques (gearbox.md, sections 1 and 8).

Each board counts from its own start. The encoder is shifted until eq. (A) without brake explains the
output torque best, the vibration until its mesh noise follows the slip that the encoder shows. What is
clearly off is applied; every estimate is told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.gearbox.clock_shifts import Part, encoder_parts, vibration_parts
from pipeline.rigs.gearbox.counts import counts_of
from pipeline.rigs.gearbox.levels import levels_of
from pipeline.rigs.gearbox.motion import spans_of
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.segmentation import rough_stages
from pipeline.rigs.gearbox.stages import Problem

# A shift is applied from so many standard errors and so many seconds on, a drift from so many standard errors.
_SURE, _LEAST = 4.0, 0.02


@dataclass(frozen=True)
class ClockFit:
    """How one board's clock stands to that of the torques: ``t_torque = t (1 + drift) + shift``.

    Attributes
    ----------
    shift, shift_sd
        s; `shift` is that at the board's time zero, `shift_sd` its standard error in the middle of the run.
    drift, drift_sd
        Relative; NaN where only one part of the run tells a shift.
    applied
        Whether the board was moved; what is not clearly off is left as logged. `drift_applied` likewise.
    """

    shift: float
    shift_sd: float
    drift: float = math.nan
    drift_sd: float = math.nan
    applied: bool = False
    drift_applied: bool = False


@dataclass(frozen=True)
class Alignment:
    """Clock of each board against the torques'; None where nothing in the run tells it."""

    encoder: ClockFit | None = None
    vibration: ClockFit | None = None
    problems: tuple[Problem, ...] = ()


def align(record: Record) -> tuple[Record, Alignment]:
    """Return the record with encoder and vibration on the torques' clock, and what their clocks were.

    A run in which nothing tells the clocks comes back as it is.
    """
    counts = counts_of(record)
    spans, _ = spans_of(counts)
    if not any(span.state == "nominal" for span in spans):
        return record, Alignment()
    levels = levels_of(record)
    stages, _ = rough_stages(record, levels.split(spans), levels)
    problems: list[Problem] = []
    encoder = _clock(encoder_parts(record, counts, stages))
    moved = record
    if encoder is not None and encoder.applied:
        drift = encoder.drift if encoder.drift_applied else 0.0
        moved = moved.aligned(record.encoder.on_clock(encoder.shift, drift), record.vibration)
        problems.append(_told("encoder", encoder, record.encoder.span))
        counts = counts_of(moved)
        stages, _ = rough_stages(moved, levels.split(spans_of(counts)[0]), levels)
    vibration = None
    if moved.vibration is not None:
        vibration = _clock(vibration_parts(moved, counts, stages))
        if vibration is not None and vibration.applied:
            drift = vibration.drift if vibration.drift_applied else 0.0
            problems.append(_told("vibration", vibration, moved.vibration.span))
            moved = moved.aligned(moved.encoder, moved.vibration.on_clock(vibration.shift, drift))
    return moved, Alignment(encoder, vibration, tuple(problems))


def _told(board: str, clock: ClockFit, span: tuple[float, float]) -> Problem:
    text = (
        f"the stamps of the {board} board are {abs(clock.shift):.3f} s {'behind' if clock.shift > 0 else 'ahead of'} those of the torques "
        f"(standard error {clock.shift_sd:.3f} s); they were moved by that"
    )
    if clock.drift_applied:
        text += f", with a drift of {1e6 * clock.drift:+.0f} ppm (standard error {1e6 * clock.drift_sd:.0f})"
    return Problem(span, text)


def _clock(parts: Sequence[Part]) -> ClockFit | None:
    """Return the weighted line through the shifts of the parts."""
    if not parts:
        return None
    time, shift, sd = (np.array([getattr(part, name) for part in parts]) for name in ("time", "shift", "sd"))
    weight = 1.0 / sd**2
    middle = float(weight @ time / weight.sum())
    mean = float(weight @ shift / weight.sum())
    drift, drift_sd, left = math.nan, math.nan, shift - mean
    if len(parts) > 1:
        spread = float(weight @ (time - middle) ** 2)
        drift = float(weight @ ((time - middle) * left)) / spread
        along = left - drift * (time - middle)
        drift_sd = math.sqrt(_excess(weight, along, len(parts) - 2) / spread)
        if abs(drift) > _SURE * drift_sd:
            left = along
    drifts = len(parts) > 1 and abs(drift) > _SURE * drift_sd
    error = math.sqrt(_excess(weight, left, len(parts) - 1 - drifts) / float(weight.sum()))
    far = abs(mean) > max(_SURE * error, _LEAST)
    start = mean - drift * middle if drifts else mean
    return ClockFit(start, error, drift, drift_sd, bool(far or drifts), bool(drifts))


def _excess(weight: np.ndarray, left: np.ndarray, dof: int) -> float:
    """Return the factor by which variances are widened where parts disagree by more than their errors say."""
    return max(float(weight @ left**2) / max(dof, 1), 1.0)
