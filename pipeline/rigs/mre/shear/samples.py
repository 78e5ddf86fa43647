"""Displacement and force of one run as samples fit to use, or why they are not (mre.md section 8).

Looks at samples only: dead, stuck, clipped channels and lone spikes. What the loop tells is
`loops`' business.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.ingest.quality.constant import ConstantStretches, Stretch
from pipeline.ingest.quality.window import Window
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.pads import Pads
from pipeline.signals.resampling import interpolated

_FEWEST = 20  # samples of both channels
# Of a record that is stuck for longer than this share nothing is used.
_STUCK_SHARE = 0.2
# Of a rounded top the highest step of the converter holds at most three times as many samples as the mean of
# the next three below it: clipping is more than that, and more than these.
_FLAT_SHARE, _FLAT_SAMPLES, _FLAT_CROWDED = 0.02, 6, 6.0
# So many in a row show it where leaving out what is not clipped would do no harm.
_FEW_FLAT = 3
# What moves less or reaches more than this (m, N) is no signal of any sensor.
_LEAST, _LARGEST = 1e-15, 1e12
# A spike is at most this many samples long, this many sigma and this share of the range high.
_SPIKE_SAMPLES, _SPIKE_SIGMA, _SPIKE_SHARE = 2, 10.0, 0.1


@dataclass(frozen=True, eq=False)
class Series:
    """Valid samples of one run: time (s), displacement (m), force (N), shape (n,) each.

    `counts` is False where the force was not measured (stuck, clipped) though the displacement was.
    """

    time: np.ndarray
    x: np.ndarray
    F: np.ndarray
    counts: np.ndarray

    def between(self, start: float, end: float) -> Series:
        """Return the samples from `start` to `end` (s)."""
        return self._where((self.time >= start) & (self.time <= end))

    def measured(self) -> Series:
        """Return the samples where both were measured."""
        return self._where(self.counts)

    def without(self, *, force: np.ndarray, rows: np.ndarray) -> Series:
        """Return the series without some `rows`, and with the force not counted in others; (n,) each."""
        return replace(self, counts=self.counts & ~force)._where(~rows)

    def _where(self, kept: np.ndarray) -> Series:
        return Series(self.time[kept], self.x[kept], self.F[kept], self.counts[kept])

    def without_spikes(self) -> tuple[Series, dict[str, int]]:
        """Return the series without lone wild samples, and how many there were in each channel."""
        wild = {"displacement": _spikes(self.x), "force": _spikes(self.F)}
        counts = {name: int(there.sum()) for name, there in wild.items() if there.any()}
        return self._where(~(wild["displacement"] | wild["force"])), counts


class UnfitError(Exception):
    """The run cannot be used: the reason, and the channel that it lies in."""

    def __init__(self, reason: str, channel: str | None = None) -> None:
        super().__init__(reason)
        self.channel = channel


def samples_of(recording: Recording, say: Callable[[QualityFinding], None]) -> Series:
    """Return the samples where displacement and force have a value; what is mended is said.

    Raises
    ------
    UnfitError
        If a channel is dead or stuck for long, or too little is left.
    """
    run = recording.run
    time, x = recording.signal("displacement")
    force_time, F = recording.signal("force")
    if recording.stream_of("displacement") is not recording.stream_of("force"):
        slow = "force" if _step(force_time) > _step(time) else "displacement"
        at = force_time if slow == "force" else time
        x, F, time = _at(time, x, at), _at(force_time, F, at), at
        other = "displacement" if slow == "force" else "force"
        message = f"force and displacement have clocks of their own; {other} was interpolated at the samples of {slow}."
        say(QualityFinding("note", message, run, other))
    for name, values in (("displacement", x), ("force", F)):
        if values.size and not np.isfinite(values).any():
            raise UnfitError(f"the channel {name} holds no number", name)
    valid = np.isfinite(x) & np.isfinite(F)
    if valid.sum() < _FEWEST:
        raise UnfitError(f"only {int(valid.sum())} samples have both displacement and force; {_FEWEST} are needed")
    series = Series(time[valid], x[valid], F[valid], np.ones(int(valid.sum()), dtype=bool))
    for name, values in (("displacement", series.x), ("force", series.F)):
        if np.ptp(values) == 0:
            raise UnfitError(f"the channel {name} is dead: every sample is {values[0]:.6g}", name)
        if not is_signal(values):
            size = float(np.abs(values).max())
            raise UnfitError(f"the {name} reaches {size:.3g} in SI units, which no sensor gives: check its unit", name)
    series, counts = series.without_spikes()
    for name, count in counts.items():
        message = f"{count} lone wild sample{'s' if count > 1 else ''} of {name} left out."
        say(QualityFinding("note", message, run, name))
    return _without_stuck(series, run, say)


def _step(time: np.ndarray) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _at(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return a signal at other times, NaN beyond its ends and in gaps; where it stands still it goes on to do so."""
    if at is time:
        return values
    if time.size < 2:
        return np.full(at.size, np.nan)
    found = interpolated(time, values, at)
    after = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    level = values[after]
    return np.where((values[after - 1] == level) & np.isfinite(found), level, found)


def _without_stuck(series: Series, run: str, say: Callable[[QualityFinding], None]) -> Series:
    """Leave out where a sensor hung: the rows where the displacement did, the force alone where it did.

    Raises
    ------
    UnfitError
        If that is too large a part of the record.
    """
    lost = {}
    for name, unit, values in (("displacement", "m", series.x), ("force", "N", series.F)):
        hung = np.zeros(series.time.size, dtype=bool)
        stretches = _stuck(series.time, values)
        for one in stretches:
            hung |= (series.time >= one.start) & (series.time <= one.end)
        lost[name] = hung
        share = float(hung.mean())
        if share > _STUCK_SHARE:
            raise UnfitError(f"the {name} is stuck for {100 * share:.0f} % of the record", name)
        if stretches:
            longest = max(stretches, key=lambda one: one.length)
            more = f", and {len(stretches) - 1} more times" if len(stretches) > 1 else ""
            message = (
                f"the {name} is stuck at {longest.value:.4g} {unit} from {longest.start:.4g} to {longest.end:.4g} s{more}; "
                f"{100 * share:.2g} % of the record do not enter."
            )
            say(QualityFinding("warning", message, run, name, (longest.start, longest.end)))
    return series.without(force=lost["force"], rows=lost["displacement"])


def _stuck(time: np.ndarray, values: np.ndarray) -> list[Stretch]:
    """Return the stretches in which a signal was cut off and stood still, but for flat tops.

    Shorter ones than ingest speaks of are left out as well: a sample less costs nothing.
    """
    found = ConstantStretches()
    found.add(Window(values, (time[:0], time)))
    found.finish()
    ends = (values.min(), values.max())
    return sorted((s for s in found.longest if s.is_freeze and s.value not in ends), key=lambda s: s.start)


def clipping(values: np.ndarray) -> tuple[float, float] | None:
    """Return level and share of samples of the flattened side of a clipped signal, None where it is not."""
    found = None
    for level, there in _crowded_ends(values, _FLAT_SAMPLES):
        share = float(there.mean())
        if share > _FLAT_SHARE and (found is None or share > found[1]):
            found = (level, share)
    return found


def flat_tops(values: np.ndarray) -> np.ndarray:
    """Tell which samples lie on flat tops, however few, of a signal that is clipped; shape of `values`."""
    flat = np.zeros(values.size, dtype=bool)
    for _, there in _crowded_ends(values, _FEW_FLAT):
        flat |= there
    return flat


def _crowded_ends(values: np.ndarray, in_a_row: int) -> list[tuple[float, np.ndarray]]:
    """Return the extreme levels that a clipped signal has, and which samples lie there.

    The extreme value must repeat, in a row and far more often than the levels next to it: a coarse
    converter repeats the top of a sine as well, but its next steps too.
    """
    found = []
    for side in (1.0, -1.0):
        levels, counts = np.unique(side * values, return_counts=True)
        there = side * values == levels[-1]
        crowded = counts[-1] > _FLAT_CROWDED * max(float(counts[-4:-1].mean()), 1.0) if levels.size > 4 else False
        if crowded and _longest(there) >= in_a_row:
            found.append((float(side * levels[-1]), there))
    return found


def _longest(there: np.ndarray) -> int:
    """Return the length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(int)))
    return int(np.max(edges[1::2] - edges[::2])) if edges.size else 0


def _spikes(values: np.ndarray) -> np.ndarray:
    """Tell lone samples that stand far off the running median of five, shape of `values`."""
    if values.size < 100:
        return np.zeros(values.size, dtype=bool)
    padded = np.r_[values[1], values[0], values, values[-1], values[-2]]
    off = np.abs(values - np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))
    low, high = np.quantile(values, [0.02, 0.98])
    # Of the second differences: in the first, a fast motion looks like noise that would hide a spike.
    spread = 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6)
    wild = off > max(_SPIKE_SIGMA * spread, _SPIKE_SHARE * float(high - low))
    # A turning point between few samples, or a steep step, stands off on more of them.
    longest = _longest(wild)
    return np.asarray(wild) if 0 < longest <= _SPIKE_SAMPLES and wild.mean() < 0.01 else np.zeros(values.size, bool)


def is_signal(values: np.ndarray) -> bool:
    """Tell whether values move within what any sensor of displacement or force can give, in SI."""
    return bool(values.size) and bool(np.ptp(values) > _LEAST and np.abs(values).max() < _LARGEST)


def number_of(recording: Recording, name: str) -> float | None:
    """Return a condition that is a number, else None."""
    value = recording.conditions.get(name)
    return float(value) if isinstance(value, float | int) and not isinstance(value, bool) else None


def pads_of(recording: Recording) -> Pads | None:
    """Return the geometry of the pads, None where it is not given or cannot be."""
    diameter, height, count = (number_of(recording, name) for name in ("pad_diameter", "pad_height", "n_pads"))
    count = 2.0 if count is None else count
    if diameter is None or height is None or not min(diameter, height, count) > 0:
        return None
    return Pads(diameter, height, count)
