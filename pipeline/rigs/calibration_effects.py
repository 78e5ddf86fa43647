"""What one input of a calibration that is off does to every parameter, and how such effects enter errors and intervals.

Pure arithmetic on parameters of two identifications; who makes these is in `calibration`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Parameter, Verdict

BUDGET = "calibration_budget"
"""The array of the findings that tells what each input adds to each parameter."""

_NORMAL95 = 1.959964
_DRAWS = 40_000
# By how much a measured operating point may move with the calibration.
_MOVED = 0.1
# Effects below this share of the standard error are none.
_NOTHING = 1e-6
# Share of the type B variance that the second order may have before the interval is drawn rather than computed.
_CURVED = 0.01

Kind = Literal["gain", "offset"]


class Input(NamedTuple):
    """A stated gain or offset: `u` is its standard uncertainty, `no_value` what stands in the channel where nothing was measured."""

    channel: str
    kind: Kind
    u: float
    no_value: float | None

    @property
    def told(self) -> str:
        """The input in words."""
        return f"{self.kind} of '{self.channel}'"


class Told(NamedTuple):
    """What an identification tells: parameters (None where nothing can be identified), verdict and its first reason."""

    parameters: list[Parameter] | None
    verdict: Verdict = "rejected"
    reason: str = ""


def matched(parameters: Sequence[Parameter], others: Sequence[Parameter] | None) -> list[float | None]:
    """Return for each parameter the value that the other identification gives at the same operating point, or None.

    Where that point is measured it moves with the calibration: between those of the same words a value is interpolated.
    """
    if others is None:
        return [None] * len(parameters)
    groups: dict[tuple[Any, ...], list[Parameter]] = {}
    for other in others:
        groups.setdefault(_kin(other), []).append(other)
    return [_value_at(p.at, groups.get(_kin(p), ())) for p in parameters]


def _kin(parameter: Parameter) -> tuple[Any, ...]:
    words = tuple((k, v if isinstance(v, str | bool) else None) for k, v in sorted(parameter.at.items()))
    return (parameter.name, words)


def _value_at(at: Mapping[str, float | str | bool], others: Sequence[Parameter]) -> float | None:
    """Return the value at an operating point: told there, or between the points that moved; None where neither."""
    for other in others:
        if other.at == at:
            return other.value
    moved = [key for key in at if others and not any(other.at[key] == at[key] for other in others)]
    moved = moved or [key for key, value in at.items() if not isinstance(value, str | bool)]
    if len(moved) != 1:
        near = [other for other in others if _near(at, other.at)]
        return near[0].value if near else None
    key = moved[0]
    line = [o for o in others if o.value is not None and all(o.at[k] == at[k] for k in at if k != key)]
    return _between({float(o.at[key]): float(o.value or 0.0) for o in line}, float(at[key]))


def _between(points: Mapping[float, float], place: float) -> float | None:
    """Return the value at `place` of a smooth line through the points; beyond its ends by half the distance of two."""
    x = np.array(sorted(points))
    if x.size < 2:
        close = x.size == 1 and math.isclose(float(x[0]), place, rel_tol=_MOVED)
        return points[float(x[0])] if close else None
    reach = np.maximum(0.5 * np.diff(x)[[0, -1]], _MOVED * abs(place))
    if not x[0] - reach[0] <= place <= x[-1] + reach[1]:
        return None
    from scipy.interpolate import PchipInterpolator

    return float(PchipInterpolator(x, [points[float(one)] for one in x])(place))


def _near(at: Mapping[str, float | str | bool], other: Mapping[str, float | str | bool]) -> bool:
    """Tell whether all numbers of two operating points of the same words differ by no more than a calibration may."""
    return all(
        isinstance(value, str | bool) or math.isclose(value, float(other[key]), rel_tol=_MOVED)
        for key, value in at.items()
    )


class Carried(NamedTuple):
    """A parameter with type B in it, and the first- and second-order effect of each input on it, shape (m,) each."""

    parameter: Parameter
    linear: np.ndarray
    curved: np.ndarray


def with_effects(p: Parameter, inputs: Sequence[Input], sides: Sequence[tuple[float | None, float | None]]) -> Carried:
    """Return a parameter with the effects of the inputs in its error and interval; `sides` are its values with each up and down."""
    linear, curved = np.zeros(len(inputs)), np.zeros(len(inputs))
    if p.value is None:
        return Carried(p, linear, curved)
    lost = []
    for k, (up, down) in enumerate(sides):
        if up is not None and down is not None:
            linear[k] = 0.5 * (up - down)
            curved[k] = 0.5 * (up + down) - p.value
        elif up is not None or down is not None:
            linear[k] = up - p.value if up is not None else p.value - (down or 0.0)
        else:
            lost.append(inputs[k].told)
    if lost:
        reason = f"not determined within the stated uncertainty of the {listing(lost)}: one standard uncertainty up or down, nothing tells it"
        update: dict[str, Any] = {"value": None, "std_error": None, "ci95": None, "type_b": None, "description": reason}
        return Carried(p.model_copy(update=update), linear, curved)
    first, second = float(linear @ linear), 2.0 * float(curved @ curved)
    added = math.sqrt(first + second)
    if added < _NOTHING * (p.std_error or abs(p.value)):  # the digits of the fit
        added = first = second = 0.0
    straight = second <= _CURVED * (first + second)
    update = {"type_b": math.hypot(p.type_b or 0.0, added)}
    if p.std_error is not None:
        update["std_error"] = math.hypot(p.std_error, added)
    if p.ci95 is not None:
        update["ci95"] = _widened(p.value, p.ci95, added) if straight else _drawn(p.value, p.ci95, linear, curved)
    return Carried(p.model_copy(update=update), linear, curved)


def _widened(value: float, ci95: tuple[float, float], added: float) -> tuple[float, float]:
    """Return the interval with a normal error added: each half in quadrature."""
    half = _NORMAL95 * added
    return (value - math.hypot(value - ci95[0], half), value + math.hypot(ci95[1] - value, half))


def _drawn(value: float, ci95: tuple[float, float], linear: np.ndarray, curved: np.ndarray) -> tuple[float, float]:
    """Return the interval by Monte Carlo on the second-order surface; type A is a normal of two halves."""
    rng = np.random.default_rng(20)
    z = rng.standard_normal((_DRAWS, linear.size))
    a = rng.standard_normal(_DRAWS)
    below, above = (value - ci95[0]) / _NORMAL95, (ci95[1] - value) / _NORMAL95
    drawn = value + z @ linear + z**2 @ curved + np.where(a < 0, a * below, a * above)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return (float(low), float(high))


def budget(carried: Sequence[Carried], inputs: Sequence[Input]) -> Any:
    """Return the table `BUDGET`: one line a parameter and input."""
    import pandas as pd

    rows = [
        (
            c.parameter.name,
            place_of(c.parameter),
            one.channel,
            one.kind,
            one.u,
            math.copysign(math.hypot(c.linear[k], math.sqrt(2.0) * c.curved[k]), c.linear[k]),
        )
        for c in carried
        for k, one in enumerate(inputs)
        if c.parameter.type_b and (c.linear[k] or c.curved[k])
    ]
    return pd.DataFrame(rows, columns=["parameter", "at", "channel", "kind", "u", "effect"])


def place_of(parameter: Parameter) -> str:
    """Return the operating point as the budget names it."""
    return ", ".join(
        f"{key} {value:.6g}" if isinstance(value, float) else f"{key} {value}" for key, value in parameter.at.items()
    )
