"""What changes along a bench run that should not: speed, level, height (tire.md, section 8)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.tire.passages.bonding import Step, step_of
from pipeline.rigs.tire.passages.device import Device
from pipeline.rigs.tire.passages.revolutions import Revolutions
from pipeline.rigs.tire.passages.run_findings import RunFindings

# Relative: drift of R0, scatter of the speed, drift of the gain.
_DRIFT, _SCATTER, _GAIN_DRIFT = 0.01, 0.02, 0.04
_FEWEST = 6
# A film that shows passages is so many codes high.
_DEAD = 5.0
# Amplitude and level that change as a falling supply would let them do, within this share of the change.
_LIKE_SAG = 0.4


def judge_steadiness(found: RunFindings, device: Device, course: Revolutions) -> None:
    """Say what changes along a run that should not: speed, level, height."""
    good = course.whole & np.isfinite(course.level)
    if good.sum() < _FEWEST:
        return
    scatter = float(course.speed.std() / course.speed.mean())
    if scatter > _SCATTER:
        found.add(
            "warning",
            f"speed not constant: it scatters by {scatter:.1%} (limit 2 %): use order tracking result only.",
            "flex_voltage",
        )
    step = step_of(course, has_film=device.has_film)
    if step is not None:
        _stepped(found, device, step)
        return
    _drifting(found, device, course, good)


def _stepped(found: RunFindings, device: Device, step: Step) -> None:
    change = f"fell by {-step.flex:.0%}" if step.flex < 0.0 else f"rose by {step.flex:.0%}"
    film = "" if step.film is None else f" while PVDF changed by {step.film:+.0%}"
    why = "debonding or broken ink" if step.flex < 0.0 else "the bond or the gain changed"
    if step.film is None:
        why = "debonding or a change of load: no film tells which"
    found.add(
        "error",
        f"flex sensor amplitude {change} at t = {step.time:.1f} s{film} ({step.sds:.0f} sd): {why}. Use the run up to there only.",
        "flex_voltage",
        (step.time, device.span[1]),
    )


def _drifting(found: RunFindings, device: Device, course: Revolutions, good: np.ndarray) -> None:
    """Say whether R0 drifts or the supply sags: the latter moves level and height together."""
    t = course.times[good]
    u = (t - t.mean()) / max(float(np.ptp(t)), 1e-9)

    def trend(values: np.ndarray) -> tuple[float, float]:
        slope, middle = np.polyfit(u, values, 1)
        return float(slope), float(middle)

    drift, level = trend(course.level[good])
    growth, height = trend(course.amplitude[good])
    VIN, R1 = device.supply_voltage, device.divider_resistance
    first, last = level - 0.5 * drift, level + 0.5 * drift
    volts = [VIN * r / (R1 + r) for r in (first, last, first + height)]
    sag = volts[1] / volts[0]
    then = sag * volts[2]
    expected = (R1 * then / (VIN - then) - last - height) if then < VIN else math.inf
    sags = abs(drift) > _DRIFT * level and abs(growth) > 0.01 * height
    if sags and abs(growth - expected) < _LIKE_SAG * abs(expected):
        found.add(
            "warning",
            f"ratiometric reference missing: level and amplitude move together as if the supply had changed by {sag - 1.0:+.1%} "
            "over the run (supply sag). Measure battery_voltage, or give the converter the supply as its reference.",
            "flex_voltage",
        )
        return
    _gain_drift(found, device, course, good, u)
    if abs(drift) < _DRIFT * level:
        return
    found.add(
        "warning",
        f"R0 drifts by {drift / level:+.1%} over the run (temperature, self-heating): R0 drift removed; gain drift cannot be.",
        "flex_voltage",
    )


def _gain_drift(found: RunFindings, device: Device, course: Revolutions, good: np.ndarray, u: np.ndarray) -> None:
    """Say whether the flex sensor's amplitude drifts against the film's; `u` is time over the run's length."""
    if not device.has_film or course.film_amplitude is None:
        return
    film = course.film_amplitude[good]
    if not np.all(np.isfinite(film) & (film > _DEAD * device.step)):
        return
    ratio = course.amplitude[good] / film
    speed = course.speed[good] / course.speed[good].mean() - 1.0
    if np.ptp(speed) > _SCATTER and abs(np.corrcoef(u, speed)[0, 1]) > 0.7:
        return  # The film grows with the speed: one cannot be told from the other.
    columns = np.column_stack([np.ones(u.size), u, speed])
    change = float(np.linalg.lstsq(columns, ratio, rcond=None)[0][1] / ratio.mean())
    if abs(change) > _GAIN_DRIFT:
        found.add(
            "warning",
            f"flex sensor amplitude drifts by {change:+.0%} over the run against PVDF: its gain drifts (temperature), or its bond "
            "creeps. What is averaged over the run is doubtful.",
            "flex_voltage",
        )
