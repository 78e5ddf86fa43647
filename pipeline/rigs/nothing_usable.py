"""The one sentence for recordings of which nothing can be identified; `rigfit check` and identification share it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.recording import Recording

_REASONS_TOLD, _RUNS_TOLD = 3, 8


def nothing_usable(left_out: Mapping[str, str], recordings: Sequence[Recording], run: str = "run") -> str:
    """Say why no run can be used: every run is named, runs with the same reason together.

    Parameters
    ----------
    left_out
        Run -> why it is left out.
    run
        What a run is called, "drive".
    """
    if not left_out:
        return f"there is no {run} to identify."
    by_reason: dict[str, list[str]] = {}
    for name, reason in left_out.items():
        # Reasons that `rigfit check` tells too name their run themselves.
        bare = reason.removeprefix(f"run '{name}'").removeprefix(":").strip()
        by_reason.setdefault(bare, []).append(name)
    told = list(by_reason.items())[:_REASONS_TOLD]
    parts = [f"{_named(names, recordings, run)}: {reason.rstrip('.')}" for reason, names in told]
    others = [name for reason, names in list(by_reason.items())[_REASONS_TOLD:] for name in names]
    if others:
        parts.append(f"{counted(len(others), f'more {run}')} for reasons of their own: {listing(others, _RUNS_TOLD)}")
    told_all = "; ".join(parts)
    return f"no {run} can be used; {told_all}{'' if told_all.endswith('?') else '.'}"


def _named(names: Sequence[str], recordings: Sequence[Recording], run: str) -> str:
    if len(names) > 1:
        return f"{counted(len(names), run)} ({listing(names, _RUNS_TOLD)})"
    files = [
        source.path for recording in recordings if recording.run == names[0] for source in recording.provenance.files
    ]
    return f"{run} '{names[0]}' ({listing(files)})" if files else f"{run} '{names[0]}'"
