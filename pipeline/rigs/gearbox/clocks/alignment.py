"""Bring the encoder's and the vibration board's clock to that of the torques (gearbox.md, sections 1 and 8).

Each board counts from its own start. The encoder is shifted until eq. (A) without brake explains the
output torque best, the vibration until its mesh noise follows the slip that the encoder shows. What is
clearly off is applied; every estimate is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.rigs.gearbox.clocks.clock_shifts import encoder_parts
from pipeline.rigs.gearbox.clocks.coarse_clocks import FAR, Coarse, encoder_shift, vibration_shift
from pipeline.rigs.gearbox.clocks.shift_search import Part
from pipeline.rigs.gearbox.clocks.vibration_shifts import vibration_parts
from pipeline.rigs.gearbox.record import Record, Signal
from pipeline.rigs.gearbox.stages.counts import Counts, counts_of
from pipeline.rigs.gearbox.stages.levels import levels_of
from pipeline.rigs.gearbox.stages.motion import Span, spans_of
from pipeline.rigs.gearbox.stages.segmentation import rough_stages
from pipeline.rigs.gearbox.stages.stage import Problem, Stage

RATE_SD = 200e-6 / math.sqrt(3.0)
"""Two boards' crystals differ by 200 ppm at the most: as a standard uncertainty (rectangular), relative.

Events of one run tell a drift to some 500 ppm only, so this is what is known where none is applied.
"""
# A shift is applied from so many standard errors and so many seconds on, a drift from so many standard errors.
_SURE, _LEAST = 4.0, 0.01
# The parts of a run agree up to this reduced chi-squared; without the part that tells most the others must still tell
# the shift by so many standard errors.
_AGREE, _ALSO = 5.0, 2.0
# The clock as logged is doubtful where the parts contradict it by so many standard errors in the mean.
_DOUBT = 3.0
# An unapplied drift of so many standard errors counts as uncertainty of the rate.
_SEEN = 2.0


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
    disagree
        Whether the parts of the run contradict each other and the clock as logged: then nothing is moved.
    """

    shift: float
    shift_sd: float
    drift: float = math.nan
    drift_sd: float = math.nan
    applied: bool = False
    drift_applied: bool = False
    disagree: bool = False


@dataclass(frozen=True)
class Alignment:
    """Clock of each board against the torques'; None where nothing in the run tells it.

    The torques' clock is the reference for all times and speeds: which board keeps true time is not known.
    """

    encoder: ClockFit | None = None
    vibration: ClockFit | None = None
    problems: tuple[Problem, ...] = ()
    rates: Mapping[str, float] = field(default_factory=dict)

    def rate_sd(self, board: str) -> float:
        """Return the relative standard uncertainty of a board's rate against that of the torques, the reference.

        Type B unless the run told a drift; zero for channels that share the torques' stamps.
        """
        return self.rates.get(board, RATE_SD)


def align(record: Record) -> tuple[Record, Alignment]:
    """Return the record with encoder and vibration on the torques' clock, and what their clocks were.

    A run in which nothing tells the clocks comes back as it is.
    """
    counts = counts_of(record)
    spans, _ = spans_of(counts)
    if not any(span.state == "nominal" for span in spans):
        return record, _typical(record, Alignment())
    moved, encoder, problems = record, None, list[Problem]()
    if not _shared(record, record.encoder):
        moved, encoder, problems = _encoder(record, counts, spans)
    if moved is not record:
        counts = counts_of(moved)
        spans, _ = spans_of(counts)
    moved, vibration, told = _vibration(moved, counts, spans)
    return moved, _typical(record, Alignment(encoder, vibration, (*problems, *told)))


def _encoder(record: Record, counts: Counts, spans: Sequence[Span]) -> tuple[Record, ClockFit | None, list[Problem]]:
    """Return the record with its encoder moved, the clock of that board, and what to tell."""
    problems: list[Problem] = []
    coarse = encoder_shift(record, counts, spans)
    far, unknown = _far(coarse, "encoder", record.encoder.span)
    problems += unknown
    moved = record.aligned(record.encoder.on_clock(far), record.vibration) if far else record
    if far:
        counts = counts_of(moved)
        spans, _ = spans_of(counts)
    stages = _rough(moved, spans)
    guess = coarse.shift - far if coarse is not None and coarse.sure and coarse.needed else None
    parts = encoder_parts(moved, counts, stages, guess)
    encoder = _clock(parts, far)
    if coarse is not None and far and len(parts) < 2:
        encoder = ClockFit(far, coarse.sd, applied=True)
    if encoder is None:
        text = "nothing in this run tells the clock of the encoder against that of the torques; it is used as logged"
        problems.append(Problem(record.encoder.span, text, "note"))
    elif encoder.disagree:
        text = (
            f"the clock of the encoder is doubtful: start-up, unlocking, relocking and run-down tell {encoder.shift:+.3f} s (standard "
            f"error {encoder.shift_sd:.3f} s) against that of the torques, but they do not bear each other out, only one tells, or its rate "
            "is off; it is used as logged, and what needs both boards is doubtful"
        )
        problems.append(Problem(record.encoder.span, text))
    elif encoder.applied:
        drift = encoder.drift if encoder.drift_applied else 0.0
        moved = record.aligned(record.encoder.on_clock(encoder.shift, drift), record.vibration)
        problems.append(_told("encoder", encoder, record.encoder.span))
    return moved, encoder, problems


def _vibration(
    record: Record, counts: Counts, spans: Sequence[Span]
) -> tuple[Record, ClockFit | None, tuple[Problem, ...]]:
    """Return the record with its vibration moved, the clock of that board, and what to tell."""
    log = record.vibration
    if log is None or _shared(record, log):
        return record, None, ()
    coarse = vibration_shift(record, counts, spans)
    far, problems = _far(coarse, "vibration", log.span)
    moved = record.aligned(record.encoder, log.on_clock(far)) if far else record
    parts = vibration_parts(moved, counts, _rough(moved, spans))
    clock = _clock(parts, far)
    if coarse is not None and far and len(parts) < 2:
        clock = ClockFit(far, coarse.sd, applied=True)
    if clock is None or not clock.applied:
        return moved, clock, tuple(problems)
    drift = clock.drift if clock.drift_applied else 0.0
    moved = record.aligned(record.encoder, log.on_clock(clock.shift, drift))
    return moved, clock, (*problems, _told("vibration", clock, log.span))


def _rough(record: Record, spans: Sequence[Span]) -> list[Stage]:
    levels = levels_of(record)
    return rough_stages(record, levels.hesitations(levels.split(spans))[0], levels)[0]


def _far(coarse: Coarse | None, board: str, span: tuple[float, float]) -> tuple[float, list[Problem]]:
    """Return the shift of a board that is seconds off, and a warning where it is off but by how much is unknown."""
    if coarse is None or not coarse.needed:
        return 0.0, []
    if coarse.far:
        return coarse.shift, []
    if coarse.sure:
        return 0.0, []
    text = (
        f"the clocks of the {board} and of the torques do not seem to agree, and no shift within {FAR:g} s brings them together: "
        f"motion and torques contradict each other ({100 * coarse.left_as_logged:.0f} % unexplained as logged, "
        f"{100 * coarse.left:.0f} % at {coarse.shift:+.1f} s). Stages that need both are doubtful"
    )
    return 0.0, [Problem(span, text)]


def _typical(record: Record, found: Alignment) -> Alignment:
    """Return the alignment with what is unknown of each board's rate."""
    rates = {}
    for name, board, clock in (
        ("encoder", record.encoder, found.encoder),
        ("vibration", record.vibration, found.vibration),
    ):
        if board is None:
            continue
        rates[name] = 0.0 if _shared(record, board) else _rate_sd(clock)
    return replace(found, rates=rates)


def _rate_sd(clock: ClockFit | None) -> float:
    """Return the relative standard uncertainty of a rate: a drift that shows and is not applied may be there."""
    if clock is None or math.isnan(clock.drift):
        return RATE_SD
    if clock.drift_applied:
        return clock.drift_sd
    return max(RATE_SD, abs(clock.drift)) if abs(clock.drift) > _SEEN * clock.drift_sd else RATE_SD


def _shared(record: Record, board: Signal) -> bool:
    """Tell whether a board's channels were logged with the stamps of the torques, but for rows without a number."""
    if not 0.5 * record.torque.time.size < board.time.size <= record.torque.time.size:
        return False
    return bool(np.isin(board.time, record.torque.time).all())


def _told(board: str, clock: ClockFit, span: tuple[float, float]) -> Problem:
    text = (
        f"the stamps of the {board} board are {abs(clock.shift):.3f} s {'behind' if clock.shift > 0 else 'ahead of'} those of the torques "
        f"(standard error {clock.shift_sd:.3f} s); they were moved by that"
    )
    if clock.drift_applied:
        text += f", with a drift of {1e6 * clock.drift:+.0f} ppm (standard error {1e6 * clock.drift_sd:.0f})"
    return Problem(span, text)


def _clock(parts: Sequence[Part], far: float = 0.0) -> ClockFit | None:
    """Return the weighted line through the shifts of the parts of a board that was moved by `far` (s) already.

    Applied is only what independent parts agree on: without the one that tells most, the others must tell it too.
    """
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
    drifts = len(parts) > 2 and abs(drift) > _SURE * drift_sd and _excess(weight, along, len(parts) - 2) < _AGREE
    if drifts:
        left = along
    dof = len(parts) - 1 - drifts
    excess = _excess(weight, left, dof)
    error = math.sqrt(excess / float(weight.sum()))
    off = abs(mean) > max(_SURE * error, _LEAST)
    agree = dof > 0 and excess < _AGREE and _without_best(shift - drift * (time - middle) * drifts, weight) > _ALSO
    applied = bool(far) or (off and agree) or drifts
    if len(parts) > 2:
        clear = abs(mean) > _SURE * error or abs(drift) > _DOUBT * drift_sd
        doubtful = clear and _excess(weight, shift, len(parts)) > _DOUBT**2
    else:
        doubtful = bool(np.all(np.abs(shift) > 1.5 * _SURE * sd))
    disagree = doubtful and not applied
    # The drift counts from the board's own zero, which `far` moved.
    start = far + mean - drift * (middle - far) if drifts else far + mean
    return ClockFit(start, error, drift, drift_sd, bool(applied), bool(drifts), bool(disagree))


def _without_best(shift: np.ndarray, weight: np.ndarray) -> float:
    """Return the mean shift of the parts but the one that tells most, in its standard errors."""
    others = np.arange(weight.size) != np.argmax(weight)
    return abs(float(weight[others] @ shift[others])) / math.sqrt(float(weight[others].sum()))


def _excess(weight: np.ndarray, left: np.ndarray, dof: int) -> float:
    """Return the factor by which variances are widened where parts disagree by more than their errors say."""
    return max(float(weight @ left**2) / max(dof, 1), 1.0)
