"""What calibration leaves uncertain (type B), carried into every parameter of every experiment.

A recipe states the standard uncertainty of a channel's gain and offset. The campaign is identified again with each of
them one standard uncertainty high and low: that is the first- and second-order effect on every parameter, whatever the
experiment does with the channel (GUM, JCGM 100, 5.1; where the second order matters, the interval comes from Monte Carlo
on that surface, JCGM 101).
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, overload

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.findings import Findings, Parameter, Quality, Verdict
from pipeline.recording import Recording
from pipeline.recording.altered import altered
from pipeline.rigs.experiment import Context, Experiment

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
# Share of a parameter's variance that one input must have for the advice to name it.
_RULES = 0.5

_RANK: tuple[Verdict, ...] = ("ok", "warning", "rejected")

Kind = Literal["gain", "offset"]


@dataclass(frozen=True)
class Calibration:
    """How well a channel is calibrated: standard uncertainties of its gain (relative) and its offset (SI).

    They are common to all runs of a campaign, independent of each other and of those of other channels.
    """

    gain_u: float = 0.0
    offset_u: float = 0.0


class _Input(NamedTuple):
    channel: str
    kind: Kind
    u: float
    no_value: float | None

    @property
    def told(self) -> str:
        return f"{self.kind} of '{self.channel}'"


def identify_calibrated(
    experiment: Experiment,
    recordings: Sequence[Recording],
    settings: Any,
    context: Context,
    calibration: Mapping[str, Calibration],
) -> Findings:
    """Return what `experiment.identify` returns, with the stated calibrations in every standard error and interval.

    ``type_b`` of a parameter then holds their part (with what the experiment itself counted as type B). The effects stand
    in the array ``calibration_budget``: parameter, operating point, channel, kind, u, effect (SI, one standard
    uncertainty).

    Parameters
    ----------
    calibration
        By channel. Nothing stated costs nothing; each stated gain or offset costs two more identifications.

    Raises
    ------
    InputError
        Where the recordings as they are let nothing be identified.
    """
    began = time.perf_counter()
    found = experiment.identify(recordings, settings, context)
    found = found.model_copy(update={"quality": [*found.quality, *_not_handed_over(context.uses)]})
    inputs = list(_inputs(experiment, recordings, calibration))
    if not inputs:
        told = list(_remarks([], recordings, calibration))
        return found.model_copy(update={"quality": [*found.quality, *told]})
    cost = time.perf_counter() - began
    tasks = [
        (experiment.id, _Off(recordings, one, side), settings, context.campaign, context.uses)
        for one in inputs
        for side in (1.0, -1.0)
    ]
    parameters, seconds = found.parameters, cost * len(tasks)
    others: list[_Told] = []
    for number, one in enumerate(context.each(_identified, tasks, seconds)):
        others.append(one)
        context.progress((number + 1) / len(tasks), f"calibration: {inputs[number // 2].told}")
    up, down = ([_matched(parameters, told.parameters) for told in others[side::2]] for side in (0, 1))
    carried = [
        _carried(p, inputs, [(u[k], d[k]) for u, d in zip(up, down, strict=True)]) for k, p in enumerate(parameters)
    ]
    doubts = list(_other_verdicts(found, inputs, others))
    lost = [p for p, c in zip(parameters, carried, strict=True) if p.value is not None and c.parameter.value is None]
    used = dict.fromkeys(one.channel for one in inputs)
    return found.model_copy(
        update={
            "verdict": "warning" if (lost or doubts) and found.verdict == "ok" else found.verdict,
            "reasons": [*([_lost(lost)] if lost else []), *doubts, *found.reasons],
            "parameters": [c.parameter for c in carried],
            "calibration": {
                name: {"gain_u": calibration[name].gain_u, "offset_u": calibration[name].offset_u} for name in used
            },
            "quality": [
                *found.quality,
                *_remarks(parameters, recordings, calibration),
                *_without_effect(carried, inputs),
            ],
            "advice": [*found.advice, *_advice(experiment, carried, inputs)],
            "arrays": {**found.arrays, BUDGET: _budget(carried, inputs)},
        }
    )


def _not_handed_over(uses: Mapping[str, Findings]) -> Iterator[Quality]:
    for name, findings in uses.items():
        if findings.calibration:
            yield Quality(
                level="warning",
                message=f"the recipe of '{name}', whose findings are used here, states calibrations of {listing(findings.calibration)}: "
                "they are in its own intervals, but not in those here.",
            )


def _lost(parameters: Sequence[Parameter]) -> str:
    names = dict.fromkeys(p.name for p in parameters)
    return (
        f"Within the stated uncertainty of the calibration {listing(names, 6)} cannot be told any more: with an input one standard "
        "uncertainty up or down there is no value at the same operating point."
    )


def _remarks(
    parameters: Sequence[Parameter], recordings: Sequence[Recording], calibration: Mapping[str, Calibration]
) -> Iterator[Quality]:
    carried = {name for recording in recordings for name in recording.names}
    for name in calibration:
        if name not in carried:
            yield Quality(
                level="note",
                channel=name,
                message=f"the recipe states how well '{name}' is calibrated, but no log carries it: nothing was done with that.",
            )
    if any(p.type_b for p in parameters):
        yield Quality(
            level="note",
            message="the logs or settings state uncertainties of their own that are in the intervals (type B); what the recipe "
            "states of its channels came on top. State each uncertainty once.",
        )


def _without_effect(carried: Sequence[_Carried], inputs: Sequence[_Input]) -> Iterator[Quality]:
    for k, one in enumerate(inputs):
        if not any(c.linear[k] or c.curved[k] for c in carried if c.parameter.type_b):
            yield Quality(
                level="warning",
                channel=one.channel,
                message=f"the stated uncertainty of the {one.told} changes no number: either none rests on it, or it only tells at which "
                "operating point numbers hold, which are told as set; what an error of that point does to them is in no interval.",
            )


def _inputs(
    experiment: Experiment, recordings: Sequence[Recording], calibration: Mapping[str, Calibration]
) -> Iterator[_Input]:
    carried = {name for recording in recordings for name in recording.names}
    for name, known in calibration.items():
        if name not in carried:
            continue
        spec = experiment.channel(name)
        no_value = spec.no_value if spec else None
        if known.gain_u:
            yield _Input(name, "gain", known.gain_u, no_value)
        if known.offset_u:
            yield _Input(name, "offset", known.offset_u, no_value)


class _Off(Sequence[Recording]):
    """Recordings with one input off by a number of standard uncertainties; each is read when it is asked for."""

    def __init__(self, recordings: Sequence[Recording], off: _Input, by: float) -> None:
        self._recordings, self._off, self._by = recordings, off, by

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: slice) -> _Off: ...
    def __getitem__(self, index: int | slice) -> Recording | _Off:
        if isinstance(index, slice):
            return _Off(self._recordings[index], self._off, self._by)
        return altered(self._recordings[index], {self._off.channel: self._changed})

    def __len__(self) -> int:
        return len(self._recordings)

    def _changed(self, values: np.ndarray) -> np.ndarray:
        step = self._by * self._off.u
        changed = values * (1.0 + step) if self._off.kind == "gain" else values + step
        return changed if self._off.no_value is None else np.where(values == self._off.no_value, values, changed)


class _Told(NamedTuple):
    """What an identification tells: parameters (None where nothing can be identified), verdict and its first reason."""

    parameters: list[Parameter] | None
    verdict: Verdict = "rejected"
    reason: str = ""


def _identified(
    experiment: str, recordings: Sequence[Recording], settings: Any, campaign: str, uses: Mapping[str, Findings]
) -> _Told:
    from pipeline.rigs.registry import experiment as find_experiment

    try:
        found = find_experiment(experiment).identify(recordings, settings, Context(campaign, uses))
    except InputError as error:
        return _Told(None, reason=str(error))
    return _Told(found.parameters, found.verdict, next(iter(found.reasons), ""))


def _other_verdicts(found: Findings, inputs: Sequence[_Input], others: Sequence[_Told]) -> Iterator[str]:
    """Say which inputs, off by one standard uncertainty, would have given a worse verdict."""
    for k, one in enumerate(inputs):
        sides = ((told, word) for told, word in zip(others[2 * k : 2 * k + 2], ("higher", "lower"), strict=True))
        worse = [(told, word) for told, word in sides if _RANK.index(told.verdict) > _RANK.index(found.verdict)]
        if worse:
            told, word = worse[0]
            yield (
                f"With the {one.told} one standard uncertainty {word} the verdict would be '{told.verdict}': "
                f"{told.reason or 'nothing could be identified.'}"
            )


def _matched(parameters: Sequence[Parameter], others: Sequence[Parameter] | None) -> list[float | None]:
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


class _Carried(NamedTuple):
    """A parameter with type B in it, and the first- and second-order effect of each input on it, shape (m,) each."""

    parameter: Parameter
    linear: np.ndarray
    curved: np.ndarray


def _carried(p: Parameter, inputs: Sequence[_Input], sides: Sequence[tuple[float | None, float | None]]) -> _Carried:
    linear, curved = np.zeros(len(inputs)), np.zeros(len(inputs))
    if p.value is None:
        return _Carried(p, linear, curved)
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
        return _Carried(p.model_copy(update=update), linear, curved)
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
    return _Carried(p.model_copy(update=update), linear, curved)


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


def _budget(carried: Sequence[_Carried], inputs: Sequence[_Input]) -> Any:
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


def _advice(experiment: Experiment, carried: Sequence[_Carried], inputs: Sequence[_Input]) -> list[str]:
    """Name the inputs that rule the error of the parameters that matter most."""
    key = {spec.name for spec in experiment.parameters if spec.key}
    ruled: dict[int, dict[str, None]] = {}
    for c in carried:
        if c.parameter.name in key and c.parameter.std_error:
            k = int(np.argmax(np.abs(c.linear)))
            if c.linear[k] ** 2 > _RULES * c.parameter.std_error**2:
                ruled.setdefault(k, {})[c.parameter.name] = None
    return [
        f"The calibration of the {inputs[k].told} rules the error of {listing(names, 6)}: more runs do not help there, a better "
        "calibration does."
        for k, names in ruled.items()
    ]
