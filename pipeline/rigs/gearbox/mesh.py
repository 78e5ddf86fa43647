"""Input speed and slip from the gear mesh lines, which exist only where the gears slip (fact sheet 3.2, 5.5).

With the teeth of Table 1 the lines lie at 140 and 40 times s/2pi and their doubles. A comb over all of them
tells the slip s; with the output held the input speed is s itself. Levels of lines are in `vibration`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.gearbox.aligned_run import Span, within

# Mesh 2, its double, mesh 1, its double, per turn of slip (fact sheet 5.5).
ORDERS = (40.0, 80.0, 140.0, 280.0)
# Geometric mean power of the comb's lines over that of the noise beside them. Noise alone exceeds it at one
# place with probability below exp(-4 (8 - 1 - ln 8)) = 3e-9 for four lines (Chernoff's bound).
LEAST_CONTRAST = 8.0

_SEARCH = (0.85, 1.05)
_PADDING = 4
# Speed within the stage: pieces of this length, s, tell whether it wanders.
_PIECE = 1.0
# A piece may differ from the whole by this share of the nominal speed.
_WANDER = 0.02
# Bins of the padded spectrum over which the noise floor is a median.
_FLOOR = 400


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
    """

    speed: float
    std_error: float
    dof: float
    contrast: float
    wander: float
    orders: tuple[float, ...]


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
) -> MeshSpeed | None:
    """Find the slip speed over a stretch with the output held.

    Parameters
    ----------
    time, channels
        s and m/s^2, shape (n,) each, uniform but for jitter.
    span
        The stage, s; `guard` is left out at both ends.
    nominal
        Where to look: 0.85 to 1.05 of it, rad/s.
    orders
        Mesh lines per turn of slip.

    Returns
    -------
    None where no comb stands out of the noise, or the log is too short.
    """
    part = within(time, (span[0] + guard, span[1] - guard))
    t = time[part]
    if t.size < 256 or t[-1] - t[0] < 0.5:
        return None
    rate = (t.size - 1) / float(t[-1] - t[0])
    used = _in_band(orders, rate, _SEARCH[1] * nominal)
    if len(used) < 2:
        return None
    signals = [values[part] for values in channels.values() if np.ptp(values[part]) > 0]
    if not signals:
        return None
    limits = (_SEARCH[0] * nominal, _SEARCH[1] * nominal)
    length = max(round(_PIECE * rate), 256)
    starts = [i * length for i in range(max(t.size // length, 1))]
    coarse = _Comb.of([signal[start : start + length] for start in starts for signal in signals], rate, used)
    rough, _ = coarse.best(limits)
    fine = _Comb.of(signals, rate, used)
    step = 2 * math.pi * rate / (length * max(used))
    near = (max(rough - 2 * step, limits[0]), min(rough + 2 * step, limits[1]))
    speed, contrast = fine.best(near)
    speed = fine.sharpened(speed)
    wide = (max(rough - _WANDER * nominal, limits[0]), min(rough + _WANDER * nominal, limits[1]))
    pieces = np.array([_Comb.of([s[i : i + length] for s in signals], rate, used).best(wide)[0] for i in starts])
    if max(contrast, coarse.contrast_at(rough)) < LEAST_CONTRAST:
        return None
    own = fine.resolution(contrast)
    scatter = float(pieces.std(ddof=1)) if pieces.size > 2 else math.inf
    piece_error = fine.resolution(contrast) * len(starts) ** 1.5
    wander = math.sqrt(max(scatter**2 - piece_error**2, 0.0)) if math.isfinite(scatter) else 0.0
    if wander > piece_error:
        # The lines are smeared: the mean of the pieces tells the mean speed, the sharpest line does not.
        return MeshSpeed(
            float(pieces.mean()), scatter / math.sqrt(pieces.size), pieces.size - 1, contrast, wander, tuple(used)
        )
    return MeshSpeed(speed, own, math.inf, contrast, wander, tuple(used))


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
    size, step = max(round(window * rate), 32), max(round(hop * rate), 1)
    signals = [values[part] for values in channels.values() if np.ptp(values[part]) > 0]
    lowest = 2 * math.pi * 3 / (window * min(orders))
    centres, slips, contrasts = [], [], []
    for start in range(0, t.size - size + 1, step):
        used = _in_band(orders, rate, highest)
        best, contrast = math.nan, 1.0
        if len(used) >= 2 and signals:
            comb = _Comb.of([s[start : start + size] for s in signals], rate, used)
            found, contrast = comb.best((lowest, highest))
            best = found if contrast >= LEAST_CONTRAST else math.nan
        centres.append(float(t[start]) + 0.5 * size / rate)
        slips.append(best)
        contrasts.append(contrast)
    return Ridge(np.array(centres), np.array(slips), np.array(contrasts))


def partial_slip(
    time: np.ndarray,
    channels: Mapping[str, np.ndarray],
    span: Span,
    speed: float,
    orders: Sequence[float] = ORDERS,
) -> MeshSpeed | None:
    """Look for mesh lines where the gears should be locked (fact sheet 5.7): None where there are none.

    Slips from a two-hundredth of the shaft speed on are looked for; multiples of the shaft speed, which any
    shaft shows, are taken out first.
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
    used = _in_band(orders, rate, 1.05 * speed)
    if not signals or len(used) < 2:
        return None
    comb = _Comb.of(signals, rate, used)
    slip, contrast = comb.best((max(speed / 200, 4 * math.pi * rate / (t.size * min(used))), 1.05 * speed))
    if contrast < LEAST_CONTRAST:
        return None
    return MeshSpeed(slip, comb.resolution(contrast), math.inf, contrast, 0.0, tuple(used))


def _in_band(orders: Sequence[float], rate: float, highest: float) -> list[float]:
    """Return the orders whose line stays below 0.48 of the sampling rate at the highest slip."""
    return [order for order in orders if order * highest / (2 * math.pi) < 0.48 * rate]


@dataclass(frozen=True, eq=False)
class _Comb:
    """Power spectrum over its own noise floor, shape (bins,), averaged over signals."""

    power: np.ndarray
    spacing: float
    rate: float
    size: int
    orders: tuple[float, ...]

    @classmethod
    def of(cls, signals: Sequence[np.ndarray], rate: float, orders: Sequence[float]) -> _Comb:
        from scipy.fft import next_fast_len, rfft

        size = min(signal.size for signal in signals)
        length = next_fast_len(_PADDING * size)
        hann = np.hanning(size + 1)[:-1]
        total: np.ndarray | float = 0.0
        for signal in signals:
            x = signal[:size]
            spectrum = rfft((x - x.mean()) * hann, length)
            total = total + _over_floor(np.asarray(spectrum.real**2 + spectrum.imag**2))
        return cls(np.asarray(total) / len(signals), rate / length, rate, size, tuple(orders))

    def best(self, limits: Span) -> tuple[float, float]:
        """Return the slip speed (rad/s) with the strongest comb within `limits`, and its contrast."""
        step = 2 * math.pi * self.spacing / max(self.orders) / 2
        speeds = np.arange(limits[0], limits[1] + step, step)
        values = self._log_contrast(speeds)
        at = int(np.argmax(values))
        top, offset = values[at], 0.0
        if 0 < at < values.size - 1:
            before, after = values[at - 1], values[at + 1]
            bend = before - 2 * top + after
            offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
        return float(speeds[at] + offset * step), float(math.exp(top))

    def sharpened(self, speed: float) -> float:
        """Return the speed near `speed` where the summed power of the lines is largest: their likelihood, rad/s."""
        half = 2 * math.pi * self.rate / (self.size * max(self.orders))
        speeds = speed + np.linspace(-half, half, 41)
        grid = np.arange(self.power.size, dtype=float)
        total = sum(
            np.interp(k * speeds / (2 * math.pi * self.spacing), grid, np.sqrt(self.power)) ** 2 for k in self.orders
        )
        curve = np.polyfit((speeds - speed) / half, np.log(total), 2)
        return float(speed - half * curve[1] / (2 * curve[0])) if curve[0] < 0 else speed

    def contrast_at(self, speed: float) -> float:
        """Return the contrast at a slip speed."""
        return float(np.exp(self._log_contrast(np.array([speed]))[0]))

    def _log_contrast(self, speeds: np.ndarray) -> np.ndarray:
        """Return the mean log power at the lines of each slip speed, shape (n,)."""
        logs = np.log(np.maximum(self.power, 1e-12))
        grid = np.arange(logs.size, dtype=float)
        total = np.zeros(speeds.size)
        for order in self.orders:
            total += np.interp(order * speeds / (2 * math.pi * self.spacing), grid, logs)
        return total / len(self.orders)

    def resolution(self, contrast: float) -> float:
        """Return the standard error of a slip speed by the Cramer-Rao bound of the comb, doubled for the window, rad/s."""
        duration = self.size / self.rate
        # One line of power ratio P at order k: sd(f) = sqrt(6 / P) / (2 pi T), and s = 2 pi f / k.
        weight = contrast * sum(order**2 for order in self.orders)
        return 2 * math.sqrt(6 / weight) / duration


def _over_floor(power: np.ndarray) -> np.ndarray:
    """Return power over the local noise: a running median by blocks, of which noise exceeds the mean by 1/ln 2."""
    size = min(_FLOOR, power.size)
    blocks = power[: power.size // size * size].reshape(-1, size)
    medians = np.median(blocks, axis=1) / math.log(2)
    centres = (np.arange(medians.size) + 0.5) * size
    floor = np.interp(np.arange(power.size), centres, medians)
    return np.asarray(power / np.maximum(floor, 1e-300 + 1e-12 * float(medians.max())))
