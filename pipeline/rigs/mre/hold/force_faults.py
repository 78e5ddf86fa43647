"""What is doubtful about the force of a hold test (mre.md section 8): each doubt is a finding and a reason of the verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.errors import counted, listing
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.analysis import Analysed, extra, relaxations_clash, without_relaxation
from pipeline.rigs.mre.hold.blank import pole_pull

# Axial stress on a pad beyond which a unit is suspected, Pa.
STRESS = (2e3, 2e7)
_PRELOAD = 0.3  # relative, force at 0 A against the preload told
_LARGEST_R = 0.1  # per decade
_SURE = 4.0  # standard errors
_REPEAT = 0.03  # relative, by which repeats may differ
_SMALL = 2e-3  # of F0: what is below is no doubt
_MISFIT = 0.01
_PLATEAU, _QUIET, _FEW = 0.05, 0.7, 4  # of the range that counts as its top; noise there over that below; holds


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
    _soft_limit(found, doubts)
    if not alone:
        _limit(found, doubts)
        _rest(found, doubts)
    _relaxation(found, doubts)
    if float(found.rows.current.min()) > max(0.1, 0.03 * float(found.rows.current.max())):
        doubts.doubt(
            run,
            f"no hold is at 0 A (the lowest is {found.rows.current.min():.2f} A): F0 and all increments rest on the law carried to 0 A.",
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
            f"the force's calibration is uncertain by {100 * gain:.3g} %: that is in the interval of F0 only. A common factor leaves increments and relaxation as they "
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


def plain(x: float) -> str:
    """Return a number with two digits and no exponent as long as it has less than six places."""
    return f"{float(f'{x:.2g}'):g}"


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


def _limit(found: Analysed, doubts: Doubts) -> None:
    state = found.saturation.state
    if found.misfit.costs_law:
        return
    top = float(found.saturation.fit.rows.current.max())
    if state != "seen":
        word = "has begun but was not passed" if state == "begun" else "was not reached"
        doubts.doubt(
            found.run,
            f"saturation {word} up to {top:.3g} A: the limit of the force, the saturation current and the sharpness are not determined. The "
            "increments at the measured currents stand.",
            f"Sweep on, to {1.4 * max(top, found.saturation.fit.I_s if state == 'begun' else top):.2g} A, if the coil allows.",
        )
        return
    aicc = found.saturation.aicc
    best = min(aicc, key=lambda name: aicc[name])
    if aicc["S law"] > 10:
        doubts.doubt(
            found.run,
            f"'{best}' describes the curve better than the S law (AICc {aicc['S law']:.3g} less): its parameters are those of a near fit.",
        )


def _soft_limit(found: Analysed, doubts: Doubts) -> None:
    """Say where the noise of the force is smaller at its top than below: the end of a range, not of the pad."""
    means = found.record.of("force_axial")
    if means is None:
        return
    force, spread = means.mean[found.used], means.spread[found.used]
    top = force > force.max() - _PLATEAU * float(np.ptp(force))
    if top.sum() < _FEW or (~top).sum() < _FEW:
        return
    quiet, usual = float(np.median(spread[top])), float(np.median(spread[~top]))
    if quiet < _QUIET * usual and float(spread[top].max()) < float(np.quantile(spread[~top], 0.25)):
        doubts.doubt(
            found.run,
            f"the noise of the force is {quiet:.2g} N near its top of {force.max():.4g} N and {usual:.2g} N below: a range of the sensor or amplifier seems to end there, and the "
            "limit that is found may be that of the sensor and not of the pad.",
            "Repeat with a larger range of the force sensor.",
            "force_axial",
        )


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
    _course(found, doubts)
    if record.both_ways:
        z = found.fit.rows.current / float(found.fit.rows.current.max())
        split = extra(found, record.direction[found.used] * z * (1 - z))
        if abs(split.z) > _SURE and abs(split.size) > _SMALL * F0:
            doubts.doubt(
                found.run,
                f"force differs between the sweeps by up to {abs(split.size):.2g} N beside relaxation: hysteresis of the field or the pad.",
            )
    _misfit(found, doubts)
    lone = found.saturation.fit.left_out
    if lone:
        numbers = np.flatnonzero(found.kept)[list(lone)]
        where = listing(f"{record.time[n]:.0f} s ({record.level[n]:.2f} A)" for n in numbers)
        doubts.doubt(
            found.run,
            f"{counted(len(lone), 'hold')} far off the law {'was' if len(lone) == 1 else 'were'} left out: at {where}.",
            "Look there for a knock, a slip, or a lost cable.",
        )


def _course(found: Analysed, doubts: Doubts) -> None:
    """Say how the force goes with time beside relaxation from the start of the log."""
    misfit, course = found.misfit, found.misfit.course
    advice = (
        "Tell with the condition 'gap_closed_for' how long the gap had been closed when the log began; note the force before and after with the pad unloaded, "
        "to see a drift of the sensor."
    )
    if course.older is not None:
        also = " A drift of the sensor would explain it as well." if course.also else ""
        doubts.doubt(
            found.run,
            f"the force relaxes as if the gap had been closed some {course.older:.0f} s before the log began.{also} Increments are taken out with that; relaxation and the "
            "force at 10 s are not told.",
            advice,
        )
    elif misfit.drift:
        told = "gap_closed_for" in found.record.recording.conditions
        also = " A gap that was closed long before the log began would explain it about as well." if course.also else ""
        doubts.doubt(
            found.run,
            f"the force drifts by {misfit.drift:.2g} N over the log beside relaxation: zero of the sensor, or temperature.{also} It is fitted beside the law"
            f"{'.' if told else '; the relaxation is not told.'}",
            advice,
        )
    elif course.unseen is not None:
        doubts.note(
            found.run,
            f"a drift of the sensor of up to {course.unseen[0]:.2g} N over the log would not be seen; the relaxation would be off by up to {100 * course.unseen[1]:.2g} % a decade.",
        )


def _misfit(found: Analysed, doubts: Doubts) -> None:
    """Say how the law misses the holds, or the holds one another, and what that costs."""
    fit, misfit = found.fit, found.misfit
    measured = misfit.levels is not None and bool(found.own_levels)
    stead = "Increments are those of the holds, no law between them." if measured else "Increments are not told."
    if misfit.pull:
        way = "press" if misfit.pull > 0 else "pull against"
        doubts.doubt(
            found.run,
            f"the law misses the holds by {misfit.missed:.2g} N (rms); with {abs(misfit.pull):.3g} N beside it that go with B^2 it fits: the poles {way} the load cell. "
            "Limit, saturation current and increments of the pad are not told.",
            "Run a blank test (a rigid non-magnetic spacer in place of the pad) to tell the pull of the poles.",
        )
    elif misfit.missed:
        doubts.doubt(
            found.run,
            f"the holds scatter about the law by {misfit.missed:.2g} N (rms), more than they differ among themselves: the law is not that of this force, so limit, saturation "
            f"current and sharpness are not told. {stead}",
            "Look for the pull of the poles (blank test), a range of the load cell that ends, or a pad that slips.",
        )
    elif misfit.apart:
        doubts.doubt(
            found.run,
            f"force differs between the sweeps by {misfit.apart:.2g} N (rms), level after level, beside relaxation: hysteresis of the field or the pad, heating, or a sensor that "
            f"moves. Limit, saturation current, sharpness and relaxation are not told. {stead}",
        )
    else:
        white = math.sqrt(float(np.median(fit.rows.white)))
        if fit.scatter > max(3 * white, _MISFIT * float(np.ptp(fit.rows.force))):
            doubts.doubt(
                found.run,
                f"the holds scatter by {fit.scatter:.2g} N about the law, {plain(fit.scatter / white)} times what their samples explain: the force jumps from hold to hold. The "
                "intervals allow for it as chance.",
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


def judge_repeats(analysed: Sequence[Analysed], doubts: Doubts) -> None:
    """Say where several sweeps do not agree in the force at 0 A or in the increments."""
    for number, first in enumerate(analysed):
        for second in analysed[number + 1 :]:
            told = _differences(first, second)
            if told:
                doubts.doubt(
                    None,
                    f"runs {first.run} and {second.run} differ: {listing(told)}. Each has numbers of its own; they are not repeats of one state.",
                    "Check pad, gap, temperature and the order of the runs (Mullins effect); repeat the first run at the end.",
                )


def _differences(first: Analysed, second: Analysed) -> list[str]:
    """Return in words how two runs differ beyond their errors and a few per cent."""
    told = []
    a, b = first.fit, second.fit
    off, sd = b.F0 / a.F0 - 1, math.hypot(a.sd({"F0": 1.0}) / a.F0, b.sd({"F0": 1.0}) / b.F0)
    if abs(off) > max(_REPEAT, _SURE * sd):
        told.append(f"the force at 0 A by {100 * off:.2g} %")
    top = min(float(a.rows.current.max()), float(b.rows.current.max()))
    (one, one_sd), (two, two_sd) = a.increment(top), b.increment(top)
    if one and abs(two / one - 1) > max(_REPEAT, _SURE * math.hypot(one_sd, two_sd) / abs(one)):
        told.append(f"the increment at {top:.3g} A by {100 * (two / one - 1):.2g} %")
    return told
