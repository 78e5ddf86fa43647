"""All checks of one channel of numbers, block by block, and what is said of it in the end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import counted
from pipeline.ingest.mapping import SelectedChannel
from pipeline.ingest.quality.constant import ConstantStretches, Stretch
from pipeline.ingest.quality.extremes import Extreme, FlatTops
from pipeline.ingest.quality.resolution import Resolution
from pipeline.ingest.quality.spikes import Spikes
from pipeline.ingest.quality.window import CONTEXT, Window
from pipeline.recording import Level, QualityFinding

# Units that are mistaken for one another, as (smaller, larger) of the same dimension.
_MISTAKEN = (
    ("mm", "m"), ("um", "mm"), ("um", "m"), ("cm", "m"), ("mm", "cm"), ("mm", "inch"), ("N", "kN"), ("N", "kgf"),
    ("kgf", "kN"), ("deg", "rad"), ("deg", "turn"), ("mT", "T"), ("gauss", "T"), ("mA", "A"), ("mV", "V"),
    ("Pa", "kPa"), ("kPa", "MPa"), ("Pa", "MPa"), ("kPa", "Pa"), ("Pa", "bar"), ("bar", "MPa"), ("mm/s", "m/s"),
    ("m/s^2", "g_0"), ("mm/s^2", "m/s^2"), ("rpm", "Hz"), ("rpm", "rad/s"), ("deg/s", "rad/s"), ("g", "kg"),
    ("W", "kW"), ("N*mm", "N*m"), ("N*m", "kN*m"), ("N/m", "N/mm"), ("ms", "s"), ("us", "s"), ("%", "1"),
)  # fmt: skip

# In fewer samples a flat top is as likely a coarse reading of what came to rest.
_FEWEST_TO_CLIP = 100
_MILLIMETRES_BELOW = 0.01  # m, below which a length is told in millimetres


@dataclass(frozen=True)
class ChannelSummary:
    """What `rigfit check` shows of a channel: least, mean and largest value (SI), samples without a value."""

    name: str
    unit: str
    raw_name: str
    raw_unit: str | None
    minimum: float
    mean: float
    maximum: float
    missing: int


class ChannelQuality:
    """Accumulates the checks of one channel; memory is bounded by the block."""

    def __init__(self, channel: SelectedChannel, in_list: bool = False) -> None:
        """`in_list`: the channel stands in a list of entries, where a blank is no missing sample."""
        self.channel = channel
        self._in_list = in_list
        self.n = 0
        self.missing = 0
        self._sum = 0.0
        self._gone: tuple[float, float] | None = None
        self._upper, self._lower = Extreme(upper=True), Extreme(upper=False)
        self.stretches = ConstantStretches()
        self._spikes = Spikes()
        self._resolution = Resolution()
        self._values = self._time = np.empty(0)
        self._counts = True

    def add(self, values: np.ndarray, time: np.ndarray) -> None:
        """Take the next block: values in SI (NaN where there are none) and time (s), each of shape (n,)."""
        self.n += values.size
        if self.channel.no_value is not None:
            measured = values != self.channel.no_value
            self.n -= int(np.count_nonzero(~measured))
            values, time = values[measured], time[measured]
        total = float(values.sum())
        if not math.isfinite(total):
            present = np.isfinite(values)
            gone = time[~present]
            if gone.size:
                self.missing += gone.size
                self._gone = (self._gone[0] if self._gone else float(gone[0]), float(gone[-1]))
            values, time = values[present], time[present]
            total = float(values.sum())
        if not values.size:
            return
        self._sum += total
        window = Window(np.concatenate((self._values, values)), (self._time, time))
        self._upper.add(window)
        self._lower.add(window)
        self.stretches.add(window)
        self._spikes.add(window, self._lower.level, self._upper.level)
        self._resolution.add(values)
        # Whole numbers that never fall: a counter, whose last value is where the motion ended and no limit.
        self._counts = self._counts and bool((window.steps >= 0.0).all() and (values == np.floor(values)).all())
        self._values = window.values[-CONTEXT:].copy()
        self._time = np.concatenate((self._time, time[-CONTEXT:]))[-CONTEXT:]

    def finish(self) -> None:
        """Judge what waited for more samples."""
        self.stretches.finish()
        tail = Window(self._values, (self._time, np.empty(0)))
        self._spikes.add(tail, self._lower.level, self._upper.level, last=True)

    @property
    def present(self) -> int:
        """Number of samples with a value."""
        return self.n - self.missing

    @property
    def is_dead(self) -> bool:
        """Tell whether all samples have the same value."""
        return self.present > 1 and self._upper.level == self._lower.level

    def summary(self) -> ChannelSummary:
        """Return the channel's numbers; NaN where it has no value at all."""
        low, high = (self._lower.level, self._upper.level) if self.present else (math.nan, math.nan)
        mean = self._sum / self.present if self.present else math.nan
        raw = self.channel.raw
        return ChannelSummary(self.channel.name, self.channel.unit, raw.name, raw.unit, low, mean, high, self.missing)

    def stuck(self) -> list[Stretch]:
        """Return stretches in which the channel stood still while it should not have.

        A counter stands where what it counts does: only the rig can tell that from a fault.
        """
        if self.is_dead or self.channel.may_rest or self.channel.unit == "count":
            return []
        clipped = {top.level for top in self._clipped()}
        return [stretch for stretch in self.stretches.stuck() if stretch.value not in clipped]

    def _clipped(self) -> list[FlatTops]:
        if self.present < _FEWEST_TO_CLIP or self.channel.may_rest:
            return []
        return [top for top in (self._lower.clipped(), self._upper.clipped()) if top]

    @property
    def reached(self) -> float:
        """The largest magnitude, SI; NaN where there is no value."""
        return max(abs(self._upper.level), abs(self._lower.level)) if self.present else math.nan

    def findings(self, swapped_with: str = "") -> list[QualityFinding]:
        """Return what is to be said, at most one finding of each kind; stuck stretches are said by the stream.

        `swapped_with` is the channel whose samples these would fit, if any.
        """
        if not self.n:
            return []
        if not self.present and self._in_list and not self.channel.required:
            return []
        if not self.present:
            level: Level = "error" if self.channel.required else "warning"
            return [self._said(level, "has no value (NaN) in any sample.")]
        said = [*self._said_missing(), *self._said_limit(swapped_with)]
        if self.is_dead:
            return [*said, self._said_dead()]
        return [*said, *self._said_clipped(), *self._said_spikes(), *self._said_resolution()]

    def _said(self, level: Level, message: str, span: tuple[float, float] | None = None) -> QualityFinding:
        return QualityFinding(level, f"{self.channel.name} {message}", channel=self.channel.name, span=span)

    def _value(self, value: float) -> str:
        if self.channel.unit == "m" and 0.0 < abs(value) < _MILLIMETRES_BELOW:
            return f"{1e3 * value:.5g} mm"
        return f"{value:.5g} {self.channel.unit}".removesuffix(" 1")

    def _said_missing(self) -> list[QualityFinding]:
        if self._gone is None or self._in_list:
            return []
        part = self.missing / self.n
        level: Level = "note" if part <= 1e-3 else "warning"
        count = counted(self.missing, "sample")
        place = f"at {self._gone[0]:.6g} s" if self.missing == 1 else f"first at {self._gone[0]:.6g} s"
        return [self._said(level, f"has no value in {count} (NaN, {100 * part:.2g} %), {place}.", self._gone)]

    def _said_dead(self) -> QualityFinding:
        what = f"is {self._value(self._upper.level)} in every sample: a dead channel, or a set value."
        return self._said("warning" if self.channel.required else "note", what)

    def _said_clipped(self) -> list[QualityFinding]:
        tops = self._clipped()
        if not tops or self._counts:
            return []
        levels = " and ".join(self._value(top.level) for top in tops)
        samples = sum(top.samples for top in tops)
        span = (min(top.start for top in tops), max(top.end for top in tops))
        places = counted(sum(top.tops for top in tops), "flat top")
        return [
            self._said(
                "warning",
                f"is clipped (saturated) at {levels}: it stays there for {samples} samples "
                f"({100 * samples / self.n:.2g} %) in {places}, first at {span[0]:.6g} s. The range of sensor or amplifier was too small.",
                span,
            )
        ]

    def _said_spikes(self) -> list[QualityFinding]:
        spikes = self._spikes
        if not spikes.isolated:
            return []
        if spikes.count == 1:
            where = f"has a spike (outlier) at {spikes.first:.6g} s, {self._value(spikes.largest)} high."
        else:
            where = (
                f"has {spikes.count} spikes (outliers), first at {spikes.first:.6g} s, "
                f"the largest {self._value(spikes.largest)} high at {spikes.at_largest:.6g} s."
            )
        return [self._said("warning", where, (spikes.at_largest, spikes.at_largest))]

    def _said_resolution(self) -> list[QualityFinding]:
        """Say where steps hide the signal; noise that is larger than they are makes them harmless."""
        step = self._resolution.step()
        if step is None or self.stretches.n_still < 0.3 * self.present:
            return []
        levels = round((self._upper.level - self._lower.level) / step) + 1
        if levels > 100:
            return []
        return [self._said("note", f"comes in steps of {self._value(step)}, only {levels} of them over its range.")]

    def _said_limit(self, swapped_with: str) -> list[QualityFinding]:
        limit = self.channel.limit
        if limit is None:
            return []
        reached = self.reached
        if reached <= limit:
            return []
        guess = "; check its unit and its calibration."
        if reached > 3.0 * limit:
            guess = _mistaken_unit(self.channel, reached, limit) or guess
        if swapped_with:
            guess = f"; it looks swapped with '{swapped_with}', whose numbers would fit here."
        return [
            self._said(
                "warning", f"reaches {self._value(reached)}, more than the plausible {self._value(limit)}{guess}"
            )
        ]


def _mistaken_unit(channel: SelectedChannel, reached: float, limit: float) -> str:
    """Say which unit the numbers look like, if that of the log is a usual mistake for it; else nothing."""
    from pipeline.recording.units import conversion

    taken_as = channel.taken_as or channel.unit
    factor = conversion(taken_as, channel.unit).factor
    for smaller, larger in _MISTAKEN:
        if larger == taken_as or (larger, taken_as) in {("1", "-"), ("inch", "in")}:
            ratio = factor / conversion(smaller, channel.unit).factor
            if ratio > 1.0 and limit / 1e5 < reached / ratio <= limit:
                return f"; it looks like {smaller} labelled as {taken_as} (factor {ratio:.4g})."
    return ""
