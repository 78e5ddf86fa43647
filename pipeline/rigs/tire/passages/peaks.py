"""Passages found coarsely: humps of the voltage above a threshold of each 10 s (tire.md, 5.2).

Where nothing stands out of the noise (the wheel stands, runs unloaded, or the sensor is dead) none is found. What lies
between them is judged in `chains`, their moments are refined in `times`.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

from pipeline.rigs.tire.passages.blocks import block_means, without_gaps

# Blocks per second that are looked at, seconds of one threshold.
_BLOCKS, _WINDOW = 4000.0, 10.0
# Gaps up to here (s) are bridged for looking only.
_BRIDGED = 2.0
# A hump rises above half of the contrast and ends below this share of it.
_UPPER, _LOWER = 0.5, 0.25
# Contrast over the spread (robust sd) of what is not a hump, and over a code of the converter.
_STANDS_OUT, _CODES = 5.0, 3.0
# A hump lower than this share of both its neighbourhoods is none.
_LEAST_HEIGHT = 0.35
_NEIGHBOURS = 5
# A single sample is a spike if it differs from both neighbours by so many times what all but 1.5 % do, and by this share
# of the signal's swing.
_SPIKE, _SPIKE_HEIGHT = 3.0, 0.1


@dataclass(frozen=True, eq=False)
class Humps:
    """Candidates in a stretch: place (samples) and height over the base, shape (p,); where windows had none, samples.

    `swing` is the difference of the 99.5 % and the 0.5 % quantile of the whole stretch, V.
    """

    places: np.ndarray
    heights: np.ndarray
    empty: tuple[tuple[float, float], ...]
    swing: float


def coarse(flex: np.ndarray, rate: float) -> tuple[np.ndarray, int]:
    """Return block means, with short gaps bridged, and how many samples each spans."""
    size = max(1, round(rate / _BLOCKS))
    return without_gaps(block_means(flex, size), int(_BRIDGED * rate / size)), size


def without_spikes(flex: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the samples without single ones that stand out of both their neighbours, and how many they were.

    What the noise and the passage itself do from sample to sample is seen in more than one sample of sixty.
    """
    jump = np.diff(flex)
    size = np.abs(jump)
    some = size[:: max(1, size.size // 100_000)]
    some = some[np.isfinite(some)]
    valid = flex[:: max(1, flex.size // 100_000)]
    valid = valid[np.isfinite(valid)]
    if some.size < 20:
        return flex, 0
    swing = float(np.subtract(*np.quantile(valid, [0.99, 0.01])))
    far = size > max(_SPIKE * float(np.quantile(some, 0.985)), _SPIKE_HEIGHT * max(swing, 0.02))
    alone = far[1:] & far[:-1]
    if not alone.any():
        return flex, 0
    alone &= jump[1:] * jump[:-1] < 0.0
    cleaned = flex.copy()
    cleaned[1:-1][alone] = np.nan
    return cleaned, int(alone.sum())


def pointing(means: np.ndarray, size: int, rate: float, step: float) -> int:
    """Return +1 where peaks point up, -1 where down, 0 where there are none.

    Parameters
    ----------
    means, size
        What `coarse` returns.
    step
        One code of the converter, V.
    """
    up = down = 0.0
    for window in _windows(means, size, rate):
        base, high, stands_out = _contrast(window, step)
        low, depth, hangs_down = _contrast(-window, step)
        up += (high - base) if stands_out else 0.0
        down += (depth - low) if hangs_down else 0.0
    return 0 if up == down == 0.0 else 1 if up >= down else -1


def humps_of(means: np.ndarray, size: int, rate: float, step: float) -> Humps:
    """Return the candidates of block means whose peaks point up."""
    windows = _windows(means, size, rate)
    upper, lower, base, empty = [], [], [], []
    at = 0
    for window in windows:
        low, high, stands_out = _contrast(window, step)
        contrast = high - low if stands_out else np.inf
        base.append(low)
        upper.append(low + _UPPER * contrast)
        lower.append(low + _LOWER * contrast)
        if not stands_out:
            empty.append((float(at * size), float((at + window.size) * size)))
        at += window.size
    sizes = [window.size for window in windows]
    centres, tops = _humps(means, np.repeat(upper, sizes), np.repeat(lower, sizes))
    heights = tops - np.repeat(base, sizes)[centres.astype(int)]
    kept = _tall(heights)
    valid = means[np.isfinite(means)]
    swing = float(np.subtract(*np.quantile(valid, [0.995, 0.005]))) if valid.size else float("nan")
    return Humps((centres[kept] + 0.5) * size, heights[kept], _joined(empty), swing)


def _humps(values: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and height of the stretches above `lower` that rise above `upper`, shape (p,) each.

    The centre is that of the area above the lower threshold, counted in values. NaN ends a stretch.

    Parameters
    ----------
    upper, lower
        The thresholds at each value, shape (n,) as the values.
    """
    inside = values > lower
    edges = np.flatnonzero(np.diff(inside, prepend=False, append=False))
    begins = edges[::2]
    if not begins.size:
        return np.zeros(0), np.zeros(0)
    risen = np.add.reduceat((values > upper).astype(np.int64), begins) > 0
    part = np.where(inside, values - lower, 0.0)
    weight = np.add.reduceat(part, begins)
    moment = np.add.reduceat(part * np.arange(values.size), begins)
    top = np.maximum.reduceat(np.where(inside, values, -np.inf), begins)
    return (moment / weight)[risen], top[risen]


def _windows(means: np.ndarray, size: int, rate: float) -> list[np.ndarray]:
    length = max(int(_WINDOW * rate / size), 1)
    return [means[begin : begin + length] for begin in range(0, means.size, length)]


def _contrast(window: np.ndarray, step: float) -> tuple[float, float, bool]:
    """Return base, 99.5 % quantile, and whether the latter stands out of the spread about the base."""
    valid = window[np.isfinite(window)]
    if valid.size < 20:
        return float("nan"), float("nan"), False
    base, high = np.quantile(valid, [0.5, 0.995])
    rest = valid[valid < 0.5 * (base + high)]
    spread = 1.4826 * float(np.median(np.abs(rest - base))) if rest.size else np.inf
    stands_out = high - base > max(_STANDS_OUT * spread, _CODES * step)
    return float(base), float(high), bool(stands_out)


def _tall(heights: np.ndarray) -> np.ndarray:
    """Return which humps are not much lower than those before and those after them."""
    high = heights.tolist()
    kept = np.ones(heights.size, dtype=bool)
    for i, height in enumerate(high):
        around = (high[max(i - _NEIGHBOURS, 0) : i], high[i + 1 : i + 1 + _NEIGHBOURS])
        usual = [median(side) for side in around if side]
        kept[i] = not usual or height >= _LEAST_HEIGHT * min(usual)
    return kept


def _joined(spans: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    joined: list[tuple[float, float]] = []
    for begin, end in spans:
        if joined and joined[-1][1] == begin:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return tuple(joined)
