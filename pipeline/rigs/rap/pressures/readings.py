"""Whose pressures and which flow the circuit's constants are found from, all on one clock. The fit is in `hydraulics_fit`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.recording import Recording
from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.pair import Pair, pairs_of
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.device_gains import with_unknown_gains
from pipeline.rigs.rap.pressures.hydraulics_fit import Hydraulics, Readings, fit_hydraulics
from pipeline.rigs.rap.pressures.levels import Level, SetPoints, levels_of
from pipeline.rigs.rap.pressures.record import Record
from pipeline.rigs.rap.tables import Signal, signal


@dataclass(frozen=True, eq=False)
class CircuitNumbers:
    """Constants of the circuit with the reader whose pressures they rest on, its steps and its signals by tap."""

    reader: str
    levels: tuple[Level, ...]
    taps: dict[str, Signal]
    found: Hydraulics


def circuit_of(
    record: Record, sound: Recording, alignment: Alignment | None, levels: Sequence[Level], device_gain_u: float
) -> CircuitNumbers | str:
    """Return the circuit's constants, or why there are none.

    Parameters
    ----------
    sound
        The recording without what cannot be used.
    alignment
        Of the device's clock to the bench's; None without a bench.
    levels
        Steps of the run on the bench's clock, or on the device's where there is no bench.
    device_gain_u
        Relative standard uncertainty of the device's gains, where its own pressures are all there is.
    """
    taps = {reader: _taps(sound, reader) for reader in ("bench", "rap")}
    # The bench is the reference; the device where it alone reads enough taps.
    reader = "bench" if len(taps["bench"]) >= len(taps["rap"]) or len(taps["bench"]) > 2 else "rap"
    if not taps[reader]:
        return "no pressure can be used"
    clock, why = (alignment, "") if alignment is not None else _by_flow(record, sound)
    to_own = _Mover(clock, reader, _split(record))
    own = list(levels) if alignment is not None and reader == "bench" else []
    if not own:
        set_points = SetPoints(to_own(record.flow_set, "rap"), to_own(record.uf_set, "rap"))
        own = levels_of(
            [taps[reader][tap] for tap in ("prefilter", "return", "access", "uf") if tap in taps[reader]], set_points
        )
    readings = Readings(
        taps=taps[reader],
        meter=to_own(record.meter, "bench"),
        location=record.meter_location,
        uf=to_own(record.uf_set, "rap"),
        poles=alignment.pole_by_name if reader == "rap" and alignment is not None else {},
        meter_gain_u=record.number("flowmeter_gain_u"),
        pressure_gain_u=record.number("bench_gain_u"),
    )
    found = fit_hydraulics(readings, own)
    if reader == "rap" and "bench_gain_u" not in record.conditions:
        found = with_unknown_gains(found, device_gain_u)
    if why and clock is None and record.meter is not None and readings.meter is None:
        told = {name: _because(one, why) for name, one in found.estimates.items()}
        found = replace(found, estimates=told)
    return CircuitNumbers(reader, tuple(own), taps[reader], found)


def _because(one: Estimate, why: str) -> Estimate:
    """Say of a number that lacks the flow meter that the meter is there, on a clock that is not known."""
    if one.value is not None or "flow meter" not in one.reason:
        return one
    return undetermined(
        one.name, f"the flow meter is on another clock than these pressures, and nothing tells how both stand: {why}"
    )


def _split(record: Record) -> bool:
    """Tell whether the run has two clocks: what the device sets, and what the bench reads."""
    device = "rap" in record.sources or record.flow_set is not None or record.uf_set is not None
    bench = "bench" in record.sources or record.meter is not None
    return device and bench


def _taps(sound: Recording, reader: str) -> dict[str, Signal]:
    found = {tap: signal(sound, pressure(tap, reader)) for tap in TAPS}
    return {tap: one for tap, one in found.items() if one is not None}


def _by_flow(record: Record, sound: Recording) -> tuple[Alignment | None, str]:
    """Return the clocks laid over each other by a pressure, or the flow as set, and the flow meter; or why they are not."""
    pairs = pairs_of(sound)
    if not pairs and record.flow_set is not None and record.meter is not None:
        pairs = (Pair("flow", record.flow_set, record.meter, alike=False),)
    if not pairs:
        return None, "no channel is seen by both"
    try:
        found = align(pairs)
    except InputError as error:
        return None, str(error).rstrip(".")
    return (found, "") if found.method != "none" and found.sure else (None, found.lag.reason.rstrip("."))


@dataclass(frozen=True, eq=False)
class _Mover:
    """Moves a signal of one source to the clock of the reader; drops it where two clocks are not known to each other."""

    alignment: Alignment | None
    reader: str
    two_clocks: bool

    def __call__(self, one: Signal | None, source: str) -> Signal | None:
        if one is None or source == self.reader or not self.two_clocks:
            return one
        if self.alignment is None:
            return None
        clock = self.alignment.clock
        return replace(one, time=clock.to_bench(one.time) if source == "rap" else clock.to_device(one.time))
