"""What is wrong with a run's channels, before any number: errors of the run, channels without use, samples left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding, Recording, Stream
from pipeline.rigs.rap.pressures.exchanged import exchange_faults
from pipeline.rigs.rap.pressures.record import Record
from pipeline.rigs.rap.pressures.spans import Span, within
from pipeline.rigs.rap.pressures.stuck import lost_samples
from pipeline.rigs.rap.pressures.tap_levels import tap_levels
from pipeline.rigs.rap.pressures.time_base import time_faults
from pipeline.rigs.rap.pressures.units import unit_faults
from pipeline.rigs.rap.pressures.zeros import zero_faults


@dataclass(frozen=True)
class DataFaults:
    """What was found, why the whole run is refused (empty where it is not), channels left out, those that `lost` samples, the recording without them."""

    findings: tuple[QualityFinding, ...]
    refused: tuple[str, ...]
    useless: Mapping[str, str]
    lost: Collection[str]
    sound: Recording


def data_faults(record: Record) -> DataFaults:
    """Judge the channels of a run.

    Wrong units (of time, too), exchanged taps and turned signs refuse the run: mended in the recipe, it can be used whole. A channel that
    is frozen or saturated over much of the run is left out, frozen samples of others as well.
    """
    if stamps := time_faults(record):
        return DataFaults(tuple(stamps), tuple(one.message for one in stamps), {}, (), record.recording)
    levels = tap_levels(record)
    lost = lost_samples(record)
    usable = [level for level in levels if level.channel not in lost.useless]
    found = [*unit_faults(record, usable), *exchange_faults(record, usable)]
    # What is doubted of a channel whose crests are cut or whose samples hang is that, and told there.
    grave = [finding for finding in found if finding.level == "error" or finding.channel not in lost.spans]
    refused = tuple(finding.message for finding in grave if finding.level == "error")
    zeros = [] if any("unit mix-up" in text for text in refused) else zero_faults(record, usable)
    findings = (*grave, *lost.findings, *zeros, *_astray(record), *_place(record))
    return DataFaults(
        findings, refused, lost.useless, tuple(lost.spans), _without(record.recording, lost.useless, lost.spans)
    )


def _astray(record: Record) -> list[QualityFinding]:
    """Tell settings of the device that are on another clock than its pressures."""
    if not record.astray:
        return []
    names = listing([one.name for one in record.astray], 4)
    time, pressures = record.astray[0].time, next(iter(record.sources["rap"].taps.values())).time
    text = (
        f"two clocks in one device: {names} are stamped {time[0]:.6g} to {time[-1]:.6g} s and the device's pressures {pressures[0]:.6g} to {pressures[-1]:.6g} s. They "
        "share no moment, so what was set is not known and not used; log both by one clock"
    )
    return [QualityFinding("warning", text, record.run, record.astray[0].name)]


def _place(record: Record) -> list[QualityFinding]:
    """Tell a flow meter whose place is not stated though fluid is drawn off between the two that it can have."""
    drawn = record.uf_set is not None and bool(np.any(record.uf_set.values > 0.0))
    if record.meter is None or record.meter_location is not None or not drawn:
        return []
    text = (
        "flowmeter_location is not stated: on the return line the meter reads Q_b - Q_uf, on the access line Q_b. Resistances rest on the time without "
        "ultrafiltration, in which both read the same; state access or return"
    )
    return [QualityFinding("warning", text, record.run, record.meter.name)]


def _without(recording: Recording, useless: Mapping[str, str], spans: Mapping[str, Sequence[Span]]) -> Recording:
    """Return a recording without the channels of `useless`, and without samples within the `spans` of the others."""
    streams = {}
    for name, stream in recording.streams.items():
        touched = [channel for channel in stream.channels if channel in useless or channel in spans]
        streams[name] = _stream(stream, touched, useless, spans) if touched else stream
    return replace(recording, streams=streams)


def _stream(
    stream: Stream, touched: Sequence[str], useless: Mapping[str, str], spans: Mapping[str, Sequence[Span]]
) -> Stream:
    channels = {name: stream.channels[name] for name in stream.channels if name not in useless}
    for name in touched:
        if name in channels:
            values = np.where(within(stream.time, spans[name]), np.nan, channels[name].values)
            channels[name] = replace(channels[name], values=values)
    return Stream(stream.name, stream.time, channels)
