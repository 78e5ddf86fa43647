"""Do T3, T2 and the static positions tell one story? Stiffness against T2, and the relations that load dependence sets.

A relation compares two numbers with their errors; it judges no fit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.findings import Findings
from pipeline.rigs.tpjb.rotating.dynamic_stiffness import ENTRIES, dynamic_states, state_at
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.load_dependence import (
    Relation,
    StiffnessOfLoad,
    conservative,
    position_relation,
    relations,
)

# Standard errors, and share of the direct stiffness, beyond which two tests contradict each other.
_SURE, _MATTERS = 3.0, 0.01


@dataclass(frozen=True)
class Consistency:
    """One comparison: left and right with standard errors (SI), z-score, and what a difference means.

    `difference_sd` is the standard error of the difference where both sides are correlated. `grave` tells that a difference casts doubt on the numbers, and not on a theory.
    """

    group: str
    kind: str
    name: str
    left: float | None
    left_sd: float
    right: float
    right_sd: float
    unit: str
    meaning: str
    scale: float = math.nan
    grave: bool = False
    difference_sd: float | None = None

    @property
    def z(self) -> float | None:
        """Difference over its standard error; None where one side is not known."""
        if self.left is None:
            return None
        apart = math.hypot(self.left_sd, self.right_sd) if self.difference_sd is None else self.difference_sd
        return (self.left - self.right) / max(apart, 1e-300)

    @property
    def holds(self) -> bool | None:
        """Tell whether both sides agree within three standard errors; None where one is not known."""
        return None if self.z is None else abs(self.z) < _SURE

    @property
    def contradicts(self) -> bool:
        """Tell whether the difference is sure, large, and casts doubt on the numbers."""
        if self.left is None or self.holds or not self.grave:
            return False
        return abs(self.left - self.right) > _MATTERS * self.scale

    @property
    def sentence(self) -> str:
        """The comparison in words."""
        if self.left is None or self.z is None:
            return f"{self.group}: {self.name} cannot be checked."
        return (
            f"{self.group}: {self.name}: {self.left:.4g} ± {1.96 * self.left_sd:.1g} against {self.right:.4g} ± "
            f"{1.96 * self.right_sd:.1g} {self.unit} (z = {self.z:+.1f}): {self.meaning}."
        )


def stiffness_of_load(
    groups: Sequence[LoadGroup], uses: Mapping[str, Findings]
) -> dict[str, tuple[StiffnessOfLoad, str]]:
    """Return by bearing the stiffness over the static load and where it comes from: T2 where it has two loads, else T3."""
    found: dict[str, tuple[StiffnessOfLoad, str]] = {}
    states = dynamic_states(uses)
    for bearing in {group.bearing for group in groups}:
        measured = {s.static_load: s for s in states if not s.bearing or not bearing or s.bearing == bearing}
        own = {
            g.static_load: g.trusted.selected for g in groups if g.bearing == bearing and g.static_load and g.trusted
        }
        if len(measured) > 1:
            loads = sorted(measured)
            k = np.array([measured[load].stiffness for load in loads])
            sigma = np.array([measured[load].std_error for load in loads])
            found[bearing] = StiffnessOfLoad.through(loads, k, sigma), "dynamic test"
        elif len(own) > 1:
            fits = [own[load] for load in sorted(own)]
            k = np.array([fit.p[:4] for fit in fits])
            sigma = np.sqrt(np.array([np.diag(fit.p_covariance)[:4] for fit in fits]))
            found[bearing] = StiffnessOfLoad.through(sorted(own), k, sigma), "rotating load itself"
    return found


def consistency_of(
    groups: Sequence[LoadGroup],
    uses: Mapping[str, Findings],
    stiffness: Mapping[str, tuple[StiffnessOfLoad, str]],
) -> list[Consistency]:
    """Return all comparisons that the runs and the used findings allow."""
    found = [entry for group in groups for entry in _against_dynamic(group, uses)]
    for group in groups:
        if group.bearing in stiffness and group.static_load and group.trusted:
            curve, source = stiffness[group.bearing]
            fit = group.trusted.comparison.fits.get("M6")
            for relation in relations(fit, curve, group.static_load) if fit else ():
                found.append(_entry(group.label, f"Load dependence of stiffness ({source})", relation, _MEANINGS))
    for bearing, (curve, source) in stiffness.items():
        loaded = sorted(
            (g for g in groups if g.bearing == bearing and g.static_load), key=lambda g: g.static_load or 0.0
        )
        for low, high in pairwise(loaded):
            relation = position_relation(_position(low), _position(high), curve)
            label = f"{low.label} to {high.label}"
            found.append(_entry(label, f"Load dependence of stiffness ({source})", relation, _MEANINGS))
    for group in groups:
        fit = group.trusted.comparison.fits.get("M6") if group.trusted else None
        for relation in conservative(fit) if fit else ():
            found.append(_entry(group.label, "Has the film's force a potential", relation, {}))
    return found


_MEANINGS = {
    "kyy2": "the quadratic term is not that of a bearing whose stiffness follows the load as at rest",
    "kxxy": "the orbit lacks the mixed term that the load dependence of kxx asks for",
    "y(W2)": "the static positions do not rise as the stiffness says: the zero of the probes moved between the runs, or "
    "the stiffness between the loads is not on this curve",
}


def _entry(label: str, kind: str, relation: Relation, meanings: Mapping[str, str]) -> Consistency:
    meaning = next((text for start, text in meanings.items() if relation.name.startswith(start)), "")
    return Consistency(
        label, kind, relation.name, relation.left, relation.left_sigma, relation.right, relation.right_sigma,
        relation.unit, meaning or "the film's force has no potential in this plane, as cross coupling has none",
        difference_sd=relation.difference_sigma,
    )  # fmt: skip


def _position(group: LoadGroup) -> tuple[float, float, float]:
    """Return static load, static position along y and what the zero may have moved: half the drift of the runs."""
    y = [float(group.equilibrium(turns.run)[1]) for turns in group.runs]
    moved = max(float(np.ptp(group.drift(turns.run)[1])) for turns in group.runs) / 2.0
    return group.static_load or 0.0, float(np.mean(y)), max(moved, float(np.std(y)), 5e-8)


def _against_dynamic(group: LoadGroup, uses: Mapping[str, Findings]) -> list[Consistency]:
    """Compare K of the chosen model, and of M2 at the lowest ratio, with T2 (gains of the sensors are common to both)."""
    if group.trusted is None:
        return []
    speed = group.at.get("shaft_speed")
    known = speed if isinstance(speed, int | float) else None
    state = state_at(dynamic_states(uses), group.bearing, group.static_load, known)
    if state is None:
        return []
    found = []
    lowest = group.linear[group.lowest.run]
    ratio = group.lowest.record.ratio
    at_lowest = f"M2 at {100 * ratio:.2g} %" if ratio else "M2 at the lowest load"
    chosen = group.trusted.selected
    compared = [(f"{chosen.name}, all its ratios", chosen)]
    if chosen.name != lowest.name or len(group.trusted.runs) > 1:
        compared.append((at_lowest, lowest))
    for label, fit in compared:
        scale = math.sqrt(abs(fit.p[0] * fit.p[3]))
        for j, name in enumerate(ENTRIES):
            sd = math.sqrt(max(float(fit.p_covariance[j, j]), 0.0))
            if not fit.model.matrix[j].any() or not sd > 0:
                continue
            found.append(
                Consistency(
                    group.label, "Rotating load against dynamic test", f"{name}, {label}", float(fit.p[j]), sd, float(state.stiffness[j]),
                    float(state.std_error[j]), "N/m",
                    f"the rotating load and the dynamic test ({state.how}) do not give the same stiffness: another state of "
                    "the bearing, a delay between force and motion, or frames of probes and actuators that are turned",
                    scale, grave=fit is chosen,
                )
            )  # fmt: skip
    return found
