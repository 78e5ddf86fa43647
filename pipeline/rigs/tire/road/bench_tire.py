"""The tire as a bench campaign found it: ring, tread, sensor, their covariance, and at what it was measured.

Whether it fits a drive is judged in `handed_over`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings, Run

if TYPE_CHECKING:
    import pandas as pd

# What the ring and the sensor of a drive are made of, by the bench's names.
RING = (
    "bending_stiffness", "belt_width", "foundation_radial", "foundation_tangential", "tread_stiffness", "loss_factor",
    "sensor_gain", "sensor_lag",
)  # fmt: skip
RADIUS, LENGTH = "rolling_radius", "sensor_length"
# Relative standard uncertainties where the bench does not tell them.
_USUAL = {"load_gain": 0.005, "pressure": 0.01, "sensor_length": 0.01}


@dataclass(frozen=True, eq=False)
class TypeB:
    """An uncertainty that all runs share: its source, its relative size, d ln(number)/d ln(source), shape (k,)."""

    source: str
    relative: float
    sensitivity: np.ndarray


@dataclass(frozen=True, eq=False)
class BenchTire:
    """What a bench campaign hands over.

    Attributes
    ----------
    campaign, verdict
        Its name and its verdict.
    values, std_errors
        By name: `RING`, `LENGTH`, `RADIUS`; SI.
    names, covariance
        Names of the k numbers fitted and the covariance of their logarithms, type A, shape (k, k).
    type_b
        What else is uncertain.
    size, pressure, divider, supply, resistance
        Tire size as told, inflation pressure (Pa), divider (ohm, V), mean R0 (ohm); None where unknown.
    loads
        Least and largest load of the runs that were used, N.
    film
        Gain over the flex sensor (V/ohm), length (m), time constant (s) and offset angle (rad) of the film; None where it
        has none or they are not determined.
    correlated
        Whether the covariance is the bench's; else the standard errors are taken as independent.
    """

    campaign: str
    verdict: str
    values: Mapping[str, float]
    std_errors: Mapping[str, float]
    names: tuple[str, ...]
    covariance: np.ndarray
    type_b: tuple[TypeB, ...]
    size: str | None
    pressure: float | None
    divider: float | None
    supply: float | None
    resistance: float | None
    loads: tuple[float, float]
    film: tuple[float, float, float, float] | None
    correlated: bool


def lacking(findings: Findings) -> str:
    """Return why a bench campaign gives no tire; '' where it does."""
    if findings.verdict == "rejected":
        why = findings.reasons[0].rstrip(".") if findings.reasons else "its findings tell no reason"
        return f"it was rejected ({why})"
    missing = [name for name in RING if (found := _of(findings, name)) is None or found[0] is None]
    if not missing:
        return ""
    told = next((p.description for p in findings.parameters if p.name == missing[0] and p.value is None), "")
    return f"it does not determine {listing(missing)}" + (f" ({missing[0]}: {told.rstrip('.')})" if told else "")


def bench_tire(name: str, findings: Findings) -> BenchTire:
    """Return what the campaign `name` found; it lacks nothing (`lacking`)."""
    told = {key: _of(findings, key) for key in (*RING, RADIUS)}
    values = {key: float(found[0]) for key, found in told.items() if found is not None and found[0] is not None}
    errors = {key: float(found[1] or 0.0) for key, found in told.items() if found is not None}
    runs = [run for run in findings.runs if run.used]
    fit = _first_row(findings.arrays.get("fit"))
    values[LENGTH] = _number(fit.get("sensor_length")) or _median(runs, "sensor_length_flex") or 0.0
    names, covariance = _covariance(findings, values, errors)
    loads = [_number(fit.get(key)) for key in ("least_load", "most_load")]
    nominal = [load for run in runs if (load := _number(run.conditions.get("nominal_load"))) is not None]
    resistances = [p.value for p in findings.find("sensor_resistance") if p.value is not None]
    return BenchTire(
        campaign=name,
        verdict=findings.verdict,
        values=values,
        std_errors=errors,
        names=names,
        covariance=covariance,
        type_b=_type_b(findings, names, runs),
        size=_text(runs, "tire_size"),
        pressure=_number(fit.get("p0")) or _median(runs, "inflation_pressure"),
        divider=_median(runs, "divider_resistance"),
        supply=_median(runs, "supply_voltage"),
        resistance=float(np.median(resistances)) if resistances else None,
        loads=(
            loads[0] if loads[0] is not None else min(nominal, default=math.nan),
            loads[1] if loads[1] is not None else max(nominal, default=math.nan),
        ),
        film=_film(findings, runs),
        correlated="ring_covariance" in findings.arrays,
    )


def _of(findings: Findings, name: str) -> tuple[float | None, float | None] | None:
    found = [p for p in findings.find(name) if not p.at]
    return (found[0].value, found[0].std_error) if found else None


def _film(findings: Findings, runs: Sequence[Run]) -> tuple[float, float, float, float] | None:
    told = [_of(findings, name) for name in ("pvdf_gain", "pvdf_time_constant", "pvdf_offset_angle")]
    numbers = [found[0] for found in told if found is not None and found[0] is not None]
    length = _median(runs, "sensor_length_pvdf")
    return (numbers[0], length, numbers[1], numbers[2]) if len(numbers) == 3 and length else None


def _number(value: Any) -> float | None:
    """Return a finite number, else None."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        return None
    return float(value) if math.isfinite(value) else None


def _first_row(table: pd.DataFrame | None) -> Mapping[str, Any]:
    return {} if table is None or table.empty else {str(key): value for key, value in table.iloc[0].items()}


def _median(runs: Sequence[Run], condition: str) -> float | None:
    found = [value for run in runs if (value := _number(run.conditions.get(condition))) is not None]
    return float(np.median(found)) if found else None


def _text(runs: Sequence[Run], condition: str) -> str | None:
    return next((str(run.conditions[condition]) for run in runs if run.conditions.get(condition)), None)


def _covariance(
    findings: Findings, values: Mapping[str, float], errors: Mapping[str, float]
) -> tuple[tuple[str, ...], np.ndarray]:
    """Return names and covariance of the logarithms; from the standard errors where the bench's table is not there."""
    table = findings.arrays.get("ring_covariance")
    if table is None or table.empty:
        return RING, np.diag([(errors[name] / values[name]) ** 2 for name in RING])
    table = table.set_index("parameter")
    names = tuple(str(name) for name in table.index if str(name) in values and str(name) in table.columns)
    return names, np.nan_to_num(table.loc[list(names), list(names)].to_numpy(dtype=float))


def _type_b(findings: Findings, names: Sequence[str], runs: Sequence[Run]) -> tuple[TypeB, ...]:
    table = findings.arrays.get("type_b")
    if table is not None and not table.empty:
        rows = table.to_dict("records")
        return tuple(
            TypeB(str(row["source"]), float(row["relative"]), np.array([_number(row.get(n)) or 0.0 for n in names]))
            for row in rows
        )
    # Without the bench's table: with the load cell all stiffnesses move, with the pressure the belt's width against it.
    moved = {
        "load_gain": np.array([float(name not in ("loss_factor", "sensor_gain", "sensor_lag")) for name in names]),
        "pressure": np.array([-float(name == "belt_width") for name in names]),
        "sensor_length": np.array([float(name == LENGTH) for name in names]),
    }
    condition = {"load_gain": "load_gain_u", "pressure": "pressure_u", "sensor_length": "sensor_length_u"}
    return tuple(
        TypeB(source, _median(runs, condition[source]) or usual, moved[source]) for source, usual in _USUAL.items()
    )
