"""One identified number with its interval, or the reason why there is none. Not a report's value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pipeline.estimation.uncertainty import t_quantile


@dataclass(frozen=True)
class Estimate:
    """A number that data gave.

    Attributes
    ----------
    name, value, std_error, ci95
        SI; value None where the data cannot determine it (then the other two are None as well).
    at
        Operating point, SI, as ``{"coil_current": 2.0}`` or ``{"run": "sh_a"}``.
    reason
        Why there is no value; a remark otherwise.
    dof
        Degrees of freedom of the standard error: the interval uses Student's t.
    type_b
        The part of the standard error that comes from calibrations and stated uncertainties, SI; None where there is none.
    """

    name: str
    value: float | None
    std_error: float | None = None
    ci95: tuple[float, float] | None = None
    at: Mapping[str, float | str | bool] = field(default_factory=dict)
    reason: str = ""
    dof: float = math.inf
    type_b: float | None = None

    @property
    def determined(self) -> bool:
        """Tell whether there is a value."""
        return self.value is not None


def estimate(
    name: str,
    value: float,
    std_error: float,
    *,
    dof: float = math.inf,
    at: Mapping[str, float | str | bool] | None = None,
    logarithmic: bool = False,
    reason: str = "",
    type_b: float | None = None,
) -> Estimate:
    """Return a determined estimate with its 95 % interval from Student's t with `dof`.

    With `logarithmic` the interval is symmetric in ln(value): right for positive numbers that were
    fitted as logarithms.

    Examples
    --------
    >>> round(estimate("k", 10.0, 1.0).ci95[0], 2)
    8.04
    """
    value, std_error = float(value), float(std_error)
    half = t_quantile(dof) * std_error
    if logarithmic and value > 0:
        spread = math.exp(min(half / value, 700.0))
        interval = (value / spread, value * spread)
    else:
        interval = (value - half, value + half)
    return Estimate(name, value, std_error, interval, dict(at or {}), reason, dof, type_b)


def undetermined(name: str, reason: str, at: Mapping[str, float | str | bool] | None = None) -> Estimate:
    """Return an estimate without a value."""
    return Estimate(name, None, at=dict(at or {}), reason=reason)
