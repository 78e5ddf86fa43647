"""The stages of a run, without labels: what the shaft does, read by the torque that goes with it (gearbox.md, 5.1).

A standing shaft is a standstill or SOS, which only the input torque tells apart; a running one is FOS with
or without load. A sequence that breaks the grammar of the test is told with its times, never forced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.brake_check import brake_faults
from pipeline.rigs.gearbox.stages.counts import Counts, counts_of
from pipeline.rigs.gearbox.stages.events import cycle_events, drive_lag, rundown_event, startup_event
from pipeline.rigs.gearbox.stages.grammar import off_protocol
from pipeline.rigs.gearbox.stages.levels import Levels, levels_of, loaded_spans
from pipeline.rigs.gearbox.stages.motion import Span, spans_of, steady_speed
from pipeline.rigs.gearbox.stages.stage import Cycle, EventName, EventTime, Problem, Segmentation, Stage, StageName

# The encoder may tell nothing for so long (s) before the torque is asked; it has then changed by this share of its level.
_LONG_GAP, _CHANGED, _FEW = 0.3, 0.3, 20
# The encoder may be logged for so long without the torques, s.
_ALONE = 0.5
# What is left of a stage that was cut lasts so long at the least, s.
_SHORTEST = 0.15


def segment(record: Record) -> Segmentation:
    """Return the stages and events of a run whose boards are on one clock.

    Parameters
    ----------
    record
        As `alignment.align` returns it.

    Returns
    -------
    What could be told; a run that does not follow the protocol comes with problems and fewer stages.
    """
    counts = counts_of(record)
    spans, nominal = spans_of(counts)
    if not any(span.state == "nominal" for span in spans):
        return Segmentation((), {}, False, (*counts.problems, _never_turns(counts)), nominal)
    levels = levels_of(record)
    nominal = steady_speed(counts, spans)
    spans, alone = _with_torques(record, spans)
    if not any(span.state == "nominal" for span in spans):
        return Segmentation((), {}, False, (*counts.problems, *alone), nominal)
    spans, frozen = levels.hesitations(levels.split(spans))
    rough, problems = rough_stages(record, spans, levels)
    # What lies in a gap of the counts has been told with the gap.
    problems = [p for p in problems if not any(a - 0.1 <= p.span[0] and p.span[1] <= b + 0.1 for a, b in counts.gaps)]
    problems += [*frozen, *alone]
    stages, cycles, unplaced = _refined(record, counts, rough)
    problems += unplaced
    found = dict(cycles[0][1]) if cycles else {}
    found |= rundown_event(record, counts, stages, drive_lag(found))
    found |= startup_event(record, counts, stages, drive_lag(found))
    stages = _with_ends(stages, found)
    stages, unseen = lost_in(record, counts, stages)
    protocol, complete = off_protocol(stages)
    doubts = _doubtful(stages, levels)
    protocol += [*doubts, *unseen, *brake_faults(record, stages)]
    order = sorted((*counts.problems, *problems, *protocol), key=lambda problem: problem.span)
    gaps = tuple(sorted((*counts.gaps, *(problem.span for problem in frozen))))
    complete = complete and not doubts and not unseen and not [p for p in problems if p not in frozen]
    return Segmentation(tuple(stages), found, complete, tuple(order), nominal, _cycles(stages, cycles), gaps)


def _cycles(stages: Sequence[Stage], found: Sequence[tuple[float, dict[EventName, EventTime]]]) -> tuple[Cycle, ...]:
    """Return the brake cycles with the stages around each SOS; `found` holds the SOS's first guess and its events."""
    out = []
    for about, events in found:
        i = next(k for k, stage in enumerate(stages) if stage.name == "sos" and stage.start < about < stage.end)
        around: dict[StageName, tuple[float, float]] = {"sos": (stages[i].start, stages[i].end)}
        for k in (i - 1, i - 2):
            if k >= 0 and stages[k].name in ("brake", "fos", "fos_after"):
                name: StageName = "brake" if stages[k].name == "brake" else "fos"
                around.setdefault(name, (stages[k].start, stages[k].end))
        for stage in stages[i + 1 : i + 3]:
            if stage.name in ("release", "fos_after"):
                around.setdefault(stage.name, (stage.start, stage.end))
        out.append(Cycle(events, around))
    return tuple(out)


def _doubtful(stages: Sequence[Stage], levels: Levels) -> list[Problem]:
    """Return where an SOS may be a stall: the vibration denies it, and so the clocks disagree, or nothing tells of the input."""
    problems = []
    running = next((stage for stage in stages if stage.name.startswith("fos")), None)
    silent = levels.vibration is None and levels.speed_in is None
    for stage in stages:
        if stage.name == "sos" and silent and running is not None and not levels.breaks_away(stage, running):
            text = (
                f"the output is held from {stage.start:.2f} to {stage.end:.2f} s without a peak of the input torque as it stops, and "
                "neither vibration nor speed_in is logged: SOS or a stalled motor, that cannot be told"
            )
            problems.append(Problem((stage.start, stage.end), text))
    for stage in stages:
        noise = levels.elsewhere(stage) if stage.name == "sos" else None
        if noise is not None:
            text = (
                f"the output is held under torque from {stage.start:.2f} to {stage.end:.2f} s, but the mesh noise of an SOS lies "
                f"at {noise[0]:.2f} to {noise[1]:.2f} s: the clocks of the boards do not agree, and how is not known. Whether this "
                "is SOS or a stalled motor cannot be told"
            )
            problems.append(Problem((stage.start, stage.end), text))
    return problems


def lost_in(record: Record, counts: Counts, stages: list[Stage]) -> tuple[list[Stage], list[Problem]]:
    """Return the stages without what was not seen, and where: the encoder told nothing while the torque left its level."""
    problems, kept = [], list(stages)
    for start, end in counts.gaps:
        over = [stage for stage in stages if stage.start < end and stage.end > start]
        if end - start < _LONG_GAP or not over or not all(stage.name.startswith("fos") for stage in over):
            continue
        torque = record.torque.part(start, end)["torque_in"]
        beside = record.torque.part(over[0].start, start)["torque_in"]
        if torque.size < _FEW or beside.size < _FEW:
            continue
        level, spread = float(np.median(beside)), float(np.ptp(np.percentile(beside, [5, 95])))
        away = float(np.abs(np.percentile(torque, [5, 95]) - level).max())
        if away > _CHANGED * abs(level) + spread:
            text = (
                f"the input torque leaves its level while the encoder told nothing ({start:.2f} to {end:.2f} s): what the output "
                "did then, an SOS perhaps, is not known"
            )
            problems.append(Problem((start, end), text))
            kept = [piece for stage in kept for piece in _cut(stage, start, end)]
    return kept, problems


def _cut(stage: Stage, start: float, end: float) -> list[Stage]:
    """Return what is left of a stage without the time from `start` to `end`."""
    left = replace(stage, end=min(stage.end, start)), replace(stage, start=max(stage.start, end))
    return [one for one in left if one.duration > _SHORTEST]


def _with_torques(record: Record, spans: list[Span]) -> tuple[list[Span], list[Problem]]:
    """Return the spans while torques were logged: beyond, a standing shaft may be anything."""
    first, last = record.torque.span
    problems = []
    for text, start, end in (
        (f"the torques begin at {first:.2f} s only, the encoder at {spans[0].start:.2f} s", spans[0].start, first),
        (f"the torques end at {last:.2f} s, the encoder goes on to {spans[-1].end:.2f} s", last, spans[-1].end),
    ):
        if end - start > _ALONE:
            problems.append(Problem((start, end), f"{text}: no stage can be told without torques"))
    cut = [replace(span, start=max(span.start, first), end=min(span.end, last)) for span in spans]
    return [span for span in cut if span.end > span.start], problems


def _never_turns(counts: Counts) -> Problem:
    span = (float(counts.time[0]), float(counts.time[-1]))
    text = "the output shaft never runs at a steady speed: there is no start-up and no FOS to read"
    return Problem(span, text, "error")


def rough_stages(record: Record, spans: list[Span], levels: Levels) -> tuple[list[Stage], list[Problem]]:
    """Return the stages as the motion bounds them, and what fits none."""
    stages: list[Stage] = []
    problems: list[Problem] = []
    slipped = False  # the gears slipped since the last start-up
    standing = levels.standing(spans)
    for i, span in enumerate(spans):
        before, after = (spans[i - 1] if i else None), (spans[i + 1] if i + 1 < len(spans) else None)
        name: StageName | None
        if span.state == "zero":
            name = standing[i]
            slipped = slipped or name == "sos"
        elif span.state == "nominal":
            name = "fos_after" if slipped else "fos"
        else:
            held = standing.get(i - 1, "standstill") != "standstill"
            stops = standing.get(i + 1, "standstill") != "standstill"
            name = _moving(before, after, held, stops)
            slipped = name == "release" or (slipped and name != "startup")
        if name is None:
            text = f"the output shaft left its nominal speed without a stop ({span.speed:.3g} rad/s)"
            if before is not None and before.state == "zero":
                text = f"the output shaft moved ({span.speed:.3g} rad/s) without reaching a steady speed"
            problems.append(Problem((span.start, span.end), text))
        elif span.state == "nominal":
            stages += loaded_spans(record, span, name)
        else:
            stages.append(Stage(name, span.start, span.end))
    return stages, problems


def _moving(before: Span | None, after: Span | None, held: bool, stops: bool) -> StageName | None:
    """Return what a shaft does that moves between two spans; `held`, `stops`: it stood, will stand, under torque."""
    if before is None:
        return "startup" if after is not None and after.state == "nominal" else None
    if before.state == "zero":
        if after is not None and after.state == "nominal":
            return "release" if held else "startup"
        return "release" if held and (after is None or stops) else "rundown" if held else None
    if stops:
        return "brake"
    return "rundown" if after is None or after.state == "zero" else None


def _refined(
    record: Record, counts: Counts, rough: list[Stage]
) -> tuple[list[Stage], list[tuple[float, dict[EventName, EventTime]]], list[Problem]]:
    """Move the bounds of every brake cycle to its events; a brake shorter than the speed's window is put in."""
    stages, problems = list(rough), []
    cycles: list[tuple[float, dict[EventName, EventTime]]] = []
    for sos in [stage for stage in rough if stage.name == "sos"]:
        events = cycle_events(record, counts, rough, sos)
        placed = _placed(stages, sos, events)
        if _ordered(placed):
            stages = placed
            cycles.append((0.5 * (sos.start + sos.end), events))
        else:
            text = "the events around this SOS contradict each other, so none is given"
            problems.append(Problem((sos.start, sos.end), text))
    return stages, cycles, problems


def _placed(stages: list[Stage], sos: Stage, events: dict[EventName, EventTime]) -> list[Stage]:
    """Return the stages with the bounds of brake, SOS and release at the events, as far as there are some."""
    i = stages.index(sos)
    before, after = stages[:i], stages[i + 1 :]
    start = events["sos_start"].time if "sos_start" in events else sos.start
    end = events["sos_end"].time if "sos_end" in events else sos.end
    brake, release = [], []
    if before and before[-1].name == "brake":
        brake = [replace(before.pop(), end=start)]
    if after and after[0].name == "release":
        release = [replace(after.pop(0), start=end)]
    if "brake_onset" in events:
        onset = events["brake_onset"].time
        before[-1] = replace(before[-1], end=onset)
        brake = [Stage("brake", onset, start)]
    if "relock" in events:
        relock = events["relock"].time
        release = [Stage("release", end, relock)]
        after[0] = replace(after[0], start=relock)
    return [*before, *brake, Stage("sos", start, end), *release, *after]


def _ordered(stages: Sequence[Stage]) -> bool:
    """Tell whether every stage lasts and none begins before the last one ends."""
    apart = all(a.end <= b.start + 1e-9 for a, b in pairwise(stages))
    return apart and all(stage.end > stage.start for stage in stages)


def _with_ends(stages: list[Stage], events: dict[EventName, EventTime]) -> list[Stage]:
    """Move the begin of the start-up and of the run-down to their events."""
    for name in ("startup", "rundown"):
        if name not in events:
            continue
        moved = list(stages)
        i = next(k for k, stage in enumerate(moved) if stage.name == name)
        moved[i - 1 : i + 1] = [
            replace(moved[i - 1], end=events[name].time),
            replace(moved[i], start=events[name].time),
        ]
        if _ordered(moved):
            stages = moved
        else:
            del events[name]
    return stages
