"""Tables that the report of `mre.hold` is drawn from, SI."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.mre.current_levels import level_name
from pipeline.rigs.mre.hold.analysis import Analysed
from pipeline.rigs.mre.hold.blank import Blank, pole_pull
from pipeline.rigs.mre.hold.field_fit import FieldFit
from pipeline.rigs.mre.hold.law import FIRST_TIME
from pipeline.rigs.mre.hold.record import Record

_CURVE = 200
_SAMPLES = 12_000


def arrays_of(
    analysed: Sequence[Analysed], fields: Mapping[str, FieldFit], blank: Blank | None, records: Mapping[str, Record]
) -> dict[str, pd.DataFrame]:
    """Return the tables by name; those without a row are left out."""
    tables = {
        "holds": pd.concat([_holds(found) for found in analysed]) if analysed else pd.DataFrame(),
        "curves": pd.concat([_curves(found) for found in analysed]) if analysed else pd.DataFrame(),
        "series": pd.concat([_series(found) for found in analysed]) if analysed else pd.DataFrame(),
        "state": pd.DataFrame([_state(found) for found in analysed]),
        "field": pd.concat([_field(field) for field in fields.values()]) if fields else pd.DataFrame(),
        "field_curves": pd.concat([_field_curves(field) for field in fields.values()]) if fields else pd.DataFrame(),
        "pull": _pull(fields, blank, records),
        "flux_levels": _flux_levels(fields),
    }
    return {name: table.reset_index(drop=True) for name, table in tables.items() if len(table)}


def _holds(found: Analysed) -> pd.DataFrame:
    fit, record, used = found.fit, found.record, found.used
    rows = fit.rows
    half = t_quantile(fit.dof) * fit.mean_sd
    F0 = fit.F0 * (1 - fit.r * rows.log)
    return pd.DataFrame(
        {
            "run": found.run,
            "current": rows.current,
            "direction": record.direction[used],
            "time": record.time[used],
            "force": rows.force,
            "low": rows.force - half,
            "high": rows.force + half,
            "model": fit.predicted(rows.current, rows.log) + fit.drifted,
            "residual": found.rest,
            # What is left when relaxation is taken out with the fitted r.
            "increment": (rows.force - fit.drifted) / F0 - 1,
            "increment_half": half / np.abs(F0),
        }
    )


def _curves(found: Analysed) -> pd.DataFrame:
    current = np.linspace(0, float(found.rows.current.max()), _CURVE)
    fit = found.fit
    values = np.array([fit.increment(float(i)) for i in current])
    half = t_quantile(fit.dof) * values[:, 1]
    return pd.DataFrame(
        {
            "run": found.run,
            "current": current,
            "increment": values[:, 0],
            "low": values[:, 0] - half,
            "high": values[:, 0] + half,
        }
    )


def _series(found: Analysed) -> pd.DataFrame:
    """Return the force over time, thinned, and the law at the holds."""
    time, force = found.record.samples["force_axial"]
    keep = slice(None, None, max(time.size // _SAMPLES, 1))
    t, F = time[keep], force[keep]
    model = np.full(t.size, np.nan)
    for number, hold in enumerate(found.record.holds):
        inside = (t >= hold.start + found.record.settle[number]) & (t < hold.stop)
        log = np.log10(np.maximum(t[inside] + found.record.age, 1e-3) / FIRST_TIME)
        clock = (t[inside] + found.record.age - FIRST_TIME) / max(float(np.ptp(found.record.time)), 1e-9)
        drift = found.fit.values.get("drift", 0.0) * clock
        model[inside] = found.fit.predicted(np.full(log.size, abs(hold.level)), log) + drift
    if found.blank is not None:
        for number, hold in enumerate(found.record.holds):
            inside = (t >= hold.start) & (t < hold.stop)
            taken = found.blank.at(found.record.level[[number]], found.record.direction[[number]])
            F = np.where(inside, F - taken, F)
    return pd.DataFrame({"run": found.run, "time": t, "force": F, "model": model})


def _state(found: Analysed) -> dict[str, object]:
    s = found.saturation
    return {
        "run": found.run,
        "state": s.state,
        "flatness": s.flatness,
        "flatness_high": s.flatness_high,
        "share": s.share,
        "I_s": s.fit.I_s,
        "I_s_low": math.exp(s.I_s.low),
        "I_s_high": math.exp(s.I_s.high),
        "a": s.fit.a,
        "p": s.fit.p,
        "F0": found.fit.F0,
        "r": found.fit.r,
        "top": float(s.fit.rows.current.max()),
        "both_ways": found.record.both_ways,
        "swept": found.record.swept,
        "holds": found.fit.rows.current.size,
        "scatter": found.fit.scatter,
        "blank": found.blank.run if found.blank is not None else "",
        "settle": float(np.median(found.record.settle)),
    }


def _field(field: FieldFit) -> pd.DataFrame:
    half = t_quantile(field.dof) * field.sd
    return pd.DataFrame(
        {
            "run": field.run,
            "current": field.current,
            "direction": field.direction,
            "flux_density": field.flux,
            "low": field.flux - half,
            "high": field.flux + half,
            "residual": field.rest,
        }
    )


def _field_curves(field: FieldFit) -> pd.DataFrame:
    parts = []
    current = np.linspace(min(float(field.current.min()), 0.0), float(field.current.max()), _CURVE)
    for sign in np.unique(field.direction):
        parts.append(
            pd.DataFrame(
                {
                    "run": field.run,
                    "current": current,
                    "direction": sign,
                    "flux_density": field.at(current, bool(sign < 0)),
                }
            )
        )
    return pd.concat(parts)


def _pull(fields: Mapping[str, FieldFit], blank: Blank | None, records: Mapping[str, Record]) -> pd.DataFrame:
    """Return the pull of the poles: the bound from B, and what the blank test measured."""
    parts = []
    for run, field in fields.items():
        diameter = records[run].recording.conditions.get("pad_diameter")
        if isinstance(diameter, float):
            current = np.linspace(0, float(field.current.max()), 60)
            pull = pole_pull(field.at(current, False), math.pi * diameter**2 / 4)
            parts.append(pd.DataFrame({"kind": "bound", "current": current, "pull": pull, "half": np.nan}))
            break
    for way, (current, pull, error) in blank.ways.items() if blank is not None else ():
        kind = "blank, rising" if way > 0 else "blank, falling"
        parts.append(pd.DataFrame({"kind": kind, "current": current, "pull": pull, "half": 2 * error}))
    return pd.concat(parts) if parts else pd.DataFrame()


def _flux_levels(fields: Mapping[str, FieldFit]) -> pd.DataFrame:
    """Return the mean flux density at each level of the current, both directions together."""
    rows = []
    for run, field in fields.items():
        names = np.array([level_name(float(level), 1e-3) for level in field.current])
        for name in np.unique(names):
            rows.append({"run": run, "current": float(name), "flux_density": float(field.flux[names == name].mean())})
    return pd.DataFrame(rows)
