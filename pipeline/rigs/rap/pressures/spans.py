"""When the blood pump runs and when it stands, by one source's own clock: before any clock is aligned, roughly.

Enough to judge units, signs and zeros. Levels for the numbers are found with the clocks aligned, in `hydraulics`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.rap.pulsation.pump import Pump, pump
from pipeline.rigs.rap.tables import Signal, signal

Span = tuple[float, float]

# Ramps and settling at either end of a span are left out, s; shorter spans are none.
_MARGIN, _SHORTEST = 3.0, 4.0
# The ultrafiltrate pressure has settled after that time, s.
_SETTLES = 1.0
# Slower logs do not show the pulsation, Hz.
_SLOWEST = 4.0
_PULSATING = ("prefilter", "return", "access")
# Which channels tell that the pump runs, on whose clock, where no pulsation does.
_DEVICE = ("blood_flow_set", "blood_pump_speed", "blood_flow_rap")
_TELLS = {"rap": _DEVICE, "prot": _DEVICE, "bench": ("blood_flow_bench",)}


# A tap that shows the pump turning for that share of the run is believed without asking the others.
_NEARLY_ALL = 0.9


@dataclass(frozen=True)
class Spans:
    """Spans (s, the source's clock) with the pump on and off, their ends taken off; `told_by` is the channel that tells it."""

    on: tuple[Span, ...]
    off: tuple[Span, ...]
    told_by: str


def spans_of(recording: Recording, reader: str, taps: Mapping[str, Signal]) -> Spans:
    """Return when the pump is on and off by the clock of `reader` (rap, prot, bench), whose pressures are `taps`."""
    pumps: dict[str, Pump] = {}
    for tap in _PULSATING:
        one = taps.get(tap)
        if one is None or one.rate < _SLOWEST:
            continue
        pumps[one.name] = pump(one.time, one.values)
        if _turned(pumps[one.name]) > _NEARLY_ALL * (one.time[-1] - one.time[0]):
            break
    if pumps:
        # A tap that hangs or is at its rail stands still while the pump runs: the one that shows most of it is believed.
        name = max(pumps, key=lambda name: _turned(pumps[name]))
        found = pumps[name]
        if found.stretches:
            on = [
                (s.first + (_MARGIN if s.start is not None else 0.0), s.last - (_MARGIN if s.stop is not None else 0.0))
                for s in found.stretches
            ]
            off = [
                (a + (_MARGIN if a > found.begin else 0.0), b - (_MARGIN if b < found.end else 0.0))
                for a, b in found.rests
            ]
            return Spans(_long(on), _long(off), name)
    for name in _TELLS[reader]:
        flow = signal(recording, name)
        if flow is not None and flow.values.max() > 0.0:
            return Spans(*_spans(flow.time, flow.values > 0.25 * float(np.quantile(flow.values, 0.95))), name)
    return Spans((), (), "")


def _turned(found: Pump) -> float:
    """Return how long the pump turned, s."""
    return sum(one.last - one.first for one in found.stretches)


def at_rest(device: Spans, other: Spans, uf_set: Signal | None) -> tuple[Spans, Spans]:
    """Return both spans without stops in which ultrafiltration goes on: the pressures are not at rest then.

    Parameters
    ----------
    device
        By the clock of `uf_set`.
    other
        By another clock; its stops are told by their number where both see as many.
    """
    if uf_set is None or not device.off:
        return device, other
    drawn = [bool(np.any(uf_set.values[within(uf_set.time, [(a - _SETTLES, b)])] > 0.0)) for a, b in device.off]
    rests = [span for span, draws in zip(device.off, drawn, strict=True) if not draws]
    mine = Spans(device.on, tuple(rests), device.told_by)
    if len(other.off) != len(device.off):
        return mine, other
    kept = [span for span, draws in zip(other.off, drawn, strict=True) if not draws]
    return mine, Spans(other.on, tuple(kept), other.told_by)


def within(time: np.ndarray, spans: Sequence[Span]) -> np.ndarray:
    """Return which of `time` (n,) lie in one of the spans, shape (n,)."""
    inside = np.zeros(time.size, dtype=bool)
    for start, end in spans:
        inside |= (time >= start) & (time <= end)
    return inside


def _spans(time: np.ndarray, on: np.ndarray) -> tuple[tuple[Span, ...], tuple[Span, ...]]:
    """Return the stretches where `on` is true and where it is false, margins taken off."""
    edges = np.flatnonzero(np.diff(on)) + 1
    starts, ends = np.concatenate([[0], edges]), np.concatenate([edges, [on.size]])
    found: dict[bool, list[Span]] = {True: [], False: []}
    for i, k in zip(starts, ends, strict=True):
        span = (float(time[i]) + (_MARGIN if i else 0.0), float(time[k - 1]) - (_MARGIN if k < on.size else 0.0))
        found[bool(on[i])].append(span)
    return _long(found[True]), _long(found[False])


def _long(spans: Sequence[Span]) -> tuple[Span, ...]:
    return tuple(span for span in spans if span[1] - span[0] >= _SHORTEST)
