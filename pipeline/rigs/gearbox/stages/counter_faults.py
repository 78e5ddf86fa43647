"""What a logged counter may be wrong in: wrap-around, spikes, large jumps, direction, held values.

Arrays in counts only; a counter that freezes or loses pulses is in `counter_losses`.
"""

from __future__ import annotations

import numpy as np

from pipeline.rigs.gearbox.stages.counter_losses import edge_speed, usual_update
from pipeline.rigs.gearbox.stages.stage import Problem

_MODULI = tuple(2.0**k for k in (8, 10, 12, 14, 15, 16, 20, 24, 31, 32)) + tuple(10.0**k for k in range(3, 8))
# A step is a jump beyond this many times the step that 99 % stay below, plus a few counts.
_JUMP, _SLACK = 4.0, 6.0
# What a frozen counter catches up is no more than the shaft turns in this time (s) and where samples are missing.
_CATCHES_UP = 2.0
_LEAST_COHERENCE, _SLOW_STEPS = 0.6, 5


def mended(time: np.ndarray, counts: np.ndarray, turn: float) -> tuple[np.ndarray, list[Problem]]:
    """Return the counts without wrap-around, single spikes and jumps, and what was mended; shape (n,).

    Parameters
    ----------
    time, counts
        s and counts, shape (n,).
    turn
        Counts a turn: a counter may be reset by the index pulse.
    """
    counts = np.array(counts, dtype=float)
    steps = np.diff(counts)
    moving = np.abs(steps[steps != 0])
    if not moving.size:
        return counts, []
    usual = np.percentile(moving, 90) if moving.size > 20 else moving.max()
    limit = _JUMP * min(float(usual), 100 * float(np.median(moving))) + _SLACK
    problems = []
    spikes = np.flatnonzero(
        (np.abs(steps[:-1]) > limit) & (np.abs(steps[1:]) > limit) & (np.abs(steps[:-1] + steps[1:]) <= limit)
    )
    for spike in spikes + 1:
        counts[spike] = np.round(0.5 * (counts[spike - 1] + counts[spike + 1]))
    if spikes.size:
        text = f"{spikes.size} single encoder samples far off their neighbours are left out"
        problems.append(Problem((float(time[spikes[0] + 1]), float(time[spikes[-1] + 1])), text))
    steps = np.diff(counts)
    typical = float(np.median(steps[(steps != 0) & (np.abs(steps) <= limit)]))
    wraps, jumps = list[int](), list[int]()
    for i in np.flatnonzero(np.abs(steps) > limit).tolist():
        modulus = next((m for m in (*_MODULI, turn) if abs(abs(steps[i]) - m) <= limit and m > 2 * limit), None)
        if modulus is not None and np.sign(steps[i]) != np.sign(typical):
            steps[i] -= np.sign(steps[i]) * modulus
            wraps.append(i)
        else:
            jumps.append(i)
    whole = np.sign(typical) * np.concatenate([[0.0], np.cumsum(steps)])
    usual_time = usual_update(time, whole)
    for i in jumps:
        # What a counter that was frozen meanwhile catches up is no jump: `counter_losses` looks at it.
        before = i
        while before > 0 and steps[before - 1] == 0:
            before -= 1
        ran = edge_speed(time, whole, before, -1, usual_time) if before else None
        went_on = edge_speed(time, whole, i + 1, 1, usual_time)
        fastest = max(ran.speed, went_on.speed) if ran is not None and (ran.abrupt or went_on.abrupt) else 0.0
        step = float(whole[i + 1] - whole[i])
        paused = float(time[i + 1] - time[i]) + min(float(time[i] - time[before]), _CATCHES_UP)
        if 0.0 < step <= 1.5 * fastest * paused + (limit if fastest else 0.0):
            continue
        text = f"the encoder count jumps by {steps[i]:+.0f}; the jump is taken out"
        problems.append(Problem((float(time[i]), float(time[i + 1])), text))
        steps[i] = np.clip(typical, -limit, limit)
    if wraps:
        text = f"the encoder counter wraps around {len(wraps)} times; undone"
        problems.append(Problem((float(time[wraps[0]]), float(time[wraps[-1] + 1])), text, "note"))
    return counts[0] + np.concatenate([[0.0], np.cumsum(steps)]), problems


def direction(time: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, list[Problem]]:
    """Return the counts so that they grow, from 0, and whether they were turned round."""
    counts = counts - counts[0]
    if counts[-1] >= 0:
        return counts, []
    text = "the encoder counts downwards; downwards is taken as the motor's direction"
    return -counts, [Problem((float(time[0]), float(time[-1])), text, "note")]


def held(time: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a counter that a faster clock sampled and held at its own update instants.

    Between updates a held value lags behind the shaft by half an update on average, which makes an
    inertia 0.5 to 1 % too small. The update period is that of the steps' instants; where the steps
    have no common period they are those of single edges, and nothing is changed.

    Parameters
    ----------
    time, counts
        s and counts, shape (n,).

    Returns
    -------
    time, counts
        At the update instants, shape (m,); the arguments where nothing was held.
    """
    stepped = np.flatnonzero(np.diff(counts) != 0) + 1
    span = float(time[-1] - time[0])
    if stepped.size < 50 or stepped.size > 0.5 * time.size:
        return time, counts
    fast = span / (time.size - 1)
    size = 4 << int(np.ceil(np.log2(time.size)))
    indicator = np.zeros(size)
    indicator[np.round((time[stepped] - time[0]) / fast).astype(int).clip(0, size - 1)] = 1.0
    coherence = np.abs(np.fft.rfft(indicator)) / stepped.size
    # Slow changes of the number of steps lie below; updates at least ten to a second.
    lowest = int(10.0 * size * fast) + 1
    if coherence[lowest:].max(initial=0.0) < _LEAST_COHERENCE:
        return time, counts
    line = lowest + int(np.argmax(coherence[lowest:] > 0.9 * coherence[lowest:].max()))
    line += int(np.argmax(coherence[line : line + 8]))
    period = size * fast / line
    rank = np.round((time[stepped] - time[stepped[0]]) / period)
    period, phase = np.polyfit(rank, time[stepped] - 0.5 * fast, 1)
    if period < 1.5 * fast:
        return time, counts
    # Edges of a shaft at constant speed have a common period too; at other speeds they do not keep to it.
    rates = np.abs(np.diff(counts[stepped])) / np.diff(time[stepped])
    slow = np.flatnonzero(rates < 0.8 * np.median(rates)) + 1
    place = (time[stepped[slow]] - 0.5 * fast - phase) / period
    if slow.size < _SLOW_STEPS or np.mean(np.abs(place - np.round(place)) < 0.2) < 0.9:
        return time, counts
    first, last = np.ceil((time[0] - phase) / period), np.floor((time[-1] - phase) / period)
    own = phase + period * np.arange(first, last + 1)
    index = np.searchsorted(time, own + 0.5 * period, side="right") - 1
    return own, counts[index]
