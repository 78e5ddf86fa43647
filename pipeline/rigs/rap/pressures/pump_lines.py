"""The pump's line at each set-point as one source logs it, and what it gives away: sub-harmonics, aliasing (rap.md, section 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.bubble import best_split
from pipeline.rigs.rap.pressures.record import WORDS, Record, Source
from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.passages import JUMP, Passages, find_passages
from pipeline.rigs.rap.tables import Signal

_ML = 1e6
# Volume of a roller passage, m^3: what can be (section 5.9), and the factors by which another line is picked.
_STROKE = (0.3e-6, 1.5e-6)
_FACTORS = {1.0 / 3.0: "a third", 0.5: "half", 2.0: "twice", 3.0: "three times"}
_NEAR = 0.15
_HIGHEST_ORDER = 12
# A folded line counts where the median window shows it by that many standard errors (chance: 1.2; the pump's own lines are in
# the error); from the second share of the fundamental on it disturbs. It must be told from the pump's and the rotor's lines, Hz.
_SEEN, _DISTURBS, _OWN, _ROTOR = 2.5, 0.05, 0.25, 0.12
_FEWEST = 5
# Windows of one speed and one mean pressure, within these shares.
_SAME_SPEED, _SAME_LEVEL = 0.03, 0.1
# Slower logs fold the line of a fast pump back, or do not show it at all, Hz.
_SLOWEST, _SLOW = 4.0, 8.0


@dataclass(frozen=True)
class PumpLine:
    """The pump at one set-point: blood flow as set (m^3/s), strokes a second (Hz), windows that tell it."""

    flow_set: float
    frequency: float
    windows: int

    @property
    def stroke(self) -> float:
        """Volume of a passage, m^3."""
        return self.flow_set / self.frequency


@dataclass(frozen=True, eq=False)
class PumpLines:
    """What a source's pre-filter (or next) pressure tells of the pump."""

    source: Source
    signal: Signal
    passages: Passages
    lines: tuple[PumpLine, ...]


def pump_lines(record: Record, source: Source) -> PumpLines | None:
    """Return the pump's lines in one source; None where its pressures are too slow or absent."""
    for tap in ("prefilter", "return", "access"):
        one = source.taps.get(tap)
        if one is None or not one.rate >= _SLOWEST or float(np.ptp(one.values)) == 0.0:
            continue
        passages = find_passages(one.time, one.values)
        flow = record.flow_set if source.reader != "bench" else None
        return PumpLines(source, one, passages, _by_set_point(passages, flow) if flow is not None else ())
    return None


def _by_set_point(passages: Passages, flow_set: Signal) -> tuple[PumpLine, ...]:
    """Return the median frequency at each set-point, of windows that hold it throughout."""
    windows = passages.windows
    first = np.clip(np.searchsorted(flow_set.time, windows.start, "right") - 1, 0, None)
    last = np.clip(np.searchsorted(flow_set.time, windows.end, "right") - 1, 0, None)
    held = flow_set.values[first] == flow_set.values[last]
    flow = np.where(held & passages.turning, flow_set.values[last], np.nan)
    found = []
    for value in np.unique(flow[np.isfinite(flow) & (flow > 0.0)]):
        rows = passages.frequency[flow == value]
        found.append(PumpLine(float(value), float(np.median(rows)), rows.size))
    return tuple(found)


def pump_faults(record: Record, found: PumpLines) -> list[QualityFinding]:
    """Return what the pump's lines of one source give away."""
    return [*line_faults(record, found), *_softer(record, found)]


def line_faults(record: Record, found: PumpLines) -> list[QualityFinding]:
    """Return what the frequencies of the pump's lines give away, in runs whose clamps are moved as well."""
    strokes = _strokes(record, found.source.reader, found.lines)
    return [*_jumps(record, found), *strokes, *_aliased(record, found)]


def _softer(record: Record, found: PumpLines) -> list[QualityFinding]:
    """Tell a pulsation that changes at some moment of one set-point, while mean and speed stay: air in the circuit."""
    passages = found.passages
    told = []
    for line in found.lines:
        rows = np.flatnonzero(passages.turning & (np.abs(passages.frequency / line.frequency - 1.0) < _SAME_SPEED))
        split = best_split(passages.amplitude[rows])
        if split is None or not rows.size:
            continue
        at, before, after = split
        level = passages.harmonics.mean[rows]
        if abs(float(level[at:].mean() / level[:at].mean()) - 1.0) > _SAME_LEVEL:
            continue
        moment = float(passages.windows.end[rows[at - 1]])
        text = (
            f"the pulsation of {found.signal.name} changes by {100 * (after / before - 1.0):+.0f} % near {moment:.0f} s at {6e7 * line.flow_set:.3g} mL/min while its mean "
            "stays: compliance changed (air between pump and filter?); E2 invalid, and C_2 and L_r are means of both"
        )
        told.append(QualityFinding("warning", text, record.run, found.signal.name, (moment, moment)))
    return told


def too_slow(record: Record, source: Source) -> list[QualityFinding]:
    """Tell a source that is sampled too slowly for the pump's lines."""
    one = next(iter(source.taps.values()))
    if not one.rate < _SLOW:
        return []
    text = (
        f"aliasing: {WORDS[source.reader]} pressures are sampled at {one.rate:.3g} Hz, and strokes of up to 3.5 Hz need {_SLOW:g} Hz at least: "
        "lines of the pump fold back, and move opposite to its speed. Sample faster, behind an anti-alias filter"
    )
    return [QualityFinding("warning", text, record.run, one.name)]


def _jumps(record: Record, found: PumpLines) -> list[QualityFinding]:
    jumps = found.passages.state == JUMP
    if not jumps.any():
        return []
    windows = found.passages.windows.of(jumps)
    text = (
        f"frequency is rotor rate, not roller rate, in {windows.size} of {jumps.size} windows of 10 s: the strongest line of {found.signal.name} jumps by a "
        f"factor 2 or 3 while the level stays (first at {windows.start[0]:.4g} s): one roller stands out, or the pump's line is weak. These windows are not used"
    )
    span = (float(windows.start[0]), float(windows.end[-1]))
    return [QualityFinding("warning", text, record.run, found.signal.name, span)]


def _strokes(record: Record, reader: str, lines: Sequence[PumpLine]) -> list[QualityFinding]:
    """Hold the frequencies of the set-points against each other, and a single one against the stroke of such pumps."""
    if not lines:
        return []
    if len(lines) > 1:
        usual = float(np.median([line.stroke for line in lines]))
        for low, high in pairwise(lines):
            if high.frequency < low.frequency:
                return [_moves_back(record, reader, low, high)]
        for line in lines:
            for factor, words in _FACTORS.items():
                if abs(usual / line.stroke / factor - 1.0) < _NEAR:
                    return [_odd_line(record, reader, line, words)]
    strokes = [line.stroke for line in lines]
    if strokes and not (_STROKE[0] <= float(np.median(strokes)) <= _STROKE[1]):
        text = (
            f"the pump's line at {lines[0].frequency:.3g} Hz makes {_ML * strokes[0]:.2g} mL a stroke of the flow as set, where {_ML * _STROKE[0]:g} to "
            f"{_ML * _STROKE[1]:g} mL can be: frequency is rotor rate, not roller rate, or the unit of blood_flow_set is wrong"
        )
        return [QualityFinding("warning", text, record.run)]
    return []


def _moves_back(record: Record, reader: str, low: PumpLine, high: PumpLine) -> QualityFinding:
    text = (
        f"aliasing: {WORDS[reader]} pump line moves opposite to the speed, from {low.frequency:.3g} Hz at {6e7 * low.flow_set:.3g} mL/min to "
        f"{high.frequency:.3g} Hz at {6e7 * high.flow_set:.3g} mL/min: the pulsation is faster than half the sampling rate and folds back. Sample at 10 Hz "
        "or more and add an anti-alias filter; lag, pole and compliances of this log cannot be trusted"
    )
    return QualityFinding("error", text, record.run)


def _odd_line(record: Record, reader: str, line: PumpLine, words: str) -> QualityFinding:
    text = (
        f"frequency is rotor rate, not roller rate: at {6e7 * line.flow_set:.3g} mL/min {WORDS[reader]} line stands at {line.frequency:.3g} Hz, {words} of what "
        "the other set-points let expect; its harmonics are not those of a stroke"
    )
    return QualityFinding("warning", text, record.run)


def _aliased(record: Record, found: PumpLines) -> list[QualityFinding]:
    """Tell harmonics above half the sampling rate that fold back into the record."""
    passages, one = found.passages, found.signal
    turning = np.flatnonzero(passages.turning)
    if turning.size < _FEWEST:
        return []
    strongest: tuple[float, int, float, float] | None = None
    for order in range(2, _HIGHEST_ORDER + 1):
        true = order * passages.frequency[turning]
        folded = np.abs(true - np.round(true / one.rate) * one.rate)
        strokes = passages.frequency[turning][:, None]
        apart = np.min(np.abs(folded[:, None] - strokes * np.arange(1, 8)), axis=1)
        rotor = np.min(np.abs(folded[:, None] - strokes * np.arange(1, 21) / 3.0), axis=1)
        clear = (
            (true > 0.5 * one.rate) & (folded > 0.3) & (apart > _OWN) & (rotor > _ROTOR) & (folded < 0.45 * one.rate)
        )
        if clear.sum() < _FEWEST:
            continue
        rows = turning[clear]
        line = harmonics(one.time, one.values, passages.windows.of(rows), folded[clear], orders=(1,))
        share = np.abs(line.coefficients[:, 0]) / passages.amplitude[rows]
        sure = float(np.median(np.abs(line.coefficients[:, 0]) / line.errors[:, 0]))
        if sure > _SEEN and (strongest is None or float(np.median(share)) > strongest[0]):
            strongest = (float(np.median(share)), order, float(np.median(true[clear])), float(np.median(folded[clear])))
    if strongest is None:
        return []
    share, order, true_, folded_ = strongest
    text = (
        f"aliasing: order {order} of the pump ({true_:.3g} Hz) is above half the sampling rate of {one.rate:.3g} Hz and shows folded back at {folded_:.3g} Hz in "
        f"{one.name}, {100 * share:.2g} % of the fundamental; it moves opposite to the speed. Add an anti-alias filter or sample faster"
    )
    return [QualityFinding("warning" if share > _DISTURBS else "note", text, record.run, one.name)]
