"""What a drive's log holds beside the transmitter: reference channels of the car, each averaged to 100 Hz at most.

Nothing is aligned or judged here. The transmitter's own table is read by `passages.device`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding, Recording, Stream

REFERENCES = (
    "vehicle_speed", "road_speed", "vertical_load", "longitudinal_force", "longitudinal_acceleration",
    "lateral_acceleration", "steering_angle",
)  # fmt: skip
# References change slowly; what comes faster is averaged to about this rate, Hz, so that memory does not follow the log.
_RATE = 100.0


@dataclass(frozen=True, eq=False)
class ReferenceChannel:
    """One reference channel: time (s, of its own table's clock) and values (SI), shape (n,) each; its table's name."""

    time: np.ndarray
    values: np.ndarray
    table: str


@dataclass(frozen=True, eq=False)
class References:
    """The reference channels of one drive by name, and what was noticed of them."""

    channels: dict[str, ReferenceChannel]
    findings: tuple[QualityFinding, ...] = ()

    @property
    def speed(self) -> ReferenceChannel | None:
        """Speed of the car, m/s; None where there is none."""
        return self.channels.get("vehicle_speed") or self.channels.get("road_speed")

    def get(self, name: str) -> ReferenceChannel | None:
        """Return a channel, None where there is none."""
        return self.channels.get(name)


def references_of(recording: Recording) -> References:
    """Return the reference channels of a drive; one without a single number is left out and told."""
    found: dict[str, ReferenceChannel] = {}
    said = []
    for stream in recording.streams.values():
        names = [name for name in REFERENCES if name in stream.channels]
        if not names:
            continue
        for name, (time, values) in _thinned(stream, names).items():
            if time.size:
                found.setdefault(name, ReferenceChannel(time, values, stream.name))
            else:
                message = f"{name} holds no number; there is no such reference."
                said.append(QualityFinding("warning", message, recording.run, name))
    return References(found, tuple(said))


def _thinned(stream: Stream, names: list[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return time and values of each channel, without what is no number."""
    rate = (stream.size - 1) / stream.duration if stream.duration > 0.0 else 1.0
    step = max(1, int(rate / _RATE))
    times: dict[str, list[np.ndarray]] = {name: [] for name in names}
    values: dict[str, list[np.ndarray]] = {name: [] for name in names}
    for time, columns in stream.blocks(names):
        for name, column in zip(names, columns, strict=True):
            known = np.isfinite(column)
            t, x = time[known], column[known]
            whole = t.size // step * step
            for part, kept in ((t, times), (x, values)):
                kept[name].append(part[:whole].reshape(-1, step).mean(axis=1))
    return {name: (np.concatenate(times[name]), np.concatenate(values[name])) for name in names}
