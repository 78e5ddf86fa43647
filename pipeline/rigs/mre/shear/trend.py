"""Does the stiffness change with the order of the runs (heating, Mullins effect, relaxation; mre.md section 8)?

Few runs are tested for a trend beside the model; of many the gain of each run is looked at over their order, and what is said of
it is what the report draws.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions
from pipeline.rigs.mre.shear.linearised import Linearised
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun
from pipeline.rigs.over_runs import MANY, OverRuns, over_runs

_FEWEST = 6
# A trend is told that chance brings about in less than this share of campaigns, and only from this size on.
_CHANCE, _LEAST = 1e-3, 2e-3
_DRIFT = "Heating, Mullins effect or relaxation: bracket the campaign with repeated runs at 0 A."
_STEP = "Something was different then: clamping, load cell, temperature."


@dataclass(frozen=True)
class Trend:
    """Relative change of the force from the first to the last run, its standard error, the scatter beside it, what tells the order."""

    total: float
    std_error: float
    scatter: float
    order: str


def trend_of(runs: SortedRuns, fit: DynamicFit) -> Trend | None:
    """Return the trend of the force over the runs of `fit`; None where there is none, or too few runs to tell."""
    by_name = {usable.run: usable for usable in runs.loops}
    used = [by_name[loop.run] for loop in fit.loops if loop.run in by_name]
    if not _FEWEST <= len(used) <= MANY or len(used) < len(fit.loops):
        return None
    place, order = order_of(used)
    if len(set(place)) < _FEWEST:
        return None
    # An untared mass changes the force with frequency, in which order runs are often made: it is not taken for a trend.
    test = Linearised(fit, FitOptions().scatter_cap, mass=True).test_trend(place - place.mean())
    total, sd = (float(part[0] * np.ptp(place)) for part in (test.coefficients, test.std_error))
    return Trend(total, sd, test.scatter, order) if test.chance < _CHANCE and abs(total) > _LEAST else None


def say_trend(runs: SortedRuns, trend: Trend | None) -> str:
    """Say by how much the force changes from the first to the last run; an empty text for no trend."""
    if trend is None:
        return ""
    doubt = (
        f"Stiffness changes by {100 * trend.total:+.1f} % (standard error {100 * trend.std_error:.1g} %) from the first to the last run ({trend.order}; "
        f"{100 * trend.scatter:.2g} % of scatter is left beside that trend): heating, Mullins effect or relaxation. Bracket the campaign "
        "with repeated runs at 0 A; intervals of the model's parameters hold half of it."
    )
    runs.say("warning", None, doubt, "force")
    return doubt


def gains_over_runs(
    runs: Sequence[str],
    gains: Sequence[float],
    sequence: Sequence[float | None],
    begins: Sequence[float | None],
) -> OverRuns:
    """Tell what the force of runs does against that of the model (1 + gain) over their order; what is not known of all is passed over."""
    return over_runs(
        "force over that of the model",
        "1",
        runs,
        [1 + gain for gain in gains],
        sequence=_if_all(sequence),
        begins=_if_all(begins),
    )


def gains_of_fit(runs: SortedRuns, fit: DynamicFit) -> OverRuns:
    """Tell what the force of the runs of `fit` does against that of the model over their order."""
    used = [usable for usable in runs.loops if usable.run in fit.gain_by_run]
    return gains_over_runs(
        [usable.run for usable in used],
        [fit.gain_by_run[usable.run] for usable in used],
        [usable.sequence for usable in used],
        [usable.begins for usable in used],
    )


def say_changes(runs: SortedRuns, found: OverRuns) -> list[str]:
    """Say how the force of many runs drifts, steps, or is off for a while."""
    doubts = []
    for change in found.course.changes:
        cause = _DRIFT if change.kind == "drift" else _STEP
        doubt = (
            f"{found.change_sentence(change)} {cause} Parameters and their intervals hold for the mean of the campaign."
        )
        runs.say("warning", None if change.kind == "drift" else found.runs[change.first], doubt, "force")
        doubts.append(doubt)
    return doubts


def _if_all(values: Sequence[float | None]) -> Sequence[float | None] | None:
    return None if any(value is None for value in values) else values


def order_of(used: Sequence[UsableRun]) -> tuple[np.ndarray, str]:
    """Return the place of each run in the order in which they were made, and what tells it."""
    sequence = [usable.sequence for usable in used if usable.sequence is not None]
    if len(sequence) == len(used):
        return np.array(sequence), "in the order of 'sequence_index'"
    begins = [usable.begins for usable in used if usable.begins is not None]
    if len(begins) == len(used):
        return np.argsort(np.argsort(begins)).astype(float), "in the order of the times at which the logs begin"
    names = sorted((usable.run for usable in used), key=_natural)
    return np.array([float(names.index(usable.run)) for usable in used]), "in the order of their names"


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts run 2 before run 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
