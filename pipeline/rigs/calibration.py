"""What calibration leaves uncertain (type B), carried into every parameter of every experiment.

A recipe states the standard uncertainty of a channel's gain and offset. The campaign is identified again with each of
them one standard uncertainty high and low: that is the first- and second-order effect on every parameter, whatever the
experiment does with the channel (GUM, JCGM 100, 5.1; where the second order matters, the interval comes from Monte Carlo
on that surface, JCGM 101).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.recording.altered import altered
from pipeline.rigs.calibration_effects import BUDGET, Input, Told, budget, matched, with_effects
from pipeline.rigs.calibration_remarks import (
    doubtful_statements,
    lost_ones,
    not_handed_over,
    other_verdicts,
    ruling_inputs,
    without_effect,
)
from pipeline.rigs.experiment import Context, Experiment


@dataclass(frozen=True)
class Calibration:
    """How well a channel is calibrated: standard uncertainties of its gain (relative) and its offset (SI).

    They are common to all runs of a campaign, independent of each other and of those of other channels.
    """

    gain_u: float = 0.0
    offset_u: float = 0.0


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
    found = found.model_copy(update={"quality": [*found.quality, *not_handed_over(context.uses)]})
    inputs = list(_inputs(experiment, recordings, calibration))
    if not inputs:
        told = list(doubtful_statements([], recordings, calibration))
        return found.model_copy(update={"quality": [*found.quality, *told]})
    cost = time.perf_counter() - began
    tasks = [
        (experiment.id, _Off(recordings, one, side), settings, context.campaign, context.uses)
        for one in inputs
        for side in (1.0, -1.0)
    ]
    parameters, seconds = found.parameters, cost * len(tasks)
    others: list[Told] = []
    for number, one in enumerate(context.each(_identified, tasks, seconds)):
        others.append(one)
        context.progress((number + 1) / len(tasks), f"calibration: {inputs[number // 2].told}")
    up, down = ([matched(parameters, told.parameters) for told in others[side::2]] for side in (0, 1))
    carried = [
        with_effects(p, inputs, [(u[k], d[k]) for u, d in zip(up, down, strict=True)]) for k, p in enumerate(parameters)
    ]
    doubts = list(other_verdicts(found, inputs, others))
    lost = [p for p, c in zip(parameters, carried, strict=True) if p.value is not None and c.parameter.value is None]
    used = dict.fromkeys(one.channel for one in inputs)
    return found.model_copy(
        update={
            "verdict": "warning" if (lost or doubts) and found.verdict == "ok" else found.verdict,
            "reasons": [*([lost_ones(lost)] if lost else []), *doubts, *found.reasons],
            "parameters": [c.parameter for c in carried],
            "calibration": {
                name: {"gain_u": calibration[name].gain_u, "offset_u": calibration[name].offset_u} for name in used
            },
            "quality": [
                *found.quality,
                *doubtful_statements(parameters, recordings, calibration),
                *without_effect(carried, inputs),
            ],
            "advice": [*found.advice, *ruling_inputs(experiment, carried, inputs)],
            "arrays": {**found.arrays, BUDGET: budget(carried, inputs)},
        }
    )


def _inputs(
    experiment: Experiment, recordings: Sequence[Recording], calibration: Mapping[str, Calibration]
) -> Iterator[Input]:
    carried = {name for recording in recordings for name in recording.names}
    for name, known in calibration.items():
        if name not in carried:
            continue
        spec = experiment.channel(name)
        no_value = spec.no_value if spec else None
        if known.gain_u:
            yield Input(name, "gain", known.gain_u, no_value)
        if known.offset_u:
            yield Input(name, "offset", known.offset_u, no_value)


class _Off(Sequence[Recording]):
    """Recordings with one input off by a number of standard uncertainties; each is read when it is asked for."""

    def __init__(self, recordings: Sequence[Recording], off: Input, by: float) -> None:
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


def _identified(
    experiment: str, recordings: Sequence[Recording], settings: Any, campaign: str, uses: Mapping[str, Findings]
) -> Told:
    from pipeline.rigs.registry import experiment as find_experiment

    try:
        found = find_experiment(experiment).identify(recordings, settings, Context(campaign, uses))
    except InputError as error:
        return Told(None, reason=str(error))
    return Told(found.parameters, found.verdict, next(iter(found.reasons), ""))
