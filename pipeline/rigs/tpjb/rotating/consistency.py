"""Do T3, T2 and the static positions tell one story? Stiffness against T2, and the relations that load dependence sets.

A relation compares two numbers with their errors; it judges no fit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipeline.findings import Findings
from pipeline.rigs.tpjb.rotating.dynamic_stiffness import ENTRIES, dynamic_states, state_at
from pipeline.rigs.tpjb.rotating.group import LoadGroup

# Standard errors, and share of the direct stiffness, beyond which two tests contradict each other.
_SURE, _MATTERS = 3.0, 0.01


@dataclass(frozen=True)
class Consistency:
    """One comparison: left and right with standard errors (SI), z-score, and what a difference means.

    `grave` tells that a difference casts doubt on the numbers, and not on a theory.
    """

    group: str
    kind: str
    name: str
    left: float
    left_sd: float
    right: float
    right_sd: float
    unit: str
    meaning: str
    scale: float = math.nan
    grave: bool = False

    @property
    def z(self) -> float:
        """Difference over its standard error."""
        return (self.left - self.right) / math.hypot(self.left_sd, self.right_sd)

    @property
    def holds(self) -> bool:
        """Tell whether both sides agree within three standard errors."""
        return abs(self.z) < _SURE

    @property
    def contradicts(self) -> bool:
        """Tell whether the difference is sure, large, and casts doubt on the numbers."""
        return self.grave and not self.holds and abs(self.left - self.right) > _MATTERS * self.scale

    @property
    def sentence(self) -> str:
        """The comparison in words."""
        return (
            f"{self.group}: {self.name}: {self.left:.4g} ± {1.96 * self.left_sd:.1g} against {self.right:.4g} ± "
            f"{1.96 * self.right_sd:.1g} {self.unit} (z = {self.z:+.1f}): {self.meaning}."
        )


def consistency_of(groups: Sequence[LoadGroup], uses: Mapping[str, Findings]) -> list[Consistency]:
    """Return all comparisons that the runs and the used findings allow."""
    return [entry for group in groups for entry in _against_dynamic(group, uses)]


def _against_dynamic(group: LoadGroup, uses: Mapping[str, Findings]) -> list[Consistency]:
    """Compare K of the chosen model, and of M2 at the lowest ratio, with T2 (gains of the sensors are common to both)."""
    speed = group.at.get("shaft_speed")
    bearing = str(group.runs[0].record.conditions.get("bearing", ""))
    known = speed if isinstance(speed, int | float) else None
    state = state_at(dynamic_states(uses), bearing, group.static_load, known)
    if state is None:
        return []
    found = []
    lowest = group.linear[group.lowest.run]
    ratio = group.lowest.record.ratio
    at_lowest = f"M2 at {100 * ratio:.2g} %" if ratio else "M2 at the lowest load"
    for label, fit in ((f"{group.selected.name}, all ratios", group.selected), (at_lowest, lowest)):
        scale = math.sqrt(abs(fit.p[0] * fit.p[3]))
        for j, name in enumerate(ENTRIES):
            sd = math.sqrt(max(float(fit.p_covariance[j, j]), 0.0))
            if not fit.model.matrix[j].any() or not sd > 0:
                continue
            found.append(
                Consistency(
                    group.label, "T3 against T2", f"{name}, {label}", float(fit.p[j]), sd, float(state.stiffness[j]),
                    float(state.std_error[j]), "N/m",
                    f"the rotating load and the dynamic test ({state.how}) do not give the same stiffness: another state of "
                    "the bearing, a delay between force and motion, or frames of probes and actuators that are turned",
                    scale, grave=fit is group.selected,
                )
            )  # fmt: skip
    return found
