"""A comb of lines at fixed multiples of one unknown rate, sought in the spectra of several signals.

Nothing of gears: which multiples, and what the rate means, is the caller's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.gearbox.aligned_run import Span

# Zero padding, in lengths of the signal.
_PADDING = 4
# Bins of the padded spectrum over which the noise floor is a median.
_FLOOR = 400
# Power over the floor of a line that stands out: noise does so at one place with probability exp(-20). Half width of a
# Hann line, in lines of the resolution.
_STANDS, _LOBE = 20.0, 2


def in_band(orders: Sequence[float], rate: float, highest: float) -> list[float]:
    """Return the orders whose line stays below 0.48 of the sampling rate at the highest slip."""
    return [order for order in orders if order * highest / (2 * math.pi) < 0.48 * rate]


def thinned(signals: list[np.ndarray], rate: float, highest: float) -> tuple[list[np.ndarray], float]:
    """Return signals and rate without the band far above the highest line (rad/s): it costs time and tells nothing."""
    factor = int(rate / (4 * highest / (2 * math.pi)))
    if factor < 2:
        return signals, rate
    from scipy.signal import resample_poly

    return [np.asarray(resample_poly(x - x.mean(), 1, factor)) for x in signals], rate / factor


@dataclass(frozen=True, eq=False)
class Comb:
    """Power spectrum over its own noise floor, shape (bins,), averaged over signals; slip speeds are in rad/s."""

    power: np.ndarray
    spacing: float
    rate: float
    size: int
    orders: tuple[float, ...]

    @classmethod
    def of(cls, signals: Sequence[np.ndarray], rate: float, orders: Sequence[float]) -> Comb:
        """Return the comb of `orders` per turn over signals of shape (n,), sampled at `rate` Hz."""
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

    def without(self, rest: Comb) -> Comb:
        """Return the comb blind to the lines that stand at rest, too: mains hum and its harmonics look like a comb."""
        size = max(round(_LOBE * rest.rate / rest.size / rest.spacing), 1)
        hum = np.convolve(rest.power > _STANDS, np.ones(2 * size + 1), "same") > 0
        at = np.minimum(np.round(np.arange(self.power.size) * self.spacing / rest.spacing).astype(int), hum.size - 1)
        return replace(self, power=np.where(hum[at], np.minimum(self.power, 1.0), self.power))

    def stands_near(self, speed: float, block: float) -> bool:
        """Tell whether a line stands so near to `speed` (rad/s) that it leaks into it in blocks of `block` seconds."""
        at, reach = speed / (2 * math.pi * self.spacing), (_LOBE + 1) / (block * self.spacing)
        return bool(self.power[max(int(at - reach), 0) : int(at + reach) + 2].max(initial=0.0) > _STANDS)

    def stands_out(self, speed: float) -> bool:
        """Tell whether two lines at least stand out of the noise at a slip speed: a single one is no comb."""
        at = np.round(np.array(self.orders) * speed / (2 * math.pi * self.spacing)).astype(int)
        tops = [float(self.power[max(i - _PADDING, 0) : i + _PADDING + 1].max()) for i in at]
        return sorted(tops)[-2] > _STANDS

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
