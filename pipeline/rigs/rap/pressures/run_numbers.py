"""One run's numbers: clock, agreement tap by tap, coherence, hydraulics. Each is a call; what could not be told carries its reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.pair import Pair, pairs_of
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.agreement import Agreement, bland_altman
from pipeline.rigs.rap.pressures.aligned import Aligned, aligned
from pipeline.rigs.rap.pressures.bubble import bubble_faults
from pipeline.rigs.rap.pressures.coherence import AtSetPoint, coherence_at_lines
from pipeline.rigs.rap.pressures.data_faults import DataFaults
from pipeline.rigs.rap.pressures.declaration import PressuresSettings
from pipeline.rigs.rap.pressures.deming import Deming, deming
from pipeline.rigs.rap.pressures.leftover import leftover, leftover_faults
from pipeline.rigs.rap.pressures.levels import Level, SetPoints, levels_of
from pipeline.rigs.rap.pressures.misfit import Misfit, misfits_of_circuit, misfits_of_tap
from pipeline.rigs.rap.pressures.misfit_faults import misfit_faults
from pipeline.rigs.rap.pressures.pump_lines import pump_faults, pump_lines, too_slow
from pipeline.rigs.rap.pressures.readings import CircuitNumbers, circuit_of
from pipeline.rigs.rap.pressures.record import Record
from pipeline.rigs.rap.pressures.resistances import NO_EFFECT, TURNED
from pipeline.rigs.rap.pressures.two_units import unit_differences
from pipeline.rigs.rap.pulsation.passages import Passages, find_passages
from pipeline.rigs.rap.tables import Signal, signal

# Slower logs do not show the pump's lines, Hz.
_SLOWEST = 8.0
# Strokes below that are hardly more than a step of the converter, Pa rms.
_LEAST_PULSATION = 150.0


@dataclass(frozen=True, eq=False)
class Tap:
    """Device and bench at one tap: side by side, limits of agreement, gain and offset, coherence by set-point."""

    aligned: Aligned
    agreement: Agreement
    deming: Deming
    coherence: tuple[AtSetPoint, ...]

    @property
    def half_width(self) -> float | None:
        """Half the distance of the limits of agreement of samples, Pa; None where they are not told."""
        limits = self.agreement.samples
        if limits.lower.value is None or limits.upper.value is None:
            return None
        return 0.5 * (limits.upper.value - limits.lower.value)


@dataclass(frozen=True, eq=False)
class RunNumbers:
    """What one run gives.

    Attributes
    ----------
    alignment, no_alignment
        Clock of the device against the bench's; None, and why, where the run has no two clocks that see the same pressures.
    taps, no_tap
        Taps that both read; why the others have no agreement.
    levels
        Steady stretches on the bench's clock (the device's where there is no bench).
    circuit
        Constants of the circuit; why there are none otherwise.
    checks
        What the models leave over (section 5.8).
    findings
        What was noticed on the way.
    """

    record: Record
    alignment: Alignment | None
    no_alignment: str
    taps: Mapping[str, Tap]
    no_tap: Mapping[str, str]
    levels: tuple[Level, ...]
    circuit: CircuitNumbers | str
    checks: tuple[Misfit, ...]
    findings: tuple[QualityFinding, ...]

    @property
    def name(self) -> str:
        """The run."""
        return self.record.run


def run_numbers(record: Record, faults: DataFaults, settings: PressuresSettings) -> RunNumbers:
    """Find the numbers of a run whose channels are sound.

    Raises
    ------
    InputError
        If neither agreement nor hydraulics can be looked for.
    """
    found: list[QualityFinding] = []
    for reader in ("rap", "bench"):
        source = record.sources.get(reader)
        lines = pump_lines(record, source) if source is not None else None
        found += too_slow(record, source) if source is not None else []
        if lines is not None:
            found += pump_faults(record, lines)
        if reader == "rap":
            found += unit_differences(record, lines, faults.lost)
    pairs = [pair for pair in pairs_of(faults.sound) if pair.alike]
    alignment, why = _aligned(record, pairs)
    if alignment is not None:
        found += [replace(q, run=record.run, channel=_channel(q.channel)) for q in alignment.problems]
    clock_known = alignment is not None and alignment.method != "none"
    levels, passages = _levels(record, faults, alignment)
    taps: dict[str, Tap] = {}
    no_tap = {tap: _why_no_tap(record, faults, tap, why) for tap in TAPS}
    if alignment is not None and clock_known:
        for pair in pairs:
            taps[pair.name] = _tap(pair, alignment, levels, passages, record)
            no_tap.pop(pair.name, None)
        found += bubble_faults(record.run, alignment, passages, [numbers.aligned for numbers in taps.values()])
    circuit = circuit_of(record, faults.sound, alignment if clock_known else None, levels, settings.device_gain_u)
    if not isinstance(circuit, str) and (why_none := circuit.found.estimates["k_uf"].reason) in (NO_EFFECT, TURNED):
        found.append(QualityFinding("warning", why_none, record.run, pressure("uf", circuit.reader)))
    checks = _checks(taps, alignment, passages, circuit)
    found += _left(record, taps, checks, found)
    return RunNumbers(
        record, alignment, why, taps, no_tap, tuple(levels), circuit, tuple(checks), tuple(dict.fromkeys(found))
    )


def _left(
    record: Record, taps: Mapping[str, Tap], checks: list[Misfit], told: list[QualityFinding]
) -> list[QualityFinding]:
    """Return what is left over, of each tap the cause alone where one was told, and nothing of strokes that hardly show."""
    soft = {finding.channel for finding in told if "transducer" in finding.message}
    left = {tap: one for tap, numbers in taps.items() if (one := leftover(numbers.aligned, numbers.deming)) is not None}
    found = leftover_faults(record.run, {tap: one for tap, one in left.items() if pressure(tap, "rap") not in soft})
    silent = {tap for tap, one in left.items() if one.pulsation < _LEAST_PULSATION or pressure(tap, "rap") in soft}
    silent |= {tap for tap in taps if any(finding.channel == pressure(tap, "rap") for finding in found)}
    return found + misfit_faults(record.run, checks, record.meter_location, silent)


def _checks(
    taps: Mapping[str, Tap], alignment: Alignment | None, passages: Passages | None, circuit: CircuitNumbers | str
) -> list[Misfit]:
    """Return the checks of section 5.8 that the run allows."""
    found: list[Misfit] = []
    if alignment is not None and passages is not None:
        for tap in taps.values():
            found += misfits_of_tap(tap.aligned, tap.deming, alignment, passages)
    return found + (misfits_of_circuit(circuit.found) if isinstance(circuit, CircuitNumbers) else [])


def _channel(tap: str | None) -> str | None:
    return pressure(tap, "rap") if tap in TAPS else tap


def _aligned(record: Record, pairs: list[Pair]) -> tuple[Alignment | None, str]:
    """Return the clock's alignment, or why there is none."""
    if not pairs:
        lacks = [reader for reader in ("rap", "bench") if reader not in record.sources]
        words = {"rap": "no device pressure", "bench": "no bench pressure"}
        has = " and ".join(words[reader] for reader in lacks) or "no tap that device and bench both read"
        return None, f"the run has {has}: nothing to hold against each other"
    try:
        return align(pairs, record.number("bench_sensor_time_constant")), ""
    except InputError as error:
        return None, str(error).rstrip(".")


def _why_no_tap(record: Record, faults: DataFaults, tap: str, why: str) -> str:
    for reader in ("rap", "bench"):
        if pressure(tap, reader) in faults.useless:
            return faults.useless[pressure(tap, reader)]
    if any(reader not in record.sources for reader in ("rap", "bench")):
        return why
    missing = [
        pressure(tap, r) for r in ("rap", "bench") if r not in record.sources or tap not in record.sources[r].taps
    ]
    if missing:
        return f"the run has no {' and no '.join(missing)}"
    return why or "the clocks of device and bench could not be laid over each other"


def _levels(record: Record, faults: DataFaults, alignment: Alignment | None) -> tuple[list[Level], Passages | None]:
    """Return the steady stretches and the strokes, on the bench's clock or, without a bench, the device's."""
    reader = "bench" if "bench" in record.sources and (alignment is not None or "rap" not in record.sources) else "rap"
    if reader not in record.sources:
        return [], None
    own = [
        one for tap in ("prefilter", "return", "access", "uf") if (one := signal(faults.sound, pressure(tap, reader)))
    ]
    if not own:
        return [], None
    moved = SetPoints(*(_on_bench(one, alignment, reader) for one in (record.flow_set, record.uf_set)))
    passages = find_passages(own[0].time, own[0].values) if own[0].rate >= _SLOWEST else None
    return levels_of(own, moved), passages


def _on_bench(one: Signal | None, alignment: Alignment | None, reader: str) -> Signal | None:
    if one is None or alignment is None or reader == "rap":
        return one
    return replace(one, time=alignment.clock.to_bench(one.time))


def _tap(pair: Pair, alignment: Alignment, levels: list[Level], passages: Passages | None, record: Record) -> Tap:
    one = aligned(pair, alignment)
    coherence = coherence_at_lines(one, levels, passages) if passages is not None else ()
    return Tap(one, bland_altman(one, levels, passages), deming(one, levels, record.number("bench_gain_u")), coherence)
