"""The tables beside the findings, SI: what the report draws and others may go on with."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.rigs.rap.flow.results import ESTIMATORS, Campaign
from pipeline.rigs.rap.flow.run_windows import RunNumbers
from pipeline.rigs.rap.flow.sets import called
from pipeline.rigs.rap.flow.trap import access_resistance, unclamped

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, Any]]
_SHOWN = (*ESTIMATORS, "E2 quadratic", "affine")
_COLUMNS = (
    "run", "role", "group", "tube", "clamp", "time", "flow_set", "uf", "f", "f_error", "A_1", "A_1_error", "back_pressure", "access", "prefilter", "back",
    "metered", "metered_error", "flow", "own",
)  # fmt: skip
# Points of a drawn window.
_FINE = 600


def arrays_of(found: Campaign) -> dict[str, pd.DataFrame]:
    """Return all tables by name; one without rows keeps its columns."""
    measured, fitted = _example(found)
    return {
        "windows": _windows(found),
        "points": _table(
            ("run", "set", "group", "tube", "clamp", "flow_set", "uf", "count", "flow", "flow_sd", "frequency", "amplitude", "back_pressure", "resistance", "open",
             *(f"{name}{what}" for name in ("E0", "E1", "E2", "E3") for what in ("", "_error"))),
            _points(found),
        ),
        "runs": _table(
            ("run", "set", "group", "tube", "clamp", "windows", "stopped", "unsteady", "jump", "lost", "source", "clock", "lag", "rate", "zero_prefilter",
             "zero_access", "meter_zero", "meter_zeroed"),
            (_run(run, found) for run in found.runs),
        ),
        "errors": _table(("estimator", "set", "tube", "group", "worst", "worst_open", "rms", "mean", "count", "where"), ({**vars(row), "group": row.group} for row in found.errors)),
        "left_out": _table(("estimator", "flow_set", "worst"), _left_out(found)),
        "trap": _table(("law", "inside", "outside", "coefficients"), _trap(found)),
        "covariance": _table(("estimator", "parameter", "value", "with", "covariance"), _covariance(found)),
        "meter": _table(
            ("stated", "used", "response", "response_error", "gain_u", "gain_stated", "uf_u", "zero_u", "tube"),
            [{"stated": found.location.stated, "used": found.location.trusted, "response": found.location.response, "response_error": found.location.error,
              "gain_u": found.gain_u, "gain_stated": found.gain_stated, "uf_u": found.uf_u, "zero_u": found.zero_u, "tube": found.tube}],
        ),
        "example": _table(("run", "flow_set", "time", "measured"), measured),
        "example_fit": _table(("run", "flow_set", "time", "fitted"), fitted),
        "flows": _table(("run", "flow_set", "estimator", "value", "random", "systematic", "metered", "count", "doubt", "why_not"),
                        (vars(row) for row in found.flows)),
    }  # fmt: skip


def _table(columns: tuple[str, ...], rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(list(rows), columns=list(columns))


def _windows(found: Campaign) -> pd.DataFrame:
    import pandas as pd

    table: dict[str, np.ndarray] = {name: getattr(found.windows, name) for name in _COLUMNS}
    for name in _SHOWN:
        law = found.laws.get(name)
        key = name.replace(" ", "_")
        table[key] = law.flow(found.windows) if law is not None else np.full(found.windows.size, np.nan)
        table[f"{key}_error"] = table[key] / found.windows.flow - 1.0
    return pd.DataFrame(table).rename(columns={"role": "set", "f": "frequency", "f_error": "frequency_error", "A_1": "amplitude", "A_1_error": "amplitude_error"})  # fmt: skip


def _points(found: Campaign) -> Rows:
    windows = found.windows
    points = windows.point
    resistance = access_resistance(windows)
    line = unclamped(windows) if windows.size else np.empty(0, dtype=bool)
    rows = []
    for p in np.unique(points):
        at = points == p
        one = windows.of(at)
        row = {
            "run": one.run[0], "set": one.role[0], "group": one.group[0], "tube": one.tube[0], "clamp": one.clamp[0], "flow_set": one.flow_set[0], "uf": one.uf[0], "count": one.size,
            "flow": _mean(one.flow), "flow_sd": _sd(one.flow), "frequency": _mean(one.f), "amplitude": _mean(one.A_1), "back_pressure": _mean(one.back_pressure),
            "resistance": _mean(resistance[at]), "open": bool(line[at].all()),
        }  # fmt: skip
        for name in ESTIMATORS:
            law = found.laws.get(name)
            values = law.flow(one) if law is not None else np.full(one.size, np.nan)
            row[name], row[f"{name}_error"] = _mean(values), _mean(values / one.flow - 1.0)
        rows.append(row)
    return rows


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else math.nan


def _sd(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.std(ddof=1)) if known.size > 1 else math.nan


def _run(run: RunNumbers, found: Campaign) -> dict[str, Any]:
    states = run.passages.state if run.passages is not None else np.empty(0)
    clock = run.clock.clock if run.clock is not None else None
    zeros = {tap: zero.value if zero.known else math.nan for tap, zero in run.zeros.items()}
    used = found.windows.of(found.windows.run == run.run.name)
    name = used.role[0] if used.size else run.run.role
    return {
        "run": run.run.name, "set": name, "group": used.group[0] if used.size else called(name), "tube": run.run.tube, "clamp": run.run.clamp or ("changes" if run.run.clamps else ""),
        "windows": run.windows.size, **{state: int((states == state).sum()) for state in ("stopped", "unsteady", "jump", "lost")}, "source": run.source,
        "clock": run.clock.how if run.clock is not None else "no meter", "lag": clock.lag if clock is not None else math.nan,
        "rate": clock.rate if clock is not None else math.nan, "zero_prefilter": zeros.get("prefilter", math.nan), "zero_access": zeros.get("access", math.nan),
        "meter_zero": run.meter_zero.value if run.meter_zero.known else math.nan, "meter_zeroed": run.meter_zeroed,
    }  # fmt: skip


def _left_out(found: Campaign) -> Rows:
    return [
        {"estimator": name, "flow_set": one.flow_set, "worst": one.worst} for name, rest in found.left_out.items() for one in rest
    ]  # fmt: skip


def _trap(found: Campaign) -> Rows:
    if found.trap is None:
        return []
    return [
        {"law": law, "inside": found.trap.inside[law], "outside": found.trap.outside[law],
         "coefficients": ", ".join(f"{value:.3g}" for value in found.trap.values[law])}
        for law in found.trap.inside
    ]  # fmt: skip


def _covariance(found: Campaign) -> Rows:
    rows = []
    for name in ("E2", "E3"):
        law = found.laws.get(name)
        if law is None or law.covariance is None:
            continue
        rows += [
            {
                "estimator": name,
                "parameter": a,
                "value": law.values[i],
                "with": b,
                "covariance": law.covariance.matrix[i, k],
            }
            for i, a in enumerate(law.law.names)
            for k, b in enumerate(law.law.names)
        ]
    return rows


def _example(found: Campaign) -> tuple[Rows, Rows]:
    """Return the first window of each set-point of the first run, as measured, and as fitted on a fine grid."""
    measured: Rows = []
    fitted: Rows = []
    run = next(
        (r for r in found.runs if r.passages is not None and r.run.pulsating is not None and r.windows.size), None
    )
    if run is None or run.passages is None or run.run.pulsating is None:
        return measured, fitted
    signal, fit = run.run.pulsating[1], run.passages.harmonics
    kept = run.windows.of(np.unique(run.windows.set_point, return_index=True)[1])
    for time, level in zip(kept.time, kept.flow_set, strict=True):
        i = int(np.argmin(np.abs(fit.windows.centre - time)))
        start, end, centre = fit.windows.start[i], fit.windows.end[i], fit.windows.centre[i]
        inside = (signal.time >= start) & (signal.time < end)
        fine = np.linspace(start, end, _FINE) - centre
        turns = np.exp(2j * np.pi * fit.frequency[i] * np.outer(fit.orders, fine))
        course = fit.mean[i] + fit.slope[i] * fine + np.nansum((fit.coefficients[i][:, None] * turns).real, axis=0)
        at = {"run": run.run.name, "flow_set": level}
        measured += [
            {**at, "time": a - start, "measured": b}
            for a, b in zip(signal.time[inside], signal.values[inside], strict=True)
        ]
        fitted += [{**at, "time": a + centre - start, "fitted": b} for a, b in zip(fine, course, strict=True)]
    return measured, fitted
