"""Tables of the alarms: states, alarms beside logged codes, ratios that raise them, the two units' difference."""

from __future__ import annotations

import math
from typing import Any

from pipeline.rigs.rap.alarms.results import RATIOS
from pipeline.rigs.rap.therapy.outcome.rows import Rows, or_nan, table
from pipeline.rigs.rap.therapy.outcome.thinning import envelope
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers

RATIO_COLUMNS = tuple(f"{name}_{end}" for name in RATIOS for end in ("low", "high"))


def states(run: RunNumbers) -> Rows:
    """Return spans of states, re-derived and logged."""
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


def alarms_of(run: RunNumbers) -> Rows:
    """Return each alarm with the logged code that belongs to it."""
    alarms = run.alarms
    if alarms is None:
        return []
    logged = {(row.code, row.derived): row for row in alarms.comparison.rows if row.derived is not None}
    rows = []
    for one in alarms.alarms:
        row = logged.get((one.code, one.time))
        rows.append({
            "alarm": one.code, "index": one.index, "began": one.began, "time": one.time, "ended": or_nan(one.ended),
            "logged": or_nan(row.logged if row else None), "delay": or_nan(row.delay if row else None),
            "verdict": row.verdict if row else "not logged", "cause": one.cause, "removed": or_nan(one.fluid_removed),
            "uf_stopped": one.uf_stopped,
        })  # fmt: skip
    rows += [
        {"alarm": row.code, "index": 0, "began": math.nan, "time": math.nan, "ended": math.nan, "logged": or_nan(row.logged),
         "delay": math.nan, "verdict": row.verdict, "cause": "", "removed": math.nan, "uf_stopped": False}
        for row in alarms.comparison.rows if row.derived is None
    ]  # fmt: skip
    return rows


def ratios_of(run: RunNumbers) -> Rows:
    """Return resistances over their baselines as envelopes."""
    ratios = run.alarms.ratios if run.alarms else None
    if ratios is None:
        return []
    columns: dict[str, Any] = {}
    for name in RATIOS:
        if name in ratios.values:
            columns["time"], columns[f"{name}_low"], columns[f"{name}_high"] = envelope(
                ratios.time, ratios.values[name]
            )
    return table(columns)


def baselines(run: RunNumbers) -> Rows:
    """Return the baselines."""
    ratios = run.alarms.ratios if run.alarms else None
    if ratios is None:
        return []
    return [
        {"ratio": name, "baseline": or_nan(ratios.baseline.get(name)), "noise": or_nan(ratios.noise.get(name))}
        for name in RATIOS
        if name in ratios.values
    ]


def redundancy(run: RunNumbers) -> Rows:
    """Return the two units' difference and its cumulative sums."""
    rows: Rows = []
    for tap in run.alarms.redundancy if run.alarms else ():
        time, low, high = envelope(tap.time, tap.residual)
        _, _, up = envelope(tap.time, tap.cusum_up)
        _, _, down = envelope(tap.time, tap.cusum_down)
        rows += table({"channel": tap.tap, "time": time, "low": low, "high": high, "up": up, "down": down})
    return rows


def units(run: RunNumbers) -> Rows:
    """Return skew, noise and false alarms by tap."""
    return [
        {"channel": tap.tap, "skew": tap.skew, "skew_sd": tap.skew_error, "noise": tap.noise, "mismatches": len(tap.mismatches),
         "raw": tap.false_raw.count, "raw_per_hour": tap.false_raw.per_hour, "kept": tap.false_kept.count,
         "kept_upper": tap.false_kept.upper95, "hours": tap.false_kept.hours}
        for tap in (run.alarms.redundancy if run.alarms else ())
    ]  # fmt: skip


def mismatches(run: RunNumbers) -> Rows:
    """Return the mismatches of the two units."""
    return [
        {"channel": one.tap, "index": one.index, "kind": one.kind, "size": one.size, "onset": one.onset, "time": one.time,
         "delay": one.delay, "by_threshold": or_nan(one.by_threshold), "by_cusum": or_nan(one.by_cusum), "end": or_nan(one.end)}
        for tap in (run.alarms.redundancy if run.alarms else ())
        for one in tap.mismatches
    ]  # fmt: skip


def rates(run: RunNumbers) -> Rows:
    """Return how often an alarm was due that was not logged."""
    if run.alarms is None or run.alarms.undetermined:
        return []
    rate = run.alarms.false_alarms
    return [{"count": rate.count, "hours": rate.hours, "upper95": rate.upper95}]
