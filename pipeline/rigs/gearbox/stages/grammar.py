"""The order of the test: STANDSTILL STARTUP FOS (BRAKE SOS RELEASE FOS)* RUNDOWN? STANDSTILL? (gearbox.md, 5.1).

What breaks it is told with its times and what it costs; nothing is moved to make it fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from pipeline.rigs.gearbox.stages.stage import Problem, Stage, StageName

_FOLLOWS: dict[StageName, tuple[StageName, ...]] = {
    "standstill": ("startup",),
    "startup": ("fos",),
    "fos": ("brake", "rundown", "fos_loaded", "stall"),
    "fos_loaded": ("fos", "fos_after", "brake", "rundown"),
    "brake": ("sos", "stall"),
    "sos": ("release",),
    "stall": ("startup", "release", "standstill"),
    "release": ("fos_after",),
    "fos_after": ("brake", "rundown", "fos_loaded"),
    "rundown": ("standstill",),
}
_PROTOCOL: tuple[StageName, ...] = ("standstill", "startup", "fos", "brake", "sos", "release", "fos_after")
_SPOKEN: dict[StageName, str] = {
    "standstill": "a standstill",
    "startup": "the start-up",
    "fos": "FOS",
    "fos_loaded": "FOS under load",
    "brake": "the brake's rise",
    "sos": "SOS",
    "stall": "a stall",
    "release": "the release",
    "fos_after": "FOS again",
    "rundown": "the run-down",
}


def off_protocol(stages: Sequence[Stage]) -> tuple[list[Problem], bool]:
    """Return what breaks the protocol, with times, and whether all of its steps are there unbroken."""
    if not stages:
        return [], False
    problems = [*_begin(stages[0]), *_order(stages), *_extra(stages)]
    names = [stage.name for stage in stages]
    at = [names.index(name) if name in names else -1 for name in _PROTOCOL]
    complete = min(at) >= 0 and at == sorted(at) and not any(p.level == "error" for p in problems)
    broken = len(_begin(stages[0])) + len(_order(stages)) > 0
    return [*problems, *_missing(stages)], complete and not broken


def _begin(first: Stage) -> list[Problem]:
    if first.name == "standstill":
        return []
    text = (
        f"the record begins with {_SPOKEN[first.name]}: no standstill before the start-up, so zero offsets of the torques "
        "must come from the end of the run or stay unknown. Start the log 2 s before the motor"
    )
    return [Problem((first.start, first.end), text)]


def _order(stages: Sequence[Stage]) -> list[Problem]:
    problems = []
    seen = False
    for before, after in pairwise(stages):
        rest_at_end = before.name == "standstill" and seen and after.name != "startup"
        seen = seen or before.name == "startup"
        if after.name in _FOLLOWS[before.name] and not rest_at_end:
            continue
        if after.start > before.end + 1e-6:  # what lies between has been told already
            continue
        expected = "the end" if rest_at_end else " or ".join(_SPOKEN[name] for name in _FOLLOWS[before.name])
        text = f"{_SPOKEN[after.name]} follows {_SPOKEN[before.name]} at {after.start:.2f} s; {expected} was expected"
        problems.append(Problem((before.end, after.end), text))
    last = stages[-1]
    cut_short = last.name in ("sos", "release") and any(stage.name == "fos_after" for stage in stages)
    if last.name in ("brake", "startup", "stall") or cut_short:
        text = f"the record ends in {_SPOKEN[last.name]}: the steps after it are missing"
        problems.append(Problem((last.start, last.end), text))
    return problems


def _extra(stages: Sequence[Stage]) -> list[Problem]:
    problems = []
    starts = [stage for stage in stages if stage.name == "startup"]
    ends = [stage.start for stage in starts[1:]] + [stages[-1].end]
    for k, stage in enumerate(starts[1:], start=2):
        text = (
            f"the motor is started again at {stage.start:.2f} s: the log holds {len(starts)} runs, and this is run {k}; values are "
            "those of the first. Cut the log into one recording a run"
        )
        problems.append(Problem((stage.start, ends[k - 1]), text))
    k = 0
    for stage in stages:
        # Another run has its own first cycle.
        k = 0 if stage.name == "startup" else k + (stage.name == "sos")
        if stage.name != "sos" or k < 2:
            continue
        text = (
            f"a further brake cycle: the output is held again from {stage.start:.2f} to {stage.end:.2f} s (cycle {k}); the run's SOS "
            "values are those of the first cycle, the load's inertia and drag those of all"
        )
        # The protocol allows it.
        problems.append(Problem((stage.start, stage.end), text, "note"))
    for stage in stages:
        if stage.name == "stall":
            text = (
                f"the output stands under torque without mesh noise from {stage.start:.2f} to {stage.end:.2f} s: the motor is stalled, "
                "this is no SOS. The brake holds, or the lock carries, more than the drive gives"
            )
            problems.append(Problem((stage.start, stage.end), text))
    return problems


def _missing(stages: Sequence[Stage]) -> list[Problem]:
    names = [stage.name for stage in stages]
    whole = (stages[0].start, stages[-1].end)
    loaded = [stage for stage in stages if stage.name == "fos_loaded"]
    if "sos" not in names and "fos" in names:
        if "stall" in names:
            stall = next(stage for stage in stages if stage.name == "stall")
            text = (
                f"step 4 of the protocol is missing: the output stopped at {stall.start:.2f} s, but the input stopped with it (stall); "
                "the lock did not break, so there is no SOS"
            )
            return [Problem((stall.start, stall.end), text)]
        if loaded:
            span = (loaded[0].start, loaded[-1].end)
            text = (
                "step 4 of the protocol is missing: the gearbox was loaded but the lock never broke and the output never "
                "stopped, so there is no SOS. Brake harder"
            )
            return [Problem(span, text)]
        return [
            Problem(
                whole,
                "step 4 of the protocol is missing: no stop of the output under a brake was seen, so there is no SOS",
            )
        ]
    if "sos" in names and "fos_after" not in names:
        sos = next(stage for stage in stages if stage.name == "sos")
        text = "step 6 of the protocol is missing: after SOS the output did not run at nominal speed again"
        if stages[-1].name in ("sos", "release"):
            text = (
                f"step 6 of the protocol is missing: the record ends in {_SPOKEN[stages[-1].name]}, at {whole[1]:.2f} s"
            )
        return [Problem((sos.start, whole[1]), text)]
    return []
