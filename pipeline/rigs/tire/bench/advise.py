"""What to measure next on the bench: runs whose Fisher information about the fitted ring shrinks its intervals most.

From the findings and their tables alone. Nothing is fitted: `ring_information` has the model.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings import Findings, Parameter
from pipeline.rigs.advice import Advice, Proposal, Shrinkage
from pipeline.rigs.tire.bench.ring_information import SOURCES, Bench, RingInformation, of_proposed
from pipeline.rigs.tire.bench.ring_model import NAMES, SIZES, Unknowns, unknowns_at
from pipeline.rigs.tire.bench.ring_run import Known, Scatter

if TYPE_CHECKING:
    import pandas as pd

_MOST = 6
# How far beyond the campaign a proposed run may go: loads and speeds as factors, pressures as shares.
_LOADS = (0.7, 1.0, 1.25)
_SPEEDS = (0.5, 1.0, 1.5)
_PRESSURES = (0.8, 1.0, 1.2)
# Nothing is proposed beyond what benches do: N, m/s.
_MOST_LOAD, _MOST_SPEED = 6000.0, 14.0
# A gain below this share of the standard error is none.
_WORTH = 0.03
_FEWEST_LOADS, _FEWEST_SPEEDS = 3, 2
_APART = 1.1
# Shared unknowns that the scale of the load moves together, and those that only a second speed parts.
_SCALE, _LOPSIDED = NAMES[:6], NAMES[6:8]
_DETERMINED = 0.25


@dataclass(frozen=True, eq=False)
class _Fitted:
    """The fit as the tables hold it."""

    values: Unknowns
    known: Known
    information: RingInformation
    bench: Bench
    scatter: Scatter
    held: float
    loads: Sequence[float]
    speeds: Sequence[float]
    pressure: float

    @property
    def sources(self) -> np.ndarray:
        """Relative standard uncertainties of `SOURCES`, shape (4,)."""
        k = self.known
        return np.array([k.pressure_u, k.load_gain_u, k.R_u, k.outer_radius_u])

    def std_errors(
        self, added: RingInformation | None, point: tuple[float, float, float] | None
    ) -> dict[str, float | None]:
        """Return the standard error of each parameter with what was added; None where it would not be determined."""
        information = self.information if added is None else self.information + added
        loads, speeds = [*self.loads], [*self.speeds]
        if point is not None:
            loads, speeds = [*loads, point[0]], [*speeds, point[1]]
        scaled = _distinct(loads) >= _FEWEST_LOADS or not self.held
        if scaled and self.held:
            # What was only guessed of the belt's width is taken out again: the loads tell it.
            guess = np.zeros((len(NAMES), len(NAMES)))
            at = NAMES.index("belt_width")
            guess[at, at] = -self.held
            information = information + RingInformation(guess, np.zeros((len(NAMES), len(SOURCES))))
        covariance = information.covariance(self.sources)
        found: dict[str, float | None] = {}
        for i, name in enumerate(NAMES):
            value = abs(float(getattr(self.values, name)))
            sd = math.sqrt(max(float(covariance[i, i]), 0.0)) * SIZES.get(name, value)
            told = (scaled or name not in _SCALE) and (_distinct(speeds) >= _FEWEST_SPEEDS or name not in _LOPSIDED)
            found[name] = sd if told and sd < _DETERMINED * value else None
        return found


def advise(findings: Findings) -> Advice:
    """Return the runs that would tell most about ring, tread and sensor."""
    fitted = _fitted(findings)
    if fitted is None:
        return Advice(
            remarks=(
                "Nothing is proposed: there is no ring fit that holds. First mend what the findings name.",
                *findings.advice[:2],
            )
        )
    told = {p.name: p for p in findings.parameters if not p.at and p.name in NAMES}
    now = fitted.std_errors(None, None)
    kept: list[tuple[float, Proposal]] = []
    for point in _candidates(fitted):
        added = of_proposed(fitted.bench, fitted.values, fitted.known, fitted.scatter, point)
        then = fitted.std_errors(added, point)
        shrinks = [_shrinkage(told[name], now[name], then[name]) for name in told]
        worth = _worth(shrinks)
        if worth > _WORTH:
            shown = sorted((s for s in shrinks if s.then is not None and _gain(s) > _WORTH), key=_gain, reverse=True)
            kept.append((worth, Proposal(_conditions(point), 1, _why(point, fitted, shown), shown)))
    kept.sort(key=lambda one: one[0], reverse=True)
    remarks = [
        "Predicted from the Fisher information of the fitted ring, for a run as long and as noisy as the others; the best run is worked out for "
        "the campaign as it is, so ask again once it is there."
    ]
    ruling = _ruled_by_gauges(fitted)
    if ruling:
        remarks.append(ruling)
    if not kept:
        remarks.append("No single run within reach of this bench shrinks an interval by more than 3 %.")
    return Advice([proposal for _, proposal in kept[:_MOST]], remarks)


def predicted(findings: Findings, point: tuple[float, float, float]) -> dict[str, float | None]:
    """Return the standard errors that one more run at load (N), speed (m/s) and pressure (Pa) would leave, SI.

    By name; None of what would not be determined. Empty where there is no ring fit that holds.
    """
    fitted = _fitted(findings)
    if fitted is None:
        return {}
    return fitted.std_errors(of_proposed(fitted.bench, fitted.values, fitted.known, fitted.scatter, point), point)


def _candidates(fitted: _Fitted) -> Iterator[tuple[float, float, float]]:
    low, high = min(fitted.loads), max(fitted.loads)
    slow, fast = min(fitted.speeds), max(fitted.speeds)
    loads = sorted(
        {
            _round(load, 50.0)
            for load in (_LOADS[0] * low, low, math.sqrt(low * high), high, _LOADS[-1] * high)
            if load <= _MOST_LOAD
        }
    )
    speeds = sorted(
        {
            _round(speed, 1.0 / 3.6)
            for speed in (_SPEEDS[0] * slow, slow, fast, _SPEEDS[-1] * fast)
            if speed <= _MOST_SPEED
        }
    )
    for share in _PRESSURES:
        for load in loads:
            for speed in speeds:
                yield load, speed, share * fitted.pressure


def _round(value: float, step: float) -> float:
    return max(round(value / step), 1) * step


def _distinct(values: Sequence[float]) -> int:
    """Return how many of the values differ by a tenth or more, as the fit counts them."""
    count, last = 0, 0.0
    for value in sorted(values):
        if count == 0 or value > last * _APART:
            count, last = count + 1, value
    return count


def _conditions(point: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip(("nominal_load", "nominal_speed", "inflation_pressure"), point, strict=True))


def _shrinkage(p: Parameter, now: float | None, then: float | None) -> Shrinkage:
    """Return the change of one standard error: as told now, then by the predicted ratio."""
    if p.std_error is None or p.value is None:
        return Shrinkage(p.name, p.at, None, then, p.unit)
    ratio = then / now if then is not None and now else 1.0
    return Shrinkage(p.name, p.at, p.std_error, ratio * p.std_error, p.unit)


def _gain(one: Shrinkage) -> float:
    """Return the logarithm of the factor; of what is not determined now, that of a hundredfold."""
    if one.then is None:
        return 0.0
    return math.log(100.0) if one.now is None else math.log(one.now / one.then)


def _worth(shrinks: Sequence[Shrinkage]) -> float:
    return float(np.mean([_gain(one) for one in shrinks])) if shrinks else 0.0


def _why(point: tuple[float, float, float], fitted: _Fitted, shown: Sequence[Shrinkage]) -> str:
    """Say in one sentence what the run tells that the campaign does not."""
    load, speed, pressure = point
    new = [one.name.replace("_", " ") for one in shown if one.now is None]
    best = shown[0].name.replace("_", " ") if shown else "all of them"
    if abs(pressure / fitted.pressure - 1.0) > 0.05:
        what = "another pressure changes the belt's tension alone, and so tells it from bending and foundation"
    elif load > _APART * max(fitted.loads) or load < min(fitted.loads) / _APART:
        what = "a load beyond the others bends the curve of peak over load, which the scale of stiffnesses and gain rests on"
    elif speed > _APART * max(fitted.speeds) or speed < min(fitted.speeds) / _APART:
        what = "another speed tells the sensor's lag from the tire's loss"
    else:
        what = "it averages out the errors of load, gain and pressure that each run has for itself"
    return f"{what[0].upper()}{what[1:]}" + (
        f"; it would determine {', '.join(new)}." if new else f"; {best} gains most."
    )


def _ruled_by_gauges(fitted: _Fitted) -> str:
    """Name the gauge that no run can make up for, where one rules an interval."""
    full = np.diag(fitted.information.covariance(fitted.sources))
    words = {
        "pressure": "the pressure gauge",
        "load_gain": "the load cell",
        "belt_radius": "the rolling radius",
        "outer_radius": "the free radius",
    }
    ruled: dict[str, list[str]] = {}
    for j, source in enumerate(SOURCES):
        without = fitted.sources.copy()
        without[j] = 0.0
        rest = np.diag(fitted.information.covariance(without))
        for i, name in enumerate(NAMES):
            if rest[i] < 0.5 * full[i]:
                ruled.setdefault(words[source], []).append(name.replace("_", " "))
    return " ".join(
        f"More than half of the variance of {', '.join(names)} is {gauge}'s: calibrate it, runs do not help."
        for gauge, names in ruled.items()
    )


def _fitted(findings: Findings) -> _Fitted | None:
    """Return the fit from the tables; None where it holds for nothing."""
    matrix: pd.DataFrame | None = findings.arrays.get("information")
    about: pd.DataFrame | None = findings.arrays.get("information_about")
    runs: pd.DataFrame | None = findings.arrays.get("ring_runs")
    if matrix is None or about is None or runs is None or not len(matrix) or not len(runs):
        return None
    one: dict[Any, Any] = about.iloc[0].to_dict()
    if not one["model_fits"]:
        return None
    known = Known(
        R=one["R"], R_u=one["R_u"], Ro=one["Ro"], sensor_length=one["sensor_length"], sensor_length_u=one["sensor_length_u"],
        pressure_u=one["pressure_u"], load_gain_u=one["load_gain_u"], outer_radius_u=one["outer_radius_u"],
    )  # fmt: skip
    names = list(NAMES)
    return _Fitted(
        values=unknowns_at(matrix["coordinate"].to_numpy(dtype=float)),
        known=known,
        information=RingInformation(matrix[names].to_numpy(dtype=float), matrix[list(SOURCES)].to_numpy(dtype=float)),
        bench=Bench(
            one["noise"], one["load_se"], one["R0"], one["supply_voltage"], one["divider_resistance"], int(one["bins"])
        ),
        scatter=Scatter(one["scatter_load"], one["scatter_gain"], one["scatter_pressure"], one["uneven"]),
        held=one["held"],
        loads=runs["load"].to_list(),
        speeds=(runs["rotation"] * known.R).to_list(),
        pressure=one["pressure"],
    )  # fmt: skip


__all__ = ["advise", "predicted"]
