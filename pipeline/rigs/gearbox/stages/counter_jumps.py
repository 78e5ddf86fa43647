"""Where a counter gained or lost counts from one sample to the next, though less than a glance would show.

Arrays in counts only; large jumps and wrap-around are undone before, in `counter_faults`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# A jump: so many counts, samples' worth of counts and robust standard deviations off what is usual beside it.
_JUMP, _WORTH, _SIGMAS, _BESIDE = 6.0, 1.5, 8.0, 6
# Samples further apart than so many times the usual are not looked at.
_EVEN = 2.5


def jumps(time: np.ndarray, counts: np.ndarray, gaps: Sequence[tuple[float, float]]) -> list[tuple[int, float]]:
    """Return where the counter gained or lost counts from one sample to the next, and how many.

    Three steps are compared with the six before and the six behind; what later samples give back (stamps that
    jitter) is none, and beside one of the `gaps` (s) nothing is looked for.
    """
    many = _BESIDE + 3 + _BESIDE
    if time.size < 2 * many:
        return []
    rate = np.diff(counts) / np.diff(time)
    dt = float(np.median(np.diff(time)))

    def excess(middle: int) -> tuple[np.ndarray, np.ndarray]:
        half = middle // 2
        at = np.arange(_BESIDE + half, time.size - 1 - _BESIDE - half)
        a, b = at - half, at + half + 1
        left = (counts[a] - counts[a - _BESIDE]) / (time[a] - time[a - _BESIDE])
        right = (counts[b + _BESIDE] - counts[b]) / (time[b + _BESIDE] - time[b])
        out, most = np.zeros(rate.size), np.zeros(rate.size)
        out[at] = counts[b] - counts[a] - 0.5 * (left + right) * (time[b] - time[a])
        most[at] = np.maximum(left, right)
        return out, most

    narrow, fastest = excess(3)
    wide, _ = excess(7)
    moving = narrow[fastest * dt > 1.0]
    sigma = 1.4826 * float(np.median(np.abs(moving))) if moving.size else 0.0
    limit = np.maximum(np.maximum(_JUMP, _WORTH * fastest * dt), _SIGMAS * sigma)
    same = (
        (np.sign(wide) == np.sign(narrow))
        & (np.abs(wide) > 0.6 * np.abs(narrow))
        & (np.abs(wide) < 1.6 * np.abs(narrow))
    )
    hits = np.flatnonzero((np.abs(narrow) > limit) & same)
    found = []
    for group in np.split(hits, np.flatnonzero(np.diff(hits) > 3) + 1):
        if not group.size:
            continue
        centre = int(group[np.argmax(np.abs(narrow[group]))])
        around = time[max(centre - many // 2, 0) : centre + many // 2 + 1]
        beside = any(gap[0] <= around[-1] and gap[1] >= around[0] for gap in gaps)
        # Where samples are missing the six before and behind are no neighbours.
        beside |= bool(np.diff(around).max() > _EVEN * dt)
        steps = np.diff(counts[centre - 1 : centre + 3])
        if not beside:
            at = centre - 1 + int(np.argmax(np.abs(steps - np.median(steps))))
            found.append((at, float(np.round(narrow[centre]))))
    return found
