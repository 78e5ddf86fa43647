"""When things happened, with their errors: motion from counts, brake and unlock from the input torque (gearbox.md, 5.1 step 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.breaks import Shape, find_break, parabola, parabola_before, ramp, ramp_before, step
from pipeline.rigs.gearbox.stages.counts import Counts, edges
from pipeline.rigs.gearbox.stages.stage import EventName, EventTime, Stage
from pipeline.signals.filtering import low_pass
from pipeline.signals.periodogram import block_means

PEAK_CUTOFF = 20.0
"""Cutoff of the low-pass under which the torque's peak is read, Hz."""

# A start is looked for this far ahead of the first count, s.
_REACH = 0.5
# A fall of the torque is clear that takes this many variances away.
_CLEAR = 40.0
Found = dict[EventName, EventTime]
# A brake and a drive come on smoothly where a straight ramp or a parabola is fitted: what that may do to a time, s.
_SHAPE: dict[EventName, float] = {
    "startup": 0.02,
    "brake_onset": 0.01,
    "unlock": 0.25 / PEAK_CUTOFF,
    "sos_start": 0.005,
    "sos_end": 0.03,
    "relock": 0.01,
    "rundown": 0.015,
}


def startup_event(record: Record, counts: Counts, stages: Sequence[Stage]) -> Found:
    """Return when the output began to turn out of a standstill.

    The drive winds the shafts up until friction lets go: there the input torque bends, and long before
    the first count. Where no bend is clear the first counts decide.
    """
    i = next((k for k, stage in enumerate(stages) if stage.name == "startup"), None)
    if i is None or i == 0 or stages[i - 1].name != "standstill":
        return {}
    blunt = _starts(counts, stages[i - 1].end, 0.3)
    first = stages[i - 1].end
    near = min(blunt.time, first - 0.05)
    # The counts, which bend smoothly, are late rather than early.
    since = near - max(0.12, min(3.0 * blunt.sd, 0.25))
    part = record.torque.part(since - 0.1, first + 0.15)
    block = max(round(0.005 * part.rate), 1) if part.time.size > 2 else 1
    time, level = block_means(part.time, part["torque_in"], block)
    if time.size < 30:
        return _widened({"startup": blunt})
    late = time - first
    columns = [np.ones_like(late), late, late**2]
    latest = min(first, max(blunt.time, near) + blunt.sd)
    bend, (without, bent) = find_break(time, level, columns, [ramp, parabola], (since, latest))
    clear = without - bent > _CLEAR * bent / time.size
    return _widened({"startup": bend if clear else blunt})


def rundown_event(counts: Counts, stages: Sequence[Stage]) -> Found:
    """Return when the output left nominal speed for good."""
    i = next((k for k, stage in enumerate(stages) if stage.name == "rundown"), None)
    if not i or not stages[i - 1].name.startswith("fos"):
        return {}
    stage = stages[i]
    return _widened({"rundown": _kink(counts, stage.start, min(0.5, 0.7 * stage.duration), 1.0)})


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
    if i:
        found["sos_start"] = _stops(counts, sos.start)
    if before and before[-1].name.startswith("fos"):
        found.update(_brake(record, counts, before[-1], found["sos_start"].time))
    after = [stage for stage in stages[i + 1 :] if stage.name != "release"]
    if i + 1 < len(stages) and stages[i + 1].name not in ("standstill", "stall"):
        found["sos_end"] = _starts(counts, sos.end, 0.15)
        if after and after[0].name.startswith("fos"):
            found["relock"] = _relock(record, counts, found["sos_end"].time, after[0])
    return _widened(found)


def _widened(found: Found) -> Found:
    """Return the events with what the fitted shape leaves open added to their errors.

    Noise, sampling and slope are in each fit's own error. What the shape adds cannot be read off one run: the floors
    are what straight shapes do to the smooth onsets of the synthetic rig (gearbox.md, section 6), where they cover the
    error at 60 to 240 rpm; that of `unlock` is a quarter of the low-pass's period. On a drive or brake that comes on
    over much more than its 0.15 to 0.3 s they may be too small.
    """
    return {name: EventTime(event.time, math.hypot(event.sd, _SHAPE[name])) for name, event in found.items()}


def _starts(counts: Counts, end: float, window: float) -> EventTime:
    """Return when a standing shaft began to turn, from its first counts; `window` s of them are used."""
    if (unseen := _unseen(counts, end)) is not None:
        return unseen
    at, _ = edges(counts)
    k = min(int(np.searchsorted(at, end - 1e-6)), at.size - 1)
    first, last = float(at[k]), float(at[min(k + 5, at.size - 1)])
    fitted = (first, max(first + window, last))
    return _standing_end(counts, fitted, (first - _REACH, first), first - _REACH, (parabola,))


def _stops(counts: Counts, start: float) -> EventTime:
    """Return when the shaft stood, from its last counts: the same as a start, backwards."""
    if (unseen := _unseen(counts, start)) is not None:
        return unseen
    at, _ = edges(counts)
    k = max(int(np.searchsorted(at, start + 1e-6)) - 1, 0)
    last, first = float(at[k]), float(at[max(k - 5, 0)])
    fitted = (min(last - 0.12, first), last)
    return _standing_end(counts, fitted, (last, last + counts.still), last + counts.still, (parabola_before,))


def _unseen(counts: Counts, bound: float) -> EventTime | None:
    """Return the middle of a gap in the counts in which a stand's `bound` lies, s: it hides the event."""
    near = 2.0 * float(np.median(np.diff(counts.time)))
    hidden = [gap for gap in counts.gaps if gap[0] - near <= bound <= gap[1] + near]
    if not hidden:
        return None
    start, end = hidden[0]
    return EventTime(0.5 * (start + end), (end - start) / math.sqrt(12))


def _standing_end(
    counts: Counts, fitted: tuple[float, float], within: tuple[float, float], stands: float, shapes: Sequence[Shape]
) -> EventTime:
    """Return when a stand ends, or begins, from the moving samples of `fitted` and one of the stand, at `stands`.

    All samples of a stand have the same error, half a count at the most: they count as one.
    """
    t, angle = _angle(counts, fitted)
    still = float(np.interp(stands, counts.time, counts.angle))
    t, angle = np.append(t, stands), np.append(angle, still)
    edge = fitted[0] if stands < fitted[0] else fitted[1]
    sampling = float(np.median(np.diff(counts.time)))
    if t.size < 6:
        return EventTime(edge, 0.25 * counts.still + sampling)
    found, _ = find_break(t, angle, [np.ones_like(t)], shapes, within, counts.step / math.sqrt(12))
    return EventTime(found.time, math.hypot(found.sd, 0.5 * sampling))


def _kink(counts: Counts, near: float, after: float, before: float) -> EventTime:
    """Return when a steady speed begins to fall, near `near`: where the angle leaves its straight line."""
    span = (max(near - before, float(counts.time[0])), min(near + after, float(counts.time[-1])))
    t, angle = _angle(counts, span)
    found, _ = find_break(t, angle, [np.ones_like(t), t - near], [parabola], (span[0] + 0.1, span[1] - 0.05))
    return found


def _relock(record: Record, counts: Counts, free: float, fos: Stage) -> EventTime:
    """Return when the gears lock again: the speed bends from rising to steady, and the torque falls.

    The bend of the speed is sure and blunt, the fall of the torque sharp where there is one.
    """
    near = fos.start
    span = (max(free + 0.05, near - 0.45), min(near + 0.5, fos.end))
    t, angle = _angle(counts, span)
    within = (span[0] + 0.1, min(near + 0.2, span[1] - 0.1))
    blunt, _ = find_break(t, angle, [np.ones_like(t), t - near], [parabola_before], within)
    part = record.torque.part(max(free + 0.05, blunt.time - 0.4), min(blunt.time + 1.2, fos.end))
    if part.time.size < 60:
        return blunt
    block = max(round(0.005 * part.rate), 1)
    time, level = block_means(part.time, part["torque_in"], block)
    turned = counts.at(time)
    known = np.isfinite(turned)
    time, level, turned = time[known], level[known], turned[known]
    if time.size < 60:
        return blunt
    within = (max(time[0] + 0.1, blunt.time - 0.2), min(time[-1] - 0.1, blunt.time + 0.2))
    sharp, (without, with_step) = find_break(time, level, _ripple(turned), [step, ramp_before], within)
    clear = without - with_step > _CLEAR * with_step / time.size
    return EventTime(sharp.time, math.hypot(sharp.sd, 0.5 * block / part.rate)) if clear else blunt


def _ripple(turned: np.ndarray) -> list[np.ndarray]:
    """Return a constant and the first two shaft orders over the angle."""
    return [np.ones_like(turned)] + [f(k * turned) for k in (1, 2) for f in (np.cos, np.sin)]


def _angle(counts: Counts, span: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    inside = (counts.time >= span[0]) & (counts.time <= span[1])
    return counts.time[inside], counts.angle[inside]


def _brake(record: Record, counts: Counts, fos: Stage, stop: float) -> Found:
    """Return when the brake began to load the gearbox and when the lock broke, both from the input torque."""
    torque = record.torque.part(max(fos.start, fos.end - 4.0), stop + 0.5)
    if torque.time.size < 60:
        return {}
    smooth = low_pass(torque.time, torque["torque_in"], PEAK_CUTOFF)
    smooth = smooth * np.sign(np.median(smooth))
    candidates = np.flatnonzero((torque.time >= fos.end - 0.8) & (torque.time <= stop + 0.1))
    if not candidates.size:
        return {}
    peak = candidates[int(np.argmax(smooth[candidates]))]
    unlock = float(torque.time[peak])
    found: Found = {"unlock": EventTime(unlock, 0.5 / torque.rate)}
    early = smooth[torque.time < unlock - 1.0]
    base = float(np.median(early)) if early.size else float(smooth[0])
    # The straight part of the rise only: towards its end the low-pass, and the brake, bend it.
    risen = np.flatnonzero(smooth[:peak] < base + 0.7 * (smooth[peak] - base))
    if not risen.size:
        return found
    block = max(round(0.005 * torque.rate), 1)
    rise = slice(0, int(risen[-1]) + 1)
    time, level = block_means(torque.time[rise], torque["torque_in"][rise], block)
    turned = counts.at(time)
    known = np.isfinite(turned)
    time, level, turned = time[known], level[known], turned[known]
    if time.size < 30:
        return found
    onset, _ = find_break(time, level, _ripple(turned), [ramp], (max(time[0] + 0.1, unlock - 1.0), float(time[-1])))
    found["brake_onset"] = EventTime(onset.time, math.hypot(onset.sd, 0.5 * block / torque.rate))
    return found
