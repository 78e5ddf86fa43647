"""Levels of the torques where the shaft stands or runs steadily: which standing shaft is held, which running one is loaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pipeline.rigs.gearbox.record import Record, Signal
from pipeline.rigs.gearbox.stages.motion import Span
from pipeline.rigs.gearbox.stages.stage import Problem, Stage, StageName
from pipeline.signals.periodogram import block_means

_RATE = 100.0
# Above this share of the way from the lowest to the highest level a standing shaft is held under torque.
_LOADED = 0.25
# The lock breaks at this many times the torque of FOS at the least, within so many seconds of the stop.
_PEAK, _NEAR = 1.2, 0.5
# Without mesh noise the input stands too: vibration above 20 Hz within this factor of that in FOS.
_QUIET, _HIGH_PASS = 1.25, 0.05
# Mesh noise elsewhere in the run, this strong for so long (s), is no stall's: the clocks of the boards do not agree.
_NOISY, _ELSEWHERE = 2.0, 1.0
# A stand shorter than that (s) goes with a step of the input torque by this share of that of FOS, or is none.
_HELD, _DROP = 0.5, 0.15
# The lock breaks this long before the output stands at the most, s.
_BREAKS = 2.0
# An input that is measured stands below this share of its top speed.
_TURNS = 0.05
# A loaded stretch of FOS: torque above the unloaded level by this share and so many sigmas, so long (s).
_STEP, _SIGMAS, _LONG, _BLOCK = 0.2, 6.0, 0.6, 0.25


@dataclass(frozen=True, eq=False)
class Levels:
    """Input torque averaged to 100 Hz, and how restless the vibration is; shape (n,) and (m,)."""

    time: np.ndarray
    torque_in: np.ndarray
    vibration: Signal | None
    speed_in: Signal | None = None

    def of(self, span: Span | Stage, trim: float = 0.2) -> float:
        """Return the median input torque of the middle of a span, N m; NaN where there is none."""
        cut = min(trim * (span.end - span.start), 0.5)
        inside = self.torque_in[(self.time >= span.start + cut) & (self.time <= span.end - cut)]
        return float(np.median(inside)) if inside.size else float("nan")

    def split(self, spans: Sequence[Span]) -> list[Span]:
        """Part a stand at the time from which the input torque that held it is gone: the motor was switched off."""
        base, _, way = self._scale(spans)
        out: list[Span] = []
        for i, span in enumerate(spans):
            inside = np.flatnonzero((self.time >= span.start) & (self.time <= span.end))
            loaded = inside[(self.torque_in[inside] - base) / way > _LOADED]
            end = float(self.time[loaded[-1]]) if loaded.size else span.end
            held = bool(loaded.size) and loaded.size > 0.8 * (loaded[-1] - inside[0] + 1)
            if span.state == "zero" and i and held and end - span.start > _LONG and span.end - end > _LONG:
                out += [replace(span, end=end), replace(span, start=end)]
            else:
                out.append(span)
        return out

    def hesitations(self, spans: Sequence[Span]) -> tuple[list[Span], list[Problem]]:
        """Give short stands amid motion to the motion where the input torque shows no step as they begin.

        An output that is stopped breaks the lock, and the input torque drops by what the peak stood above the
        slip; a counter that is frozen leaves the torque as it was.
        """
        base, running, _ = self._scale(spans)
        out: list[Span] = []
        problems = []
        for i, span in enumerate(spans):
            amid = 0 < i < len(spans) - 1 and {spans[i - 1].state, spans[i + 1].state} == {"moving"}
            if (
                span.state == "zero"
                and amid
                and span.end - span.start < _HELD
                and not self._drops(span, running - base)
            ):
                text = (
                    f"no count comes for {span.end - span.start:.2f} s and no step of the input torque goes with it: taken for a "
                    "counter that was frozen, not for a stop"
                )
                problems.append(Problem((span.start, span.end), text))
                span = replace(span, state="moving")
            if out and span.state == out[-1].state == "moving":
                span = replace(out.pop(), end=span.end)
            out.append(span)
        return out, problems

    def _drops(self, span: Span, running: float, reach: float = 0.3) -> bool:
        before = self.torque_in[(self.time >= span.start - reach) & (self.time <= span.start)]
        inside = self.torque_in[(self.time >= span.start + 0.05) & (self.time <= max(span.end, span.start + 0.1))]
        if not before.size or not inside.size:
            return True
        sign = np.sign(running) or 1.0
        return bool(np.max(sign * before) - np.median(sign * inside) > _DROP * abs(running))

    def standing(self, spans: Sequence[Span]) -> dict[int, StageName]:
        """Tell of every standing span, by its index, whether the shaft is at rest, held, or stalled with the motor.

        Held means: the input torque is above 25 % of the way from the lowest to the highest level, and it had
        a peak as the shaft stopped. A shaft that runs down stops under falling torque.
        """
        base, running, way = self._scale(spans)
        out: dict[int, StageName] = {}
        for i, span in enumerate(spans):
            if span.state != "zero":
                continue
            loaded = (self.of(span) - base) / way > _LOADED
            if loaded and i and spans[i - 1].state != "zero":
                start = spans[i - 1].start if spans[i - 1].state == "moving" else span.start
                near = (self.time >= start - _NEAR) & (self.time <= span.start + _NEAR)
                loaded = bool(np.any((self.torque_in[near] - base) * np.sign(way) > _PEAK * abs(running - base)))
            out[i] = "standstill" if not loaded else ("stall" if self._quiet(span) else "sos")
        return out

    def _scale(self, spans: Sequence[Span]) -> tuple[float, float, float]:
        """Return the level of a standstill, that of FOS, and the way from the first to the highest, N m (signed)."""
        standing = [level for s in spans if s.state == "zero" and np.isfinite(level := self.of(s))]
        steady = [level for s in spans if s.state == "nominal" and np.isfinite(level := self.of(s))]
        running = float(np.median(steady)) if steady else max(standing, key=abs, default=0.0)
        base = min(standing, key=abs, default=0.0)
        if abs(base) > 0.5 * abs(running):  # no standstill among them
            base = 0.0
        way = max((*standing, running), key=lambda level: abs(level - base)) - base
        return base, running, way if way else 1.0

    def breaks_away(self, stage: Stage, running: Stage) -> bool:
        """Tell whether the input torque fell from a peak as the output stopped: the lock broke, the input turned on."""
        base = min((self.torque_in[0], self.torque_in[-1]), key=abs)
        span = Span("zero", stage.start, stage.end, 0.0)
        return self._drops(span, self.of(running) - float(base), _BREAKS)

    def elsewhere(self, span: Span | Stage) -> tuple[float, float] | None:
        """Return where mesh noise lies that a quiet stand of the output should have, s; None where there is none."""
        if self.vibration is None or self.speed_in is not None or not self.restless(span.start, span.end) < _QUIET:
            return None
        time = self.vibration.time
        noisy = np.max(list(self.vibration.values.values()), axis=0) > _NOISY
        noisy &= (time < span.start) | (time > span.end)
        if noisy.sum() * float(np.median(np.diff(time))) < _ELSEWHERE:
            return None
        return float(time[noisy][0]), float(time[noisy][-1])

    def _quiet(self, span: Span) -> bool:
        """Tell whether the input stands too: by its speed where that is measured, else by the lack of mesh noise."""
        if self.speed_in is not None:
            inside = self.speed_in.part(span.start, span.end)["speed_in"]
            top = float(np.abs(self.speed_in["speed_in"]).max())
            if inside.size:
                return bool(np.median(np.abs(inside)) < _TURNS * top)
        return self.restless(span.start, span.end) < _QUIET and self.elsewhere(span) is None

    def restless(self, start: float, end: float) -> float:
        """Return the vibration's fast part over that of the quietest second of the run; NaN where there is none."""
        if self.vibration is None:
            return float("nan")
        cut = min(0.2 * (end - start), 0.5)
        inside = (self.vibration.time >= start + cut) & (self.vibration.time <= end - cut)
        ratios = [float(np.median(values[inside])) for values in self.vibration.values.values() if inside.any()]
        return max(ratios, default=float("nan"))


def levels_of(record: Record) -> Levels:
    """Return the block means of the input torque and the restlessness of the vibration."""
    size = max(round(record.torque.rate / _RATE), 1)
    time, torque_in = block_means(record.torque.time, record.torque["torque_in"], size)
    return Levels(
        time,
        torque_in,
        None if record.vibration is None else restlessness(record.vibration),
        record.speed_in,
    )


@lru_cache(maxsize=2)
def restlessness(vibration: Signal, block: float = _HIGH_PASS) -> Signal:
    """Return the rms of sample-to-sample differences in blocks of `block` s, over that of the quiet tenth of the run.

    Differences let shaft orders of a few hertz through at a hundredth only, mesh tones of 20 Hz and more
    and their noise in full. The result for the last logs is kept: clocks and stages both ask for it.
    """
    size = max(round(vibration.rate * block), 4)
    out = {}
    time = vibration.time[1:]
    for name, values in vibration.values.items():
        at, power = block_means(time, np.diff(values) ** 2, size)
        rms = np.sqrt(power)
        floor = float(np.percentile(rms, 10))
        if floor > 0:
            out[name] = rms / floor
    return Signal(at, out)


def loaded_spans(record: Record, span: Span, name: StageName) -> list[Stage]:
    """Split a run at nominal speed where both torques are stepped up: ``fos_loaded`` between stretches of `name`."""
    part = record.torque.part(span.start, span.end)
    size = max(round(part.rate * _BLOCK), 1) if part.time.size > 2 else 1
    if part.time.size < 8 * size:
        return [Stage(name, span.start, span.end)]
    time, levels = part.time, []
    for channel in ("torque_in", "torque_out"):
        time, blocks = block_means(part.time, part[channel], size)
        low = float(np.percentile(blocks, 25))
        sigma = 1.4826 * float(np.median(np.abs(np.diff(blocks)))) / np.sqrt(2)
        levels.append(blocks - low > max(_STEP * abs(low), _SIGMAS * sigma))
    loaded = levels[0] & levels[1]
    bounds = np.flatnonzero(np.diff(loaded)) + 1
    starts = np.concatenate([[0], bounds])
    ends = np.concatenate([bounds, [loaded.size]])
    marks: list[tuple[float, float]] = [
        (float(time[a]) - 0.5 * _BLOCK, float(time[b - 1]) + 0.5 * _BLOCK)
        for a, b in zip(starts, ends, strict=True)
        if loaded[a] and (b - a) * _BLOCK >= _LONG
    ]
    stages, since = [], span.start
    for start, end in marks:
        start, end = max(start, span.start), min(end, span.end)
        if start > since + _LONG:
            stages.append(Stage(name, since, start))
        else:
            start = since
        stages.append(Stage("fos_loaded", start, end))
        since = end
    if span.end > since + 1e-9:
        stages.append(Stage(name, since, span.end))
    return stages
