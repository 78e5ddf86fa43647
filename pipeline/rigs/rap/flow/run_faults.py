"""What one flow run gives away before anything is calibrated: units, signs, exchanged taps, frozen channels, zeros, encoder (rap.md, 8).

Channels are judged as for `rap.pressures`; here it is decided which of that concerns the flow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.conditions import pressure
from pipeline.rigs.rap.flow.record import METER, FlowRun
from pipeline.rigs.rap.flow.run_windows import RunNumbers
from pipeline.rigs.rap.pressures.data_faults import data_faults
from pipeline.rigs.rap.pressures.pump_lines import pump_faults, pump_lines
from pipeline.rigs.rap.pressures.record import record_of

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


@dataclass(frozen=True)
class Inspected:
    """A run's recording without what cannot be used, what was found, and why the run is left out ('' where it is not)."""

    sound: Recording
    findings: tuple[QualityFinding, ...]
    refused: str


def inspected(recording: Recording) -> Inspected:
    """Judge the channels of a run."""
    record = record_of(recording)
    faults = data_faults(record)
    found = [_weighed(finding) for finding in faults.findings]
    source = record.sources.get("rap")
    lines = pump_lines(record, source) if source is not None else None
    refused = next((f.message for f in found if f.level == "error"), "")
    if lines is not None and not refused:
        found += pump_faults(record, lines)
        refused = next((f.message for f in found if f.level == "error"), "")
    return Inspected(faults.sound, tuple(found), refused)


def _weighed(finding: QualityFinding) -> QualityFinding:
    """Return a finding on a channel that the flow does not rest on as a note."""
    if finding.channel is None or finding.channel in _USED or finding.level == "note":
        return finding
    return replace(finding, level="note", message=f"{finding.message} (no matter for the flow)")


def run_faults(numbers: RunNumbers) -> list[QualityFinding]:
    """Return what the windows of a run give away."""
    run = numbers.run
    return [*numbers.problems, *_no_windows(numbers), *_encoder(numbers), *_meter(numbers), *_missing(run)]


def _no_windows(numbers: RunNumbers) -> list[QualityFinding]:
    if numbers.windows.size:
        return []
    if not numbers.pump.stretches:
        text = f"the pump never turns: {numbers.source} shows no pulsation. Look whether the channel is mapped and the run is the right one"
    else:
        text = (
            f"no window of the run is steady: the pump turns for {_turning(numbers):.0f} s in all, and windows must lie clear of starts, steps of set-points and "
            "clamp changes. Hold each set-point for 30 s or more"
        )
        if numbers.clock is not None and numbers.clock.margin > 10.0:
            text += f"; {numbers.clock.how}, so that {numbers.clock.margin:.0f} s are kept off every change: log a pressure on the bench too"
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
    if numbers.meter_zeroed:
        text = f"the flow meter reads {6e7 * zero.value:+.2f} ± {1.96 * 6e7 * zero.error:.2f} mL/min while the pump stands; that is taken off all its readings. Re-zero it"
        found.append(QualityFinding("warning", text, numbers.run.name, METER))
    if numbers.run.meter is not None and numbers.windows.size and not np.isfinite(numbers.windows.metered).any():
        text = "the flow meter has no samples in any window of this run, by its clock: it was not logging, or its stamps lie elsewhere"
        found.append(QualityFinding("warning", text, numbers.run.name, METER))
    return found


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
