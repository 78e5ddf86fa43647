"""Runs of one coil current taken together, and the stiffening from one current to another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.findings.findings import OperatingPoint
from pipeline.recording import Recording
from pipeline.rigs.mre.axial.numbers import NAMES
from pipeline.rigs.mre.axial.run_fit import RunFit
from pipeline.rigs.mre.pads import group_levels

_LABEL_TOLERANCE = 0.05  # A
_APART = 0.3  # A, and a tenth: label and channel then contradict each other
_TURNED_ON = 0.1  # A, by which the current may change during a run, and a twentieth of it
STIFFENING = {"stiffening_secant": "stiffness_secant", "stiffening_slope": "stiffness_slope"}


@dataclass(frozen=True)
class Current:
    """Coil current of one run (A), None where unknown, and what is to be said of it."""

    value: float | None
    label: float | None
    doubt: str = ""
    steady: bool = True


@dataclass(frozen=True, eq=False)
class Level:
    """All runs at one current: what they are called in `at`, the runs, their numbers taken together.

    `scatter` is the relative scatter of the secant stiffness from run to run, None for one run.
    """

    at: OperatingPoint
    runs: tuple[RunFit, ...]
    numbers: Mapping[str, Estimate]
    scatter: float | None

    @property
    def current(self) -> float | None:
        """Coil current, A."""
        value = self.at.get("coil_current")
        return float(value) if value is not None else None


def current_of(recording: Recording) -> Current:
    """Return the measured coil current, else the one set; the measured one is trusted where they differ."""
    given = recording.conditions.get("coil_current")
    label = float(given) if isinstance(given, float | int) and not isinstance(given, bool) else None
    if "current" not in recording:
        return Current(label, label)
    values = recording.values("current")
    values = values[np.isfinite(values)]
    if not values.size:
        return Current(label, label, "the channel 'current' has no value; the current as set is used")
    measured = float(np.median(values))
    low, high = np.quantile(values, [0.02, 0.98]).tolist()
    if high - low > max(_TURNED_ON, 0.05 * abs(measured)) + 6 * _noise(values):
        return Current(
            measured,
            label,
            f"the coil current changes from {low:.3g} to {high:.3g} A during the run: the loop is of no one current",
            False,
        )
    if label is not None and abs(measured - label) > max(_APART, 0.1 * abs(label)):
        return Current(
            measured,
            label,
            f"the measured coil current is {measured:.3g} A but the label says {label:g} A; the measured one is used",
        )
    return Current(measured, label)


def _noise(values: np.ndarray) -> float:
    return float(np.median(np.abs(np.diff(values)))) / 0.6745 / math.sqrt(2) if values.size > 2 else 0.0


def levels_of(fits: Sequence[RunFit], currents: Mapping[str, Current], tolerance: float) -> list[Level]:
    """Group runs by their current and take the numbers of each group together; unknown currents stay alone."""
    known = [fit for fit in fits if currents[fit.run].value is not None]
    labels, means = group_levels([currents[fit.run].value for fit in known], tolerance)
    groups: list[tuple[OperatingPoint, list[RunFit]]] = []
    for number, mean in enumerate(means if known else []):
        members = [fit for fit, label in zip(known, labels, strict=True) if label == number]
        groups.append(({"coil_current": _called(mean, [currents[fit.run] for fit in members])}, members))
    unknown = [fit for fit in fits if currents[fit.run].value is None]
    groups += [({} if len(fits) == 1 else {"run": fit.run}, [fit]) for fit in unknown]
    scatters = {name: _scatter([members for _, members in groups], name) for name in NAMES}
    return [_level(at, members, scatters) for at, members in groups]


def _called(mean: float, currents: Sequence[Current]) -> float:
    """Return the set current where the measured one agrees with it, else the measured one."""
    named = {
        c.label
        for c in currents
        if c.label is not None and c.value is not None and abs(c.label - c.value) < 0.1 + 0.02 * abs(c.label)
    }
    near = [label for label in named if abs(label - mean) <= _LABEL_TOLERANCE + 0.02 * abs(label)]
    return min(near, key=lambda label: abs(label - mean)) if near else mean


@dataclass(frozen=True)
class _Scatter:
    """How runs of one current differ, all currents together: relative variance `total`, that which the runs' own
    errors explain (`own`), and degrees of freedom.
    """

    total: float = 0.0
    own: float = 0.0
    dof: int = 0


def _scatter(groups: Sequence[Sequence[RunFit]], name: str) -> _Scatter:
    squares, expected, dof = 0.0, 0.0, 0
    for members in groups:
        found = [e for e in (fit.numbers.estimates[name] for fit in members) if e.value is not None]
        if len(found) < 2:
            continue
        value = np.array([e.value for e in found], dtype=float)
        own = np.array([e.std_error or 0.0 for e in found])
        mean = float(value.mean())
        squares += float(((value / mean - 1) ** 2).sum())
        expected += float(((own / mean) ** 2).mean()) * (len(found) - 1)
        dof += len(found) - 1
    return _Scatter(squares / dof, expected / dof, dof) if dof else _Scatter()


def _level(at: OperatingPoint, members: Sequence[RunFit], scatters: Mapping[str, _Scatter]) -> Level:
    numbers = {name: _together(name, members, at, scatters[name]) for name in NAMES}
    secants = [e.value for e in (fit.numbers.estimates["stiffness_secant"] for fit in members) if e.value is not None]
    scatter = float(np.std(secants, ddof=1) / np.mean(secants)) if len(secants) > 1 else None
    return Level(at, tuple(members), numbers, scatter)


def _together(name: str, members: Sequence[RunFit], at: OperatingPoint, scatter: _Scatter) -> Estimate:
    """Return the mean of the runs; where they differ by more than their own errors, its error is that of their scatter.

    Student's t then has the degrees of freedom of the scatter. Runs that happen to agree better than their errors
    do not make these smaller.
    """
    all_ = [fit.numbers.estimates[name] for fit in members]
    found = [e for e in all_ if e.value is not None]
    if not found:
        reasons = list(dict.fromkeys(e.reason for e in all_))
        return undetermined(name, "; ".join(reasons), at)
    value = float(np.mean([e.value for e in found if e.value is not None]))
    own = float(np.mean([((e.std_error or 0.0) / value) ** 2 for e in found])) if value else 0.0
    more = max(scatter.total - scatter.own, 0.0)
    total = max(scatter.total, own) if len(found) > 1 else own + more
    if len(found) == 1 and not more:
        e = found[0]
        return Estimate(name, e.value, e.std_error, e.ci95, dict(at), e.reason, e.dof)
    scattered = total > own
    told = f"mean of {len(found)} runs" if len(found) > 1 else "one run"
    if scattered:
        told += f"; the error holds {100 * math.sqrt(max(more, total - own)):.2g} % scatter from run to run"
    dof = min(e.dof for e in found) if not scattered else float(scatter.dof)
    return estimate(name, value, abs(value) * math.sqrt(total / len(found)), dof=dof, at=at, reason=told)


def stiffening(levels: Sequence[Level]) -> list[Estimate]:
    """Return the stiffening relative to 0 A in both definitions, for every other current; null without 0 A."""
    base = next((level for level in levels if level.current == 0), None)
    found = []
    for level in levels:
        if level is base or level.current is None:
            continue
        at = {"coil_current": level.current}
        for name, stiffness in STIFFENING.items():
            if base is None:
                found.append(undetermined(name, "no run is at 0 A, relative to which it is told", at))
                continue
            with_, without = level.numbers[stiffness], base.numbers[stiffness]
            if with_.value is None or without.value is None:
                found.append(undetermined(name, (with_ if with_.value is None else without).reason, at))
                continue
            ratio = with_.value / without.value
            parts = [(e.std_error or 0.0) / abs(e.value or 1.0) for e in (with_, without)]
            relative = math.hypot(*parts)
            # Not Welch's: where runs scatter, both errors rest on the same estimate of it.
            freedom = min(with_.dof, without.dof)
            found.append(estimate(name, ratio - 1, ratio * relative, dof=freedom, at=at))
    return found
