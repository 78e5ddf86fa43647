"""Samples that are none: a channel that is frozen, at its rail, or repeated row by row (rap.md, section 8)."""

from __future__ import annotations

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
_PILED, _FEWEST = 3.0, 100
# Steps of a converter that are wider than the noise let a channel rest by itself, Pa, s.
_COARSE, _FROZEN_COARSE = 60.0, 60.0
# Rows repeat by chance at rest, not where the values two rows apart differ by that many of the converter's steps.
_MOVED, _FEW, _REPEATED = 4.0, 3, 1e-3


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
            flat = _flat_tops(one, source)
            frozen = _frozen(one, source) if not flat else ()
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
    least = _FROZEN_COARSE if resolution(one) > _COARSE else _FROZEN
    # A coarse or slow channel rests often; one that seldom does, and then for long, hangs.
    # Two equal samples on either side of a gap are no rest.
    filled = last - first + 1 > 0.5 * lasts * one.rate
    long = np.flatnonzero(filled & (lasts > max(least, _TIMES * usual, 5.0 / one.rate)))
    on = within(0.5 * (one.time[first[long]] + one.time[last[long]]), source.spans.on)
    whole = lasts[long] > 0.5 * (one.time[-1] - one.time[0])
    spans = tuple((float(one.time[first[i]]), float(one.time[last[i]])) for i in long[on | whole])
    held = sum(end - start for start, end in spans)
    # Where many short rests make up the record it is coarse: readings of a still quantity.
    rests = long.size > 20 and held > 0.5 * (one.time[-1] - one.time[0])
    return () if rests else spans


def _flat_tops(one: Signal, source: Source) -> tuple[Span, ...]:
    """Return spans in which a running pump holds a channel at the upper or lower end of its range, again and again."""
    first, last = _runs(one)
    running = within(one.time, source.spans.on)
    values = one.values[running]
    if values.size < _FEWEST:
        return ()
    found: list[Span] = []
    for rail in (float(values.max()), float(values.min())):
        share = float(np.mean(values == rail))
        inner = values[values != rail]
        if share <= _RAIL or not inner.size:
            continue
        # A crest thins out towards its end; one that is cut off piles up there.
        edge = inner.max() if rail > inner.max() else inner.min()
        piled = share > _PILED * float(np.mean(values == edge))
        at = (one.values[first] == rail) & (last - first + 1 >= _HELD) & running[first]
        held = float(np.sum((last - first + 1)[at])) / values.size
        if piled and held > 0.5 * share:
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
    """Tell rows that repeat the one before in every pressure although the pressures move on around them."""
    taps = [one for one in source.taps.values() if one.values.size > 2 and float(np.ptp(one.values)) > 0.0]
    together = [one for one in taps if np.array_equal(one.time, taps[0].time)]
    if len(together) < 2:
        return []
    equal = np.all([np.diff(one.values)[:-1] == 0.0 for one in together], axis=0)
    moved = np.any([np.abs(one.values[2:] - one.values[:-2]) > _MOVED * resolution(one) for one in together], axis=0)
    rows = equal & moved
    count = int(rows.sum())
    if count <= max(_FEW, _REPEATED * rows.size):
        return []
    at = together[0].time[1:-1][rows]
    # Now and then a row repeats by chance: where most of them stand counts.
    low, high = (float(end) for end in np.quantile(at, [0.1, 0.9]))
    text = (
        f"duplicated samples: {count} rows repeat the one before in {', '.join(one.name for one in together)} while the pressures move on around them "
        f"(most of them from {low:.4g} to {high:.4g} s): the logger writes faster than the converter samples, or holds the last value over a lost one. Their values are up "
        "to a step late, which blurs lag and pole"
    )
    return [QualityFinding("warning", text, record.run, together[0].name, (low, high))]


def resolution(one: Signal) -> float:
    """Return the smallest step between two samples of a channel, Pa; 0 where it never moves."""
    steps = np.abs(np.diff(one.values))
    steps = steps[steps > 0.0]
    return float(steps.min()) if steps.size else 0.0
