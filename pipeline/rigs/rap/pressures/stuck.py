"""Samples that are none: a channel that is frozen, at its rail, or repeated row by row (rap.md, section 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.record import Record, Source
from pipeline.rigs.rap.pressures.spans import Span, within
from pipeline.rigs.rap.tables import Signal

# A channel that shows no change for that long with the pump on is frozen, s, unless it often rests for a third of it.
_FROZEN, _TIMES = 2.0, 3.0
# More than that share of a channel's samples at its rail is saturation; frozen over more than that share it is no use.
_RAIL, _USELESS = 0.01, 0.3
# A rail is a value that is held by runs of that many samples at least, at an end of the channel's range.
_HELD = 3
# Repeated rows are told from chance by that many of the latter's standard deviations.
_SIGMAS, _FEW = 6.0, 3


@dataclass(frozen=True)
class Lost:
    """What of a run's pressures cannot be used: `spans` (s) by channel, channels that are `useless` altogether."""

    findings: tuple[QualityFinding, ...] = ()
    spans: dict[str, tuple[Span, ...]] = field(default_factory=dict)
    useless: dict[str, str] = field(default_factory=dict)


def lost_samples(record: Record) -> Lost:
    """Look for frozen, saturated and repeated samples of all pressures."""
    findings: list[QualityFinding] = []
    spans: dict[str, tuple[Span, ...]] = {}
    useless: dict[str, str] = {}
    for source in record.sources.values():
        for one in source.taps.values():
            frozen = _frozen(one, source)
            flat = _flat_tops(one) if not frozen else ()
            if not frozen and not flat:
                continue
            finding, whole = _told(record, one, frozen, flat)
            findings.append(finding)
            if whole:
                useless[one.name] = finding.message
            spans[one.name] = frozen or flat
        findings += _repeated(record, source)
    return Lost(tuple(findings), spans, useless)


def _runs(one: Signal) -> tuple[np.ndarray, np.ndarray]:
    """Return first and last index of each run of equal samples, shape (m,) each."""
    edges = np.flatnonzero(np.diff(one.values) != 0.0) + 1
    return np.concatenate([[0], edges]), np.concatenate([edges, [one.values.size]]) - 1


def _frozen(one: Signal, source: Source) -> tuple[Span, ...]:
    """Return spans over which a channel does not change though the pump runs."""
    if one.values.size < _HELD or not source.spans.on:
        return ()
    first, last = _runs(one)
    lasts = one.time[last] - one.time[first]
    short = lasts[lasts < _FROZEN]
    usual = float(np.quantile(short, 0.99)) if short.size else 0.0
    # A coarse or slow channel rests often; one that seldom does, and then for long, hangs.
    long = np.flatnonzero(lasts > max(_FROZEN, _TIMES * usual, 5.0 / one.rate))
    on = within(0.5 * (one.time[first[long]] + one.time[last[long]]), source.spans.on)
    whole = lasts[long] > 0.5 * (one.time[-1] - one.time[0])
    spans = tuple((float(one.time[first[i]]), float(one.time[last[i]])) for i in long[on | whole])
    held = sum(end - start for start, end in spans)
    # Where many short rests make up the record it is coarse: readings of a still quantity.
    rests = long.size > 20 and held > 0.5 * (one.time[-1] - one.time[0])
    return () if rests else spans


def _flat_tops(one: Signal) -> tuple[Span, ...]:
    """Return spans at the upper or lower end of a channel's range where it is held there again and again."""
    size = one.values.size
    if size < 100:
        return ()
    first, last = _runs(one)
    found: list[Span] = []
    for rail in (float(one.values.max()), float(one.values.min())):
        share = float(np.mean(one.values == rail))
        at = (one.values[first] == rail) & (last - first + 1 >= _HELD)
        held = float(np.sum((last - first + 1)[at])) / size
        if share > _RAIL and held > 0.5 * share:
            found += [(float(one.time[i]), float(one.time[k])) for i, k in zip(first[at], last[at], strict=True)]
    return tuple(sorted(found))


def _told(record: Record, one: Signal, frozen: Sequence[Span], flat: Sequence[Span]) -> tuple[QualityFinding, bool]:
    """Return what to say of a channel, and whether nothing of it can be used."""
    duration = float(one.time[-1] - one.time[0])
    if frozen:
        held = sum(end - start for start, end in frozen)
        value = float(one.values[np.searchsorted(one.time, frozen[0][0])])
        whole = held > _USELESS * duration
        does = "the channel is not used" if whole else "these samples are not used"
        other = _other_reader(record, one.name, frozen)
        text = (
            f"channel frozen: {one.name} stands at {value:.4g} Pa, without even noise, for {held:.4g} s with the pump on (first from {frozen[0][0]:.4g} "
            f"to {frozen[0][1]:.4g} s){other}; {does}. Look at the sensor, its cable and its converter"
        )
        return QualityFinding("error" if whole else "warning", text, record.run, one.name, _over(frozen)), whole
    share = float(np.mean(within(one.time, flat)))
    rail = float(one.values[np.searchsorted(one.time, flat[0][0])])
    whole = share > _USELESS
    text = (
        f"channel saturated: {100.0 * share:.2g} % of {one.name} stand at {rail:.5g} Pa, the end of its range, and its peaks are cut off; "
        + (
            "the channel is not used. "
            if whole
            else "means and pulsation of that tap are biased, windows with cut peaks are not used. "
        )
        + "Choose a wider range"
    )  # fmt: skip
    return QualityFinding("error" if whole else "warning", text, record.run, one.name, _over(flat)), whole


def _over(spans: Sequence[Span]) -> Span:
    return spans[0][0], spans[-1][1]


def _other_reader(record: Record, name: str, frozen: Sequence[Span]) -> str:
    """Say whether the other control unit, on the same clock, goes on reading while this one stands."""
    for mine, theirs in (("_rap", "_prot"), ("_prot", "_rap")):
        if name.endswith(mine):
            reader = theirs[1:]
            tap = name.removeprefix("pressure_").removesuffix(mine)
            source = record.sources.get(reader)
            other = source.taps.get(tap) if source is not None else None
            if other is None:
                return ""
            inside = other.values[within(other.time, frozen)]
            if inside.size > _HELD and float(np.ptp(inside)) > 0.0:
                return f", while {other.name} goes on: the unit's reading hangs and not the sensor"
            return f", and so does {other.name}: it is the sensor or its cable"
    return ""


def _repeated(record: Record, source: Source) -> list[QualityFinding]:
    """Tell rows that repeat the one before in every pressure, more than noise would by chance."""
    taps = list(source.taps.values())
    same_clock = [one for one in taps if one.time.size == taps[0].time.size and np.array_equal(one.time, taps[0].time)]
    if len(same_clock) < 2 or taps[0].time.size < 100:
        return []
    equal = np.array([np.diff(one.values) == 0.0 for one in same_clock if float(np.ptp(one.values)) > 0.0])
    if equal.shape[0] < 2:
        return []
    rows = equal.all(axis=0)
    chance = float(np.prod(equal.mean(axis=1))) * rows.size
    count = int(rows.sum())
    if count <= chance + _SIGMAS * math.sqrt(chance) + _FEW:
        return []
    first = float(same_clock[0].time[1:][rows][0])
    text = (
        f"duplicated samples: {count} rows of {', '.join(one.name for one in same_clock)} repeat the one before in every channel (first at "
        f"{first:.4g} s), where noise would do so in about {chance:.0f}: the logger writes faster than the converter samples, or holds the last value over lost "
        "ones. The stamps of these rows are off by up to a step"
    )
    return [QualityFinding("warning", text, record.run, same_clock[0].name)]
