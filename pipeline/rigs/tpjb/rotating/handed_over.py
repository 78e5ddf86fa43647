"""Findings of other campaigns that were handed over: which fit the runs, and why the others are not used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.rotating.dynamic_stiffness import dynamic_states, state_at
from pipeline.rigs.tpjb.rotating.group import LoadGroup


def fitting(
    groups: Sequence[LoadGroup], uses: Mapping[str, Findings]
) -> tuple[dict[str, Findings], list[QualityFinding]]:
    """Return the findings of the same bearing, and notes on what is not used of the others.

    Parameters
    ----------
    groups
        The static loads that were fitted.
    uses
        Findings by name.
    """
    kept: dict[str, Findings] = {}
    notes: list[QualityFinding] = []
    own = sorted({group.bearing for group in groups if group.bearing})
    for name, findings in uses.items():
        if findings.experiment not in ("tpjb.dynamic", "tpjb.bump"):
            notes.append(_note(name, findings, "tpjb.rotating makes use of tpjb.dynamic and tpjb.bump only"))
            continue
        tested = _bearings(findings)
        if own and tested and not set(own) & set(tested):
            why = f"it is of bearing {listing(tested)}, these runs are of {listing(own)}"
            notes.append(_note(name, findings, why))
            continue
        kept[name] = findings
        if findings.experiment == "tpjb.dynamic":
            notes += _other_states(name, findings, groups)
    return kept, notes


def _note(name: str, findings: Findings, why: str) -> QualityFinding:
    return QualityFinding("note", f"the findings '{name}' ({findings.experiment}) are not used: {why}.")


def _bearings(findings: Findings) -> list[str]:
    """Return the bearings that a campaign tested; empty where it does not say."""
    named = {str(run.conditions.get("bearing") or "") for run in findings.runs if run.used}
    named |= {str(p.at.get("bearing") or "") for p in findings.parameters}
    return sorted(named - {""})


def _other_states(name: str, findings: Findings, groups: Sequence[LoadGroup]) -> list[QualityFinding]:
    """Say that no stiffness of a dynamic test is of these loads and speeds."""
    states = dynamic_states({name: findings})
    for group in groups:
        speed = group.at.get("shaft_speed")
        known = speed if isinstance(speed, int | float) else None
        if state_at(states, group.bearing, group.static_load, known) is not None:
            return []
    if not states:
        return [_note(name, findings, "it holds no stiffness with a static load")]
    has = listing(_state_words(state.static_load, state.speed) for state in states)
    these = listing(_state_words(group.static_load, group.at.get("shaft_speed")) for group in groups)
    text = f"the stiffness of '{name}' (tpjb.dynamic) is not compared with these runs: it was measured at {has}, these at {these}."
    return [QualityFinding("note", text)]


def _state_words(load: float | None, speed: object) -> str:
    carried = f"{load / 1e3:.4g} kN" if load else "an unknown static load"
    return f"{carried} and {speed:.4g} rad/s" if isinstance(speed, int | float) else carried
