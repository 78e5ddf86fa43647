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

# A silence from here on (s) is left out between two pieces instead of filled with NaN.
_SILENCE = 10.0
# So many equal codes at an end of the scale are clipped.
_CLIPPED = 3
# So many samples in a row at the highest or lowest volts of all are flat, where the scale of the converter is not stated.
_FLAT = 20
# So near to 0 V or to the supply the divider has lost its sensor.
_OPEN = 0.005
_TOLD = ("sample_rate", "frames_per_packet", "counter_bits", "gated")


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the log on the even grid.

    Attributes
    ----------
    first, begins, rate
        Number of its first sample, the moment of that (s), samples per second.
    flex, film
        V, shape (n,), NaN where lost or clipped; film None where there is none.
    clipped
        Whether the flex sensor was at an end of the scale, shape (n,); None where it never was.
    film_clipped
        The same of the film.
    """

    first: int
    begins: float
    rate: float
    flex: np.ndarray
    film: np.ndarray | None
    clipped: np.ndarray | None = None
    film_clipped: np.ndarray | None = None

    @property
    def time(self) -> np.ndarray:
        """Moment of each sample, s, shape (n,)."""
        return np.asarray(self.begins + np.arange(self.flex.size) / self.rate)


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
        gatherer = _Gatherer(self, max(int(seconds * self.rate), 1))
        row = 0
        for time, values in self.stream.blocks(names):
            volts = [factor * np.asarray(v, dtype=float) for v, factor in zip(values, scale, strict=True)]
            yield from gatherer.add(row, time.size, volts)
            row += time.size
        yield from gatherer.rest()


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
            f"{', '.join(c.name for c in recording) or 'no channel'}. Name the flex sensor's channel in the recipe."
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
        quality=_findings(recording.run, layout),
        layout=layout,
        stream=stream,
        assumed=assumed(recording.conditions, name == "flex_code"),
    )


def _name(stream: Stream, sensor: str) -> str:
    return f"{sensor}_code" if f"{sensor}_code" in stream.channels else f"{sensor}_voltage"


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


class _Gatherer:
    """Puts rows on the grid; gives a piece when it is full or a long silence begins."""

    def __init__(self, device: Device, size: int) -> None:
        self._device, self._layout, self._size = device, device.layout, size
        self._silence = int(_SILENCE * device.rate)
        self._channels = 2 if device.has_film else 1
        self._run = 0
        self._first = 0
        self._filled, self._begun = 0, False
        self._buffer = np.full((self._channels, size), np.nan)

    def add(self, row: int, rows: int, volts: list[np.ndarray]) -> Iterator[Piece]:
        starts, places = self._layout.rows, self._layout.places
        done = 0
        while done < rows:
            ends = int(starts[self._run + 1]) if self._run + 1 < starts.size else self._layout.size
            if row + done >= ends:
                self._run += 1
                continue
            place = int(places[self._run]) + row + done - int(starts[self._run])
            count = min(ends - row - done, rows - done)
            while count:
                silent = place - self._first - self._filled > self._silence
                if self._filled and silent:
                    yield self._piece(place)
                if not self._begun or silent:
                    self._first, self._begun = place, True
                while place >= self._first + self._size:
                    yield self._piece(place)
                at = place - self._first
                if at < 0:  # Late, and its piece is given already.
                    skipped = min(count, -at)
                    place, done, count = place + skipped, done + skipped, count - skipped
                    continue
                now = min(count, self._size - at)
                for channel, values in enumerate(volts):
                    self._buffer[channel, at : at + now] = values[done : done + now]
                self._filled = max(self._filled, at + now)
                place, done, count = place + now, done + now, count - now

    def rest(self) -> Iterator[Piece]:
        if self._filled:
            yield self._piece(self._first + self._filled)

    def _piece(self, following: int) -> Piece:
        """Return what is gathered; a short gap up to the sample `following` belongs to it."""
        gap = following - self._first - self._filled
        length = self._filled if gap > self._silence else min(self._filled + gap, self._size)
        values, device = self._buffer[:, :length], self._device
        if device.scale_known:
            ends = [(0.5 * device.step, device.adc_full_scale - 1.5 * device.step)] * self._channels
        else:
            ends = [_flat_ends(row) for row in values]
        ends[0] = (
            max(ends[0][0], _OPEN * device.supply_voltage),
            min(ends[0][1], (1.0 - _OPEN) * device.supply_voltage),
        )
        clipped = [_clipped(row, *end) for row, end in zip(values, ends, strict=True)]
        for row, mask in zip(values, clipped, strict=True):
            if mask is not None:
                row[mask] = np.nan
        piece = Piece(
            self._first,
            self._layout.begins + self._first / device.rate,
            device.rate,
            values[0],
            values[1] if self._channels == 2 else None,
            clipped[0],
            clipped[1] if self._channels == 2 else None,
        )
        self._buffer = np.full((self._channels, self._size), np.nan)
        self._first += length
        self._filled = 0
        return piece


def _flat_ends(volts: np.ndarray) -> tuple[float, float]:
    """Return below and above which volts are at an end of a scale that nobody stated: where they stay at their extreme."""
    least, most = -math.inf, math.inf
    valid = volts[np.isfinite(volts)]
    if valid.size:
        low, high = float(valid.min()), float(valid.max())
        slack = 1e-6 * max(high - low, 1e-3)
        if _longest(valid <= low + slack) >= _FLAT:
            least = low + 2.0 * slack
        if _longest(valid >= high - slack) >= _FLAT:
            most = high - 2.0 * slack
    return least, most


def _longest(mask: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _clipped(volts: np.ndarray, least: float, most: float) -> np.ndarray | None:
    """Return which samples are beyond the ends of the scale, at least three in a row; None where there are none."""
    at_end = (volts < least) | (volts > most)
    if not at_end.any():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_end, [False]]).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]
    mask = np.zeros(volts.size, dtype=bool)
    for begin, end in zip(begins[ends - begins >= _CLIPPED], ends[ends - begins >= _CLIPPED], strict=True):
        mask[begin:end] = True
    return mask if mask.any() else None
