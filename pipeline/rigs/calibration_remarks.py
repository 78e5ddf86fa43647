"""What is said of calibrations: in reasons, quality findings and advice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings, Parameter, Quality, Verdict
from pipeline.recording import Recording
from pipeline.rigs.calibration_effects import Carried, Input, Told
from pipeline.rigs.experiment import Experiment

# Share of a parameter's variance that one input must have for the advice to name it.
_RULES = 0.5
_RANK: tuple[Verdict, ...] = ("ok", "warning", "rejected")


def not_handed_over(uses: Mapping[str, Findings]) -> Iterator[Quality]:
    """Warn of findings that are used and whose calibration is not carried on."""
    for name, findings in uses.items():
        if findings.calibration:
            yield Quality(
                level="warning",
                message=f"the recipe of '{name}', whose findings are used here, states calibrations of {listing(findings.calibration)}: "
                "they are in its own intervals, but not in those here.",
            )


def lost_ones(parameters: Sequence[Parameter]) -> str:
    """Say which parameters cannot be told within the stated uncertainty."""
    names = dict.fromkeys(p.name for p in parameters)
    return (
        f"Within the stated uncertainty of the calibration {listing(names, 6)} cannot be told any more: with an input one standard "
        "uncertainty up or down there is no value at the same operating point."
    )


def doubtful_statements(
    parameters: Sequence[Parameter], recordings: Sequence[Recording], calibration: Mapping[str, Any]
) -> Iterator[Quality]:
    """Note what the recipe states to no effect, or beside what the logs state."""
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


def without_effect(carried: Sequence[Carried], inputs: Sequence[Input]) -> Iterator[Quality]:
    """Warn of inputs that change no number."""
    for k, one in enumerate(inputs):
        if not any(c.linear[k] or c.curved[k] for c in carried if c.parameter.type_b):
            yield Quality(
                level="warning",
                channel=one.channel,
                message=f"the stated uncertainty of the {one.told} changes no number: either none rests on it, or it only tells at which "
                "operating point numbers hold, which are told as set; what an error of that point does to them is in no interval.",
            )


def other_verdicts(found: Findings, inputs: Sequence[Input], others: Sequence[Told]) -> Iterator[str]:
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


def ruling_inputs(experiment: Experiment, carried: Sequence[Carried], inputs: Sequence[Input]) -> list[str]:
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
