"""Tables of the circuit: steps with their means, lines of the resistances, harmonic ratio of the filter, transmembrane pressure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.rigs.rap.circuit.hydraulics import filter_transfer
from pipeline.rigs.rap.pressures.level_means import LevelMeans
from pipeline.rigs.rap.pressures.readings import CircuitNumbers
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers
from pipeline.rigs.rap.pressures.tables_of import Rows, joined, table
from pipeline.rigs.rap.tables import Signal

if TYPE_CHECKING:
    import pandas as pd

_SOURCES = {"bench": "the bench's pressures", "rap": "the device's pressures"}
_CURVE = 120
# Ultrafiltration below it is off, m^3/s.
_OFF = 1e-9


def circuit_tables(runs: Sequence[RunNumbers]) -> dict[str, pd.DataFrame]:
    """Return the tables by name."""
    known = [(run, run.circuit) for run in runs if isinstance(run.circuit, CircuitNumbers)]
    return {
        "levels": table(
            ("run", "source", "start", "end", "turning", "flow_set", "flow", "uf_set", "heparin_set", "frequency", "access", "prefilter", "return", "uf", "tmp"),
            [row for run, circuit in known for row in _levels(run, circuit)],
        ),
        "resistance": table(("run", "name", "x", "y", "sd", "zeroed"), [row for run, circuit in known for row in _lines(run, circuit)]),
        "filter_ratio": joined(("run", "harmonic", "frequency", "size", "phase", "sd", "used"), [_ratios(run, circuit) for run, circuit in known]),
        "filter_curve": joined(("run", "frequency", "size", "phase"), [_curve(run, circuit) for run, circuit in known]),
        "tmp": joined(("run", "time", "tmp", "uf_set"), [_tmp(run, circuit) for run, circuit in known]),
        "membrane": table(("run", "time", "k_uf", "sd"), [row for run, circuit in known for row in _membrane(run, circuit)]),
        "uf_steps": joined(("run", "step", "time", "measured", "modelled"), [part for run, circuit in known for part in _steps(run, circuit)]),
        "unobservable": table(
            ("run", "name", "reason"),
            [{"run": run.name, "name": name, "reason": reason} for run, circuit in known for name, reason in circuit.found.unobservable.items()],
        ),
    }  # fmt: skip


def _mean(values: np.ndarray) -> tuple[float, float]:
    """Return mean and its standard error of windows, NaN left out; NaN where there is none."""
    known = values[np.isfinite(values)]
    if not known.size:
        return math.nan, math.nan
    return float(known.mean()), float(known.std(ddof=1) / math.sqrt(known.size)) if known.size > 1 else math.nan


def _zeroed(circuit: CircuitNumbers) -> dict[str, np.ndarray]:
    found = circuit.found
    return {tap: found.means.mean[tap] - found.zero.get(tap, 0.0) for tap in circuit.taps}


def _tmp_of(p: dict[str, np.ndarray], means: LevelMeans) -> np.ndarray:
    if {"prefilter", "return", "uf"} <= set(p):
        return np.asarray(0.5 * (p["prefilter"] + p["return"]) - p["uf"])
    return np.full(means.level.size, np.nan)


def _levels(run: RunNumbers, circuit: CircuitNumbers) -> Rows:
    found, means = circuit.found, circuit.found.means
    p = _zeroed(circuit)
    tmp = _tmp_of(p, means)
    heparin = run.record.heparin
    rows: Rows = []
    for number, level in enumerate(circuit.levels):
        inside = means.level == number
        if not inside.any():
            continue
        rows.append({
            "run": run.name, "source": _SOURCES[circuit.reader], "start": level.start, "end": level.end, "turning": level.turning,
            "flow_set": math.nan if level.flow_set is None else level.flow_set, "flow": _mean(found.flow[inside])[0],
            "uf_set": math.nan if level.uf_set is None else level.uf_set,
            "heparin_set": float(np.median(heparin.values)) if heparin is not None else math.nan,
            "frequency": _mean(means.frequency[inside])[0], "tmp": _mean(tmp[inside])[0],
            **{tap: _mean(p[tap][inside])[0] if tap in p else math.nan for tap in ("access", "prefilter", "return", "uf")},
        })  # fmt: skip
    return rows


def _lines(run: RunNumbers, circuit: CircuitNumbers) -> Rows:
    """Return by level what each proportion is drawn through: x, y and the standard error of y."""
    found, means = circuit.found, circuit.found.means
    p = _zeroed(circuit)
    flow, uf = found.flow, np.where(np.isfinite(found.uf_flow), found.uf_flow, 0.0)
    tmp = _tmp_of(p, means)
    off = tmp[means.turning & (uf <= _OFF)]
    resting = float(np.nanmean(off)) if np.isfinite(off).any() else 0.0
    missing = np.full(flow.size, np.nan)
    pairs = {
        "r_access": (flow, -p.get("access", missing)),
        "r_filter": (flow - 0.5 * uf, p.get("prefilter", missing) - p.get("return", missing)),
        "r_return": (flow - uf, p.get("return", missing)),
        "k_uf": (tmp - resting, np.where(uf > _OFF, uf, np.nan)),
    }
    rows: Rows = []
    for name, (x, y) in pairs.items():
        for number in np.unique(means.level[means.turning]):
            inside = (means.level == number) & np.isfinite(x) & np.isfinite(y)
            if inside.any():
                value, sd = _mean(y[inside])
                if name == "k_uf":
                    # The set rate is exact: what scatters is the pressure.
                    sd = value * _mean(x[inside])[1] / _mean(x[inside])[0]
                rows.append(
                    {
                        "run": run.name,
                        "name": name,
                        "x": _mean(x[inside])[0],
                        "y": value,
                        "sd": sd,
                        "zeroed": bool(found.zero),
                    }
                )
    return rows


def _ratios(run: RunNumbers, circuit: CircuitNumbers) -> dict[str, Any]:
    line = circuit.found.return_line
    if line is None:
        return {}
    one = line.ratios
    return {
        "run": run.name, "harmonic": one.order, "frequency": one.frequency, "size": np.abs(one.ratio), "phase": np.angle(one.ratio), "sd": one.sd,
        "used": one.used,
    }  # fmt: skip


def _curve(run: RunNumbers, circuit: CircuitNumbers) -> dict[str, Any]:
    line, whole = circuit.found.return_line, circuit.found.circuit
    if line is None or whole is None:
        return {}
    frequency = np.linspace(0.8 * line.ratios.frequency.min(), 1.05 * line.ratios.frequency.max(), _CURVE)
    ratio = filter_transfer(whole, 2j * np.pi * frequency)
    return {"run": run.name, "frequency": frequency, "size": np.abs(ratio), "phase": np.angle(ratio)}


def _tmp(run: RunNumbers, circuit: CircuitNumbers) -> dict[str, Any]:
    """Return the transmembrane pressure in means of 1 s."""
    taps = circuit.taps
    if not {"prefilter", "return", "uf"} <= set(taps):
        return {}
    edges = np.arange(taps["uf"].time[0], taps["uf"].time[-1])
    p = {
        tap: _second_means(taps[tap], edges) - circuit.found.zero.get(tap, 0.0) for tap in ("prefilter", "return", "uf")
    }
    return {
        "run": run.name,
        "time": edges[:-1] + 0.5,
        "tmp": 0.5 * (p["prefilter"] + p["return"]) - p["uf"],
        "uf_set": np.nan,
    }


def _second_means(one: Signal, edges: np.ndarray) -> np.ndarray:
    places = np.searchsorted(one.time, edges)
    sums = np.concatenate([[0.0], np.cumsum(one.values)])
    count = np.diff(places)
    return np.where(count > 0, (sums[places[1:]] - sums[places[:-1]]) / np.maximum(count, 1), np.nan)


def _membrane(run: RunNumbers, circuit: CircuitNumbers) -> Rows:
    """Return the ultrafiltration coefficient by window with ultrafiltration on."""
    means, uf = circuit.found.means, circuit.found.uf_flow
    p = _zeroed(circuit)
    tmp = _tmp_of(p, means)
    off = tmp[means.turning & (uf <= _OFF)]
    resting = float(np.nanmean(off)) if np.isfinite(off).any() else 0.0
    rows: Rows = []
    for number in np.unique(means.level):
        inside = (means.level == number) & means.turning & (uf > _OFF) & np.isfinite(tmp)
        if inside.any():
            pressure, sd = _mean(tmp[inside] - resting)
            rate = float(uf[inside].mean())
            rows.append(
                {
                    "run": run.name,
                    "time": float(means.windows.centre[inside].mean()),
                    "k_uf": rate / pressure,
                    "sd": rate / pressure**2 * sd,
                }
            )
    return rows


def _steps(run: RunNumbers, circuit: CircuitNumbers) -> list[dict[str, Any]]:
    steps = circuit.found.uf
    if steps is None:
        return []
    return [
        {
            "run": run.name,
            "step": number,
            "time": step.time - step.time[0],
            "measured": step.measured,
            "modelled": step.modelled,
        }
        for number, step in enumerate(steps.steps)
    ]
