"""The tables beside the findings, SI, thinned where long: what the report draws and others may go on with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.rigs.rap.alarms.results import RATIOS
from pipeline.rigs.rap.therapy.command import command_of
from pipeline.rigs.rap.therapy.levels import REASONS, USABLE
from pipeline.rigs.rap.therapy.outcome.checks import Check
from pipeline.rigs.rap.therapy.outcome.thinning import envelope, picked, spans
from pipeline.rigs.rap.therapy.record import ALARMS, BATTERY, MEMBRANE, PARTS, REDUNDANCY, TEMPERATURE, VOLUME
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers
from pipeline.rigs.rap.therapy.volume_numbers import stops

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, Any]]
# Gated innovations that are drawn one by one, and blind spans that are listed.
_MOST_GATED, _MOST_SPANS = 200, 40
_RATIO_COLUMNS = tuple(f"{name}_{end}" for name in RATIOS for end in ("low", "high"))


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


def _table(columns: Mapping[str, Any]) -> Rows:
    """Return rows from columns of one length and single values."""
    n = max((len(value) for value in columns.values() if isinstance(value, np.ndarray)), default=0)
    return [{k: v[i] if isinstance(v, np.ndarray) else v for k, v in columns.items()} for i in range(n)]


def _parts(run: RunNumbers) -> Rows:
    """Say for each part what the run tells of it."""
    volume, alarms, asked = run.volume, run.alarms, run.record.asked
    told = {
        TEMPERATURE: bool(run.temperatures), VOLUME: volume is not None and volume.course is not None,
        MEMBRANE: run.membrane is not None and run.membrane.initial.determined, BATTERY: run.battery is not None,
        ALARMS: alarms is not None and not alarms.undetermined, REDUNDANCY: alarms is not None and bool(alarms.redundancy),
    }  # fmt: skip
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
        {"lag": _or_nan(lag.value), "lag_sd": _or_nan(lag.std_error), "rate": _or_nan(rate.value), "rate_sd": _or_nan(rate.std_error),
         "end": float(np.asarray(found.clock.lag_at(np.array([end])))[0]), "method": found.method, "sure": found.sure}
    ]  # fmt: skip


def _lags(run: RunNumbers) -> Rows:
    track = run.clock.track if run.clock is not None else None
    if run.clock is None or track is None or not track.time.size:
        return []
    kept = picked(track.time.size)
    time = track.time[kept]
    return _table({"time": time, "lag": track.lag[kept], "sd": track.sd[kept], "used": track.used[kept],
                   "line": np.asarray(run.clock.clock.lag_at(time))})  # fmt: skip


def _temperature(run: RunNumbers) -> Rows:
    rows: Rows = []
    for source, fit in run.temperatures.items():
        rows += _table({"source": source, "time": fit.time, "value": fit.measured, "model": fit.modelled})
    return rows


def _temperature_error(run: RunNumbers) -> Rows:
    error = run.temperature_error
    return _table({"time": error.time, "error": error.error, "share": error.percent / 100.0}) if error else []


def _volume(run: RunNumbers) -> Rows:
    volume = run.volume
    course = volume.course if volume else None
    if volume is None or course is None:
        return []
    kept = picked(course.time.size)
    time = course.time[kept]
    # Before the first echo the smoother fills in what the filter could not know yet.
    known = time >= (course.first_echo if course.first_echo is not None else math.inf)
    nothing = np.full(time.size, math.nan)
    own, scale, lag = run.record.signal("uf_volume_rap"), volume.weighed, volume.lag
    on_scale = time + (lag.value if lag is not None else 0.0)
    set_point = run.record.signal("uf_flow_set")
    asked = nothing
    if set_point is not None and len(course.segments) == 1:
        asked = command_of(set_point, None, stopped=stops(run.record)).volume(course.time)
        asked = (asked - asked[0] + course.smoothed_volume[0])[kept]
    return _table({
        "time": time, "estimate": np.where(known, course.volume[kept], course.smoothed_volume[kept]),
            "sd": np.where(known, course.volume_sd[kept], course.smoothed_sd[kept]), "filled_in": ~known,
        "gain": course.smoothed_gain[kept], "gain_sd": course.smoothed_gain_sd[kept],
        "set": asked,
        "scale": np.interp(on_scale, scale.time[scale.good], scale.volume[scale.good], left=math.nan, right=math.nan) if scale is not None else nothing,
        "device": np.interp(time, own.time, own.values, left=math.nan, right=math.nan) if own is not None else nothing,
    })  # fmt: skip


def _volume_error(run: RunNumbers) -> Rows:
    volume, rows = run.volume, []
    for source, error in (("filter", volume.error), ("device", volume.device_error)) if volume else ():
        if error is not None:
            kept = picked(error.time.size)
            sd = error.sd[kept]
            rows += _table({"source": source, "time": error.time[kept], "error": error.error[kept], "sd": sd})
    return rows


def _blind(run: RunNumbers) -> Rows:
    levels = run.volume.levels if run.volume else None
    if levels is None:
        return []
    found = spans(levels.time, levels.why != USABLE)
    longest = sorted(found, key=lambda span: span[0] - span[1])[:_MOST_SPANS]
    rows = []
    for start, end in sorted(longest):
        inside = (levels.time >= start) & (levels.time <= end)
        why = int(np.bincount(levels.why[inside]).argmax())
        rows.append({"start": start, "end": end, "why": REASONS[why]})
    return rows


def _innovations(run: RunNumbers) -> Rows:
    course = run.volume.course if run.volume else None
    if course is None:
        return []
    used = np.where(course.gated, math.nan, course.innovation)
    time, low, high = envelope(course.time, used)
    _, _, sd = envelope(course.time, course.innovation_sd)
    rows = _table({"kind": "used", "time": time, "low": low, "high": high, "sd": sd})
    gated = np.flatnonzero(course.gated & np.isfinite(course.innovation))
    gated = gated[picked(gated.size, _MOST_GATED)]
    at = course.innovation[gated]
    return rows + _table({"kind": "passed over", "time": course.time[gated], "low": at, "high": at, "sd": course.innovation_sd[gated]})  # fmt: skip


def _account(run: RunNumbers) -> Rows:
    volume = run.volume
    if volume is None or volume.course is None:
        return []
    error, regulation = volume.error, volume.regulation
    ratio = error.rate_ratio.value if error else None
    return [{
        "removed": volume.course.total, "removed_sd": volume.course.total_sd,
        "final_error": _or_nan(error.final.value) if error else math.nan, "final_share": volume.final_share,
        "rate_ratio": _or_nan(ratio), "closed_loop": regulation.error_share if regulation else math.nan,
        "open_loop": regulation.open_loop_share if regulation else math.nan, "nis": volume.course.consistency.mean_nis,
    }]  # fmt: skip


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
    return _table({name: values[kept] for name, values in columns.items()})


def _battery(run: RunNumbers) -> Rows:
    found = run.battery
    if found is None or not len(found.time):
        return []
    kept = picked(found.time.size, 400)
    return _table({"time": found.time[kept], "power": found.power[kept], "energy": found.used_over_time[kept]})


def _states(run: RunNumbers) -> Rows:
    alarms = run.alarms
    if alarms is None:
        return []
    rows = [
        {"source": "re-derived", "state": s.state, "start": s.start, "end": s.end, "reason": s.reason}
        for s in alarms.states
    ]
    logged = alarms.log.states
    last = max((s.end for s in alarms.states), default=logged[-1].time if logged else 0.0)
    ends = [row.time for row in logged[1:]] + [max(last, logged[-1].time)] if logged else []
    rows += [
        {"source": "logged", "state": row.text.upper(), "start": row.time, "end": end, "reason": ""}
        for row, end in zip(logged, ends, strict=True)
    ]
    return rows


def _alarms(run: RunNumbers) -> Rows:
    alarms = run.alarms
    if alarms is None:
        return []
    logged = {(row.code, row.derived): row for row in alarms.comparison.rows if row.derived is not None}
    rows = []
    for one in alarms.alarms:
        row = logged.get((one.code, one.time))
        rows.append({
            "alarm": one.code, "index": one.index, "began": one.began, "time": one.time, "ended": _or_nan(one.ended),
            "logged": _or_nan(row.logged if row else None), "delay": _or_nan(row.delay if row else None),
            "verdict": row.verdict if row else "not logged", "cause": one.cause, "removed": _or_nan(one.fluid_removed),
            "uf_stopped": one.uf_stopped,
        })  # fmt: skip
    rows += [
        {"alarm": row.code, "index": 0, "began": math.nan, "time": math.nan, "ended": math.nan, "logged": _or_nan(row.logged),
         "delay": math.nan, "verdict": row.verdict, "cause": "", "removed": math.nan, "uf_stopped": False}
        for row in alarms.comparison.rows if row.derived is None
    ]  # fmt: skip
    return rows


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _ratios(run: RunNumbers) -> Rows:
    ratios = run.alarms.ratios if run.alarms else None
    if ratios is None:
        return []
    columns: dict[str, Any] = {}
    for name in RATIOS:
        if name in ratios.values:
            columns["time"], columns[f"{name}_low"], columns[f"{name}_high"] = envelope(
                ratios.time, ratios.values[name]
            )
    return _table(columns)


def _baselines(run: RunNumbers) -> Rows:
    ratios = run.alarms.ratios if run.alarms else None
    if ratios is None:
        return []
    return [
        {"ratio": name, "baseline": _or_nan(ratios.baseline.get(name)), "noise": _or_nan(ratios.noise.get(name))}
        for name in RATIOS
        if name in ratios.values
    ]


def _redundancy(run: RunNumbers) -> Rows:
    rows: Rows = []
    for tap in run.alarms.redundancy if run.alarms else ():
        time, low, high = envelope(tap.time, tap.residual)
        _, _, up = envelope(tap.time, tap.cusum_up)
        _, _, down = envelope(tap.time, tap.cusum_down)
        rows += _table({"channel": tap.tap, "time": time, "low": low, "high": high, "up": up, "down": down})
    return rows


def _units(run: RunNumbers) -> Rows:
    return [
        {"channel": tap.tap, "skew": tap.skew, "skew_sd": tap.skew_error, "noise": tap.noise, "mismatches": len(tap.mismatches),
         "raw": tap.false_raw.count, "raw_per_hour": tap.false_raw.per_hour, "kept": tap.false_kept.count,
         "kept_upper": tap.false_kept.upper95, "hours": tap.false_kept.hours}
        for tap in (run.alarms.redundancy if run.alarms else ())
    ]  # fmt: skip


def _mismatches(run: RunNumbers) -> Rows:
    return [
        {"channel": one.tap, "index": one.index, "kind": one.kind, "size": one.size, "onset": one.onset, "time": one.time,
         "delay": one.delay, "by_threshold": _or_nan(one.by_threshold), "by_cusum": _or_nan(one.by_cusum), "end": _or_nan(one.end)}
        for tap in (run.alarms.redundancy if run.alarms else ())
        for one in tap.mismatches
    ]  # fmt: skip


def _rates(run: RunNumbers) -> Rows:
    if run.alarms is None or run.alarms.undetermined:
        return []
    rate = run.alarms.false_alarms
    return [{"count": rate.count, "hours": rate.hours, "upper95": rate.upper95}]


_TABLES: Mapping[str, tuple[tuple[str, ...], Callable[[RunNumbers], Rows]]] = {
    "parts": (("part", "asked", "told", "reason"), _parts),
    "checks": (("criterion", "found", "allowed", "word", "mood"), lambda _run: []),
    "set_points": (("blood_flow_set", "uf_flow_set", "heparin_flow_set"), _set_points),
    "clocks": (("lag", "lag_sd", "rate", "rate_sd", "end", "method", "sure"), _clocks),
    "lags": (("time", "lag", "sd", "used", "line"), _lags),
    "temperature": (("source", "time", "value", "model"), _temperature),
    "temperature_error": (("time", "error", "share"), _temperature_error),
    "volume": (("time", "set", "estimate", "sd", "filled_in", "scale", "device", "gain", "gain_sd"), _volume),
    "volume_error": (("source", "time", "error", "sd"), _volume_error),
    "account": (("removed", "removed_sd", "final_error", "final_share", "rate_ratio", "closed_loop", "open_loop", "nis"), _account),
    "blind": (("start", "end", "why"), _blind),
    "innovations": (("kind", "time", "low", "high", "sd"), _innovations),
    "membrane": (("time", "tmp", "air", "k", "k_sd", "fitted", "low", "high", "used"), _membrane),
    "decline": (("naive_sd", "p", "blocks"), _decline),
    "explanations": (("text",), _explanations),
    "battery": (("time", "power", "energy"), _battery),
    "states": (("source", "state", "start", "end", "reason"), _states),
    "alarms": (("alarm", "index", "began", "time", "ended", "logged", "delay", "verdict", "cause", "removed", "uf_stopped"), _alarms),
    "alarm_rates": (("count", "hours", "upper95"), _rates),
    "ratios": (("time", *_RATIO_COLUMNS), _ratios),
    "baselines": (("ratio", "baseline", "noise"), _baselines),
    "redundancy": (("channel", "time", "low", "high", "up", "down"), _redundancy),
    "units": (("channel", "skew", "skew_sd", "noise", "mismatches", "raw", "raw_per_hour", "kept", "kept_upper", "hours"), _units),
    "mismatches": (("channel", "index", "kind", "size", "onset", "time", "delay", "by_threshold", "by_cusum", "end"), _mismatches),
}  # fmt: skip
