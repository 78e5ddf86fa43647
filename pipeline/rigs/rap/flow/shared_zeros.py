"""Zeros for runs in which the pump never stops: those that the other runs show, told (rap.md, section 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.run_windows import RunNumbers
from pipeline.rigs.rap.flow.zero import Zero

_TAPS = {"access": "access", "prefilter": "prefilter", "return": "back"}


def with_zeros(runs: Sequence[RunNumbers]) -> list[RunNumbers]:
    """Return the runs with the zeros of the others taken off where they have none of their own."""
    known: dict[str, list[tuple[str, Zero]]] = {tap: [] for tap in _TAPS}
    for run in runs:
        for tap in _TAPS:
            if (zero := run.zeros.get(tap)) is not None and zero.known:
                known[tap].append((run.run.name, zero))
    return [_with(run, known) for run in runs]


def _with(run: RunNumbers, known: dict[str, list[tuple[str, Zero]]]) -> RunNumbers:
    missing = [tap for tap in _TAPS if tap in run.zeros and not run.zeros[tap].known]
    shared = [tap for tap in missing if known[tap]]
    if not missing or not run.windows.size:
        return run
    problems, windows, zeros = list(run.problems), run.windows, dict(run.zeros)
    for tap in shared:
        values = [zero.value for _, zero in known[tap]]
        zeros[tap] = Zero(float(np.median(values)), float(np.std(values)) if len(values) > 1 else float("nan"))
        changed = {_TAPS[tap]: getattr(windows, _TAPS[tap]) - zeros[tap].value}
        windows = replace(windows, **changed)
    windows = replace(windows, back_pressure=windows.prefilter - windows.access)
    if shared:
        names = listing([name for name, _ in known[shared[0]]], 4)
        text = f"the pump never stands long enough to show a zero; the zeros of {names} are taken off: the sensors must not have been touched in between"
        problems.append(QualityFinding("note", text, run.run.name))
    else:
        text = (
            "no pump stop of any run shows the zeros of the pressures: means are used as logged, and an offset of 100 Pa is 0.3 % of E3's stroke volume. "
            "Log 10 s with the pump stopped, before or after"
        )
        problems.append(QualityFinding("warning", text, run.run.name))
    return replace(run, windows=windows, zeros=zeros, problems=problems)
