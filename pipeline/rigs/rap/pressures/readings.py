"""Whose pressures and which flow the circuit's constants are found from, all on one clock. The fit is in `hydraulics_fit`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.pair import pairs_of
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.conditions import TAPS, pressure
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
    record: Record, sound: Recording, alignment: Alignment | None, levels: Sequence[Level]
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
    """
    taps = {reader: _taps(sound, reader) for reader in ("bench", "rap")}
    # The bench is the reference; the device where it alone reads enough taps.
    reader = "bench" if len(taps["bench"]) >= len(taps["rap"]) or len(taps["bench"]) > 2 else "rap"
    if not taps[reader]:
        return "no pressure can be used"
    clock, known = (alignment, "") if alignment is not None else _by_flow(sound)
    if clock is None and reader == "rap" and record.meter is not None:
        return (
            f"the device's pressures and the flow meter are on two clocks, and nothing tells how these stand: {known}"
        )
    to_own = _moved(clock, reader)
    own = list(levels) if alignment is not None or reader == "rap" else []
    if not own or (reader == "rap" and alignment is not None):
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
    return CircuitNumbers(reader, tuple(own), taps[reader], fit_hydraulics(readings, own))


def _taps(sound: Recording, reader: str) -> dict[str, Signal]:
    found = {tap: signal(sound, pressure(tap, reader)) for tap in TAPS}
    return {tap: one for tap, one in found.items() if one is not None}


def _by_flow(sound: Recording) -> tuple[Alignment | None, str]:
    """Return the clocks laid over each other by a pressure and the flow meter, or why they are not."""
    try:
        found = align(pairs_of(sound))
    except InputError as error:
        return None, str(error).rstrip(".")
    return (found, "") if found.method != "none" else (None, found.lag.reason)


class _moved:  # noqa: N801
    """Moves a signal of one source to the clock of another."""

    def __init__(self, alignment: Alignment | None, reader: str) -> None:
        self._alignment, self._reader = alignment, reader

    def __call__(self, one: Signal | None, source: str) -> Signal | None:
        if one is None or self._alignment is None or source == self._reader:
            return one
        clock = self._alignment.clock
        return replace(one, time=clock.to_bench(one.time) if source == "rap" else clock.to_device(one.time))
