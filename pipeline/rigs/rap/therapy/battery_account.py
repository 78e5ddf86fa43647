"""Energy that a run took and how long the battery lasts (rap.md, 3.11 and section 4, row 1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.battery import energy_used, runtime
from pipeline.rigs.rap.tables import Signal

PAPER_ENERGY = 75.5 * 3600.0
"""Battery of the device as the paper states it, J."""
_LAST = 600.0
_LONG_GAP = 30.0
# A rise of the level that is no noise of its gauge.
_RISE = 0.05


@dataclass(frozen=True, eq=False)
class Battery:
    """Account of the battery.

    Attributes
    ----------
    used, runtime
        Energy taken in the run (J), time that the full battery lasts at the mean power (s).
    mean_power
        W; its standard error in `mean_power_sd`.
    time, power, used_over_time
        Course, (n,): s, W, J. Power is NaN where only the level is logged.
    remaining_end, time_left
        Energy left at the end, if the battery was full at the start (J), and how long it lasts at the power of the last
        10 min (s); None where the battery's energy is not known.
    required_efficiency
        Share of the battery's energy that `duration` at this power takes: an efficiency below it does not last.
    source
        voltage and current, or level.
    """

    used: Estimate
    runtime: Estimate
    mean_power: float
    mean_power_sd: float
    time: np.ndarray
    power: np.ndarray
    used_over_time: np.ndarray
    energy: float
    efficiency: float
    remaining_end: float | None
    time_left: float | None
    required_efficiency: float
    lasts: bool | None
    source: str
    problems: tuple[QualityFinding, ...]


def account(
    voltage: Signal | None,
    current: Signal | None,
    level: Signal | None,
    *,
    energy: float | None = None,
    efficiency: float | None = None,
    duration: float = 18000.0,
    gain_u: float = 0.0,
) -> Battery:
    """Return the battery's account.

    Parameters
    ----------
    voltage, current, level
        V; A, + while discharging; share left. Voltage and current, else the level.
    energy, efficiency
        Of the full battery, J (the paper's 75.5 W h, and that is told, where None); share that reaches the device (1, and
        that is told, where None).
    duration
        How long it has to last, s.
    gain_u
        Relative standard uncertainty of the power (type B).

    Raises
    ------
    InputError
        If neither voltage and current nor the level is logged.
    """
    problems: list[QualityFinding] = []
    stated = energy is not None
    if energy is None:
        energy = PAPER_ENERGY
        problems.append(
            QualityFinding(
                "note", "battery_energy is not stated: the paper's 75.5 W h taken.", channel="battery_voltage"
            )
        )
    told_efficiency = (
        "" if efficiency is not None else "without losses of a converter; 0.90 of it is left with one of 90 %"
    )
    eta = efficiency if efficiency is not None else 1.0
    if voltage is not None and current is not None:
        time, power = _power(voltage, current, problems)
        used_course = energy_used(time, power)
        span = float(time[-1] - time[0])
        mean = float(used_course[-1]) / span
        sd = math.hypot(_mean_sd(power), gain_u * abs(mean))
        reading_sd = float(np.std(np.diff(power))) / math.sqrt(2.0 * power.size)
        own_sd = math.hypot(reading_sd, gain_u * abs(mean)) * span
        used = estimate(
            "energy_used",
            float(used_course[-1]),
            own_sd,
            reason="voltage times current over this run",
            type_b=gain_u * abs(mean) * span or None,
        )
        source = "voltage and current"
        if level is not None:
            _changed(level, problems)
    elif level is not None:
        time, power, used_course, mean, sd, used = _by_level(level, energy, stated, problems)
        source = "level"
    else:
        has = (
            "only battery_voltage"
            if voltage is not None
            else "only battery_current"
            if current is not None
            else "nothing"
        )
        raise InputError(
            f"of the battery {has} is logged; energy needs battery_voltage and battery_current, or battery_level. Log them."
        )
    reason = "; ".join(
        x for x in ("" if stated else "battery's energy as in the paper, 75.5 W h", told_efficiency) if x
    )
    if mean > 0.0 and sd < 0.5 * mean:
        lasts_for = runtime(energy, eta, mean)
        wandering = "its error holds that the power wanders"
        told = "; ".join(x for x in (reason, wandering) if x)
        projected = estimate("runtime_projected", lasts_for, lasts_for * sd / mean, reason=told)
        recent = time >= time[-1] - _LAST
        last = float(used_course[-1] - used_course[recent][0]) / max(float(time[-1] - time[recent][0]), 1e-9)
        remaining = eta * energy - float(used_course[-1])
        left = max(remaining, 0.0) / last if last > 0.0 else None
    else:
        projected = undetermined("runtime_projected", "no power is drawn on the mean, so nothing can be projected")
        remaining, left = eta * energy - float(used_course[-1]), None
    if remaining < 0.0:
        text = (
            f"the run took {float(used_course[-1]) / 3600.0:.1f} W h, more than the {eta * energy / 3600.0:.1f} W h that the battery gives: "
            "it ran on mains, the battery was changed, or its energy or efficiency is stated wrong."
        )
        problems.append(QualityFinding("warning", text, channel="battery_current"))
    return Battery(
        used=used,
        runtime=projected,
        mean_power=mean,
        mean_power_sd=sd,
        time=time,
        power=power,
        used_over_time=used_course,
        energy=energy,
        efficiency=eta,
        remaining_end=remaining,
        time_left=left,
        required_efficiency=mean * duration / energy,
        lasts=projected.value >= duration if projected.value is not None else None,
        source=source,
        problems=tuple(problems),
    )


def _power(voltage: Signal, current: Signal, problems: list[QualityFinding]) -> tuple[np.ndarray, np.ndarray]:
    """Return moments (n,) and power (n,) where both are logged."""
    first, last = max(voltage.time[0], current.time[0]), min(voltage.time[-1], current.time[-1])
    inside = (current.time >= first) & (current.time <= last)
    time, drawn = current.time[inside], current.values[inside]
    if time.size < 2:
        raise InputError("battery_voltage and battery_current do not overlap in time; look at their tables.")
    power = np.interp(time, voltage.time, voltage.values) * drawn
    if np.median(drawn) < 0.0:
        power = -power
        text = (
            "battery_current is negative while the device runs; it is + while discharging. Taken with the other sign."
        )
        problems.append(QualityFinding("warning", text, channel="battery_current"))
    elif np.mean(-0.02 * np.abs(drawn).max() > drawn) > 0.01:
        text = f"battery_current is negative in {100 * np.mean(drawn < 0.0):.0f} % of the samples: charged, or on mains; the energy told is the net."
        problems.append(QualityFinding("warning", text, channel="battery_current"))
    usual = float(np.median(np.diff(time)))
    gaps = np.flatnonzero(np.diff(time) > max(_LONG_GAP, 5.0 * usual))
    if gaps.size:
        lost = float(np.diff(time)[gaps].sum())
        text = f"{lost:.0f} s of the battery's record are missing; the power there is taken between its neighbours'."
        span = (float(time[gaps[0]]), float(time[gaps[-1] + 1]))
        problems.append(QualityFinding("warning", text, channel="battery_current", span=span))
    return time, power


def _mean_sd(power: np.ndarray) -> float:
    """Return the standard error of the mean of samples that hang together."""
    from pipeline.estimation.uncertainty import effective_size

    thin = max(power.size // 20000, 1)
    kept = power[: power.size // thin * thin].reshape(-1, thin).mean(axis=1)
    return float(kept.std(ddof=1)) / math.sqrt(effective_size(kept)) if kept.size > 3 else float(np.ptp(power)) / 2.0


def _changed(level: Signal, problems: list[QualityFinding]) -> bool:
    """Tell whether the battery was changed or charged within the run."""
    steps = np.diff(level.values)
    rises = np.flatnonzero(steps > _RISE)
    if not rises.size:
        return False
    at = float(level.time[rises[0] + 1])
    text = (
        f"battery_level rises by {100 * steps[rises].max():.0f} %: the battery was changed or charged. The energy told is that of all "
        "batteries together; what is left at the end is that of none of them."
    )
    problems.append(QualityFinding("warning", text, channel="battery_level", span=(at, at)))
    return True


def _by_level(
    level: Signal, energy: float, stated: bool, problems: list[QualityFinding]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float, Estimate]:
    """Return the account from the share left: moments, power (NaN), energy used, mean power, its error, energy used."""
    from pipeline.estimation.uncertainty import widened

    time, share = level.time, level.values
    if time.size < 3 or not time[-1] > time[0]:
        raise InputError("battery_level has fewer than three readings; no energy can be told from it.")
    if _changed(level, problems):
        share = share - np.concatenate([[0.0], np.cumsum(np.where(np.diff(share) > _RISE, np.diff(share), 0.0))])
    span = float(time[-1] - time[0])
    x = (time - time.mean()) / span
    X = np.stack([np.ones(x.size), x], axis=1)
    c, *_ = np.linalg.lstsq(X, share, rcond=None)
    residual = share - X @ c
    told = widened(np.linalg.inv(X.T @ X) * float(residual @ residual) / max(x.size - 2, 1), residual)
    steps = np.diff(np.unique(np.round(share, 9)))
    resolution = float(steps.min()) if steps.size else 0.01
    fall, fall_sd = -float(c[1]), math.hypot(float(told.std_error[1]), resolution / math.sqrt(6.0))
    of = "battery_energy" if stated else "the paper's 75.5 W h"
    used = estimate(
        "energy_used", fall * energy, fall_sd * energy, reason=f"fall of battery_level times {of}: as good as its gauge"
    )
    mean, sd = fall * energy / span, fall_sd * energy / span
    return time, np.full(time.size, math.nan), (share[0] - share) * energy, mean, sd, used
