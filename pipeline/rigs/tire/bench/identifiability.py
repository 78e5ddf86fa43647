"""Which numbers of the ring fit may be told, and what to measure for the others (tire.md, 5.9).

Decided by what was varied on the bench first, by the covariance second: with too few loads or speeds the ring's exact
form would separate what the data do not.
"""

from __future__ import annotations

import math

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.identifiability import Combination
from pipeline.rigs.tire.bench.ring_model import NAMES, SCALED, SIZES
from pipeline.rigs.tire.bench.ring_result import RingFit
from pipeline.rigs.tire.bench.ring_verdict import RingVerdict

# A larger relative standard error is no determination.
_LIMIT = 0.25
# What counts as a size where the value itself may be zero.
_LEAST = {"loss_factor": 0.02, "sensor_lag": 2e-4}
_FEWEST_SPEEDS = 2
# A number that cannot be negative is not told where it is, by more standard errors than this.
_BELOW = 2.0
# What loads that were only set leave of the contact length (relative).
_SET_U = 0.012
# How far (in logarithms) the belt's width may be from what was expected.
_WIDTH = 0.3
_G0 = 9.80665
# All that keeps the same waveforms when it grows together; the tread nearly.
_SCALE = (*SCALED, "sensor_gain")
PARAMETERS = tuple(name for name in NAMES if name != "sensor_length")


def told(fit: RingFit, verdict: RingVerdict) -> dict[str, Estimate]:
    """Return every parameter of the joint fit by its findings name, with interval (type A and B) or the reason for none."""
    return {name: _told(fit, verdict, name) for name in PARAMETERS}


def _told(fit: RingFit, verdict: RingVerdict, name: str) -> Estimate:
    why = refusal(fit, verdict, name)
    if why:
        return undetermined(name, why)
    return estimate(name, getattr(fit.values, name), fit.std_error(name), logarithmic=name not in SIZES)


def refusal(fit: RingFit, verdict: RingVerdict, name: str) -> str:
    """Return why a parameter may not be told; empty where it may."""
    if not verdict.fits:
        return verdict.statement
    if name in fit.at_bound:
        return (
            f"the fit ends at a bound of {name}; the runs do not determine it. Check loads, pressure and sensor length, or "
            "measure over a wider range of loads."
        )
    if fit.known.loads_set and name in _SCALE:
        return (
            "the loads were set and not measured: an error of half a per cent between them, which the waveforms do not show, moves all stiffnesses and "
            "the sensor's gain together by several. Log the load cell."
        )
    if fit.scale_held and name in _SCALE:
        return (
            f"{_counted(fit.loads, 'load')} cannot tell the scale of stiffnesses and sensor gain (a stiffer tire with a "
            "more sensitive sensor gives the same waveforms): only ratios are known. Measure at least three loads, or the "
            "height of the hub, or state the belt's width and its uncertainty."
        )
    if fit.speeds < _FEWEST_SPEEDS and name in SIZES:
        return (
            "at one speed the tire's loss and the sensor's lag both only make the waveform lopsided and cannot be told "
            "apart. Measure one load at two speeds or more, the fastest at least twice the slowest."
        )
    value = getattr(fit.values, name)
    if name in SIZES and value < -_BELOW * fit.std_error(name):
        return (
            "it comes out negative, which no tire and no sensor is: the log runs backward, the wheel is driven, or the waveforms hardly tell it. "
            "Look at the order of time and the sense of rotation."
        )
    size = max(abs(value), _LEAST.get(name, 0.0))
    if not fit.std_error(name, combined=False) < _LIMIT * size:
        share = fit.std_error(name, combined=False) / size
        return (
            f"its relative standard error is {share:.0%}: the runs hardly depend on it. Measure more revolutions, or over "
            "a wider range of loads."
        )
    return ""


def contact_lengths(fit: RingFit, verdict: RingVerdict) -> tuple[Estimate, ...]:
    """Return Lc at every load and speed as set, each once, with its interval."""
    found: dict[tuple[float, float], Estimate] = {}
    for run in fit.runs:
        at = {"load": run.nominal_load, "speed": run.nominal_speed}
        key = (run.nominal_load, run.nominal_speed)
        if key in found:
            continue
        if not verdict.fits:
            found[key] = undetermined("contact_length", verdict.statement, at)
            continue
        remark = (
            "The belt's width was held at a guess within 10 %, which is in the interval; measure three loads."
            if fit.scale_held
            else ""
        )
        # The length goes with the load to the power 0.6, told for a load that is not known better than that.
        unknown = _SET_U * run.contact_length if fit.known.loads_set else 0.0
        error = math.hypot(run.contact_length_se, unknown)
        found[key] = estimate("contact_length", run.contact_length, error, at=at, reason=remark)
    return tuple(found.values())


def ratios(fit: RingFit, verdict: RingVerdict) -> tuple[Combination, ...]:
    """Return what is known of stiffnesses and gain where their scale is not: each over the belt's width b.

    Times p0 R in the denominator these are ratios to the belt's tension p0 b R.
    """
    if not (verdict.fits and fit.scale_held):
        return ()
    found = []
    width = NAMES.index("belt_width")
    for name in _SCALE:
        i = NAMES.index(name)
        if i == width:
            continue
        C = fit.covariance
        variance = C[i, i] + C[width, width] - 2.0 * C[i, width]
        value = getattr(fit.values, name) / fit.values.belt_width
        sd = math.sqrt(max(float(variance), 0.0))
        if sd < _LIMIT:
            found.append(Combination(f"{name} / belt_width", (name, "belt_width"), value, sd * value))
    return tuple(found)


def scale_doubt(fit: RingFit) -> str:
    """Return what speaks against the scale of the fitted stiffnesses: a belt far wider or narrower than expected.

    Load, pressure and width enter as F/(p0 b): a wrong unit of load or pressure shows here and nowhere else.
    """
    expected = fit.known.belt_width
    if expected is None or fit.scale_held or fit.known.belt_width_u is not None:
        return ""
    ratio = fit.values.belt_width / expected
    if abs(math.log(ratio)) < _WIDTH:
        return ""
    found = f"the fit wants a belt of {1e3 * fit.values.belt_width:.0f} mm, {1e3 * expected:.0f} mm were expected"
    if abs(math.log(ratio * _G0)) < _WIDTH:
        return f"{found}: the load looks like kg taken for N, or the pressure is ten times too large"
    return f"{found}: look at the inflation pressure and at the unit and gain of the load cell"


def statements(fit: RingFit, verdict: RingVerdict) -> tuple[str, ...]:
    """Return in sentences what the runs determine and what they do not."""
    if not verdict.fits:
        return (verdict.statement,)
    reasons: dict[str, list[str]] = {}
    for name in PARAMETERS:
        why = refusal(fit, verdict, name)
        if why:
            reasons.setdefault(why, []).append(name)
    spoken = [f"Not determined: {', '.join(names)}: {why}" for why, names in reasons.items()]
    good = [name for name in PARAMETERS if not any(name in names for names in reasons.values())]
    if good:
        weakest = max(
            good, key=lambda n: fit.std_error(n, False) / max(abs(getattr(fit.values, n)), _LEAST.get(n, 0.0))
        )
        share = fit.std_error(weakest, False) / max(abs(getattr(fit.values, weakest)), _LEAST.get(weakest, 0.0))
        condition = float(fit.singular[0] / fit.singular[-1])
        spoken.append(
            f"{len(good)} of {len(PARAMETERS)} parameters are determined from {_counted(fit.loads, 'load')} and "
            f"{_counted(fit.speeds, 'speed')}; the weakest is {weakest} (relative error {100.0 * share:.2g} %), condition number "
            f"{condition:.3g}."
        )
    spoken += [
        f"{c.text} = {c.value:.5g} (standard error {100 * c.std_error / c.value:.2g} %) is determined although its members are not."
        for c in ratios(fit, verdict)
    ]
    doubt = scale_doubt(fit)
    if doubt:
        spoken.append(doubt[0].upper() + doubt[1:] + ".")
    prior = fit.known.sensor_length
    shift = (fit.values.sensor_length - prior) / prior
    if abs(shift) > 2.0 * fit.known.sensor_length_u:
        spoken.append(
            f"The fit wants a sensor of {1e3 * fit.values.sensor_length:.1f} mm, {abs(shift):.0%} off the stated "
            f"{1e3 * prior:.1f} mm: measure its length, the contact length depends on it."
        )
    return tuple(spoken)


def _counted(count: int, what: str) -> str:
    return f"one {what}" if count == 1 else f"{count} {what}s"
