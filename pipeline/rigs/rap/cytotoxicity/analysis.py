"""One run's cultures: differences to the control at each time, and what they say together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.cytotoxicity.declaration import OUTCOMES, CytotoxicitySettings
from pipeline.rigs.rap.cytotoxicity.equivalence import (
    Cell,
    Differences,
    Slope,
    Verdict,
    differences,
    slope_of,
    verdict_of,
)
from pipeline.rigs.rap.cytotoxicity.samples import Samples, cells_of, repeated_cultures, times_of
from pipeline.rigs.rap.cytotoxicity.scatter import lone_sample, unequal_scatter

Control = Literal["once", "each", "some", "none"]


@dataclass(frozen=True, eq=False)
class Outcome:
    """One of viability, necrosis, apoptosis.

    Attributes
    ----------
    times
        Times with a difference, shape (k,), s.
    treated, controls
        Their cells; the same control object where there is one for all.
    found
        The differences; None where there is none.
    undetermined
        Time -> why there is no difference, or no interval.
    verdict, reason
        What they say together, and in words why.
    """

    name: str
    margin: float
    times: np.ndarray
    treated: tuple[Cell, ...]
    controls: tuple[Cell, ...]
    found: Differences | None
    undetermined: Mapping[float, str]
    verdict: Verdict
    reason: str
    slope: Slope | None = None


@dataclass(frozen=True, eq=False)
class Culture:
    """All of one run: its samples with the time each belongs to, how the control stands, outcomes by name, problems."""

    run: str
    samples: Samples
    times: np.ndarray
    control: Control
    outcomes: Mapping[str, Outcome]
    problems: tuple[QualityFinding, ...]


def analyse(samples: Samples, settings: CytotoxicitySettings) -> Culture:
    """Return what a run's samples say of each outcome that it holds."""
    times = times_of(samples, settings)
    problems = list(samples.problems)
    control = _control(samples, times)
    repeats = repeated_cultures(samples, times)
    if repeats:
        message = (
            f"{repeats} samples repeat a culture of the same time and group: their mean counts once, since repeats of one "
            "culture are not cultures."
        )
        problems.append(QualityFinding("note", message, samples.run, "replicate"))
    outcomes = {name: _outcome(samples, times, name, control, settings, problems) for name in samples.values}
    problems += _of_times(samples, times, settings)
    if control == "some":
        message = "the control was drawn at some of the times only; its mean stands for the others, which a change of the control would bias."
        problems.append(QualityFinding("warning", message, samples.run, "group"))
    return Culture(samples.run, samples, times, control, outcomes, tuple(problems))


def _control(samples: Samples, times: np.ndarray) -> Control:
    own, treated = set(times[~samples.treated]), set(times[samples.treated])
    if not own:
        return "none"
    if len(own) == 1 and len(treated) > 1:
        return "once"
    return "each" if treated <= own else "some"


# Shares that are equal but for rounding do not scatter.
_NO_SCATTER = 1e-9


def _outcome(
    samples: Samples,
    times: np.ndarray,
    name: str,
    control: Control,
    settings: CytotoxicitySettings,
    problems: list[QualityFinding],
) -> Outcome:
    margin = settings.margin(name)
    cells = cells_of(samples, times, name)
    own = {time: cell for (time, treated), cell in cells.items() if not treated}
    due = {float(t): "no sample was drawn at this time" for t in settings.times}
    blank = np.zeros(0)
    if not own:
        reason = "there is no control: a difference needs one"
        missing = {**dict.fromkeys((t for t, treated in cells if treated), reason), **dict.fromkeys(due, reason)}
        return Outcome(name, margin, blank, (), (), None, missing, "inconclusive", reason)
    everything = _joined(list(own.values()))
    at = sorted(time for time, treated in cells if treated)
    missing = {time: why for time, why in due.items() if time not in at}
    if not at:
        return Outcome(name, margin, blank, (), (), None, missing, "inconclusive", "there is no treated sample")
    treated = tuple(cells[time, True] for time in at)
    controls = tuple(own.get(time, everything) if control in ("each", "some") else everything for time in at)
    found = differences(treated, controls, margin)
    if not found.dof:
        why = "one culture of each group: nothing tells how far cultures scatter, so the difference has no interval"
        alone = {time: f"{why}; it is {100 * value:+.3g} points" for time, value in zip(at, found.value, strict=True)}
        return Outcome(name, margin, blank, (), (), None, {**alone, **missing}, "inconclusive", why)
    if not found.deviation > _NO_SCATTER:
        why = f"{name} is the same in all cultures of a time: nothing tells how far cultures scatter, so the difference has no interval"
        problems.append(
            QualityFinding(
                "warning", f"{why}. Log each culture's own count, not a mean or a copy of it.", samples.run, name
            )
        )
        return Outcome(name, margin, blank, (), (), None, {**dict.fromkeys(at, why), **missing}, "inconclusive", why)
    problems += unequal_scatter(samples.run, name, [*treated, *_distinct(controls)])
    problems += lone_sample(samples, times, name, found.deviation, found.dof)
    verdict = verdict_of(found, margin)
    reason = _reason(name, verdict, found, at, margin)
    if verdict == "equivalence" and missing:
        verdict = "inconclusive"
        reason = f"all times sampled pass, but there is no sample at {_minutes(missing)}, and equivalence is claimed for all times or not at all"
    return Outcome(
        name, margin, np.array(at), treated, controls, found, missing, verdict, reason,
        slope_of(np.array(at), treated, controls, found),
    )  # fmt: skip


def _distinct(cells: tuple[Cell, ...]) -> list[Cell]:
    return [cell for i, cell in enumerate(cells) if not any(cell is other for other in cells[:i])]


def _joined(cells: list[Cell]) -> Cell:
    whole = cells[0]
    for cell in cells[1:]:
        whole = whole.joined(cell)
    return whole


def _reason(name: str, verdict: Verdict, found: Differences, at: list[float], margin: float) -> str:
    if verdict == "equivalence":
        return f"every 90 % interval lies within ±{100 * margin:g} points"
    worst = int(np.argmax(np.abs(found.value)))
    when, value = _minutes([at[worst]]), f"{100 * found.value[worst]:+.2g} points"
    if verdict == "different":
        return f"{name} differs by {value} at {when}, more than the margin of {100 * margin:g} points"
    outside = [
        time for time, low, high in zip(at, found.low90, found.high90, strict=True) if low <= -margin or high >= margin
    ]
    return (
        f"the 90 % interval at {_minutes(outside)} reaches beyond ±{100 * margin:g} points; neither equivalence nor a difference "
        "is shown"
    )


def _minutes(times: Iterable[float]) -> str:
    words = [f"{float(time) / 60.0:g}" for time in times]
    return f"{', '.join(words)} min"


def _of_times(samples: Samples, times: np.ndarray, settings: CytotoxicitySettings) -> list[QualityFinding]:
    """Note times of the protocol that are missing, and minutes or hours that pass for seconds."""
    present = {float(t) for t in times[samples.treated]}
    due = [float(t) for t in settings.times]
    missing = [t for t in due if t not in present]
    if not missing or not present:
        return []
    for factor, units in (
        (60.0, "minutes taken for seconds, or hours for minutes"),
        (3600.0, "hours taken for seconds"),
    ):
        if len(due) > 2 and all(any(abs(factor * p - t) <= 0.02 * t + 1e-2 for p in samples.time) for t in due):
            message = (
                f"the times of sampling are the protocol's divided by {factor:g}: {units}? Mend the unit of the time, in the log or "
                "the recipe."
            )
            return [QualityFinding("warning", message, samples.run, "time")]
    message = f"no treated sample was drawn at {_minutes(missing)}, as the protocol asks (setting 'times')."
    return [QualityFinding("warning", message, samples.run, "time")]


def ordered(culture: Culture) -> list[Outcome]:
    """Return the outcomes in the order of `OUTCOMES`."""
    return [culture.outcomes[name] for name in OUTCOMES if name in culture.outcomes]
