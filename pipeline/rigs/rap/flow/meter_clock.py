"""The flow meter on the device's clock, and how far its stamps can be trusted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.pair import pairs_of
from pipeline.rigs.rap.flow.record import FlowRun

# Where the clocks could not be aligned they are within that of each other, s: windows so near a change are left out.
UNSURE = 30.0
# Aligned by the pump's lines or by steps alone they are within that, s.
_BY_LINES, _BY_STEPS = 0.1, 1.5
# Where steps fit at one lag only (correlation of the best and of the second over it), a few strokes may still be open, s.
_LIKE, _UNIQUE, _STROKES = 0.7, 0.9, 4.0


@dataclass(frozen=True)
class MeterClock:
    """`clock` takes device time to the meter's; it is right within `margin` s. `how` says from what, `problems` what must be told."""

    clock: Clock
    margin: float
    how: str
    problems: tuple[QualityFinding, ...] = ()

    def to_meter(self, device_time: np.ndarray) -> np.ndarray:
        """Return stamps of the device, s, shape (n,), on the meter's clock."""
        return self.clock.to_bench(device_time)


def meter_clock(run: FlowRun) -> MeterClock:
    """Align the meter's clock with the device's by the pressures that both log, else by the steps of flow."""
    if run.one_clock:
        return MeterClock(Clock(0.0, 0.0), 0.0, "meter and pressures stand in one table, on one clock")
    pairs = pairs_of(run.recording)
    if not pairs:
        return MeterClock(Clock(0.0, 0.0), UNSURE, "nothing that both clocks see: stamps as logged")
    found = align(pairs, run.number("bench_sensor_time_constant"))
    told = tuple(replace(p, level="note") if found.sure else p for p in found.problems if p.level != "note")
    coarse = found.coarse
    if not found.sure and coarse.featured and coarse.peak > _LIKE and coarse.margin < _UNIQUE:
        noted = tuple(replace(p, level="note") for p in told)
        return MeterClock(
            found.clock, _STROKES, "starts and steps; ambiguous by strokes, which does not matter here", noted
        )
    if not found.sure:
        return MeterClock(found.clock, UNSURE, "the lag between the clocks is not sure", told)
    how = "pressures that both log" if pairs[0].alike else "steps of the meter against those of the pressures"
    exact = found.method == "harmonics"
    sampling = 1.0 / run.meter.rate if run.meter is not None and np.isfinite(run.meter.rate) else 0.0
    return MeterClock(found.clock, (_BY_LINES if exact else _BY_STEPS) + sampling, how, told)
