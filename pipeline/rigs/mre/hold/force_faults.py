"""What is doubtful about the force of a hold test (mre.md section 8): each doubt is a finding and a reason of the verdict."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import counted, listing
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.analysis import Analysed, extra, relaxations_clash, without_relaxation
from pipeline.rigs.mre.hold.blank import pole_pull
from pipeline.rigs.mre.hold.law_faults import judge_course, judge_limit, judge_misfit, judge_soft_limit, plain

# Axial stress on a pad beyond which a unit is suspected, Pa.
STRESS = (2e3, 2e7)
_PRELOAD = 0.3  # relative, force at 0 A against the preload told
_LARGEST_R = 0.1  # per decade
_SURE = 4.0  # standard errors
_SMALL = 2e-3  # of F0: what is below is no doubt


def judge_force(found: Analysed, doubts: Doubts, *, alone: bool = False) -> bool:
    """Say what is doubtful about the force of one run; False where its numbers are not to be used.

    With `alone` the run was fitted without the blank test that may stand beside it: nothing is said that the pull of the poles may explain.
    """
    if _wrong_unit(found, doubts):
        return False
    fit, record, run = found.fit, found.record, found.run
    if fit.values["h"] < 0:
        doubts.doubt(
            run,
            "the force falls as the current rises: the poles pull against the load cell, or the gap opens. The law's gain is negative.",
            "Run a blank test with a rigid spacer; check the sign of the force.",
        )
    judge_soft_limit(found, doubts)
    if not alone:
        judge_limit(found, doubts)
        _rest(found, doubts)
    _relaxation(found, doubts)
    if float(found.rows.current.min()) > max(0.1, 0.03 * float(found.rows.current.max())):
        doubts.doubt(
            run,
            f"no hold is at 0 A (the lowest is {found.rows.current.min():.2f} A): F_0 and all increments rest on the law carried to 0 A.",
            "Begin and end the sweep with a hold at 0 A.",
        )
    if record.of("force_axial") is not None and not record.both_ways and not record.swept:
        _one_way(found, doubts)
    late = record.late[found.used] * record.direction[found.used]
    late = late[np.isfinite(late)]
    if late.size >= 4:
        mean, error = float(late.mean()), float(late.std(ddof=1)) / math.sqrt(late.size)
        if -mean > _SURE * error and -mean > _SMALL * abs(fit.F0):
            doubts.doubt(
                run,
                f"the force has not settled when a hold begins to count: it still goes {-mean:.2g} N the way of the step on average.",
                "Hold each level longer, or raise 'settle' in the recipe.",
            )
    gain = record.recording.conditions.get("force_gain_error")
    if isinstance(gain, float) and gain > 0:
        doubts.note(
            run,
            f"the force's calibration is uncertain by {100 * gain:.3g} %: that is in the interval of F_0 only. A common factor leaves increments and relaxation as they "
            "are; a zero that is off, or a sensor that is not linear (FSR), does not, and is in no interval.",
            "force_axial",
        )
    if found.blank is None:
        _pull(found, doubts)
    else:
        doubts.note(
            run,
            f"the pull of the poles from run {found.blank.run} was taken off, {found.blank.largest[1]:.3g} N at {found.blank.largest[0]:.3g} A.",
        )
    return True


def _wrong_unit(found: Analysed, doubts: Doubts) -> bool:
    """Tell whether the force's unit is wrong, and say so."""
    F0, conditions = found.fit.F0, found.record.recording.conditions
    diameter, preload = conditions.get("pad_diameter"), conditions.get("preload")
    if isinstance(preload, float) and preload > 0 and not 0.02 < F0 / preload < 50:
        doubts.reject(
            found.run,
            f"the force at 0 A is {F0:.4g} N, {F0 / preload:.3g} times the preload of {preload:.4g} N that the conditions tell: kN taken as N, or N "
            "as kN, is a factor 1000. Check the unit of force_axial.",
            channel="force_axial",
        )
        return True
    area = math.pi * diameter**2 / 4 if isinstance(diameter, float) and diameter > 0 else 1.963495e-3
    stress = F0 / area
    if not STRESS[0] < stress < STRESS[1]:
        doubts.reject(
            found.run,
            f"the force at 0 A is {F0:.4g} N, {plain(stress)} Pa on a pad: kN taken as N, or N as kN, is a factor 1000; a pad that is not "
            "squeezed has no increment. If a spacer stood in place of the pad, tell it with the condition 'test: blank'. Check the unit of force_axial and its zero.",
            channel="force_axial",
        )
        return True
    if isinstance(preload, float) and preload > 0 and abs(F0 / preload - 1) > _PRELOAD:
        doubts.doubt(
            found.run,
            f"the force at 0 A is {F0:.4g} N but the conditions tell a preload of {preload:.4g} N: label, zero or gain of the force?",
            channel="force_axial",
        )
    return False


def _relaxation(found: Analysed, doubts: Doubts) -> None:
    fit = found.fit
    sd = fit.sd({"r": 1.0})
    if fit.r < -_SURE * sd and fit.r < -2e-3:
        doubts.doubt(
            found.run,
            f"the force grows with time ({-100 * fit.r:.2g} % a decade) in place of relaxing: drift of the sensor (FSR), heating, or a gap that closes.",
            "Repeat with a load cell, or with a spacer, to see the drift.",
        )
    elif fit.r > _LARGEST_R:
        doubts.doubt(
            found.run,
            f"the force loses {100 * fit.r:.2g} % a decade of time, more than rubber does: sensor drift, slip, or a press that gives way.",
        )
    clash = relaxations_clash(found)
    if clash is not None and not found.misfit.drift:
        within, means = clash
        doubts.doubt(
            found.run,
            f"creep within the holds means {100 * within:.2g} % a decade, the difference between the sweeps up and down {100 * means:.2g} %: there is "
            "more between them than relaxation (hysteresis of the field, heating, a gap that gives).",
        )


def _rest(found: Analysed, doubts: Doubts) -> None:
    """Look into what the law leaves: drift, difference of the directions, scatter, lone holds."""
    fit, record = found.fit, found.record
    F0 = abs(fit.F0)
    judge_course(found, doubts)
    if record.both_ways:
        z = found.fit.rows.current / float(found.fit.rows.current.max())
        split = extra(found, record.direction[found.used] * z * (1 - z))
        if abs(split.z) > _SURE and abs(split.size) > _SMALL * F0:
            doubts.doubt(
                found.run,
                f"force differs between the sweeps by up to {abs(split.size):.2g} N beside relaxation: hysteresis of the field or the pad.",
            )
    judge_misfit(found, doubts)
    lone = found.saturation.fit.left_out
    if lone:
        numbers = np.flatnonzero(found.kept)[list(lone)]
        where = listing(f"{record.time[n]:.0f} s ({record.level[n]:.2f} A)" for n in numbers)
        doubts.doubt(
            found.run,
            f"{counted(len(lone), 'hold')} far off the law {'was' if len(lone) == 1 else 'were'} left out: at {where}.",
            "Look there for a knock, a slip, or a lost cable.",
        )


def _one_way(found: Analysed, doubts: Doubts) -> None:
    top = min(float(found.rows.current.max()), 6.0)
    ignored = without_relaxation(found, top)
    value, sd = found.fit.increment(top)
    share = (
        f" A fit without relaxation gives {100 * ignored:.1f} % at {top:.3g} A, this one {100 * value:.1f} +- {196 * sd:.1f} %."
        if ignored is not None
        else ""
    )
    doubts.doubt(
        found.run,
        f"the current was swept one way only: relaxation and the law are confounded, and rest on the creep within the holds and on the shape of the law.{share}",
        "Sweep the current back down.",
    )


def _pull(found: Analysed, doubts: Doubts) -> None:
    diameter = found.record.recording.conditions.get("pad_diameter")
    if found.field is None or not isinstance(diameter, float):
        doubts.note(
            found.run,
            "no blank test (a rigid spacer in place of the pad): how much of the rise is the pull of the poles is not known.",
        )
        return
    top = float(found.rows.current.max())
    flux = found.field.flux_at(top)[0]
    pull = float(pole_pull(flux, math.pi * diameter**2 / 4))
    rise = float(found.fit.increment(top)[0]) * found.fit.F0
    doubts.note(
        found.run,
        f"no blank test: at {top:.3g} A and {flux:.3g} T the poles pull with up to {pull:.3g} N on the area of the pad, where the force rises by {rise:.3g} N. "
        "How much of it the load cell sees is not known.",
    )
    advice = "Run a blank test (a rigid non-magnetic spacer in place of the pad) to tell the pull of the poles."
    if advice not in doubts.said.advice:
        doubts.said.advice.append(advice)
