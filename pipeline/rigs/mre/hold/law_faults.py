"""What is doubtful about the force law of a hold test: its limit, its fit to the holds, the course of time beside it."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.analysis import Analysed

_MISFIT = 0.01
_PLATEAU, _QUIET, _FEW = 0.05, 0.7, 4  # of the range that counts as its top; noise there over that below; holds


def plain(x: float) -> str:
    """Return a number with two digits and no exponent as long as it has less than six places."""
    return f"{float(f'{x:.2g}'):g}"


def soft_limit(found: Analysed) -> tuple[float, float, float] | None:
    """Return where the range of the sensor seems to end, and its noise there and below, N: less noise at the top than under it."""
    means = found.record.of("force_axial")
    if means is None or found.record.swept:
        return None  # in a sweep the force itself moves within a stretch
    force, spread = means.mean[found.used], means.spread[found.used]
    end = float(force.max()) - _PLATEAU * float(np.ptp(force))
    top = force > end
    if top.sum() < _FEW or (~top).sum() < _FEW:
        return None
    quiet, usual = float(np.median(spread[top])), float(np.median(spread[~top]))
    apart = float(np.quantile(spread[top], 0.75)) < float(np.quantile(spread[~top], 0.25))
    return (end, quiet, usual) if quiet < _QUIET * usual and apart else None


def judge_soft_limit(found: Analysed, doubts: Doubts) -> None:
    """Say where the range of the sensor seems to end below the limit of the pad."""
    soft = soft_limit(found)
    if soft is not None:
        doubts.doubt(
            found.run,
            f"the noise of the force is {soft[1]:.2g} N above {soft[0]:.3g} N and {soft[2]:.2g} N below: a range of the sensor or amplifier seems to end there. The limit that "
            "is found is that of the sensor; limit, saturation current, sharpness and the increments there are not told.",
            "Repeat with a larger range of the force sensor.",
            "force_axial",
        )


def judge_limit(found: Analysed, doubts: Doubts) -> None:
    """Say where saturation was not passed, or another law describes the curve better."""
    state = found.saturation.state
    if found.misfit.costs_law or soft_limit(found) is not None:
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


def judge_course(found: Analysed, doubts: Doubts) -> None:
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


def judge_misfit(found: Analysed, doubts: Doubts) -> None:
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
