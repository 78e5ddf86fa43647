"""May the law be believed? Tests of its fit against the holds themselves: levels, repeats, drift, age of the squeeze, pull of the poles.

What is found is said in `force_faults`; which numbers it costs is told here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.mre.current_levels import level_name
from pipeline.rigs.mre.hold.law_fit import LawFit, Rows, fit_law
from pipeline.rigs.mre.hold.level_fit import LevelFit, fit_levels
from pipeline.rigs.mre.hold.record import Record
from pipeline.rigs.mre.hold.samples import creep_of, log_times

_SURE, _LACK = 0.995, 0.9995  # levels of the tests for the course of time, and for the law
_SMALL = 1e-3  # of F0: a drift below is none
_MISS = 3e-3  # of the range of the force: a misfit below is none
_ROUGH = 1e-2  # of the range of the force, hold to hold
_ALIKE = 0.5  # correlation of neighbouring differences between the sweeps beyond which they are no chance
_AGES = (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 1e4)  # s
_OLDER = 6.63  # chi2 by which an older gap must be better, 99 %
_MOST_R = 0.1  # per decade
_WORSE = 6.0  # chi2 by which one of drift and older gap may be worse than the other and still be possible


@dataclass(frozen=True, eq=False)
class Course:
    """How the force goes with time beside the current: what `course_of` found.

    `levels` is fitted with a drift where one is sure; else `older` (s) is set where an older squeeze is sure, and `also` tells that the other of the two
    does about as well. `unseen` is the drift over the log (N) and the error of r that would pass unseen (95 %), None where drift cannot be tested.
    """

    levels: LevelFit | None = None
    older: float | None = None
    also: bool = False
    unseen: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Misfit:
    """What stands between the law and the holds; forces in N.

    Attributes
    ----------
    course
        Levels without a law, and how the force goes with time.
    missed
        Rms by which the law misses the levels, 0 where it fits.
    pull
        Force at the largest field that goes with B^2 and mends the misfit, 0 where none does.
    apart
        Hold-to-hold scatter that is no chance (the sweeps differ), 0 where there is none.
    """

    course: Course
    missed: float = 0.0
    pull: float = 0.0
    apart: float = 0.0

    @property
    def levels(self) -> LevelFit | None:
        """Fit of the levels without a law, None where no levels were held."""
        return self.course.levels

    @property
    def drift(self) -> float:
        """Part of the force that goes linearly with time, N over the log; 0 where none is sure."""
        return self.levels.drift if self.levels is not None and math.isfinite(self.levels.drift_sd) else 0.0

    @property
    def costs_law(self) -> str:
        """Why the law's numbers are not told; empty where they are."""
        if self.pull:
            return f"the law misses the holds by {self.missed:.2g} N (rms) and needs {self.pull:.3g} N beside it that go with B^2"
        if self.missed:
            return f"the law misses the holds by {self.missed:.2g} N (rms): it is not that of this force"
        if self.apart:
            return f"the sweeps differ by {self.apart:.2g} N (rms): one law does not hold for both"
        return ""


def levels_of(rows: Rows, level_error: np.ndarray) -> np.ndarray:
    """Return the number of the level of each hold, 0 for the lowest, shape (H,)."""
    names = np.array([level_name(float(i), float(e)) for i, e in zip(rows.current, level_error, strict=True)])
    return np.asarray(np.unique(names, return_inverse=True)[1])


def course_of(record: Record, rows: Rows, used: np.ndarray) -> Course:
    """Test for a drift, and for a gap closed before the log began; both need levels held on the way up and down.

    Parameters
    ----------
    record, rows, used
        The log, the holds that the law was fitted to, and which of the record's they are.
    """
    if record.swept:
        return Course()
    level_of = levels_of(rows, record.level_error[used])
    try:
        plain = fit_levels(rows, level_of, drift=False)
        if not (plain.repeats and record.both_ways):
            return Course(plain)
        drifting = fit_levels(rows, level_of, drift=True)
    except ValueError:
        return Course()
    t = t_quantile(max(drifting.spare, 1.0), _SURE)
    drifts = abs(drifting.drift) > max(t * drifting.drift_sd, _SMALL * abs(float(plain.force[0])))
    unseen = (2 * drifting.drift_sd, 2 * drifting.r_sd)
    if "gap_closed_for" in record.recording.conditions:
        return Course(drifting if drifts else plain, unseen=unseen)
    age, aged = _oldest(record, plain, used)
    if age is None or aged is None:
        return Course(drifting if drifts else plain, unseen=unseen)
    own, with_drift, older = (_white_chi2(fit) for fit in (plain, drifting, aged))
    noise = max(older / max(aged.spare, 1.0), 1.0)
    if own - older > _OLDER * noise and older <= with_drift + 1:
        return Course(plain, age, with_drift < older + _WORSE * noise, unseen)
    return Course(drifting if drifts else plain, None, drifts and older < with_drift + _WORSE * noise, unseen)


def _white_chi2(fit: LevelFit) -> float:
    raw = fit.residual[: fit.mean_sd.size] * fit.mean_sd
    return float((raw**2 / fit.rows.white).sum())


def _oldest(record: Record, plain: LevelFit, used: np.ndarray) -> tuple[float | None, LevelFit | None]:
    """Return the age of the squeeze, s, that leaves least, with its fit; None where no relaxation comes of any."""
    signal = record.samples["force_axial"]
    windows = [record.windows[n] for n in used]
    holds = [record.holds[n] for n in used]
    best: tuple[float | None, LevelFit | None] = (None, None)
    for age in _AGES:
        log = np.array([float(log_times(signal, window, age).mean()) for window in windows])
        creep = creep_of(signal, windows, holds, record.lost[used], age)
        centre = float(log.mean())
        # About the middle of the log: the same family of curves, and levels that stay near the data.
        weighed = np.where(plain.rows.has_creep, creep.force, np.nan)
        rows = replace(plain.rows, log=log - centre, creep_log=creep.log, creep_force=weighed)
        found = fit_levels(rows, plain.level_of, drift=False)
        r = found.r / (1 + found.r * centre)
        if 0 < r < _MOST_R and (best[1] is None or _white_chi2(found) < _white_chi2(best[1])):
            best = (age, found)
    return best


def misfit_of(fit: LawFit, course: Course, field_squared: np.ndarray | None) -> Misfit:
    """Test the law against the levels, and where it misses them against a law with a force that goes with B^2.

    Parameters
    ----------
    fit
        The law, with the drift or the age that the course has.
    course
        From `course_of`, its levels fitted to the same rows.
    field_squared
        B^2 of each hold, shape (H,), where it was measured and no blank test was taken off.
    """
    levels = course.levels
    if levels is None:
        return Misfit(course)
    size = float(np.ptp(fit.rows.force))
    missed = _missed(fit, levels)
    pull = 0.0
    if missed and field_squared is not None and not fit.rows.drifting and np.ptp(field_squared) > 0:
        pulled = replace(
            fit.rows,
            clock=field_squared / field_squared.max(),
            creep_clock=np.zeros_like(field_squared),
            drifting=True,
        )
        mended = fit_law(pulled)
        pull = mended.values["drift"] if not mended.left_out and not _missed(mended, levels) else 0.0
    apart = 0.0
    white = math.sqrt(float(np.median(fit.rows.white)))
    if levels.repeats and levels.scatter > max(3 * white, 0.5 * _ROUGH * size) and _alike(levels) > _ALIKE:
        apart = levels.scatter
    return Misfit(course, missed, pull, apart)


def _missed(fit: LawFit, levels: LevelFit) -> float:
    """Return the rms by which the law misses the levels, N; 0 where that may be chance, or is small."""
    rest = fit.rows.force - fit.predicted(fit.rows.current, fit.rows.log) - fit.drifted
    n = rest.size
    size = float(np.ptp(fit.rows.force))
    white = math.sqrt(float(np.median(fit.rows.white)))
    if not levels.repeats:
        return fit.scatter if fit.scatter > max(3 * white, _ROUGH * size) else 0.0
    more = levels.current.size - len([name for name in fit.free if name not in ("r", "drift")])
    own = levels.residual[:n] * levels.mean_sd
    lack = float(rest @ rest) - float(own @ own)
    if more < 1 or lack <= 0 or math.sqrt(lack / n) < _MISS * size:
        return 0.0
    from scipy.stats import f as f_distribution

    weighted = float(((rest / levels.mean_sd) ** 2).sum()) - float((levels.residual[:n] ** 2).sum())
    noise = max(float((levels.residual[:n] ** 2).sum()) / levels.spare, 1e-12)
    sure = weighted / more / noise > float(f_distribution.ppf(_LACK, more, levels.spare))
    return math.sqrt(lack / n) if sure else 0.0


def _alike(levels: LevelFit) -> float:
    """Return the correlation of the differences between the sweeps at neighbouring levels."""
    n = levels.level_of.size
    top = int(levels.current.size - 1)
    turn = int(np.argmax(levels.level_of == top))
    up = [
        float(levels.residual[k] * levels.mean_sd[k])
        for k in range(n)
        if k < turn and (levels.level_of == levels.level_of[k]).sum() > 1
    ]
    off = np.array(up)
    return float(off[:-1] @ off[1:] / (off @ off)) if off.size > 3 and (off @ off) > 0 else 0.0
