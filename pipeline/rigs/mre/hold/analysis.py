"""One run of a hold test as it was fitted: rows, saturation, field, blank; and the tests on what the law leaves over."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.mre.current_levels import level_name
from pipeline.rigs.mre.hold.blank import Blank
from pipeline.rigs.mre.hold.field_fit import FieldFit
from pipeline.rigs.mre.hold.law import FIRST_TIME
from pipeline.rigs.mre.hold.law_fit import LawFit, Problem, Rows
from pipeline.rigs.mre.hold.level_fit import fit_levels
from pipeline.rigs.mre.hold.misfit import Misfit, course_of, levels_of, misfit_of
from pipeline.rigs.mre.hold.record import Record
from pipeline.rigs.mre.hold.saturation import Saturation, judge_saturation

NEAR_ZERO = 0.05  # A
_CLASH, _CLASH_LEAST = 4.0, 5e-3  # standard errors, and per decade, by which two relaxations differ


@dataclass(frozen=True, eq=False)
class Analysed:
    """What one run gave; `rows` are the holds that entered, `kept` tells which of the record's they are, shape (H,)."""

    record: Record
    rows: Rows
    kept: np.ndarray
    saturation: Saturation
    blank: Blank | None
    field: FieldFit | None
    misfit: Misfit

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.record.run

    @property
    def fit(self) -> LawFit:
        """The law that the increments come from."""
        return self.saturation.for_increments

    @property
    def used(self) -> np.ndarray:
        """Numbers of the record's holds that the fit used."""
        rows = np.flatnonzero(self.kept)
        return np.delete(rows, list(self.saturation.fit.left_out))

    @property
    def rest(self) -> np.ndarray:
        """Mean force less law at the holds used, N."""
        fit = self.saturation.for_increments
        return np.asarray(fit.rows.force - fit.predicted(fit.rows.current, fit.rows.log) - fit.drifted)

    @property
    def nrmse(self) -> float:
        """Ratio of the rms of the rest over that of the force about its mean."""
        force = self.fit.rows.force
        return float(np.sqrt(np.mean(self.rest**2)) / max(float(np.std(force)), 1e-12))

    @property
    def own_levels(self) -> dict[float, int]:
        """Numbers of the levels of `misfit.levels` by the name of the current, those above 0 A."""
        levels = self.misfit.levels
        if levels is None or float(levels.current[0]) > NEAR_ZERO:
            return {}
        errors = self.record.level_error[self.used]
        named = {}
        for number, current in enumerate(levels.current.tolist()):
            if current > NEAR_ZERO:
                named[level_name(current, float(errors[levels.level_of == number].max()))] = number
        return named

    def labels(self) -> dict[float, float]:
        """Return the levels above 0 A by name, and the mean current measured there."""
        found: dict[float, list[float]] = {}
        for number in self.used:
            current = abs(float(self.record.level[number]))
            if current > NEAR_ZERO:
                found.setdefault(level_name(current, float(self.record.level_error[number])), []).append(current)
        if self.record.swept:  # no level was held: every whole ampere that the sweep went through
            return {float(i): float(i) for i in range(1, int(self.fit.rows.current.max() + 0.1) + 1)}
        return {name: float(np.mean(currents)) for name, currents in found.items()}


def analyse(record: Record, blank: Blank | None, field: FieldFit | None) -> Analysed:
    """Fit the law to a run, the pull of the poles taken off where a blank test tells it.

    Raises
    ------
    ValueError
        If too few holds are left for the law.
    """
    means, creep = record.of("force_axial"), record.creep
    if means is None or creep is None:
        raise ValueError("the run has no force")
    kept = np.isfinite(means.mean) & np.isfinite(record.log_time)
    current = np.abs(record.level)
    force = means.mean - (blank.at(current, record.direction) if blank is not None else 0.0)
    slope = float(np.ptp(force[kept])) / max(float(np.ptp(current[kept])), 1e-9) if kept.any() else 0.0
    coarse = _coarse(record)
    unresolved = means.spread < 0.5 * coarse
    white = means.spread**2 / np.maximum(means.count, 1) + (slope * record.level_error) ** 2
    white = white + np.where(unresolved, coarse**2 / 12, 0.0)
    if blank is not None:
        white = white + blank.error_at(current, record.direction) ** 2
    span = max(float(np.ptp(record.time)), 1e-9)
    rows = Rows(
        current,
        force,
        record.log_time,
        np.where(unresolved, np.nan, creep.force),
        creep.log,
        creep.current,
        np.maximum(white, 1e-12 + (1e-7 * force) ** 2),
        (record.time + record.age - FIRST_TIME) / span,
        creep.time / span,
    ).where(kept)
    if rows.current.size < 6:
        raise ValueError(f"only {rows.current.size} holds have a force; the law has five parameters")
    saturation = judge_saturation(rows)
    used = np.delete(np.flatnonzero(kept), list(saturation.fit.left_out))
    course = course_of(record, saturation.fit.rows, used)
    if course.older is not None:
        found = analyse(record.aged(course.older), blank, field)
        aged = replace(found.misfit.course, older=course.older, also=course.also)
        return replace(found, misfit=replace(found.misfit, course=aged))
    drifts = course.levels is not None and math.isfinite(course.levels.drift_sd)
    if drifts:
        saturation = judge_saturation(replace(rows, drifting=True))
        used = np.delete(np.flatnonzero(kept), list(saturation.fit.left_out))
        level_of = levels_of(saturation.fit.rows, record.level_error[used])
        course = replace(course, levels=fit_levels(saturation.fit.rows, level_of, drift=True))
    flux = record.of("flux_density")
    squared = flux.mean[used] ** 2 if flux is not None and blank is None else None
    squared = squared if squared is not None and np.isfinite(squared).all() else None
    misfit = misfit_of(saturation.for_increments, course, squared)
    return Analysed(record, rows, kept, saturation, blank, field, misfit)


def _coarse(record: Record) -> float:
    """Return the step of the force's converter, N: the least difference between samples."""
    values = record.samples["force_axial"][1]
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    steps = steps[steps > 1e-9 * float(np.nanmax(np.abs(values)))]
    return float(steps.min()) if steps.size else 0.0


@dataclass(frozen=True)
class Extra:
    """A further term that the rest asks for: its size over the log (N) and how many standard errors that is."""

    size: float
    z: float


def extra(found: Analysed, term: np.ndarray) -> Extra:
    """Return how much of `term`, shape (H,) of the holds used, the force holds beside the law, its range as size."""
    fit = found.fit
    n = fit.rows.current.size
    weights = 1 / fit.mean_sd
    column = term * weights
    J = fit.jacobian[:n]
    left = column - J @ np.linalg.lstsq(J, column, rcond=None)[0]
    norm = float(left @ left)
    if norm < 1e-10 * float(column @ column):
        return Extra(0.0, 0.0)
    value = float(left @ (found.rest * weights)) / norm
    return Extra(value * float(np.ptp(term)), value * math.sqrt(norm))


def two_relaxations(found: Analysed) -> tuple[float, float, float, float] | None:
    """Return r and its standard error from the creep within the holds, and from their means alone; None where either is not told."""
    fit = found.saturation.fit
    there = fit.rows.has_creep
    if "r" not in fit.free or there.sum() < 4:
        return None
    level = (fit.F0 + fit.values["h"] * fit.effective(fit.rows.current)) * fit.rows.creep_log
    level, y = level[there], fit.rows.creep_force[there]
    within, sd = -float(level @ y) / float(level @ level), fit.creep_sd / math.sqrt(float(level @ level))
    means = Problem(_no_creep(fit.rows), fit.mean_sd, fit.creep_sd, fit.shape)
    start = {name: fit.values[name] for name in ("ln_I_s", "u", "r")}
    free = [name for name in ("ln_I_s", "u", "r") if name in fit.free]
    try:
        alone, values = means.fit(free, start)
    except ValueError:
        return None
    position = free.index("r")
    return within, sd, values["r"], math.sqrt(float(alone.covariance[position, position]))


def relaxations_clash(found: Analysed) -> tuple[float, float] | None:
    """Return both relaxations where that of the creep contradicts that of the sweeps, None where not."""
    both = two_relaxations(found) if found.record.both_ways else None
    if both is None:
        return None
    within, within_sd, means, means_sd = both
    off = abs(within - means)
    return (within, means) if off > _CLASH * math.hypot(within_sd, means_sd) and off > _CLASH_LEAST else None


def _no_creep(rows: Rows) -> Rows:
    return replace(rows, creep_force=np.full(rows.current.size, np.nan))


def without_relaxation(found: Analysed, current: float) -> float | None:
    """Return the increment at a current that a fit without relaxation would give."""
    fit = found.saturation.fit
    problem = Problem(_no_creep(fit.rows), fit.mean_sd, fit.creep_sd, fit.shape)
    try:
        _, values = problem.fit(("ln_I_s", "u"), {**{n: fit.values[n] for n in ("ln_I_s", "u")}, "r": 0.0})
    except ValueError:
        return None
    x = fit.shape(np.array([current]), math.exp(values["ln_I_s"]), values["u"])[0]
    return float(values["h"] * x[0] / values["F0"])
