"""What is doubtful about a step test (mre.md section 8): each doubt is a finding and a reason of the verdict."""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.estimation.uncertainty import autocovariance, effective_size
from pipeline.rigs.mre.current_levels import level_name
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.step.declaration import StepSettings
from pipeline.rigs.mre.step.lag_fit import LagFit
from pipeline.rigs.mre.step.record import Record
from pipeline.rigs.mre.step.times import blind, coarse

# Axial stress on a pad beyond which a unit is suspected, Pa.
STRESS = (2e3, 2e7)
_AREA = 1.963495e-3  # m^2, of the paper's pads where none are told
_COLOURED = 0.6  # effective over actual number of samples below which the noise of a channel is filtered
_WHITE = 0.8
_FILTER = 0.05  # s, correlation beyond which it is no filter of a force channel
_MISFIT, _CLEAR = 0.01, 3.0  # of the step; times the noise
_EARLY = 3.0  # standard errors
_LONGEST = 30.0  # s, beyond any lag of a pad that is known


def judge_record(record: Record, settings: StepSettings, doubts: Doubts) -> None:
    """Say what is doubtful about a log whatever is fitted to it."""
    doubts.hand_on(record.findings)
    run = record.run
    _current(record, doubts)
    if record.recording.conditions.get("gap_held") is False:
        doubts.doubt(
            run, "the conditions say that the gap was not held: the force then follows the press and not the field."
        )
    if "displacement_axial" in record.recording:
        time, gap = record.recording.signal("displacement_axial")
        begin = min(float(s.time[0]) for s in record.recording.streams.values() if s.time.size)
        levels = [
            float(np.nanmedian(gap[inside]))
            for hold in record.stairs.holds
            if (inside := (time - begin >= hold.start) & (time - begin < hold.stop) & np.isfinite(gap)).any()
        ]
        moved = float(np.ptp(levels)) if levels else 0.0
        if moved > settings.gap_limit:
            doubts.doubt(
                run,
                f"the gap moves by {1e6 * moved:.3g} um with the current: it was not held, and part of the response is that of the press.",
                "Stiffen or lock the press, and log the gauge.",
                "displacement_axial",
            )
    for direction, word in (("rise", "rising"), ("fall", "falling")):
        if not record.of(direction):
            doubts.doubt(
                run,
                f"the log holds no {word} step of the current: nothing can be told of that direction.",
                "Log a step up and a step down.",
            )


def _current(record: Record, doubts: Doubts) -> None:
    jumps = [step for step in record.steps if step.spread > 0]
    if record.looks_set:
        doubts.doubt(
            record.run,
            f"the logged current changes within one sample ({record.period:.2g} s), where the current of a coil takes inductance over resistance, some 10 to 100 ms: it looks like the "
            "set-point. The coil's time cannot be told from the delay and the short time constants, which are withheld; t63 and t90 count from the set-point.",
            "Log the measured coil current.",
            "current",
        )
    elif jumps:
        period = record.period
        doubts.doubt(
            record.run,
            f"the current changes within one sample ({period:.2g} s): its onset is known to +- {max(s.spread for s in jumps) * math.sqrt(3):.2g} s only, and what is "
            f"shorter than {max(blind(s, period) for s in jumps):.2g} s cannot be told from the coil's own time.",
            f"Sample force and current at {max(1000.0, 10 / period):.0f} Hz.",
            "current",
        )


def judge_fit(fit: LagFit, estimates: list[Estimate], settings: StepSettings, doubts: Doubts) -> bool:
    """Say what is doubtful about the fit of one log; False where its numbers are not to be used."""
    record, run = fit.record, fit.record.run
    if _wrong_unit(fit, doubts):
        return False
    sizes = [fit.gain(number) * (step.after - step.before) for number, step in enumerate(record.steps)]
    if any(fit.gain(number) < 0 for number in range(len(record.steps))):
        doubts.doubt(
            run,
            "the force falls as the current rises: the poles pull against the load cell, the gap opens, or one of the two has the wrong sign.",
            "Run a blank test with a rigid spacer; check the signs.",
        )
    noise = fit.sigma
    if min(abs(size) for size in sizes) < 3 * noise / math.sqrt(max(fit.effective / len(sizes), 1)):
        doubts.doubt(
            run, "the force hardly answers a step: less than three standard errors of its level.", channel="force_axial"
        )
    for step in record.steps:
        slow = fit.taus(step.direction)[0]
        if step.end - step.onset < settings.settled * slow:
            doubts.doubt(
                run,
                f"the level of {level_name(step.after, 1e-3):.3g} A is held for {step.end - step.onset:.2g} s, {(step.end - step.onset) / slow:.2g} time constants: the force had not "
                "settled, so its end level and all times of this direction rest on the shape of the model.",
                f"Wait for {math.ceil(2 * settings.settled * slow)} s after each step.",
            )
            break
    longest = max(sum(fit.taus(direction)) for direction in fit.lags)
    if longest > _LONGEST:
        doubts.doubt(
            run,
            f"the force takes {longest:.3g} s to answer and the log lasts {record.grid[-1]:.5g} s, where pads answer within a second: ms taken as s (factor 1000)? "
            "All times are then to be divided by 1000.",
            "Check the unit of the time column.",
            "time",
        )
    _misfit(fit, max(abs(size) for size in sizes), doubts)
    _filtered(fit, doubts)
    for e in estimates:
        if (
            e.name == "delay"
            and e.value is not None
            and e.ci95 is not None
            and e.value < -_EARLY * (e.std_error or 0.0)
        ):
            doubts.doubt(
                run,
                f"the force answers {-1e3 * e.value:.3g} ms before the current ({e.at['direction']}): clocks or filters of the two channels differ.",
                "Log both with one clock and one filter.",
            )
    open_ones = [
        f"{e.name} ({e.at['direction']})" for e in estimates if e.value is None and e.at["direction"] in fit.lags
    ]
    if open_ones:
        doubts.said.warn(f"Run {run}: not determined: {', '.join(open_ones)}; the parameters tell why.")
    return True


def _wrong_unit(fit: LagFit, doubts: Doubts) -> bool:
    conditions = fit.record.recording.conditions
    level = float(np.median(fit.record.force))
    preload, diameter = conditions.get("preload"), conditions.get("pad_diameter")
    area = math.pi * diameter**2 / 4 if isinstance(diameter, float) and diameter > 0 else _AREA
    odd = not STRESS[0] < level / area < STRESS[1]
    if isinstance(preload, float) and preload > 0:
        odd = not 0.02 < float(fit.c[0]) / preload < 50
    if odd:
        beside = (
            f" where the conditions tell a preload of {preload:.4g} N"
            if isinstance(preload, float) and preload > 0
            else ""
        )
        doubts.reject(
            fit.record.run,
            f"the force is about {level:.3g} N{beside}, {level / area:.4g} Pa on the pad: kN taken as N, or N as kN, is a factor 1000. Check the unit of force_axial and its zero.",
            channel="force_axial",
        )
    return odd


def _misfit(fit: LagFit, size: float, doubts: Doubts) -> None:
    """Doubt the model where it misses the response itself by more than the noise away from it."""
    record = fit.record
    rest, time = fit.residual[fit.kept], record.time[fit.kept]
    period = float(np.median(np.diff(time)))
    close = np.zeros(time.size, dtype=bool)
    worst = 0.0
    for step in record.steps:
        reach = 4 * sum(fit.taus(step.direction)) + abs(fit.values[f"{step.direction}.L"])
        close |= (time > step.onset) & (time < step.onset + reach)
        group = max(round(reach / 12 / period), 1)
        inside = rest[(time > step.onset) & (time < step.onset + reach)]
        n = inside.size // group * group
        if n >= 3 * group:
            worst = max(worst, float(np.abs(inside[:n].reshape(-1, group).mean(axis=1)).max()))
    away = rest[~close]
    if away.size < 20:
        return
    noise = float(away.std()) / math.sqrt(max(min(effective_size(away) / away.size, 1.0) * max(group, 1), 1.0))
    if worst > _MISFIT * size and worst > _CLEAR * 1.5 * noise:
        doubts.doubt(
            record.run,
            f"the model misses the response by up to {worst:.2g} N, {100 * worst / size:.2g} % of the step: a delay and two lags do not describe it, or the steps of one direction "
            "answer at different rates.",
        )


def _filtered(fit: LagFit, doubts: Doubts) -> None:
    """Tell coarse steps, drift, and a filter in the force channel alone (its noise is coloured, that of the current white)."""
    record = fit.record
    rest = fit.residual[fit.kept]
    worst = coarse(fit)
    if worst > 0:
        doubts.doubt(
            record.run,
            f"the force comes in steps of {worst * math.sqrt(6):.2g} N, larger than its noise: levels are known to {worst:.2g} N only, which the intervals allow for roughly.",
            "Use a finer range of the converter.",
            "force_axial",
        )
        return
    if fit.drift:
        doubts.doubt(
            record.run,
            f"the force drifts by {fit.drift:.2g} N over the log beside creep: zero of the sensor, temperature, or a slow third process. A straight drift was fitted along; "
            "where it is a process, part of it is in the larger time constant, t63 and t90.",
            "Note the force before and after with the pad unloaded.",
            "force_axial",
        )
    if fit.effective > _COLOURED * rest.size or rest.size < 200:
        return
    late = 0.5 * rest.size / fit.effective * float(np.median(np.diff(record.time)))
    if late > _FILTER:
        doubts.doubt(
            record.run,
            f"what the model leaves wanders over some {late:.2g} s ({fit.sigma:.2g} N rms): creep, drift or a second process that the model does not hold.",
            channel="force_axial",
        )
        return
    hold = max(record.stairs.holds, key=lambda h: h.duration)
    time, current = record.recording.signal("current")
    begin = min(float(s.time[0]) for s in record.recording.streams.values() if s.time.size)
    inside = current[(time - begin > hold.start) & (time - begin < hold.stop) & np.isfinite(current)]
    own = autocovariance(inside, 1) if inside.size > 50 else np.array([1.0, 0.0])
    alike = bool(own[0] > 0 and own[1] / own[0] > 1 - _WHITE)
    if not alike and record.filter_lag == 0:
        doubts.doubt(
            record.run,
            f"the noise of the force is correlated over some {1e3 * late:.2g} ms, that of the current is not: a filter in the force channel alone would add its delay, about as long, to "
            "the delay and the smaller time constant.",
            "Filter both channels alike, or calibrate 'force_lag' with a rigid spacer.",
            "force_axial",
        )
