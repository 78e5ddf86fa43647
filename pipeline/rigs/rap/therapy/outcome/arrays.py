"""The tables beside the findings, SI, thinned where long: what the report draws and others may go on with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.rigs.rap.therapy.outcome import arrays_alarms, arrays_volume
from pipeline.rigs.rap.therapy.outcome.checks import Check
from pipeline.rigs.rap.therapy.outcome.rows import Rows, or_nan, table
from pipeline.rigs.rap.therapy.outcome.thinning import picked
from pipeline.rigs.rap.therapy.record import ALARMS, BATTERY, MEMBRANE, PARTS, REDUNDANCY, TEMPERATURE, VOLUME
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers

if TYPE_CHECKING:
    import pandas as pd


class Tables:
    """Rows of all tables, gathered run by run; the samples behind them need not be kept."""

    def __init__(self) -> None:
        self._rows: dict[str, Rows] = {name: [] for name in _TABLES}

    def add(self, run: RunNumbers, checks: Sequence[Check]) -> None:
        """Take what the tables show of a run."""
        for name, (_, rows) in _TABLES.items():
            self._rows[name] += [{"run": run.run, **row} for row in rows(run)]
        self._rows["checks"] += [
            {"run": one.run, "criterion": one.criterion, "found": one.found, "allowed": one.allowed, "word": one.word, "mood": one.mood}
            for one in checks
        ]  # fmt: skip

    def frames(self) -> dict[str, pd.DataFrame]:
        """Return the tables by name; one without rows keeps its columns."""
        import pandas as pd

        return {
            name: pd.DataFrame(self._rows[name], columns=["run", *columns]) for name, (columns, _) in _TABLES.items()
        }


def _parts(run: RunNumbers) -> Rows:
    """Say for each part what the run tells of it."""
    volume, asked, told = run.volume, run.record.asked, run.tells
    reasons = {
        TEMPERATURE: run.reasons.get("temperature error", ""),
        VOLUME: next((r for r in volume.reasons.values()), "") if volume else "",
        MEMBRANE: run.reasons.get(MEMBRANE, "") or (run.membrane.initial.reason if run.membrane else ""),
        BATTERY: run.reasons.get(BATTERY, ""), ALARMS: run.reasons.get(ALARMS, ""), REDUNDANCY: run.reasons.get(ALARMS, ""),
    }  # fmt: skip
    return [
        {"part": part, "asked": part in asked, "told": part in asked and told[part], "reason": reasons[part] if part in asked else ""}
        for part in PARTS
    ]  # fmt: skip


def _set_points(run: RunNumbers) -> Rows:
    return [dict(run.set_points)]


def _clocks(run: RunNumbers) -> Rows:
    found = run.clock
    if found is None:
        return []
    track = found.track
    end = float(track.time[-1]) if track is not None and track.time.size else found.clock.reference
    lag, rate = found.lag, found.rate
    return [
        {"lag": or_nan(lag.value), "lag_sd": or_nan(lag.std_error), "rate": or_nan(rate.value), "rate_sd": or_nan(rate.std_error),
         "end": float(np.asarray(found.clock.lag_at(np.array([end])))[0]), "method": found.method, "sure": found.sure}
    ]  # fmt: skip


def _lags(run: RunNumbers) -> Rows:
    track = run.clock.track if run.clock is not None else None
    if run.clock is None or track is None or not track.time.size:
        return []
    kept = picked(track.time.size)
    time = track.time[kept]
    return table({"time": time, "lag": track.lag[kept], "sd": track.sd[kept], "used": track.used[kept],
                   "line": np.asarray(run.clock.clock.lag_at(time))})  # fmt: skip


def _temperature(run: RunNumbers) -> Rows:
    rows: Rows = []
    for source, fit in run.temperatures.items():
        rows += table({"source": source, "time": fit.time, "value": fit.measured, "model": fit.modelled})
    return rows


def _temperature_error(run: RunNumbers) -> Rows:
    error = run.temperature_error
    return table({"time": error.time, "error": error.error, "share": error.percent / 100.0}) if error else []


def _decline(run: RunNumbers) -> Rows:
    found = run.membrane
    return [{"naive_sd": found.naive_sd, "p": found.p_no_decline, "blocks": found.n_blocks}] if found else []


def _explanations(run: RunNumbers) -> Rows:
    return [{"text": text} for text in run.membrane.explanations] if run.membrane else []


def _membrane(run: RunNumbers) -> Rows:
    found, tmp = run.membrane, run.transmembrane
    if tmp is None:
        return []
    time, pressure = tmp.time, tmp.tmp
    bench = run.record.signal("temperature_air_bench") or run.record.signal("temperature_air_rap")
    air = np.interp(time, bench.time, bench.values) if bench is not None else np.full(time.size, math.nan)

    def on_grid(values: np.ndarray | None) -> np.ndarray:
        if found is None or values is None or np.size(values) != found.time.size or not found.time.size:
            return np.full(time.size, math.nan)
        at = np.clip(np.searchsorted(found.time, time), 0, found.time.size - 1)
        near = np.abs(found.time[at] - time) < 31.0
        return np.where(near, np.asarray(values, dtype=float)[at], math.nan)

    columns = {
        "time": time, "tmp": pressure, "air": air, "k": on_grid(found.k if found else None),
        "k_sd": on_grid(found.k_sd if found else None), "fitted": on_grid(found.fitted if found else None),
        "low": on_grid(found.band[:, 0] if found else None), "high": on_grid(found.band[:, 1] if found else None),
        "used": on_grid(found.used if found else None),
    }  # fmt: skip
    kept = picked(time.size)
    return table({name: values[kept] for name, values in columns.items()})


def _battery(run: RunNumbers) -> Rows:
    found = run.battery
    if found is None or not len(found.time):
        return []
    kept = picked(found.time.size, 400)
    return table({"time": found.time[kept], "power": found.power[kept], "energy": found.used_over_time[kept]})


_TABLES: Mapping[str, tuple[tuple[str, ...], Callable[[RunNumbers], Rows]]] = {
    "parts": (("part", "asked", "told", "reason"), _parts),
    "checks": (("criterion", "found", "allowed", "word", "mood"), lambda _run: []),
    "set_points": (("blood_flow_set", "uf_flow_set", "heparin_flow_set"), _set_points),
    "clocks": (("lag", "lag_sd", "rate", "rate_sd", "end", "method", "sure"), _clocks),
    "lags": (("time", "lag", "sd", "used", "line"), _lags),
    "temperature": (("source", "time", "value", "model"), _temperature),
    "temperature_error": (("time", "error", "share"), _temperature_error),
    "volume": (("time", "set", "estimate", "sd", "filled_in", "scale", "device", "gain", "gain_sd"), arrays_volume.volume),
    "volume_error": (("source", "time", "error", "sd"), arrays_volume.volume_error),
    "account": (("removed", "removed_sd", "final_error", "final_share", "rate_ratio", "closed_loop", "open_loop", "nis"), arrays_volume.account_of),
    "blind": (("start", "end", "why"), arrays_volume.blind),
    "innovations": (("kind", "time", "low", "high", "sd"), arrays_volume.innovations),
    "membrane": (("time", "tmp", "air", "k", "k_sd", "fitted", "low", "high", "used"), _membrane),
    "decline": (("naive_sd", "p", "blocks"), _decline),
    "explanations": (("text",), _explanations),
    "battery": (("time", "power", "energy"), _battery),
    "states": (("source", "state", "start", "end", "reason"), arrays_alarms.states),
    "alarms": (("alarm", "index", "began", "time", "ended", "logged", "delay", "verdict", "cause", "removed", "uf_stopped"), arrays_alarms.alarms_of),
    "alarm_rates": (("count", "hours", "upper95"), arrays_alarms.rates),
    "ratios": (("time", *arrays_alarms.RATIO_COLUMNS), arrays_alarms.ratios_of),
    "baselines": (("ratio", "baseline", "noise"), arrays_alarms.baselines),
    "redundancy": (("channel", "time", "low", "high", "up", "down"), arrays_alarms.redundancy),
    "units": (("channel", "skew", "skew_sd", "noise", "mismatches", "raw", "raw_per_hour", "kept", "kept_upper", "hours"), arrays_alarms.units),
    "mismatches": (("channel", "index", "kind", "size", "onset", "time", "delay", "by_threshold", "by_cusum", "end"), arrays_alarms.mismatches),
}  # fmt: skip
