"""Tables of the ultrafiltrate: volume, its error, the filter's innovations, stretches without a level."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.rap.therapy.command import command_of
from pipeline.rigs.rap.therapy.levels import REASONS, USABLE
from pipeline.rigs.rap.therapy.outcome.rows import Rows, or_nan, table
from pipeline.rigs.rap.therapy.outcome.thinning import envelope, picked, spans
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers
from pipeline.rigs.rap.therapy.volume_numbers import stops

# Gated innovations that are drawn one by one, and blind spans that are listed.
_MOST_GATED, _MOST_SPANS = 200, 40


def volume(run: RunNumbers) -> Rows:
    """Return estimated, set, weighed volume and the pump's gain over time."""
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
    return table({
        "time": time, "estimate": np.where(known, course.volume[kept], course.smoothed_volume[kept]),
            "sd": np.where(known, course.volume_sd[kept], course.smoothed_sd[kept]), "filled_in": ~known,
        "gain": course.smoothed_gain[kept], "gain_sd": course.smoothed_gain_sd[kept],
        "set": asked,
        "scale": np.interp(on_scale, scale.time[scale.good], scale.volume[scale.good], left=math.nan, right=math.nan) if scale is not None else nothing,
        "device": np.interp(time, own.time, own.values, left=math.nan, right=math.nan) if own is not None else nothing,
    })  # fmt: skip


def volume_error(run: RunNumbers) -> Rows:
    """Return estimate less scale over time, of the filter and of the device."""
    volume, rows = run.volume, []
    for source, error in (("filter", volume.error), ("device", volume.device_error)) if volume else ():
        if error is not None:
            kept = picked(error.time.size)
            sd = error.sd[kept]
            rows += table({"source": source, "time": error.time[kept], "error": error.error[kept], "sd": sd})
    return rows


def blind(run: RunNumbers) -> Rows:
    """Return the longest stretches without a usable level."""
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


def innovations(run: RunNumbers) -> Rows:
    """Return the filter's innovations, as envelope, and those that were passed over."""
    course = run.volume.course if run.volume else None
    if course is None:
        return []
    used = np.where(course.gated, math.nan, course.innovation)
    time, low, high = envelope(course.time, used)
    _, _, sd = envelope(course.time, course.innovation_sd)
    rows = table({"kind": "used", "time": time, "low": low, "high": high, "sd": sd})
    gated = np.flatnonzero(course.gated & np.isfinite(course.innovation))
    gated = gated[picked(gated.size, _MOST_GATED)]
    at = course.innovation[gated]
    return rows + table({"kind": "passed over", "time": course.time[gated], "low": at, "high": at, "sd": course.innovation_sd[gated]})  # fmt: skip


def account_of(run: RunNumbers) -> Rows:
    """Return the account of the run's ultrafiltrate."""
    volume = run.volume
    if volume is None or volume.course is None:
        return []
    error, regulation = volume.error, volume.regulation
    ratio = error.rate_ratio.value if error else None
    return [{
        "removed": volume.course.total, "removed_sd": volume.course.total_sd,
        "final_error": or_nan(error.final.value) if error else math.nan, "final_share": volume.final_share,
        "rate_ratio": or_nan(ratio), "closed_loop": regulation.error_share if regulation else math.nan,
        "open_loop": regulation.open_loop_share if regulation else math.nan, "nis": volume.course.consistency.mean_nis,
    }]  # fmt: skip
