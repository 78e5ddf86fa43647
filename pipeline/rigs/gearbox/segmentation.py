"""The stages of a run, without labels: what the shaft does, read by the torque that goes with it (gearbox.md, 5.1).

A standing shaft is a standstill or SOS, which only the input torque tells apart; a running one is FOS with
or without load. A sequence that breaks the grammar of the test is told with its times, never forced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from pipeline.rigs.gearbox.counts import Counts, counts_of
from pipeline.rigs.gearbox.events import cycle_events, rundown_event, startup_event
from pipeline.rigs.gearbox.grammar import off_protocol
from pipeline.rigs.gearbox.levels import Levels, levels_of, loaded_spans
from pipeline.rigs.gearbox.motion import Span, spans_of, steady_speed
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages import EventName, EventTime, Problem, Segmentation, Stage, StageName


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
    spans, nominal = levels.split(spans), steady_speed(counts, spans)
    rough, problems = rough_stages(record, spans, levels)
    stages, cycles, unplaced = _refined(record, counts, rough)
    problems += unplaced
    found = {
        **startup_event(record, counts, stages),
        **(cycles[0] if cycles else {}),
        **rundown_event(counts, stages),
    }
    stages = _with_ends(stages, found)
    protocol, complete = off_protocol(stages)
    order = sorted((*counts.problems, *problems, *protocol), key=lambda problem: problem.span)
    return Segmentation(tuple(stages), found, complete and not problems, tuple(order), nominal, tuple(cycles))


def _never_turns(counts: Counts) -> Problem:
    span = (float(counts.time[0]), float(counts.time[-1]))
    text = "the output shaft never runs at a steady speed: there is no start-up and no FOS to read"
    return Problem(span, text, "error")


def rough_stages(record: Record, spans: list[Span], levels: Levels) -> tuple[list[Stage], list[Problem]]:
    """Return the stages as the motion bounds them, and what fits none."""
    stages: list[Stage] = []
    problems: list[Problem] = []
    slipped = False
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
) -> tuple[list[Stage], list[dict[EventName, EventTime]], list[Problem]]:
    """Move the bounds of every brake cycle to its events; a brake shorter than the speed's window is put in."""
    stages, cycles, problems = list(rough), [], []
    for sos in [stage for stage in rough if stage.name == "sos"]:
        events = cycle_events(record, counts, rough, sos)
        placed = _placed(stages, sos, events)
        if _ordered(placed):
            stages = placed
            cycles.append(events)
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
