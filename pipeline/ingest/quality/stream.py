"""All checks of one stream: its sampling, each of its channels, and what only their comparison tells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.ingest.mapping import SelectedChannel
from pipeline.ingest.quality.channel import ChannelQuality, ChannelSummary
from pipeline.ingest.quality.constant import Stretch
from pipeline.ingest.quality.sampling import Sampling
from pipeline.recording import QualityFinding


@dataclass(frozen=True)
class StreamSummary:
    """What `rigfit check` shows of a stream: samples, rate (Hz), first and last time (s), its channels."""

    n: int
    rate: float
    start: float
    end: float
    channels: tuple[ChannelSummary, ...]


class StreamQuality:
    """Accumulates the checks of one stream, block by block.

    Parameters
    ----------
    channels
        The channels of the stream; words are counted, not checked.
    """

    def __init__(self, channels: Sequence[SelectedChannel]) -> None:
        self.sampling = Sampling()
        self._texts = [channel for channel in channels if channel.unit == ""]
        self._is_list = any(channel.lists_entries for channel in channels)
        self._channels = [ChannelQuality(channel, self._is_list) for channel in channels if channel.unit != ""]
        self._order = [channel.name for channel in channels]
        self._losses_counted = any(channel.counts_samples for channel in channels)

    def add(self, time: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Take the next block: time (n,), s, strictly increasing, and the channels in SI."""
        self.sampling.add(time)
        if self._is_list:
            time = time.round(4)  # entries of one time stand microseconds apart, which is no time to name
        for quality in self._channels:
            quality.add(columns[quality.channel.name], time)

    def finish(self) -> None:
        """Judge what waited for more samples; call it once, before findings are asked for."""
        self.sampling.finish()
        for quality in self._channels:
            quality.finish()

    def empty_channels(self) -> list[SelectedChannel]:
        """Return the channels of numbers that have no value in any sample."""
        return [quality.channel for quality in self._channels if quality.present == 0]

    def findings(self) -> list[QualityFinding]:
        """Return what is to be said, without run."""
        found = [] if self._is_list else self.sampling.findings(self._losses_counted)
        for quality in self._channels:
            found += quality.findings(self._swapped_with(quality))
        return [*found, *self._said_stuck()]

    def _swapped_with(self, one: ChannelQuality) -> str:
        """Return the channel that would be plausible in the place of `one`, which is not, and `one` in its."""
        limit = one.channel.limit
        if limit is None or not one.reached > 3.0 * limit:
            return ""
        fitting = [
            other.channel.name
            for other in self._channels
            if other.channel.limit is not None
            and 0 < other.reached <= limit
            and one.reached <= other.channel.limit
            and other.channel.unit != one.channel.unit
        ]
        return fitting[0] if len(fitting) == 1 else ""

    def summary(self) -> StreamSummary:
        """Return the numbers of the stream and of its channels, in the order of the declarations."""
        summaries = {quality.channel.name: quality.summary() for quality in self._channels}
        nan = float("nan")
        for text in self._texts:
            summaries[text.name] = ChannelSummary(text.name, "", text.raw.name, text.raw.unit, nan, nan, nan, 0)
        sampling = self.sampling
        ordered = tuple(summaries[name] for name in self._order)
        return StreamSummary(sampling.n, sampling.rate, sampling.first, sampling.last, ordered)

    def _said_stuck(self) -> list[QualityFinding]:
        """Say which channels stood still; where all did at the same time, the logger did."""
        stuck = {quality.channel.name: quality.stuck() for quality in self._channels}
        moving = [quality for quality in self._channels if not quality.is_dead and quality.present > 1]
        said: list[QualityFinding] = []
        for quality in moving:
            for stretch in stuck[quality.channel.name][:1]:
                name = quality.channel.name
                together = [n for n, others in stuck.items() if any(_overlap(stretch, other) for other in others)]
                if len(moving) > 1 and len(together) == len(moving):
                    message = (
                        f"all channels stand still from {stretch.start:.6g} s to {stretch.end:.6g} s "
                        f"({stretch.length} samples): the logger repeated old values."
                    )
                    said.append(QualityFinding("warning", message, span=(stretch.start, stretch.end)))
                    return said
                times = len(stuck[name])
                more = f", and {times - 1} more times" if times > 1 else ""
                message = (
                    f"{name} is stuck at {stretch.value:.4g} {quality.channel.unit} from {stretch.start:.6g} s to "
                    f"{stretch.end:.6g} s ({stretch.length} samples){more}."
                )
                said.append(QualityFinding("warning", message, channel=name, span=(stretch.start, stretch.end)))
        return said


def of_run(findings: Sequence[QualityFinding], run: str) -> list[QualityFinding]:
    """Return findings with the run that they belong to."""
    return [finding if finding.run else replace(finding, run=run) for finding in findings]


def _overlap(one: Stretch, other: Stretch) -> bool:
    """Tell whether two stretches share four fifths of the longer one."""
    shared = min(one.end, other.end) - max(one.start, other.start)
    return shared >= 0.8 * max(one.end - one.start, other.end - other.start)
