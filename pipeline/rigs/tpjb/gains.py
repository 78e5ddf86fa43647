"""Gains of probes and load cells as far as the logs state their uncertainty (type B).

One gain error is common to all probes and one to all load cells of a campaign (tpjb.md, section 5): it scales
all coefficients alike and no log shows it. What is compared under the same sensors is compared by type A.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Parameter
from pipeline.recording import Condition


@dataclass(frozen=True)
class Gains:
    """Relative standard uncertainties; None where they are not stated."""

    probe: float | None
    cell: float | None

    def share(self, probe: float, cell: float) -> float:
        """Return the relative standard error of a number that goes with these powers of both gains.

        Examples
        --------
        >>> round(Gains(0.01, 0.005).share(1, 1), 5)
        0.01118
        """
        return math.hypot(probe * (self.probe or 0.0), cell * (self.cell or 0.0))

    def text(self, probe: float, cell: float) -> str:
        """Return what the interval of such a number holds of the gains."""
        needed = [
            (name, gain)
            for name, gain, power in (("probes", self.probe, probe), ("load cells", self.cell, cell))
            if power
        ]
        untold = " and ".join(name for name, gain in needed if gain is None)
        told = " and ".join(name for name, gain in needed if gain is not None)
        held = f"interval with ±{100 * self.share(probe, cell):.2g} % (standard, type B) for the gain of the {told}"
        lacking = f"gain of the {untold} not stated and not in the interval"
        return "; ".join(text for text, there in ((held, told), (lacking, untold)) if there)


def gains_of(conditions: Iterable[Mapping[str, Condition]]) -> Gains:
    """Return the largest that any run states."""
    told = list(conditions)
    return Gains(*(_largest(told, name) for name in ("sensor_gain_u", "force_gain_u")))


def _largest(conditions: Iterable[Mapping[str, Condition]], name: str) -> float | None:
    stated = [
        abs(float(value))
        for one in conditions
        if isinstance(value := one.get(name), int | float) and not isinstance(value, bool) and math.isfinite(value)
    ]
    return max(stated, default=None)


def with_type_b(parameter: Parameter, type_b: float) -> Parameter:
    """Return a parameter whose interval also holds a standard error of type B, SI; as it is where there is no value."""
    if parameter.value is None or parameter.std_error is None or parameter.ci95 is None or not type_b > 0:
        return parameter
    wide = t_quantile(math.inf) * type_b
    low, high = parameter.ci95
    return parameter.model_copy(
        update={
            "std_error": math.hypot(parameter.std_error, type_b),
            "type_b": math.hypot(parameter.type_b or 0.0, type_b),
            "ci95": (
                parameter.value - math.hypot(parameter.value - low, wide),
                parameter.value + math.hypot(high - parameter.value, wide),
            ),
        }
    )


def type_a(parameter: Parameter) -> float | None:
    """Return the part of the standard error that is no type B, SI; None for an undetermined parameter."""
    if parameter.std_error is None:
        return None
    return math.sqrt(max(parameter.std_error**2 - (parameter.type_b or 0.0) ** 2, 0.0))
