"""Which tones a run is excited with, and how long a block of whole cycles of all of them is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import Recording, Stream
from pipeline.rigs.tpjb.conditions import numbers_of
from pipeline.rigs.tpjb.dynamic.blocks import common_divisor

# Hz, what tones are looked for below (the rig's actuators end at 350 Hz), and the stretch that tells them.
_HIGHEST = 400.0
_STRETCH = 10.0
# A line is a tone when its power is that much above its surroundings, and its amplitude a share of the largest.
_ABOVE, _SHARE = 200.0, 0.05
# Blocks below which their scatter says too little of the error; what one would rather have.
LEAST_BLOCKS, _GOOD_BLOCKS = 4, 8


def commanded_tones(recording: Recording) -> np.ndarray | None:
    """Return the tones (Hz, rising) that the run says it is excited with; None where it says none.

    Raises
    ------
    InputError
        If the condition is no list of frequencies.
    """
    text = recording.conditions.get("excitation_tones")
    if text is None or text == "":
        return None
    tones = np.unique(numbers_of(text, "Hz", run=recording.run, name="excitation_tones"))
    return tones[tones > 0]


def tones_in(stream: Stream, names: Sequence[str]) -> np.ndarray:
    """Return the tones (Hz, rising) that stand out of the spectra of channels, to 1/10 of their width.

    Averaged periodograms of stretches of 10 s, so that a change of phase in the log (from in-phase
    to antiphase) does not split a line; lines on a common grid are put on it.
    """
    rate = (stream.size - 1) / max(stream.duration, 1e-12)
    group = max(1, int(rate / (2.5 * _HIGHEST)))
    stretch = min(_STRETCH, stream.duration / 2)
    n = int(stretch * rate / group)
    if n < 64:
        return np.zeros(0)
    power = np.zeros(2 * n + 1)
    rest = np.zeros((len(names), 0))
    window = np.hanning(n)
    for _, values in stream.blocks(names):
        samples = np.nan_to_num(np.vstack(values))
        whole = samples.shape[1] // group * group
        rest = np.hstack((rest, samples[:, :whole].reshape(len(names), -1, group).mean(axis=2)))
        while rest.shape[1] >= n:
            part = rest[:, :n] - rest[:, :n].mean(axis=1, keepdims=True)
            power += (np.abs(np.fft.rfft(part * window, 4 * n)) ** 2).sum(axis=0)
            rest = rest[:, n // 2 :]
    frequency = np.fft.rfftfreq(4 * n, group / rate)
    return _on_grid(_peaks(frequency, power, 4))


def _peaks(frequency: np.ndarray, power: np.ndarray, width: int) -> np.ndarray:
    """Return the frequencies of narrow peaks; a line is `width` bins wide (half)."""
    low, high = np.searchsorted(frequency, [8 * frequency[width], 0.95 * frequency[-1]])
    found = []
    largest = power[low:high].max(initial=0.0)
    for i in range(low, high):
        around = power[max(i - 10 * width, 1) : i + 10 * width + 1]
        if power[i] < _SHARE**2 * largest or power[i] < power[max(i - 2 * width, 0) : i + 2 * width + 1].max():
            continue
        if power[i] > _ABOVE * np.median(around):
            a, b, c = np.log(power[i - 1 : i + 2])
            found.append(frequency[i] + 0.5 * (a - c) / (a - 2 * b + c) * frequency[1])
    return np.array(found)


def _on_grid(tones: np.ndarray) -> np.ndarray:
    """Put tones on the coarsest usual grid that all of them lie near."""
    for step in (1.0, 0.5, 0.25, 0.2, 0.1, 0.05, 0.02):
        if tones.size and np.abs(tones / step - np.rint(tones / step)).max() < 0.02:
            return np.round(np.rint(tones / step) * step, 6)
    return tones


@dataclass(frozen=True)
class BlockLength:
    """`length` of a block (s), how many fit, and whether tones and shaft do whole cycles in it."""

    length: float
    blocks: int
    whole: bool
    shaft_whole: bool


def block_length(tones: np.ndarray, shaft: float | None, orders: int, duration: float) -> BlockLength:
    """Choose the block: whole cycles of all tones and, where the log is long enough, of the shaft.

    Parameters
    ----------
    tones
        Hz.
    shaft
        Turns a second, None where it is unknown or stands still; orders 1..`orders` are kept 2/length
        away from the tones where that can be had.
    duration
        Of the log, s.

    Notes
    -----
    Long blocks tell neighbouring lines apart, many blocks tell the error: of those of which eight fit, the
    shortest that parts all lines is taken, and rather one with whole turns of the shaft.
    """
    divisor = common_divisor(tones)
    whole = divisor is not None and LEAST_BLOCKS / divisor <= duration * (1 + 1e-6)
    # Without a common cycle the least squares part the lines all the same, given some resolution.
    base = 1 / divisor if whole and divisor else max(duration / 20, 4 / _closest(tones, None, 0))
    apart = _closest(tones, shaft, orders)
    best: BlockLength | None = None
    for n in range(1, 1 + max(1, int(duration * (1 + 1e-6) / base / LEAST_BLOCKS))):
        length = n * base
        blocks = int(duration * (1 + 1e-6) / length)
        turns = shaft * length if shaft else math.nan
        shaft_whole = bool(abs(turns - round(turns)) < 0.02) if shaft else False
        choice = BlockLength(length, blocks, whole, shaft_whole)
        if best is None:
            best = choice
        parts, parted = apart * length >= 2, apart * best.length >= 2
        if n > 1 and blocks < min(_GOOD_BLOCKS, int(duration / base)):
            break
        if parted and not (parts and shaft_whole and not best.shaft_whole):
            continue
        best = choice  # parts the lines, or does it as far as the length of the log allows
    return best or BlockLength(base, int(duration * (1 + 1e-6) / base), whole, False)


def shortest_block(tones: np.ndarray, shaft: float | None, orders: int) -> float:
    """Return the shortest block (s) that parts tones and shaft orders, whole cycles or not."""
    return max(2 / _closest(tones, shaft, orders), 2 / float(tones.min()))


def _closest(tones: np.ndarray, shaft: float | None, orders: int) -> float:
    """Return the smallest distance (Hz) of a tone from another, from zero, or from a shaft order."""
    distances = [tones.min(initial=np.inf), np.diff(np.sort(tones)).min(initial=np.inf)]
    if shaft:
        distances.append(np.abs(tones[:, None] - shaft * np.arange(1, orders + 1)).min(initial=np.inf))
    return float(min(distances))


def on_shaft_orders(tones: np.ndarray, shaft: float | None, orders: int, length: float) -> np.ndarray:
    """Return which tones, shape (k,) bool, stand within 2/length of a shaft order."""
    if not shaft:
        return np.zeros(tones.shape, dtype=bool)
    distance = np.abs(tones[:, None] - shaft * np.arange(1, orders + 1)).min(axis=1, initial=np.inf)
    return np.asarray(distance < (2 - 1e-9) / length)


def second_order_products(tones: np.ndarray, shaft: float | None, orders: int, length: float) -> np.ndarray:
    """Return the sums and differences of tones (Hz) that are apart from every tone and shaft order.

    There a linear bearing leaves nothing. With tones at odd multiples of one frequency these are its even multiples.
    """
    sums = np.abs(np.concatenate([np.add.outer(tones, tones).ravel(), np.subtract.outer(tones, tones).ravel()]))
    products = np.unique(np.round(sums, 6))
    lines = np.r_[tones, [] if not shaft else shaft * np.arange(1, 2 * orders + 1)]
    apart = np.abs(products[:, None] - lines).min(axis=1) >= (2 - 1e-9) / length
    merged = products[apart & (products >= 2 / length)]
    return np.asarray(merged[np.diff(merged, prepend=-np.inf) >= 0.5 / length])
