"""Events of a drive: the load leaves its running median, or a longitudinal force acts (tire.md, 5.13).

One tire cannot tell steering from a bump: both are vertical. A change slower than the median's window is none.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.tire.road.event_centre import LONGITUDINAL, VERTICAL, Event, event_of
from pipeline.rigs.tire.road.rolling_force import rolling_force

_FEWEST_IN_WINDOW = 5
# Of normal deviations a quarter is smaller than this many standard deviations.
_LOWER_QUARTER = 0.3186394
# Within a longitudinal event a vertical one has to stand out of what load transfer leaves unexplained.
_WITHIN = 1.5
# Rotation by which two revolutions follow each other without a gap, turns.
_NEXT = 1.5
# Revolutions that may lack within an event, and the deviation over its limit that they need.
_REACH = 2
_BETWEEN = 0.25
# So many turns may be lost in one.
_LOST = 6.5
# Of a long event so large a share may be below the limit in one piece.
_SHARE = 0.25
# How many revolutions weigh together, and the share of the limit that each of them needs; which of them are a few.
_TOGETHER = {2: 0.5, 3: 0.5, 5: 0.25, 9: 0.25, 17: 0.25}
_FEW = 3


def quiet_load(time: np.ndarray, load: np.ndarray, window: float) -> np.ndarray:
    """Return the running median of the load over `window` s, centred, shape (m,); NaN loads are left out."""
    first = np.searchsorted(time, time - 0.5 * window)
    last = np.searchsorted(time, time + 0.5 * window, side="right")
    found = np.full(time.size, np.nan)
    for i, (a, b) in enumerate(zip(first, last, strict=True)):
        part = load[a:b]
        part = part[np.isfinite(part)]
        if part.size >= _FEWEST_IN_WINDOW:
            found[i] = np.median(part)
    return np.where(np.isfinite(found), found, np.nanmedian(load) if np.isfinite(load).any() else np.nan)


def events(
    time: np.ndarray,
    speed: np.ndarray,
    load: np.ndarray,
    load_se: np.ndarray,
    force: np.ndarray,
    force_se: np.ndarray,
    *,
    usable: np.ndarray | None = None,
    deviation: float = 4.0,
    longitudinal: float = 6.0,
    window: float = 12.0,
    span: tuple[float, float] | None = None,
) -> list[Event]:
    """Return the events of a drive in order of time.

    A standard deviation is that of the revolution, scaled by the quietest quarter of the drive (of the force: where the
    speed is steady): so a drive of many events hides none, and a rough road is not one event. The force counts from what
    steady rolling at that speed takes (`rolling_force`): wind and rolling resistance are no event. What the load does in
    proportion to the longitudinal force is load transfer and no event of its own.

    Parameters
    ----------
    time, speed
        Passages (s, rising) and rotation (rad/s), shape (m,) each.
    load, load_se, force, force_se
        Fz and Fx of each revolution and their standard errors, N, unfiltered, shape (m,) each.
    usable
        Which revolutions count, bool, shape (m,).
    deviation, longitudinal
        Standard deviations from which a revolution deviates, and from which an event is longitudinal.
    window
        Of the running median, s.
    span
        Begin and end of the log, s; by default those of the revolutions.
    """
    known = np.isfinite(load) & np.isfinite(force) & np.isfinite(load_se) & np.isfinite(force_se)
    if usable is not None:
        known &= usable
    at = np.flatnonzero(known)
    if at.size < 2 * _FEWEST_IN_WINDOW:
        return []
    t, rotation, Fz = time[at], speed[at], load[at]
    usual, steady = rolling_force(t, rotation, force[at])
    Fx = force[at] - usual
    force_sd = force_se[at] * _scale((Fx / force_se[at])[steady])
    carried, strong = _load_transfer(t, Fz, Fx, force_sd, longitudinal, window)
    left = Fz - carried
    left = left - quiet_load(t, left, window)
    load_sd = load_se[at] * _scale(left / load_se[at])
    turn = 2.0 * math.pi / rotation
    ends = (t[0], t[-1]) if span is None else span
    joins = np.diff(t) * np.minimum(rotation[1:], rotation[:-1]) < _NEXT * 2.0 * math.pi
    found = []
    for begin, end in _runs(Fx / (deviation * force_sd), t, rotation, np.ones(t.size, dtype=bool)):
        event = event_of(LONGITUDINAL, t, Fx, force_sd, begin, end, joins, turn, ends)
        if event.deviations > longitudinal:
            found.append(event)
    limit = deviation * np.where(strong, _WITHIN, 1.0)
    inner = (t - t[0] > 0.5 * window) & (t[-1] - t > 0.5 * window)
    for begin, end in _runs(left / (limit * load_sd), t, rotation, inner):
        found.append(event_of(VERTICAL, t, left, load_sd, begin, end, joins, turn, ends))
    return sorted(found, key=lambda event: event.time)


def _scale(standardised: np.ndarray) -> float:
    """Return how much larger deviations are than their errors tell, by their quietest quarter; 1 at least."""
    return max(1.0, float(np.quantile(np.abs(standardised), 0.25)) / _LOWER_QUARTER)


def _load_transfer(
    time: np.ndarray, load: np.ndarray, force: np.ndarray, force_sd: np.ndarray, longitudinal: float, window: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return what driving and braking shift of the load, N, and where they act, shape (m,) each."""
    strong = np.abs(force) > longitudinal * force_sd
    calm = np.where(strong, np.nan, load)
    off = load - quiet_load(time, calm, window)
    carried = np.zeros(time.size)
    for acting in (strong & (force > 0.0), strong & (force < 0.0)):
        if np.count_nonzero(acting) >= _FEWEST_IN_WINDOW:
            share = float(np.median(off[acting] / force[acting]))
            side = np.sign(force) == np.sign(force[acting][0])
            carried[side] = share * force[side]
    return carried, strong


def _runs(beyond: np.ndarray, time: np.ndarray, rotation: np.ndarray, inner: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last place of each stretch that is an event; `beyond` is the deviation over its limit, signed.

    Two revolutions in a row at the limit are one. So are some that weigh as much together, each above a share of it
    (`_TOGETHER`): a short event between two passages is lower on both, a gentle one lasts. Many weigh together only
    where `inner`: there what they deviate from is known well enough.
    """
    core = np.zeros(beyond.size, dtype=bool)
    rho = _correlation(beyond)
    turns = np.concatenate([[math.inf], np.diff(time) * np.minimum(rotation[1:], rotation[:-1]) / (2.0 * math.pi)])
    for count, share in _TOGETHER.items():
        if beyond.size < count:
            break
        windows = np.lib.stride_tricks.sliding_window_view(beyond, count)
        least = (np.sign(windows[:, :1]) * windows).min(axis=1)
        # Revolutions whose errors go together weigh less together.
        widened = math.sqrt(1.0 + 2.0 * sum((1.0 - k / count) * rho**k for k in range(1, count)))
        enough = (least > share) & (np.abs(windows.sum(axis=1)) >= widened * math.sqrt(2.0 * count))
        enough |= least >= 1.0
        enough &= np.lib.stride_tricks.sliding_window_view(turns, count)[:, 1:].max(axis=1) < _REACH + 0.5
        if count > _FEW:
            enough &= inner[: enough.size] & inner[count - 1 :]
        for i in np.flatnonzero(enough):
            core[i : i + count] = True
    found: list[list[int]] = []
    for i in np.flatnonzero(core):
        if found:
            last = found[-1][1]
            apart = (time[i] - time[last]) * rotation[last] / (2.0 * math.pi)
            between = np.sign(beyond[i]) * beyond[last : i + 1]
            reach = max(_REACH, _SHARE * (last - found[-1][0]))
            filled = i - last == 1 or float(between[1:-1].mean()) > _BETWEEN
            if i - last <= reach and apart - (i - last) < _LOST and between[0] > 0.0 and filled:
                found[-1][1] = int(i)
                continue
        found.append([int(i), int(i)])
    return [(a, b) for a, b in found]


def _correlation(values: np.ndarray) -> float:
    """Return how a revolution goes with the next, 0 to 0.9, by signs alone: events and wild values count no more."""
    small = np.abs(values) < 0.75
    both = small[1:] & small[:-1]
    if np.count_nonzero(both) < _FEWEST_IN_WINDOW:
        return 0.0
    agreeing = float(np.mean(np.sign(values[1:][both] * values[:-1][both])))
    return float(np.clip(math.sin(0.5 * math.pi * agreeing), 0.0, 0.9))
