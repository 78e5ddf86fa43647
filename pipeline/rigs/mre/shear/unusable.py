"""The one sentence for recordings of which nothing can be identified; `rigfit check` and identification share it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.recording import Recording

_REASONS_TOLD, _RUNS_TOLD = 3, 8


def nothing_usable(left_out: Mapping[str, str], recordings: Sequence[Recording]) -> str:
    """Say why no run can be used: every run is named, runs with the same reason together.

    Parameters
    ----------
    left_out
        Run -> why it is left out.
    """
    if not left_out:
        return "there is no run to identify."
    by_reason: dict[str, list[str]] = {}
    for run, reason in left_out.items():
        by_reason.setdefault(reason, []).append(run)
    told = list(by_reason.items())[:_REASONS_TOLD]
    parts = [f"{_named(runs, recordings)}: {reason.rstrip('.')}" for reason, runs in told]
    others = [run for reason, runs in list(by_reason.items())[_REASONS_TOLD:] for run in runs]
    if others:
        parts.append(f"{counted(len(others), 'more run')} for reasons of their own: {listing(others, _RUNS_TOLD)}")
    return f"no run can be used; {'; '.join(parts)}."


def _named(runs: Sequence[str], recordings: Sequence[Recording]) -> str:
    if len(runs) > 1:
        return f"{len(runs)} runs ({listing(runs, _RUNS_TOLD)})"
    files = [
        source.path for recording in recordings if recording.run == runs[0] for source in recording.provenance.files
    ]
    return f"run '{runs[0]}' ({listing(files)})" if files else f"run '{runs[0]}'"
