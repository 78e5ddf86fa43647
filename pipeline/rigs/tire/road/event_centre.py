"""One event of a drive: its centre, and how sure that is beside gaps and standstills."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

VERTICAL, LONGITUDINAL = "vertical", "longitudinal"
# A gap at an end of an event counts for so many turns; so many revolutions tell how the wheel slows down towards one.
_OUTER = 3.0
_SLOWING = 4
# How far the time to a standstill may be off, relative: the acceleration is not constant.
_UNSEEN = 0.15


@dataclass(frozen=True)
class Event:
    """Something that happened to the tire.

    Attributes
    ----------
    kind
        `VERTICAL` (steering, bump) or `LONGITUDINAL` (driving, braking).
    time, time_se
        Centre of the deviation, s, and its standard error.
    first, last
        First and last revolution beyond the limit, s.
    change
        Largest deviation, N: of the load from its running median, of the longitudinal force from that of steady rolling.
    deviations
        What the revolutions deviate together, in standard deviations.
    revolutions
        How many are beyond the limit.
    cut
        Whether it reaches the end of the log or of a gap: centre and change are of what was seen.
    """

    kind: str
    time: float
    time_se: float
    first: float
    last: float
    change: float
    deviations: float
    revolutions: int
    cut: bool


def event_of(
    kind: str,
    time: np.ndarray,
    values: np.ndarray,
    sd: np.ndarray,
    begin: int,
    end: int,
    joins: np.ndarray,
    turn: np.ndarray,
    ends: tuple[float, float],
) -> Event:
    """Return the event of a stretch: its centre is the centroid of the deviation with a revolution on either side."""
    a, b = max(begin - 1, 0), min(end + 1, time.size - 1)
    top = begin + int(np.argmax(np.abs(values[begin : end + 1])))
    height = np.maximum(np.sign(values[top]) * values[a : b + 1], 0.0)
    spans, lost = _spans(time[a : b + 1], turn[a : b + 1], joins[a:b])
    unseen = [0.0, 0.0]
    if kind == LONGITUDINAL:
        unseen = [_to_standstill(time, turn, begin, end, place, ends) for place in (begin, end)]
    for place, length in zip((begin, end), unseen, strict=True):
        if length:
            # The way to the standstill takes the place of what half a turn stands for.
            spans[place - a] = 0.5 * abs(float(time[place] - time[place - int(np.sign(length))]))
    # Two more points: what is not seen on either side.
    weight = np.append(height * spans, [abs(values[p] * w) for p, w in zip((begin, end), unseen, strict=True)])
    moment = np.append(time[a : b + 1], [time[p] + 0.5 * w for p, w in zip((begin, end), unseen, strict=True)])
    centre = float((weight * moment).sum() / weight.sum())
    lever = spans * (time[a : b + 1] - centre) / weight.sum()
    noise = float(np.sqrt(((lever * sd[a : b + 1]) ** 2).sum()))
    # What happened in a gap is not known: anything from that of one side to that of the other.
    unknown = np.maximum(height[1:], height[:-1]) * lost / math.sqrt(12.0)
    gaps = float(np.abs(unknown * (time[a:b] + 0.5 * lost - centre)).sum())
    gaps += float(np.abs(weight[b - a + 1 :] * (moment[b - a + 1 :] - centre)).sum()) * _UNSEEN
    # Where the deviation begins and ends is seen once a turn only; as it fades in and out, a quarter of that is felt.
    sampled = 0.25 * float(turn[a : b + 1].max()) / math.sqrt(12.0)
    cut = begin == 0 or end == time.size - 1 or not joins[max(begin - 1, 0) : end + 1].all()
    return Event(
        kind,
        centre,
        math.hypot(noise, sampled, gaps / weight.sum()),
        float(time[begin]),
        float(time[end]),
        float(values[top]),
        float(np.abs(values[begin : end + 1].sum()) / np.sqrt((sd[begin : end + 1] ** 2).sum())),
        int(end - begin + 1),
        bool(cut),
    )


def _to_standstill(
    time: np.ndarray, turn: np.ndarray, begin: int, end: int, place: int, ends: tuple[float, float]
) -> float:
    """Return for how long (s, negative: before) an event went on unseen, where the wheel comes from or to a standstill.

    With the acceleration of the revolutions next to it; 0 where the event does not end at a gap of some turns or the wheel does
    not come near a standstill in it.
    """
    sign = -1 if place == begin else 1
    beside = place + sign
    outside = float(time[beside]) if 0 <= beside < time.size else ends[beside > 0]
    gap = abs(outside - float(time[place]))
    inner = place - sign * min(_SLOWING, end - begin)
    if gap < _OUTER * turn[place] or inner == place:
        return 0.0
    rotation = 2.0 * math.pi / turn
    rate = float((rotation[place] - rotation[inner]) / (time[place] - time[inner]))
    if not sign * rate < 0.0:
        return 0.0
    rest = float(rotation[place]) / abs(rate)
    return sign * min(rest, gap) if rest < gap + _OUTER * turn[place] else 0.0


def _spans(time: np.ndarray, turn: np.ndarray, joins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the time (s) that each revolution stands for, shape (m,), and what is lost between them, shape (m-1,).

    A gap within is shared by those beside it. Beyond the first and the last it is one turn that counts, and a few that are
    not known: there the wheel may have stood.
    """
    apart = np.diff(time)
    lost = np.where(joins, 0.0, apart)
    lost[[0, -1]] = np.minimum(lost[[0, -1]], _OUTER * turn[[1, -2]])
    apart[[0, -1]] = np.minimum(apart[[0, -1]], turn[[1, -2]])
    spans = np.convolve(apart, [0.5, 0.5], mode="full")
    spans[[0, -1]] = np.minimum(spans[[0, -1]], turn[[0, -1]])
    return spans, lost
