"""When things happened, with their errors: motion from counts, brake and unlock from the input torque (gearbox.md, 5.1 step 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.rigs.gearbox.breaks import find_break, parabola, parabola_before, ramp
from pipeline.rigs.gearbox.counts import Counts, edges
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages import EventName, EventTime, Stage
from pipeline.signals.filtering import low_pass
from pipeline.signals.periodogram import block_means

PEAK_CUTOFF = 20.0
"""Cutoff of the low-pass under which the torque's peak is read, Hz."""

Found = dict[EventName, EventTime]


def startup_event(counts: Counts, stages: Sequence[Stage]) -> Found:
    """Return when the output began to turn out of a standstill."""
    i = next((k for k, stage in enumerate(stages) if stage.name == "startup"), None)
    if i is None or i == 0 or stages[i - 1].name != "standstill":
        return {}
    return {"startup": _starts(counts, stages[i - 1].end, 0.6)}


def rundown_event(counts: Counts, stages: Sequence[Stage], nominal: float) -> Found:
    """Return when the output left nominal speed for good."""
    stage = next((stage for stage in stages if stage.name == "rundown"), None)
    if stage is None:
        return {}
    return {"rundown": _kink(counts, stage.start, min(0.5, 0.7 * stage.duration), 1.0)}


def cycle_events(record: Record, counts: Counts, stages: Sequence[Stage], sos: Stage) -> Found:
    """Return the events around one SOS, as far as the record holds them.

    Parameters
    ----------
    stages
        As the motion bounds them.
    sos
        The stage whose cycle is meant.
    """
    i = list(stages).index(sos)
    found: Found = {}
    before = [stage for stage in stages[:i] if stage.name != "brake"]
    found["sos_start"] = _stops(counts, sos.start)
    if before and before[-1].name.startswith("fos"):
        found.update(_brake(record, counts, before[-1], found["sos_start"].time))
    after = [stage for stage in stages[i + 1 :] if stage.name != "release"]
    if i + 1 < len(stages):
        found["sos_end"] = _starts(counts, sos.end, 0.25)
        if after and after[0].name.startswith("fos"):
            found["relock"] = _relock(counts, found["sos_end"].time, after[0])
    return found


def _starts(counts: Counts, end: float, window: float) -> EventTime:
    """Return when the shaft began to turn: the vertex of a parabola through its first counts."""
    at, _ = edges(counts)
    first = float(at[min(np.searchsorted(at, end - 1e-6), at.size - 1)])
    last = max(first + window, float(at[min(np.searchsorted(at, first) + 5, at.size - 1)]))
    return _vertex(counts, first, (first, last), (first - counts.still - 0.5, first))


def _stops(counts: Counts, start: float) -> EventTime:
    """Return when the shaft stood: the vertex of a parabola through its last counts."""
    at, _ = edges(counts)
    k = max(int(np.searchsorted(at, start + 1e-6)) - 1, 0)
    last = float(at[k])
    first = min(last - 0.12, float(at[max(k - 5, 0)]))
    return _vertex(counts, last, (first, last), (last, last + counts.still))


def _vertex(counts: Counts, edge: float, fitted: tuple[float, float], within: tuple[float, float]) -> EventTime:
    inside = (counts.time >= fitted[0]) & (counts.time <= fitted[1])
    t = counts.time[inside] - edge
    sampling = float(np.median(np.diff(counts.time)))
    fallback = EventTime(edge, 0.25 * counts.still + sampling)
    if t.size < 5:
        return fallback
    A = np.vander(t, 3)
    (c, b, _), *_ = np.linalg.lstsq(A, counts.angle[inside], rcond=None)
    if c == 0.0 or not within[0] <= edge - b / (2 * c) <= within[1]:
        return fallback
    noise = max(
        counts.step / math.sqrt(12),
        float(np.std(A @ np.linalg.lstsq(A, counts.angle[inside], rcond=None)[0] - counts.angle[inside])),
    )
    covariance = noise**2 * np.linalg.inv(A.T @ A)
    gradient = np.array([b / (2 * c * c), -1 / (2 * c), 0.0])
    sd = math.sqrt(float(gradient @ covariance @ gradient))
    return EventTime(edge - float(b / (2 * c)), math.hypot(sd, 0.5 * sampling))


def _kink(counts: Counts, near: float, after: float, before: float) -> EventTime:
    """Return when a steady speed begins to fall, near `near`: where the angle leaves its straight line."""
    span = (max(near - before, float(counts.time[0])), min(near + after, float(counts.time[-1])))
    t, angle = _angle(counts, span)
    found, _ = find_break(t, angle, [np.ones_like(t), t - near], [parabola], (span[0] + 0.1, span[1] - 0.05))
    return found


def _relock(counts: Counts, free: float, fos: Stage) -> EventTime:
    """Return when an accelerating shaft reaches its steady speed: where the angle runs into a straight line."""
    rise = fos.start - free
    span = (free + 0.4 * rise, min(fos.start + max(0.5 * rise, 0.4), fos.end))
    t, angle = _angle(counts, span)
    columns = [np.ones_like(t), t - fos.start]
    within = (span[0] + 0.1, min(fos.start + 0.2, span[1] - 0.1))
    found, _ = find_break(t, angle, columns, [parabola_before], within)
    return found


def _angle(counts: Counts, span: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    inside = (counts.time >= span[0]) & (counts.time <= span[1])
    return counts.time[inside], counts.angle[inside]


def _brake(record: Record, counts: Counts, fos: Stage, stop: float) -> Found:
    """Return when the brake began to load the gearbox and when the lock broke, both from the input torque."""
    torque = record.torque.part(max(fos.start, fos.end - 4.0), stop + 0.5)
    smooth = low_pass(torque.time, torque["torque_in"], PEAK_CUTOFF)
    candidates = np.flatnonzero((torque.time >= fos.end - 0.8) & (torque.time <= stop + 0.1))
    if not candidates.size:
        return {}
    peak = candidates[int(np.argmax(smooth[candidates]))]
    unlock = float(torque.time[peak])
    found: Found = {"unlock": EventTime(unlock, 0.25 / PEAK_CUTOFF)}
    early = smooth[torque.time < unlock - 1.0]
    base = float(np.median(early)) if early.size else float(smooth[0])
    # The straight part of the rise only: towards its end the low-pass, and the brake, bend it.
    risen = np.flatnonzero(smooth[:peak] < base + 0.7 * (smooth[peak] - base))
    if not risen.size:
        return found
    block = max(round(0.005 * torque.rate), 1)
    time, level = block_means(torque.time[: risen[-1] + 1], torque["torque_in"][: risen[-1] + 1], block)
    turned = counts.at(time)
    known = np.isfinite(turned)
    time, level, turned = time[known], level[known], turned[known]
    if time.size < 30:
        return found
    ripple = [np.ones_like(time)] + [f(k * turned) for k in (1, 2) for f in (np.cos, np.sin)]
    onset, _ = find_break(time, level, ripple, [ramp], (max(time[0] + 0.1, unlock - 1.0), float(time[-1])))
    found["brake_onset"] = EventTime(onset.time, math.hypot(onset.sd, 0.5 * block / torque.rate))
    return found
