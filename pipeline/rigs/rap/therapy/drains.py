"""When the tank was emptied: announced by the key, or seen in the levels alone (rap.md, 3.9 and section 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.tank import Tank
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.command import Command
from pipeline.rigs.rap.therapy.levels import Levels

LEAST_DROP = 50e-6
"""Fall of the volume that means that the tank was emptied, m^3 (in less than a minute)."""
_AFTER_KEY_DROP = 20e-6
_WITHIN = 60.0
_AFTER_KEY = 600.0
# Rows of a key that is held follow each other faster than that, s.
_HELD = 5.0
_COUNT, _BETWEEN = 11, 34
_LASTING = 61


@dataclass(frozen=True)
class Emptying:
    """The tank was emptied at `time` (s), somewhere in `span`; `drop` (m^3; NaN where no level shows it)."""

    time: float
    span: tuple[float, float]
    drop: float
    announced: bool


def drain_times(pressed: Signal | None, events: Sequence[float] = ()) -> list[float]:
    """Return when the drain key was pressed, s: edges of `drain_pressed` and rows of the events, those within 5 s once.

    A list of events that holds presses alone has no edges: each of its rows is a press.
    """
    found = list(events)
    if pressed is not None:
        on = pressed.values > 0.5
        apart = np.diff(pressed.time, prepend=-np.inf) > _HELD
        lists = on.all() and bool(apart.all())
        found += pressed.time[on if lists else on & ~np.concatenate([[False], on[:-1]])].tolist()
    found.sort()
    return [t for i, t in enumerate(found) if i == 0 or t - found[i - 1] > _HELD]


def emptied(
    levels: Levels, tank: Tank, command: Command, pressed: Sequence[float] = ()
) -> tuple[tuple[Emptying, ...], bool, tuple[QualityFinding, ...]]:
    """Return when the tank was emptied, whether the key says it was empty at the start, and what is odd about it.

    A key pressed before anything has been pumped tells an empty tank. Elsewhere it closes a segment at the fall of the
    level that follows within 10 min, or at the press where no echo shows a fall.
    """
    begin = float(levels.time[0]) if levels.time.size else 0.0
    pumped = command.volume(np.array(pressed, dtype=float)) if len(pressed) else np.zeros(0)
    early = [t for t, v in zip(pressed, pumped, strict=True) if t <= begin + 1.0 or v < 2e-6]
    keys = [t for t in pressed if t not in early]
    falls = _falls(levels, tank, command, LEAST_DROP)
    # A key says what to look for: less of a fall will do.
    smaller = _falls(levels, tank, command, _AFTER_KEY_DROP) if keys else []
    out, problems = [], []
    for key in keys:
        own = [f for f in falls if key - _WITHIN <= f.time <= key + _AFTER_KEY]
        falls = [f for f in falls if f not in own]
        own = own or [f for f in smaller if key - _WITHIN <= f.time <= key + _AFTER_KEY]
        seen = max(own, key=lambda f: f.drop) if own else Emptying(key, (key, key), float("nan"), True)
        out.append(Emptying(max(seen.time, key), seen.span, seen.drop, True))
    for fall in falls:
        out.append(fall)
        text = (
            f"the tank loses {1e6 * fall.drop:.0f} mL without drain_pressed: emptied without the key; the volume is "
            "restarted from the echoes after it and the segments are added up."
        )
        problems.append(QualityFinding("warning", text, channel="drain_pressed", span=fall.span))
    out.sort(key=lambda e: e.time)
    return tuple(out), bool(early), tuple(problems)


def _falls(levels: Levels, tank: Tank, command: Command, least: float) -> list[Emptying]:
    """Return falls of more than `least` (m^3) between groups of levels half a minute apart, what was pumped taken off."""
    good = np.flatnonzero(levels.usable)
    lag = _COUNT + _BETWEEN
    if good.size < _COUNT + lag:
        return []
    time = levels.time[good]
    rest = levels.level[good] * tank.area - command.volume(time)
    from numpy.lib.stride_tricks import sliding_window_view

    medians = np.median(sliding_window_view(rest, _COUNT), axis=1)
    # medians[i] looks at i .. i + _COUNT - 1: the fall lies between the last of one group and the first of the other.
    drop = medians[:-lag] - medians[lag:]
    last, first = np.arange(drop.size) + _COUNT - 1, np.arange(drop.size) + lag
    moving = np.where(levels.moving[good[last]], 2.0, 1.0)
    # The pump's gain may be a few per cent off over a long gap.
    doubt = 0.2 * command.at(time[last]) * (time[first] - time[last])
    found = drop > least * moving + doubt
    out: list[Emptying] = []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], found, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        best = begin + int(np.argmax(drop[begin:end]))
        before, after = best + _COUNT - 1, best + lag
        near = np.arange(max(before - _COUNT + 1, 0), min(after + _COUNT - 1, time.size - 1))
        step = _parting(rest, near) if near.size else before
        # Waves and walking fake a fall for seconds, not for a minute.
        before_it, after_it = rest[max(step - _LASTING, 0) : step + 1], rest[step + 1 : step + 1 + _LASTING]
        lasting = float(np.median(before_it) - np.median(after_it))
        if lasting > least:
            # It may take the better part of a minute: from the last level before it to the first after it.
            high, low = float(np.median(before_it)), float(np.median(after_it))
            near = np.arange(max(step - _LASTING, 0), min(step + 1 + _LASTING, time.size))
            still_full = near[rest[near] > high - 0.1 * lasting]
            still_full = still_full[still_full <= step]
            already = near[(rest[near] < low + 0.1 * lasting) & (near > step)]
            t0 = float(time[still_full[-1] if still_full.size else step])
            t1 = float(time[already[0] if already.size else step + 1])
            # Where the echo is lost first, the tank is empty by then at the latest a minute on.
            t1 = min(t1, float(time[step]) + _WITHIN)
            out.append(Emptying(t1, (t0, t1), lasting, False))
    return out


def _parting(rest: np.ndarray, near: np.ndarray) -> int:
    """Return after which of the `near` places (k,) the levels part best into a high and a low side; wild ones count little."""

    def left(step: int) -> float:
        sides = rest[max(step - _LASTING, 0) : step + 1], rest[step + 1 : step + 1 + _LASTING]
        spread = np.concatenate([np.abs(side - np.median(side)) for side in sides])
        return float(np.minimum(spread, LEAST_DROP).mean())

    return int(min(near, key=left))
