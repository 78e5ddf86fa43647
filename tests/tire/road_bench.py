"""Findings of a bench that found the synthetic tire as it is, for drives."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.findings import Findings, Parameter, Run
from pipeline.rigs.tire.synthetic.truth import bench_truth

TRUTH = bench_truth({})
VALUES = {
    "rolling_radius": TRUTH.R, "bending_stiffness": TRUTH.EI, "belt_width": TRUTH.b, "foundation_radial": TRUTH.kw,
    "foundation_tangential": TRUTH.kv, "tread_stiffness": TRUTH.kt, "loss_factor": TRUTH.eta, "sensor_gain": TRUTH.c,
    "sensor_lag": TRUTH.flex_lag,
}  # fmt: skip
CONDITIONS = {
    "tire_size": TRUTH.tire_size, "inflation_pressure": TRUTH.inflation_pressure, "sensor_length_flex": TRUTH.flex_length,
    "sensor_length_pvdf": TRUTH.film_length, "supply_voltage": TRUTH.supply_voltage, "divider_resistance": TRUTH.divider_resistance,
}  # fmt: skip
_FILM = {
    "pvdf_gain": TRUTH.film_gain * TRUTH.h / (2.0 * TRUTH.c), "pvdf_time_constant": TRUTH.film_time_constant,
    "pvdf_offset_angle": TRUTH.film_offset_angle,
}  # fmt: skip


def bench(
    relative: float = 1e-3,
    nulls: dict[str, str] | None = None,
    verdict: str = "ok",
    loads: tuple[float, ...] = (1000.0, 2000.0, 3000.0),
    type_b: dict[str, float] | None = None,
    **conditions: float | str | None,
) -> Findings:
    """Return findings of tire.bench; `nulls` are not determined, with their reasons; conditions of None are not told."""
    reasons = nulls or {}
    parameters = [
        Parameter(name=name, symbol=name, value=None, unit="1", description=reasons[name])
        if name in reasons
        else Parameter(name=name, symbol=name, value=value, std_error=relative * value, unit="1")
        for name, value in {**VALUES, **_FILM}.items()
    ]
    told = {name: value for name, value in {**CONDITIONS, **conditions}.items() if value is not None}
    runs = [Run(run=f"load_{load:.0f}", conditions={**told, "nominal_load": load}) for load in loads]
    for run in runs:
        parameters.append(
            Parameter(
                name="sensor_resistance", symbol="R_0", value=TRUTH.R0, std_error=1.0, unit="ohm", at={"run": run.run}
            )
        )
    findings = Findings(
        campaign="bench", experiment="tire.bench", verdict=verdict, reasons=["told."], parameters=parameters, runs=runs
    )
    names = [name for name in VALUES if name != "rolling_radius"]
    covariance = pd.DataFrame(relative**2 * np.eye(len(names)), columns=names)
    covariance.insert(0, "parameter", names)
    findings.arrays["ring_covariance"] = covariance
    if type_b is not None:
        scaled = {"bending_stiffness", "belt_width", "foundation_radial", "foundation_tangential", "tread_stiffness"}
        findings.arrays["type_b"] = pd.DataFrame(
            [
                {"source": source, "relative": size, **{name: float(name in scaled) for name in names}}
                for source, size in type_b.items()
            ]
        )
    return findings
