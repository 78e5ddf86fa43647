"""The tables beside the findings, SI: what the report draws and others may go on with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.many.stand_for_all import odd_of, typical_of
from pipeline.rigs.gearbox.model.kinematics import member_speeds, mesh_orders
from pipeline.rigs.gearbox.one_run import Told
from pipeline.rigs.gearbox.outcome.paper import BRAKE, FOS, SOS, STARTUP
from pipeline.rigs.gearbox.outcome.sampled import DRAWN
from pipeline.rigs.gearbox.record import TORQUES
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.torques.nominal import type_b
from pipeline.rigs.gearbox.vibration.sos_speed import teeth_in
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers
from pipeline.rigs.number_over_runs import OverRuns

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, Any]]
_STATES = (
    (STARTUP, "startup", "peak"), (FOS, "fos", "nominal"), (BRAKE, "brake", "peak"), (SOS, "sos", "nominal"),
)  # fmt: skip
_LAWS = {"stribeck": "c0 + c_S exp(-(ω/ω_S)²) + b0 ω", "line": "c0 + b0 ω", "slip": "M_c + M_v s"}


def arrays_of(
    campaign: CampaignNumbers, told: Mapping[str, Told], settings: LoadExchangeSettings
) -> dict[str, pd.DataFrame]:
    """Return all tables by name; one without rows keeps its columns.

    Parameters
    ----------
    told
        Of each run of the campaign; what is drawn stands in those that are (`Told.drawn`).
    """
    import pandas as pd

    runs = campaign.runs
    shown = [run for run in runs if told[run.name].drawn]
    by_run: dict[str, tuple[Sequence[RunNumbers], tuple[str, ...], Callable[[RunNumbers], Rows]]] = {
        "stages": (runs, ("run", "stage", "start", "end"), _stages),
        "events": (runs, ("run", "event", "time", "sd", "disturbance"),
                   lambda run: _events(run, told[run.name].vibration)),
        "levels": (runs, ("run", "quantity", "stage", "value", "sd", "low", "high", "start", "end", "type_b", "turns",
                          "correlation_time"), lambda run: _levels(run, settings)),
        "peaks": (runs, ("run", "quantity", "stage", "value", "sd", "low", "high", "raw", "bias", "time", "saturated",
                         "type_b"), lambda run: _peaks(run, settings)),
        "map": (runs, ("run", "state", "torque_in", "torque_out", "in_sd", "out_sd"), _map),
        "transfers": (runs, ("run", "phase", "slope", "slope_sd", "intercept", "intercept_sd"), _transfers),
        "energy": (runs, ("run", "stage", "duration", "work_in", "work_out", "kinetic"),
                   lambda run: _energy(told[run.name], campaign)),
        "load": (shown, ("run", "time", "measured", "predicted", "residual"), lambda run: _load(run, campaign)),
        "members": (runs, ("run", "member", "fos", "sos", "source"), _members),
        "clocks": (runs, ("run", "board", "shift", "shift_sd", "drift", "drift_sd", "applied"), _clocks),
        "vibration": (runs, ("run", "stage", "channel", "rms", "sd", "crest", "kurtosis"),
                      lambda run: _vibration(told[run.name].vibration)),
    }  # fmt: skip
    found = {
        name: pd.DataFrame([row for run in those for row in rows(run)], columns=list(columns))
        for name, (those, columns, rows) in by_run.items()
    }
    for name, columns in DRAWN.items():
        parts = [told[run.name].drawn[name] for run in shown if name in told[run.name].drawn]
        found[name] = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame([], columns=list(columns))
    found["runs"] = pd.DataFrame(_runs(campaign))
    group = {name: speed for speed, names in campaign.speeds.items() for name in names}
    found["watched"] = pd.DataFrame(
        [row for number in campaign.watched for row in _watched(number, group)],
        columns=["number", "unit", "run", "group", "begins", "value", "error"],
    )
    found["friction"] = pd.DataFrame(_friction(campaign), columns=["kind", "run", "x", "value", "sd"])
    found["curves"] = pd.DataFrame(_curves(campaign), columns=["kind", "law", "x", "y", "low", "high"])
    return found


def _runs(campaign: CampaignNumbers) -> Rows:
    """Return a row a run: its speed and group of equal speeds, what it stands for, in what it is unlike the others."""
    group = {name: speed for speed, names in campaign.speeds.items() for name in names}
    typical, odd = (typical_of(campaign), odd_of(campaign)) if campaign.watched else ([], [])
    return [
        {
            "run": run.name, "speed": run.speed, "complete": run.segmentation.complete, "group": group.get(run.name, math.nan),
            "drawn": "typical" if run.name in typical else "odd" if run.name in odd else "",
            "unlike": campaign.exceptions.get(run.name, ""),
        }
        for run in campaign.runs
    ]  # fmt: skip


def _watched(number: OverRuns, group: Mapping[str, float]) -> Rows:
    return [
        {
            "number": number.what, "unit": number.unit, "run": run, "group": group.get(run, math.nan),
            "begins": number.begins[k] if number.begins is not None else math.nan,
            "value": float(number.values[k]), "error": float(number.std_errors[k]),
        }
        for k, run in enumerate(number.runs)
    ]  # fmt: skip


def _table(columns: Mapping[str, Any]) -> Rows:
    """Return rows from columns of one length and single values."""
    n = max(len(value) for value in columns.values() if isinstance(value, np.ndarray))
    return [{k: v[i] if isinstance(v, np.ndarray) else v for k, v in columns.items()} for i in range(n)]


def _stages(run: RunNumbers) -> Rows:
    return [
        {"run": run.name, "stage": stage.name, "start": stage.start, "end": stage.end}
        for stage in run.segmentation.stages
    ]


def _events(run: RunNumbers, vibration: VibrationNumbers) -> Rows:
    return [
        {
            "run": run.name,
            "event": name,
            "time": event.time,
            "sd": event.sd,
            "disturbance": vibration.disturbance.get(name, math.nan),
        }
        for name, event in run.segmentation.events.items()
    ]


def _type_b(run: RunNumbers, quantity: str, settings: LoadExchangeSettings) -> float:
    reach = run.record.conditions.get(quantity.replace("torque", "torque_range"))
    return type_b(float(reach), settings.torque_accuracy) if isinstance(reach, int | float) else math.nan


def _levels(run: RunNumbers, settings: LoadExchangeSettings) -> Rows:
    known = {name: not math.isnan(run.zero(name)) for name in TORQUES}
    return [
        {
            "run": run.name, "quantity": quantity, "stage": stage, "value": level.value,
            "sd": level.std_error if known[quantity] else math.nan, "low": level.ci95[0], "high": level.ci95[1],
            "start": level.span[0], "end": level.span[1], "type_b": _type_b(run, quantity, settings),
            "turns": level.revolutions, "correlation_time": level.correlation_time,
        }
        for (quantity, stage), level in run.levels.items()
    ]  # fmt: skip


def _peaks(run: RunNumbers, settings: LoadExchangeSettings) -> Rows:
    return [
        {
            "run": run.name, "quantity": quantity, "stage": stage, "value": peak.value,
            "sd": math.nan if peak.saturated or math.isnan(run.zero(quantity)) else peak.std_error,
            "low": peak.ci95[0], "high": peak.ci95[1], "raw": peak.raw, "bias": peak.bias, "time": peak.time,
            "saturated": peak.saturated, "type_b": _type_b(run, quantity, settings),
        }
        for (quantity, stage), peak in run.peaks.items()
    ]  # fmt: skip


def _map(run: RunNumbers) -> Rows:
    rows = []
    for state, stage, kind in _STATES:
        t_in, t_out = (getattr(run, "peak" if kind == "peak" else "level")(name, stage) for name in TORQUES)
        if t_in is not None and t_out is not None:
            rows.append({"run": run.name, "state": state, "torque_in": t_in.value, "torque_out": t_out.value,
                         "in_sd": t_in.std_error, "out_sd": t_out.std_error})  # fmt: skip
    return rows


def _transfers(run: RunNumbers) -> Rows:
    return [
        {"run": run.name, "phase": phase, "slope": one.slope, "slope_sd": one.slope_error, "intercept": one.intercept,
         "intercept_sd": one.intercept_error}
        for phase, one in run.transfers.items()
    ]  # fmt: skip


def _energy(told: Told, campaign: CampaignNumbers) -> Rows:
    inertia = float(campaign.load.values[0]) if campaign.load else math.nan
    rows = []
    for row in told.work:
        kept = {name: value for name, value in row.items() if name != "swing"}
        rows.append({**kept, "kinetic": 0.5 * inertia * row["swing"]})
    return rows


def _load(run: RunNumbers, campaign: CampaignNumbers) -> Rows:
    windows, fit = run.windows, campaign.load
    if windows is None or fit is None:
        return []
    scale = windows.columns[:, 1]
    measured, predicted = windows.torque / scale, windows.columns @ fit.values / scale
    return _table({"run": run.name, "time": windows.time, "measured": measured, "predicted": predicted,
                   "residual": measured - predicted})  # fmt: skip


def _members(run: RunNumbers) -> Rows:
    w, speed = run.speed_out[0], run.speed_in
    if not math.isfinite(w):
        return []
    teeth = teeth_in(run.record)
    w_sos = speed.value if speed else math.nan
    fos, sos = member_speeds(w, w, teeth), member_speeds(w_sos, 0.0, teeth)
    fos, sos = {"carrier_1": w, "carrier_2": w, **fos}, {"carrier_1": w_sos, "carrier_2": 0.0 * w_sos, **sos}
    for place, order in enumerate(mesh_orders(teeth), 1):
        fos[f"mesh_{place}"], sos[f"mesh_{place}"] = 0.0, float(order) * w_sos / (2.0 * math.pi)
    told = speed.told if speed else ""
    return [
        {"run": run.name, "member": name, "fos": float(fos[name]), "sos": float(sos[name]), "source": told}
        for name in fos
    ]


def _clocks(run: RunNumbers) -> Rows:
    boards = (("encoder", run.alignment.encoder), ("vibration", run.alignment.vibration))
    return [
        {"run": run.name, "board": board, "shift": fit.shift, "shift_sd": fit.shift_sd, "drift": fit.drift,
         "drift_sd": fit.drift_sd, "applied": fit.applied}
        for board, fit in boards
        if fit is not None
    ]  # fmt: skip


def _vibration(vibration: VibrationNumbers) -> Rows:
    return [
        {"run": one.run, "stage": one.stage, "channel": one.channel, "rms": one.rms, "sd": one.std_error, "crest": one.crest,
         "kurtosis": one.kurtosis}
        for one in vibration.levels
    ]  # fmt: skip


def _friction(campaign: CampaignNumbers) -> Rows:
    rows: Rows = []
    for run in campaign.runs:
        drag, slip = campaign.drag[run.name], campaign.slip[run.name]
        if drag.value is not None and math.isfinite(run.speed_out[0]):
            rows.append(
                {
                    "kind": "drag_locked",
                    "run": run.name,
                    "x": run.speed_out[0],
                    "value": drag.value,
                    "sd": drag.std_error,
                }
            )
        if slip.value is not None and run.speed_in is not None:
            rows.append(
                {"kind": "slip", "run": run.name, "x": run.speed_in.value, "value": slip.value, "sd": slip.std_error}
            )
        level = run.levels.get(("torque_out", "fos"))
        if level is not None and not math.isnan(run.zero("torque_out")) and math.isfinite(run.speed_out[0]):
            rows.append(
                {"kind": "load", "run": run.name, "x": run.speed_out[0], "value": level.value, "sd": level.std_error}
            )
    return rows


def _curves(campaign: CampaignNumbers) -> Rows:
    rows: Rows = []
    points: Sequence[dict[str, Any]] = _friction(campaign)
    for kind, law in (("drag_locked", campaign.drag_law), ("slip", campaign.slip_law)):
        own = [row["x"] for row in points if row["kind"] == kind]
        if law is None or len(own) < 2:
            continue
        x = np.linspace(0.9 * min(own), 1.05 * max(own), 60)
        y, half = law.at(x), 1.96 * law.error(x)
        rows += _table({"kind": kind, "law": _LAWS[law.law], "x": x, "y": y, "low": y - half, "high": y + half})
    own = [row["x"] for row in points if row["kind"] == "load"]
    if campaign.load is not None and own:
        x = np.linspace(0.0, 1.05 * max(own), 60)
        A = np.stack([np.ones_like(x), x], axis=1)
        y = A @ campaign.load.values[1:]
        variance = np.einsum("ni,ij,nj->n", A, campaign.load.covariance.matrix[1:, 1:], A)
        half = 1.96 * np.sqrt(np.maximum(variance, 0.0))
        rows += _table({"kind": "load", "law": "d0 + d1 ω", "x": x, "y": y, "low": y - half, "high": y + half})
    return rows
