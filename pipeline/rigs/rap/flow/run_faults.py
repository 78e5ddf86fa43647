"""What one flow run gives away before anything is calibrated: units, signs, exchanged taps, frozen channels, zeros, encoder (rap.md, 8).

Channels are judged as for `rap.pressures`; here it is decided which of that concerns the flow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.conditions import pressure
from pipeline.rigs.rap.flow.record import METER, FlowRun
from pipeline.rigs.rap.flow.run_windows import ZERO_MOST, RunNumbers
from pipeline.rigs.rap.pressures.data_faults import data_faults
from pipeline.rigs.rap.pressures.pump_lines import line_faults, pump_lines
from pipeline.rigs.rap.pressures.record import record_of
from pipeline.rigs.rap.pressures.spikes import without_spikes

# The numbers of this experiment rest on these channels; faults of others are told and cost nothing.
_USED = (
    *(pressure(tap, "rap") for tap in ("access", "prefilter", "return")),
    METER,
    "blood_flow_set",
    "blood_pump_speed",
)
# The encoder agrees with the passages within that share; or it is off by one of these factors.
_AGREES = 0.01
_ROTOR = {1.0 / n: f"1/{n}" for n in (2, 3, 4, 6)}
_NEAR = 0.05
# With the access line open the pump delivers about what is set: the meter's largest share of it lies in between.
_LIKE = (0.6, 1.5)


@dataclass(frozen=True)
class Inspected:
    """A run's recording without what cannot be used, what was found, and why the run is left out ('' where it is not)."""

    sound: Recording
    findings: tuple[QualityFinding, ...]
    refused: str


def inspected(recording: Recording) -> Inspected:
    """Judge the channels of a run."""
    sound, spiky = without_spikes(recording)
    record = record_of(sound)
    faults = data_faults(record)
    found = [_weighed(finding, faults.useless) for finding in (*faults.findings, *spiky)]
    source = record.sources.get("rap")
    lines = pump_lines(record, source) if source is not None else None
    refused = next((f.message for f in found if f.level == "error"), "")
    if lines is not None and not refused:
        found += line_faults(record, lines)
        refused = next((f.message for f in found if f.level == "error"), "")
    return Inspected(faults.sound, tuple(found), refused)


def _weighed(finding: QualityFinding, useless: Mapping[str, str]) -> QualityFinding:
    """Return a finding as it bears on the flow: a channel left out costs what rests on it, a zero is taken off, others do not matter."""
    if finding.level == "note" or finding.channel is None:
        return finding
    if finding.channel not in _USED:
        return replace(finding, level="note", message=f"{finding.message} (no matter for the flow)")
    if finding.message.startswith("zero not taken"):
        return replace(finding, level="note", message=f"{finding.message}. Taken off here")
    return replace(finding, level="warning") if finding.channel in useless else finding


def run_faults(numbers: RunNumbers) -> list[QualityFinding]:
    """Return what the windows of a run give away."""
    run = numbers.run
    return [
        *numbers.problems,
        *_no_windows(numbers),
        *_lost(numbers),
        *_encoder(numbers),
        *_meter(numbers),
        *_missing(run),
    ]


def _no_windows(numbers: RunNumbers) -> list[QualityFinding]:
    if numbers.windows.size:
        return []
    if not numbers.pump.stretches:
        read = numbers.meter_zero.value
        flowing = f" though the flow meter reads {6e7 * read:.3g} mL/min" if _flows_at_rest(numbers) else ""
        text = f"the pump never turns: {numbers.source} shows no pulsation{flowing}. Look whether the channel is mapped and the run is the right one"
        return [QualityFinding("error", text, numbers.run.name, numbers.source)]
    text = (
        f"no window of the run is steady: the pump turns for {_turning(numbers):.0f} s in all, and windows must lie clear of starts, steps of set-points and "
        "clamp changes. Hold each set-point for 30 s or more"
    )
    if numbers.clock is not None and numbers.clock.margin > 10.0:
        text += f"; {numbers.clock.how}, so that {numbers.clock.margin:.0f} s are kept off every change: log a pressure on the bench too"
    return [QualityFinding("warning", text, numbers.run.name)]


def _lost(numbers: RunNumbers) -> list[QualityFinding]:
    """Tell set-points at which the pump turns and no window can be used."""
    if not numbers.lost_set_points or not numbers.windows.size:
        return []
    levels = listing([f"{6e7 * level:.3g}" for level in numbers.lost_set_points], 6)
    text = (
        f"no window at {levels} mL/min can be used: {numbers.source} shows no steady line of the roller passages there in the band that is looked at (0.8 to 3.5 Hz "
        "unless set otherwise). For slower or faster pumps set 'slowest' and 'fastest' in the recipe"
    )
    return [QualityFinding("warning", text, numbers.run.name)]


def _turning(numbers: RunNumbers) -> float:
    return sum(one.last - one.first for one in numbers.pump.stretches)


def _encoder(numbers: RunNumbers) -> list[QualityFinding]:
    """Hold the passages found in the pressure against the pump's encoder."""
    run, windows = numbers.run, numbers.windows
    if run.speed is None or run.pulsating is None or not windows.size:
        return []
    first, last = (
        np.searchsorted(run.speed.time, windows.time - 5.0),
        np.searchsorted(run.speed.time, windows.time + 5.0),
    )
    speed = np.array([run.speed.values[a:b].mean() if b > a else np.nan for a, b in zip(first, last, strict=True)])
    ratio = speed / windows.f
    if not np.isfinite(ratio).any():
        return []
    off = float(np.nanmedian(ratio))
    if abs(off - 1.0) < _AGREES:
        return []
    factor = next((words for value, words in _ROTOR.items() if abs(off / value - 1.0) < _NEAR), "")
    turns = next((words for value, words in _ROTOR.items() if abs(off * value - 1.0) < _NEAR), "")
    text = f"blood_pump_speed is {off:.4g} times the frequency of the passages in {numbers.source}"
    if factor:
        text += f": the encoder counts turns of the rotor and not strokes (factor {factor}). The frequency of the pressure is used; scale the channel in the recipe"
    elif turns:
        text += f": frequency is rotor rate, not roller rate ({turns} of the strokes), one roller stands out. Windows found so cannot be used"
        return [QualityFinding("error", text, run.name, run.speed.name)]
    else:
        text += ": one of the two is wrong (unit of the encoder, clock, a line that is not the pump's). The frequency of the pressure is used"
    return [QualityFinding("warning", text, run.name, run.speed.name)]


def _meter(numbers: RunNumbers) -> list[QualityFinding]:
    found = []
    zero = numbers.meter_zero
    if _flows_at_rest(numbers) and numbers.pump.stretches:
        text = f"the flow meter reads {6e7 * zero.value:+.3g} mL/min where {numbers.source} shows no pulsation: it is frozen there, or the pump turns unseen. No zero is taken from it"
        found.append(QualityFinding("warning", text, numbers.run.name, METER))
    if numbers.meter_zeroed:
        text = f"the flow meter reads {6e7 * zero.value:+.2f} ± {1.96 * 6e7 * zero.error:.2f} mL/min while the pump stands; that is taken off all its readings. Re-zero it"
        found.append(QualityFinding("warning", text, numbers.run.name, METER))
    if numbers.meter_frozen:
        text = f"channel frozen: the flow meter stands at one value, without noise, in {numbers.meter_frozen} windows while the pump's speed changes; these are not held against it"
        found.append(QualityFinding("warning", text, numbers.run.name, METER))
    elif numbers.run.meter is not None and numbers.windows.size and not np.isfinite(numbers.windows.metered).any():
        text = "the flow meter has no samples in any window of this run, by its clock: it was not logging, or its stamps lie elsewhere"
        found.append(QualityFinding("warning", text, numbers.run.name, METER))
    return [*found, *_unlike_set(numbers)]


def _flows_at_rest(numbers: RunNumbers) -> bool:
    """Tell whether the meter reads a flow where the pressures show no pump."""
    return numbers.meter_zero.known and abs(numbers.meter_zero.value) >= ZERO_MOST


def _unlike_set(numbers: RunNumbers) -> list[QualityFinding]:
    """Tell a meter that is far from what is set, where nothing is clamped."""
    windows = numbers.windows
    if numbers.run.flow_set is None or not windows.size:
        return []
    ratio = windows.metered / np.where(windows.flow_set > 0.0, windows.flow_set, np.nan)
    ratio = ratio[np.isfinite(ratio)]
    if not ratio.size or _LIKE[0] < float(ratio.max()) < _LIKE[1]:
        return []
    text = (
        f"the flow meter reads {float(ratio.max()):.3g} times the set-point at most: another unit or scale of blood_flow_bench or blood_flow_set, or the line is shut. "
        "All volumes go with the meter; look before they are used"
    )
    return [QualityFinding("warning", text, numbers.run.name, METER)]


def _missing(run: FlowRun) -> list[QualityFinding]:
    found = []
    for tap, what in (("prefilter", "E2 and E3"), ("access", "E3")):
        if tap not in run.pressures:
            found.append(
                QualityFinding("warning", f"no {pressure(tap, 'rap')}: {what} cannot be told in this run", run.name)
            )
    if run.flow_set is None:
        found.append(
            QualityFinding(
                "note",
                "no blood_flow_set: set-points are told from the frequency, and named after what flows there",
                run.name,
            )
        )
    if run.location == "return" and run.uf is None:
        text = (
            "the meter is on the return line, and neither uf_pump_command nor uf_flow_set is logged: UF is taken as off. If it ran, all flows are too low by its rate "
            "(5 mL/min are 8.3 to 5 % of 60 to 100 mL/min)"
        )
        found.append(QualityFinding("warning", text, run.name, METER))
    return found


def errors_of(findings: Sequence[QualityFinding]) -> list[str]:
    """Return the messages of the errors among the findings."""
    return [finding.message for finding in findings if finding.level == "error"]
