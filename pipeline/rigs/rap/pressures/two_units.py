"""Do the device's two control units read the same? Skew between them and stretches where they part (rap.md, 3.10 and 8).

Only what bears on the pressures' numbers; redundancy with its false alarms is `rap.therapy`'s.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.skew import skew_of
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures.pump_lines import PumpLines
from pipeline.rigs.rap.pressures.record import Record
from pipeline.rigs.rap.pressures.spans import Spans, within
from pipeline.rigs.rap.tables import Signal

# Skews below that (s) do not matter; means of that length (s) that differ by more than that (Pa) do.
_LEAST_SKEW = 1e-3
_MEANS, _PART = 2.0, 150.0
# In slower logs the pulsation is in the means, Hz.
_SLOWEST = 8.0


def unit_differences(record: Record, pump: PumpLines | None, lost: Collection[str] = ()) -> list[QualityFinding]:
    """Return a note on the skew between both units, and warnings where their readings part.

    Parameters
    ----------
    lost
        Channels of which something is frozen or saturated: that they part is told there.
    """
    control, protective = record.sources.get("rap"), record.sources.get("prot")
    if control is None or protective is None:
        return []
    found = []
    pairs = {
        tap: (one, protective.taps[tap])
        for tap, one in control.taps.items()
        if tap in protective.taps and np.array_equal(one.time, protective.taps[tap].time)
    }
    for tap, (one, other) in pairs.items():
        if not {one.name, other.name} & set(lost):
            found += _parted(record, control.spans, tap, one, other)
    if pump is not None and pump.source.reader == "rap":
        tap = next((tap for tap, one in control.taps.items() if one.name == pump.signal.name), "")
        if tap in pairs:
            found += _skewed(record, pump, *pairs[tap])
    return found


def _skewed(record: Record, pump: PumpLines, one: Signal, other: Signal) -> list[QualityFinding]:
    skew = skew_of(one.time, one.values, other.values)
    if skew is None or not abs(skew.value) > max(_LEAST_SKEW, 3.0 * skew.error):
        return []
    passages = pump.passages
    swing = 2.0 * math.pi * float(np.nanmax(passages.frequency * passages.amplitude)) * abs(skew.value)
    text = (
        f"skew {1e3 * skew.value:+.2g} ms: the protective unit samples {'after' if skew.value > 0 else 'before'} the control unit, so that their difference "
        f"pulsates by up to {swing:.0f} Pa at {one.name}; a mismatch threshold near that is not valid before the skew is taken out. The numbers here rest "
        "on the control unit alone"
    )
    return [QualityFinding("note", text, record.run, other.name)]


def _parted(record: Record, spans: Spans, tap: str, one: Signal, other: Signal) -> list[QualityFinding]:
    size = max(round(_MEANS * one.rate), 1)
    count = one.values.size // size
    if count < 3 or not one.rate >= _SLOWEST:
        return []
    difference = (other.values - one.values)[: count * size].reshape(count, size).mean(axis=1)
    away = difference - float(np.median(difference))
    parted = np.flatnonzero(np.abs(away) > _PART)
    resting = within(one.time, spans.off)
    zero = float(np.mean(other.values[resting]) - np.mean(one.values[resting])) if resting.any() else 0.0
    # Zeros that differ are told as zeros.
    always = abs(float(np.median(difference))) > _PART and abs(float(np.median(difference)) - zero) > 0.5 * _PART
    if parted.size < 2 and not always:
        return []
    worst = float(np.median(difference)) if always else float(difference[parted[np.argmax(np.abs(away[parted]))]])
    start, end = (0, count - 1) if always else (int(parted[0]), int(parted[-1]))
    span = (float(one.time[start * size]), float(one.time[min((end + 1) * size, one.time.size) - 1]))
    text = (
        f"the two control units part at the {TAP_NAMES[tap]} tap: {other.name} stands up to {worst:+.0f} Pa off {one.name}, from {span[0]:.4g} to {span[1]:.4g} s. "
        "One of their converters is off or frozen; which one, the bench tells"
    )
    return [QualityFinding("warning", text, record.run, other.name, span)]
