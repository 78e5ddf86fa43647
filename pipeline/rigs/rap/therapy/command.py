"""What the ultrafiltrate pump was asked for between two moments: its command, or the set-point in its place (rap.md, 3.7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.tables import Signal

COMMAND, SET_POINT = "uf_pump_command", "uf_flow_set"
_LONG_GAP = 30.0
_SAMPLED = 2.0


@dataclass(frozen=True, eq=False)
class Command:
    """Rate asked for, held from `time` (s) on: `rate` (n,) in m^3/s; `source` is the name of the channel."""

    time: np.ndarray
    rate: np.ndarray
    source: str
    problems: tuple[QualityFinding, ...]

    def volume(self, time: np.ndarray) -> np.ndarray:
        """Return the volume asked for since the first command, m^3, at `time`, shape (n,); nothing before it."""
        whole = np.concatenate([[0.0], np.cumsum(self.rate[:-1] * np.diff(self.time))])
        at = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 1)
        return np.asarray(whole[at] + self.rate[at] * np.maximum(time - self.time[at], 0.0))

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return the rate asked for at `time`, m^3/s, shape (n,); 0 before the first command."""
        at = np.searchsorted(self.time, time, side="right") - 1
        return np.where(at >= 0, self.rate[np.maximum(at, 0)], 0.0)

    @property
    def started(self) -> float | None:
        """Moment of the first rate over zero, s."""
        on = np.flatnonzero(self.rate > 0.0)
        return float(self.time[on[0]]) if on.size else None


def command_of(
    command: Signal | None, set_point: Signal | None, *, stopped: Sequence[tuple[float, float]] = ()
) -> Command:
    """Return what the pump was asked for.

    Parameters
    ----------
    command, set_point
        `uf_pump_command` and `uf_flow_set`; the set-point stands in where the command is missing.
    stopped
        Spans (s) in which the ultrafiltrate pump stood still, from the states; the set-point does not show them.

    Raises
    ------
    InputError
        If the run has neither.
    """
    problems: list[QualityFinding] = []
    chosen = command if command is not None else set_point
    if chosen is None:
        raise InputError(
            f"the run has neither '{COMMAND}' nor '{SET_POINT}', so between echoes nobody knows how fast the tank fills. "
            "Log what the ultrafiltrate pump is asked for."
        )
    source = COMMAND if command is not None else SET_POINT
    time, rate = chosen.time, chosen.values
    if command is None:
        text = f"'{COMMAND}' is missing; the set-point '{SET_POINT}' stands in. Where the device regulates, the pump's gain then holds the regulation too."
        problems.append(QualityFinding("warning", text, channel=SET_POINT))
        time, rate = _paused(time, rate, stopped)
    if np.any(rate < 0.0):
        text = f"{chosen.name} is negative in {int((rate < 0.0).sum())} samples; the pump cannot run backwards, 0 is taken there. Check its sign."
        problems.append(QualityFinding("warning", text, channel=chosen.name))
        rate = np.maximum(rate, 0.0)
    steps = np.diff(time)
    if command is not None and time.size > 2 and float(np.median(steps)) <= _SAMPLED:
        # Eq. 9: a row of a sampled command is what was asked for up to it; rows written on a change alone hold from them on.
        time = time - float(np.median(steps))
    gaps = np.flatnonzero(steps > max(_LONG_GAP, 5.0 * float(np.median(steps)))) if time.size > 2 else np.zeros(0, int)
    for i in gaps:
        text = f"{chosen.name} has a gap of {time[i + 1] - time[i]:.0f} s; the value before it is held."
        problems.append(QualityFinding("warning", text, channel=chosen.name, span=(float(time[i]), float(time[i + 1]))))
    return Command(time, rate, source, tuple(problems))


def _paused(
    time: np.ndarray, rate: np.ndarray, stopped: Sequence[tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the set-point with zeros in the spans in which the pump stood still."""
    spans = [
        (max(a, float(time[0])), min(b, float(time[-1]) + 1.0)) for a, b in stopped if a <= time[-1] and b > time[0]
    ]
    if not spans:
        return time, rate
    edges = np.array([t for span in spans for t in span])
    held = rate[np.clip(np.searchsorted(time, edges, side="right") - 1, 0, time.size - 1)]
    merged = np.concatenate([time, edges])
    values = np.concatenate([rate, held])
    order = np.argsort(merged, kind="stable")
    merged, values = merged[order], values[order]
    for begin, end in spans:
        values[(merged >= begin) & (merged < end)] = 0.0
    return merged, values
