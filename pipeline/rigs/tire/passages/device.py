"""The transmitter's log as volts on an even grid, in pieces (tire.md, 5.1). What the volts mean is in `resistance`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError, counted
from pipeline.recording import QualityFinding, Recording, Stream
from pipeline.rigs.tire.conditions import CONVERTER, DIVIDER, assumed
from pipeline.rigs.tire.passages.layout import Layout, Loss, layout_of
from pipeline.rigs.tire.passages.pieces import Gatherer, Piece

# So near to 0 V or to the supply the divider has lost its sensor.
_OPEN = 0.005
_TOLD = ("sample_rate", "frames_per_packet", "counter_bits", "gated")


@dataclass(frozen=True, eq=False)
class Device:
    """A transmitter's log. Nothing of its signals is held in memory.

    Attributes
    ----------
    rate, span
        Samples per second; first and last moment, s, on the stream's own time.
    supply_voltage, divider_resistance, adc_full_scale
        VIN, V; R1, ohm; the voltage of the converter's highest code + 1.
    scale_known
        Whether the converter's scale is stated or the log holds codes; volts alone do not tell it.
    polarity
        +1 or -1 as told, None where not told.
    on_road
        Whether speed and load change at will.
    sensor_resistance
        R0 as told, ohm, or None.
    quality
        What is wrong with the packets.
    assumed
        What of the circuit the run does not state, and what is taken for it.
    """

    run: str
    rate: float
    span: tuple[float, float]
    supply_voltage: float
    divider_resistance: float
    adc_full_scale: float
    scale_known: bool
    adc_bits: int
    polarity: int | None
    gated: bool
    has_film: bool
    on_road: bool
    sensor_resistance: float | None
    loss: Loss
    quality: tuple[QualityFinding, ...]
    layout: Layout
    stream: Stream
    assumed: Mapping[str, float] = field(default_factory=dict)

    @property
    def step(self) -> float:
        """One code of the converter, V."""
        return self.adc_full_scale / 2.0**self.adc_bits

    @property
    def duration(self) -> float:
        """Seconds from first to last sample."""
        return self.span[1] - self.span[0]

    def pieces(self, seconds: float = 60.0) -> Iterator[Piece]:
        """Yield the log piece by piece on the even grid; a silence of more than 10 s lies between two pieces."""
        names = [_name(self.stream, "flex")] + ([_name(self.stream, "pvdf")] if self.has_film else [])
        scale = [self.step if name.endswith("_code") else 1.0 for name in names]
        size = max(int(seconds * self.rate), 1)
        gatherer = Gatherer(self.layout, self._scales(), size, stated=self.scale_known)
        row = 0
        for time, values in self.stream.blocks(names):
            volts = [factor * np.asarray(v, dtype=float) for v, factor in zip(values, scale, strict=True)]
            yield from gatherer.add(row, time.size, volts)
            row += time.size
        yield from gatherer.rest()

    def _scales(self) -> list[tuple[float, float]]:
        """Return least and highest volts of flex sensor and film: the converter's, and those that the divider can give."""
        least, most = -math.inf, math.inf
        if self.scale_known:
            least, most = 0.5 * self.step, self.adc_full_scale - 1.5 * self.step
        VIN = self.supply_voltage
        flex = max(least, _OPEN * VIN), min(most, (1.0 - _OPEN) * VIN)
        return [flex, (least, most)] if self.has_film else [flex]


def device_of(recording: Recording) -> Device:
    """Return the transmitter's log of a run; its counters are read once, in pieces.

    Raises
    ------
    InputError
        Where the run has no flex sensor or too few samples.
    """
    name = next((n for n in ("flex_code", "flex_voltage") if n in recording), None)
    if name is None:
        raise InputError(
            f"run '{recording.run}' has neither flex_code nor flex_voltage; it has "
            f"{', '.join(recording.names) or 'no channel'}. Name the flex sensor's channel in the recipe."
        )
    stream = recording.stream_of(name)
    told = {n: float(recording.condition(n)) for n in _TOLD if n in recording.conditions}
    layout = layout_of(stream, told)
    begins = layout.begins
    polarity = recording.conditions.get("flex_polarity")
    R0 = recording.conditions.get("sensor_resistance")
    return Device(
        run=recording.run,
        rate=layout.rate,
        span=(begins, begins + (layout.samples - 1) / layout.rate),
        supply_voltage=recording.condition("supply_voltage", DIVIDER["supply_voltage"]),
        divider_resistance=recording.condition("divider_resistance", DIVIDER["divider_resistance"]),
        adc_full_scale=recording.condition("adc_reference", CONVERTER["adc_reference"]),
        scale_known=name == "flex_code" or "adc_reference" in recording.conditions,
        adc_bits=int(recording.condition("adc_bits", CONVERTER["adc_bits"])),
        polarity=None if polarity is None else (-1 if float(polarity) < 0.0 else 1),
        gated=bool(told.get("gated", 0.0)),
        has_film=_name(stream, "pvdf") in stream.channels,
        on_road=recording.conditions.get("bench_or_road", "road" if "vehicle_speed" in recording else "") == "road",
        sensor_resistance=None if R0 is None else float(R0),
        loss=layout.loss,
        quality=(*_findings(recording.run, layout), *_film_elsewhere(recording, stream)),
        layout=layout,
        stream=stream,
        assumed=assumed(recording.conditions, name == "flex_code"),
    )


def _name(stream: Stream, sensor: str) -> str:
    return f"{sensor}_code" if f"{sensor}_code" in stream.channels else f"{sensor}_voltage"


def _film_elsewhere(recording: Recording, stream: Stream) -> tuple[QualityFinding, ...]:
    """Say that a film which is not in the table of the flex sensor is not used."""
    name = next((n for n in ("pvdf_code", "pvdf_voltage") if n in recording and n not in stream.channels), None)
    if name is None or _name(stream, "pvdf") in stream.channels:
        return ()
    said = (
        f"{name} is not in the table of the flex sensor ('{stream.name}') and has another time: the film is not used."
    )
    return (QualityFinding("warning", said, recording.run, name),)


def _findings(run: str, layout: Layout) -> tuple[QualityFinding, ...]:
    """Say what the counters tell."""
    found = [QualityFinding("warning", f"{remark}.", run, layout.by) for remark in layout.remarks]
    loss = layout.loss
    if layout.untimed:
        found.append(
            QualityFinding(
                "error",
                f"radio packet id of {layout.counter_bits} bits cannot count losses, and the log's time does not know of them "
                "either: speeds and moments cannot be told. Log sample_index, a longer counter or the time of arrival.",
                run,
                "packet_counter",
            )
        )
    elif 0 < layout.counter_bits <= 4:
        use = "; sample_index places the samples instead" if layout.by == "sample_index" else ""
        found.append(
            QualityFinding(
                "warning",
                f"radio packet id of {layout.counter_bits} bits cannot count losses, timing unsafe beyond "
                f"{2**layout.counter_bits - 1} lost packets{use}.",
                run,
                "packet_counter",
            )
        )
    if layout.by == "time":
        found.append(
            QualityFinding(
                "warning",
                "neither sample_index nor packet_counter is in the log: lost samples are told by gaps of its time only.",
                run,
                "time",
            )
        )
    if layout.repeated:
        found.append(
            QualityFinding("note", f"{counted(layout.repeated, 'sample')} came twice: taken once.", run, layout.by)
        )
    if math.isfinite(loss.share) and loss.share > 0.05:
        found.append(
            QualityFinding(
                "warning",
                f"{loss.share:.1%} of the packets lost ({loss.packets} of them, longest gap {loss.longest * 1e3:.0f} ms): "
                "radio shadow of the rim?",
                run,
                "packet_counter" if layout.counter_bits else layout.by,
            )
        )
    return tuple(found)
