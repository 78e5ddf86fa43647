"""Input speed and slip from the gear mesh lines, which exist only where the gears slip (fact sheet 3.2, 5.5).

With the teeth of Table 1 the lines lie at 140 and 40 times s/2pi and their doubles. A comb over all of them
tells the slip s; with the output held the input speed is s itself. Levels of lines are in `vibration`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.gearbox.aligned_run import Span, within
from pipeline.rigs.gearbox.vibration.comb import Comb, in_band, thinned
from pipeline.rigs.gearbox.vibration.comb_support import Support, support
from pipeline.rigs.gearbox.vibration.phase_track import Track, follow

# Mesh 2, its double, mesh 1, its double, per turn of slip (fact sheet 5.5).
ORDERS = (40.0, 80.0, 140.0, 280.0)
# Geometric mean power of the comb's lines over that of the noise beside them. Noise alone exceeds it at one
# place with probability below exp(-4 (8 - 1 - ln 8)) = 3e-9 for four lines (Chernoff's bound).
LEAST_CONTRAST = 8.0

# Where the input speed is sought, in nominal speeds: near it (fact sheet 5.5), else where a drive without slip
# compensation may droop to (4.4).
_NEAR, _DROOPED = (0.85, 1.05), (0.6, 0.86)
# Speed within the stage: pieces of this length, s, tell whether it wanders.
_PIECE = 1.0
# A piece may differ from the whole by this share.
_WANDER = 0.02


@dataclass(frozen=True)
class MeshSpeed:
    """Slip speed over a stretch, from the comb of mesh lines.

    Attributes
    ----------
    speed, std_error
        rad/s: mean over the stretch; with the output held it is the input speed.
    dof
        Degrees of freedom of the error.
    contrast
        Geometric mean power of the lines over the noise beside them.
    wander
        Standard deviation of the speed between pieces of a second, rad/s, beyond what their own errors give.
    orders
        Lines that lie in the band of the vibration log.
    support
        What speaks for the speed and against it; None where it was not asked.
    """

    speed: float
    std_error: float
    dof: float
    contrast: float
    wander: float
    orders: tuple[float, ...]
    support: Support | None = None


@dataclass(frozen=True, eq=False)
class Ridge:
    """Slip speed over time: `time` (s), `slip` (rad/s, NaN where no mesh line stands out), `contrast`; shape (n,)."""

    time: np.ndarray
    slip: np.ndarray
    contrast: np.ndarray


def input_speed(
    time: np.ndarray,
    channels: Mapping[str, np.ndarray],
    span: Span,
    nominal: float,
    orders: Sequence[float] = ORDERS,
    guard: float = 0.2,
    rest: Span | None = None,
) -> MeshSpeed | None:
    """Find the slip speed over a stretch with the output held.

    Parameters
    ----------
    time, channels
        s and m/s^2, shape (n,) each, uniform but for jitter.
    span
        The stage, s; `guard` is left out at both ends.
    nominal
        Where to look: 0.85 to 1.05 of it, else down to 0.6 of it, rad/s.
    orders
        Mesh lines per turn of slip.
    rest
        A standstill, s: lines that stand there, too, are hum.

    Returns
    -------
    None where no comb stands out of the noise, or the log is too short. A comb that is in doubt is one only where
    no other is found.
    """
    part = within(time, (span[0] + guard, span[1] - guard))
    t = time[part]
    if t.size < 256 or t[-1] - t[0] < 0.5:
        return None
    logged = rate = (t.size - 1) / float(t[-1] - t[0])
    used = in_band(orders, rate, _NEAR[1] * nominal)
    live = {name: values for name, values in channels.items() if np.ptp(values[part]) > 0}
    if len(used) < 2 or not live:
        return None
    signals, rate = thinned([values[part] for values in live.values()], rate, max(used) * _NEAR[1] * nominal)
    hum = _at_rest(time, live, rest, max(used) * _NEAR[1] * nominal, used)
    doubtful = None
    for share in (_NEAR, _DROOPED):
        found = _searched(signals, rate, used, (share[0] * nominal, share[1] * nominal), span[1] - span[0], hum)
        if found is None:
            continue
        weighed = support(_pieces(signals, rate, used, hum)[1], found.speed, nominal, orders, logged)
        found = replace(found, support=weighed)
        if not weighed.doubt:
            return found
        doubtful = doubtful or found
    return doubtful


def _pieces(
    signals: Sequence[np.ndarray], rate: float, used: Sequence[float], hum: Comb | None
) -> tuple[list[Comb], Comb]:
    """Return the combs of pieces of a second, and their mean, blind to hum."""
    length = max(round(_PIECE * rate), 256)
    starts = [i * length for i in range(max(signals[0].size // length, 1))]
    parts = [Comb.of([signal[start : start + length] for signal in signals], rate, used) for start in starts]
    mean = replace(parts[0], power=np.mean([part.power for part in parts], axis=0))
    return parts, mean if hum is None else mean.without(hum)


def _searched(
    signals: Sequence[np.ndarray], rate: float, used: Sequence[float], limits: Span, stage: float, hum: Comb | None
) -> MeshSpeed | None:
    """Return the slip speed within `limits` (rad/s) of a stage `stage` seconds long; `hum` is the comb at rest."""
    parts, coarse = _pieces(signals, rate, used, hum)
    length = parts[0].size
    fine = Comb.of(signals, rate, used)
    fine = fine if hum is None else fine.without(hum)
    rough, _ = coarse.best(limits)
    step = 2 * math.pi * rate / (length * max(used))
    near = (max(rough - 2 * step, limits[0]), min(rough + 2 * step, limits[1]))
    speed, contrast = fine.best(near)
    # Strong hum leaks into a line beside it.
    clear = [order for order in used if hum is None or not hum.stands_near(order * speed, _PIECE)]
    clear = clear if len(clear) > 1 else list(used)
    speed = replace(fine, orders=tuple(clear)).sharpened(speed)
    if max(contrast, coarse.contrast_at(rough)) < LEAST_CONTRAST:
        return None
    if not (fine.stands_out(speed) or coarse.stands_out(rough)):
        return None
    wide = ((1 - _WANDER) * rough, (1 + _WANDER) * rough)
    pieces = np.array([part.best(wide)[0] for part in parts])
    track = _tracked(signals, rate, clear, pieces, speed, length)
    if track is None or track.steady:
        return MeshSpeed(speed, fine.resolution(contrast), math.inf, contrast, 0.0, tuple(used))
    # What lies outside the track is a share of the stage whose speed may be off by the wander.
    outside = 1.0 - (track.span[1] - track.span[0]) / stage
    error = math.hypot(track.std_error, outside * track.wander)
    return MeshSpeed(track.rate, error, track.dof, contrast, track.wander, tuple(used))


def _at_rest(
    time: np.ndarray, channels: Mapping[str, np.ndarray], rest: Span | None, highest: float, orders: Sequence[float]
) -> Comb | None:
    """Return the spectrum of a standstill over its floor; None where there is none of a second or more."""
    if rest is None or rest[1] - rest[0] < _PIECE:
        return None
    part = within(time, rest)
    if part.stop - part.start < 256:
        return None
    rate = (part.stop - part.start - 1) / float(time[part.stop - 1] - time[part.start])
    signals, rate = thinned([values[part] for values in channels.values()], rate, highest)
    return Comb.of(signals, rate, orders)


def _tracked(
    signals: Sequence[np.ndarray], rate: float, orders: Sequence[float], pieces: np.ndarray, speed: float, length: int
) -> Track | None:
    """Return the mean speed by the phases of the lines; None where they do not stand out of a single piece."""
    size = signals[0].size
    centres = (np.arange(pieces.size) + 0.5) * length
    # A speed within half a line width is one: the phases tell it better than the pieces do.
    width = 2 * math.pi * rate / (length * max(orders))
    steady = np.abs(pieces - speed).max() < width
    guess = np.full(size, speed) if steady else np.interp(np.arange(size), centres, pieces)
    return follow(signals, rate, orders, guess, length / rate)


def slip_ridge(
    time: np.ndarray,
    channels: Mapping[str, np.ndarray],
    span: Span,
    highest: float,
    orders: Sequence[float] = ORDERS,
    window: float = 0.2,
    hop: float = 0.05,
) -> Ridge:
    """Follow the slip through a transition: the comb of short windows, where it stands out.

    Parameters
    ----------
    time, channels
        s and m/s^2, shape (n,) each.
    span
        Where to look, s.
    highest
        Largest slip looked for, rad/s.
    orders
        Mesh lines per turn of slip.
    window, hop
        Of the spectrogram, s. Slips below 2 lines of its resolution cannot be told.
    """
    part = within(time, span)
    t = time[part]
    if t.size < 64:
        return Ridge(np.zeros(0), np.zeros(0), np.zeros(0))
    rate = (t.size - 1) / float(t[-1] - t[0])
    used = in_band(orders, rate, highest)
    signals = [values[part] for values in channels.values() if np.ptp(values[part]) > 0]
    if len(used) < 2 or not signals:
        return Ridge(np.zeros(0), np.zeros(0), np.zeros(0))
    signals, rate = thinned(signals, rate, max(used) * highest)
    size, step = max(round(window * rate), 32), max(round(hop * rate), 1)
    lowest = 2 * math.pi * 3 / (window * min(orders))
    if not highest > lowest:
        return Ridge(np.zeros(0), np.zeros(0), np.zeros(0))
    centres, slips, contrasts = [], [], []
    for start in range(0, signals[0].size - size + 1, step):
        comb = Comb.of([s[start : start + size] for s in signals], rate, used)
        found, contrast = comb.best((lowest, highest))
        centres.append(float(t[0]) + (start + 0.5 * size) / rate)
        slips.append(found if contrast >= LEAST_CONTRAST else math.nan)
        contrasts.append(contrast)
    return Ridge(np.array(centres), np.array(slips), np.array(contrasts))


def partial_slip(
    time: np.ndarray,
    channels: Mapping[str, np.ndarray],
    span: Span,
    speed: float,
    orders: Sequence[float] = ORDERS,
    rest: Span | None = None,
) -> MeshSpeed | None:
    """Look for mesh lines where the gears should be locked (fact sheet 5.7): None where there are none.

    Slips from a two-hundredth of the shaft speed on are looked for; multiples of the shaft speed, which any
    shaft shows, are taken out first, and what stands at `rest` (a standstill, s), too.
    """
    part = within(time, (span[0] + 0.2, span[1] - 0.2))
    t = time[part]
    if t.size < 1024 or t[-1] - t[0] < 2.0 or not speed > 0:
        return None
    rate = (t.size - 1) / float(t[-1] - t[0])
    turn = speed * (t - t[0])
    columns = np.column_stack([f(k * turn) for k in range(1, 13) for f in (np.cos, np.sin)])
    basis = np.linalg.qr(columns - columns.mean(axis=0))[0]
    signals = []
    for values in channels.values():
        x = values[part] - values[part].mean()
        if np.ptp(x) > 0:
            signals.append(x - basis @ (basis.T @ x))
    used = in_band(orders, rate, 1.05 * speed)
    if not signals or len(used) < 2:
        return None
    signals, rate = thinned(signals, rate, max(used) * 1.05 * speed)
    comb = Comb.of(signals, rate, used)
    hum = _at_rest(time, channels, rest, max(used) * 1.05 * speed, used)
    comb = comb if hum is None else comb.without(hum)
    slip, contrast = comb.best((max(speed / 200, 4 * math.pi * rate / (signals[0].size * min(used))), 1.05 * speed))
    if contrast < LEAST_CONTRAST or not comb.stands_out(slip):
        return None
    return MeshSpeed(slip, comb.resolution(contrast), math.inf, contrast, 0.0, tuple(used))
