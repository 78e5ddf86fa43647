"""Warming of the housing's air: eq. 7 per sensor, and the air for eq. 8 (rap.md, 3.6, 5.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import t_quantile
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.thermal import housing_temperature
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.temperature_profile import profile_intervals

_TAU = (120.0, 7200.0)
_TAU_START = 1000.0
_FIRST_HOUR = 3600.0
# A first sample later than that says little of T_0 where the time constant is not known, s.
_EARLY = 300.0
# Intervals of tau whose ends differ by more than this factor, of temperatures wider than this (K), tell no number.
_WIDEST, _VAGUE = 8.0, 6.0
# A sensor whose offset nobody has checked, K (1 sigma): the device's own.
_UNCHECKED = 0.5


@dataclass(frozen=True, eq=False)
class TemperatureFit:
    """Eq. 7 fitted to one sensor: `source` rap or bench, `modelled` at the samples, `residual_sd` in K."""

    source: str
    initial: Estimate
    final: Estimate
    time_constant: Estimate
    time: np.ndarray
    measured: np.ndarray
    modelled: np.ndarray
    residual_sd: float
    dof: int
    problems: tuple[QualityFinding, ...]

    @property
    def estimates(self) -> tuple[Estimate, Estimate, Estimate]:
        """T_0, T_inf, tau."""
        return self.initial, self.final, self.time_constant


@dataclass(frozen=True, eq=False)
class AirTemperature:
    """Course of the air in the housing: knots `time` (s), `values` (K), standard uncertainty `sd` (K), in words `source`."""

    time: np.ndarray
    values: np.ndarray
    sd: float
    source: str

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return the temperature (K) at `time` (s), shape (n,); held beyond the ends."""
        return np.asarray(np.interp(time, self.time, self.values))


def fit_temperature(sensor: Signal, source: str, start: float = 0.0) -> TemperatureFit:
    """Fit eq. 7 to one sensor.

    Parameters
    ----------
    sensor
        Air temperature, K; a handful of samples.
    source
        rap or bench; goes into `at`.
    start
        Moment (s) that T_0 is for: switching on.

    Returns
    -------
    TemperatureFit
        Numbers that the samples cannot tell have no value but a reason.
    """
    from pipeline.estimation.least_squares import Unknown, fit

    t, T = sensor.time - start, sensor.values
    at = {"source": source}
    problems: list[QualityFinding] = []
    if T.size < 5:
        reason = (
            f"{T.size} samples cannot tell three numbers of eq. (7); log the temperature every 10 min from switching on"
        )
        T_0, T_inf, tau = (undetermined(name, reason, at) for name in _NAMES)
        return TemperatureFit(source, T_0, T_inf, tau, sensor.time, T, np.full(T.size, np.nan), math.nan, 0, ())
    span = float(t[-1] - t[0])
    upper = min(max(_TAU[1], 2.0 * span), 86400.0)
    unknowns = [
        Unknown("T_0", float(T[0]), float(T[0]) - 10.0, float(T[0]) + 10.0, "K"),
        Unknown("T_inf", float(T[-1]), float(T[-1]) - 10.0, float(T[-1]) + 10.0, "K"),
        Unknown("tau", _TAU_START, _TAU[0], upper, "s", logarithmic=True),
    ]
    found = fit(lambda p: housing_temperature(t, p["T_0"], p["T_inf"], p["tau"]) - T, unknowns, starts=2)
    values, sd, dof = found.values, found.std_error, found.dof
    residual_sd = found.sigma
    # Residuals that happen to be nil know the readings no better than their steps do.
    least = resolution(T) / math.sqrt(12.0)
    if 0.0 < residual_sd < least:
        sd, residual_sd = {key: one * least / residual_sd for key, one in sd.items()}, least
    # Readings in steps coarser than the noise repeat the same error however many there are; noise of half a step dithers it
    # away (mean error of a rounded Gaussian, first harmonic: Widrow, Kollar and Liu, IEEE Trans. Instrum. Meas. 45, 1996, 353).
    step = resolution(T)
    noise = math.sqrt(max(residual_sd**2 - step**2 / 12.0, 0.0)) / max(step, 1e-9)
    common = step / math.sqrt(12.0) * math.exp(-2.0 * (math.pi * noise) ** 2)
    rise = abs(values["T_inf"] - values["T_0"])
    profile = profile_intervals(t, T, least)
    lost = _why_lost(float(t[0]), span, rise, residual_sd, found.at_bound, sd, profile)
    modelled = housing_temperature(t, values["T_0"], values["T_inf"], values["tau"])
    if "tau" in lost and "moves" in lost["tau"]:
        return _flat(source, sensor, lost, step)
    estimates = []
    for name, key in zip(_NAMES, ("T_0", "T_inf", "tau"), strict=True):
        if key in lost:
            estimates.append(undetermined(name, lost[key], at))
            continue
        extra = 0.0 if key == "tau" else common
        whole = math.hypot(sd[key], extra)
        linear = estimate(name, values[key], whole, dof=dof, at=at, logarithmic=key == "tau")
        estimates.append(_widened(linear, profile[key], t_quantile(dof) * extra))
    if lost:
        problems.append(QualityFinding("warning", next(iter(lost.values())) + ".", channel=f"temperature_air_{source}"))
    initial, final, time_constant = estimates
    return TemperatureFit(
        source, initial, final, time_constant, sensor.time, T, modelled, residual_sd, dof, tuple(problems)
    )


def _widened(linear: Estimate, profile: tuple[float, float] | None, common: float) -> Estimate:
    """Return an estimate whose interval holds the profile's too, widened by `common`; its standard error grows alike."""
    if profile is None or linear.ci95 is None or linear.std_error is None:
        return linear
    low, high = linear.ci95
    middle = 0.5 * (low + high) if linear.value is None else linear.value
    wide = (
        min(low, middle - math.hypot(middle - profile[0], common)),
        max(high, middle + math.hypot(profile[1] - middle, common)),
    )
    if not high > low:
        return replace(linear, ci95=wide)
    return replace(linear, ci95=wide, std_error=linear.std_error * (wide[1] - wide[0]) / (high - low))


_NAMES = ("temperature_initial", "temperature_final", "time_constant")


def _flat(source: str, sensor: Signal, lost: dict[str, str], step: float) -> TemperatureFit:
    """Return what a temperature tells that does not move: its mean."""
    from pipeline.estimation.uncertainty import effective_size

    T, at = sensor.values, {"source": source}
    sd = float(T.std(ddof=1))
    n = effective_size(T)
    whole = math.hypot(sd / math.sqrt(n), step / math.sqrt(12.0))
    mean = float(T.mean())
    initial, final = (
        undetermined(name, lost[key], at) if key in lost else estimate(name, mean, whole, dof=max(n - 1.0, 1.0), at=at)
        for name, key in zip(_NAMES[:2], ("T_0", "T_inf"), strict=True)
    )
    told = QualityFinding("warning", lost["tau"] + ".", channel=f"temperature_air_{source}")
    return TemperatureFit(
        source,
        initial,
        final,
        undetermined(_NAMES[2], lost["tau"], at),
        sensor.time,
        T,
        np.full(T.size, mean),
        sd,
        T.size - 1,
        (told,),
    )


def _why_lost(
    first: float,
    span: float,
    rise: float,
    noise: float,
    at_bound: tuple[str, ...],
    sd: dict[str, float],
    profile: dict[str, tuple[float, float] | None],
) -> dict[str, str]:
    """Return which numbers of eq. 7 the samples do not tell, and why."""
    lost: dict[str, str] = {}
    if rise < 4.0 * noise or rise < 0.3:
        lost["tau"] = (
            f"the temperature moves by only {rise:.2g} K with {noise:.2g} K of noise, so no warming can be timed"
        )
        if first > _EARLY:
            lost["T_0"] = (
                f"the first sample stands {first / 60:.0f} min after the start, when the air had warmed already; log from switching on"
            )
        return lost
    late = first > _FIRST_HOUR / 4
    why = (
        f"the first sample stands {first / 60:.0f} min after the start; the first hour tells the time constant, and T_0 trades against it. Log from switching on"
        if late
        else f"the {span / 60:.0f} min of samples do not tell it. Log every 10 min from switching on, for an hour at least"
    )
    within = profile["tau"]
    if "tau" in at_bound or not sd["tau"] < _TAU_START or within is None or within[1] > _WIDEST * within[0]:
        lost["tau"] = why
    for key in ("T_0", "T_inf"):
        known = profile[key]
        if (
            key in at_bound
            or known is None
            or not known[1] - known[0] < _VAGUE
            or (key == "T_0" and "tau" in lost and first > _EARLY)
        ):
            lost[key] = why
    return lost


def resolution(values: np.ndarray) -> float:
    """Return the resolution of readings, 0 where none shows."""
    steps = np.diff(np.unique(np.round(values, 6)))
    steps = steps[steps > 1e-5]
    return float(steps.min()) if steps.size else 0.0


def air_temperature(rap: Signal | None, bench: Signal | None, lag: float = 0.0) -> AirTemperature | None:
    """Return the air's temperature for eq. 8: the bench's where there is one, else the device's; None without either.

    Where eq. 7 describes the samples its smooth course is taken, else the samples with straight lines between them.
    """
    from pipeline.estimation.residuals import runs_test

    chosen, sd, word = (bench, 0.1, "bench") if bench is not None else (rap, _UNCHECKED, "device")
    if chosen is None:
        return None
    time = chosen.time - (lag if bench is not None else 0.0)
    course = fit_temperature(Signal(chosen.name, time, chosen.values), "bench" if bench is not None else "rap")
    if course.dof >= 5 and runs_test(course.measured - course.modelled).passed:
        told = [e.value for e in course.estimates if e.value is not None]
        if len(told) < len(course.estimates):
            return AirTemperature(time, course.modelled, sd, f"a smooth course through the {word}'s samples")
        dense = np.arange(time[0], time[-1] + 60.0, 60.0)
        return AirTemperature(dense, housing_temperature(dense, *told), sd, f"eq. (7) through the {word}'s samples")
    return AirTemperature(time, chosen.values, sd, f"the {word}'s samples, straight lines between them")
