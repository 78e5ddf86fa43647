"""Mean rate of a comb of lines whose rate may wander, from the phases of its lines block by block.

The phase that a line gains between the first and the last block is the mean rate between them, however the
rate moved meanwhile. Where the comb lies to begin with is found in `comb`; nothing of gears here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Blocks overlap by half. The floor beside a line is a median over so many bins on either side, its own left out.
_BESIDE, _OWN = 24, 3
# Steps of the search for the phase gained between blocks, over one turn of the fastest line.
_STEPS = 32
_PASSES = 3
# Power over noise that all lines of a block need together, so that no turn of the fastest line is lost; squares of
# the phases about a straight line, over their noise, that are no noise.
_LEAST, _BENT = 100.0, 3.0
# Third differences of blocks that do not overlap: fewer tell no scatter.
_FEWEST = 5


@dataclass(frozen=True)
class Track:
    """Mean rate between the middles of the first and of the last block.

    `rate` and `std_error` are in rad/s, `dof` are those of the error, `span` s from the first sample,
    `wander` the standard deviation of the rate from block to block beyond its noise, rad/s. `steady` tells
    that the phases lie on a straight line as far as noise lets see.
    """

    rate: float
    std_error: float
    dof: float
    span: tuple[float, float]
    wander: float
    steady: bool


def follow(
    signals: Sequence[np.ndarray], rate: float, orders: Sequence[float], guess: np.ndarray, block: float
) -> Track | None:
    """Follow the phases of a comb.

    Parameters
    ----------
    signals
        Shape (n,) each, sampled at `rate` Hz.
    orders
        Lines per turn.
    guess
        Rate at every sample, rad/s, shape (n,), to within half a line width of a block.
    block
        Length of a block, s.

    Returns
    -------
    None where fewer than five blocks fit, or the lines of one block do not tell their phase well enough.
    """
    n, size = min(signal.size for signal in signals), round(block * rate)
    hop = size // 2
    count = (n - size) // hop + 1
    if size < 16 or count < 5:
        return None
    hann = np.hanning(size + 1)[:-1]
    turned = np.cumsum(guess[:n]) / rate
    carriers = [_cut(np.exp(-1j * order * turned), size, hop) for order in orders]
    bins = [round(order * float(guess[:n].mean()) / (2 * math.pi) * size / rate) for order in orders]
    # Per line and channel: what the blocks hold of it, over the noise.
    lines = np.empty((len(orders), len(signals), count), dtype=complex)
    for c, signal in enumerate(signals):
        blocks = _cut(signal[:n] - signal[:n].mean(), size, hop) * hann
        power = np.mean(np.abs(np.fft.rfft(blocks, axis=1)) ** 2, axis=0)
        for i, carrier in enumerate(carriers):
            lines[i, c] = np.einsum("ij,ij->i", blocks, carrier) / math.sqrt(_floor(power, bins[i]))
    strength = np.maximum(np.sum(np.abs(lines) ** 2 - 1.0, axis=1), 0.0)
    if np.median(strength.sum(axis=0)) < _LEAST:
        return None
    k = np.asarray(orders, dtype=float)
    pairs = np.sum(lines[:, :, 1:] * lines[:, :, :-1].conj(), axis=1)
    angle = np.r_[0.0, np.cumsum(_agreed(k, pairs))]
    for _ in range(_PASSES):
        # From block to block errors add up; against the mean of all blocks each stands alone.
        turned_back = lines * np.exp(-1j * k[:, None, None] * angle)
        mean = turned_back.mean(axis=2, keepdims=True)
        angle = angle + _agreed(k, np.sum(turned_back * mean.conj(), axis=1))
    middles = (0.5 * size + hop * np.arange(count)).astype(int)
    angle = angle + turned[middles]
    # Cramer and Rao: the phase of a line of power P over the noise is known to 1/sqrt(2 P).
    variance = 1.0 / np.maximum(2.0 * (k**2) @ strength, 1e-300)
    bound, dof = float(variance[0] + variance[-1]), math.inf
    bends = np.diff(angle[::2], 3)
    if bends.size >= _FEWEST:
        # A rate that drifts steadily leaves third differences alone: 1, 3, 3, 1 make 20 variances.
        scatter = 2.0 * float(np.mean(bends**2)) / 20.0
        if scatter > bound:
            bound, dof = scatter, bends.size / 2.0
    at = middles / rate
    straight = np.polynomial.Polynomial.fit(at, angle, 1)(at)
    rates = np.diff(angle) / np.diff(at)
    noise = float(np.median(variance)) * 2.0 * (rate / hop) ** 2
    return Track(
        float((angle[-1] - angle[0]) / (at[-1] - at[0])),
        math.sqrt(bound) / float(at[-1] - at[0]),
        dof,
        (float(at[0]), float(at[-1])),
        math.sqrt(max(float(rates.var()) - noise, 0.0)),
        bool(np.mean((angle - straight) ** 2 / variance) < _BENT),
    )


def _cut(values: np.ndarray, size: int, hop: int) -> np.ndarray:
    """Return overlapping blocks, shape (count, size)."""
    return np.lib.stride_tricks.sliding_window_view(values, size)[::hop]


def _floor(power: np.ndarray, at: int) -> float:
    """Return the power of the noise beside a line."""
    beside = np.r_[power[max(at - _BESIDE, 1) : max(at - _OWN, 1)], power[at + _OWN + 1 : at + _BESIDE + 1]]
    return max(float(np.median(beside)), 1e-300) if beside.size else 1e-300


def _agreed(orders: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the angle that the phases of all lines (of `pairs`, shape (orders, m)) agree on best, rad, shape (m,)."""
    top = math.pi / float(orders.max())
    grid = np.linspace(-top, top, 2 * _STEPS + 1)
    score = (np.exp(-1j * np.outer(grid, orders)) @ pairs).real
    found = grid[np.argmax(score, axis=0)]
    for _ in range(4):  # Newton's steps to the top
        turned = pairs * np.exp(-1j * np.outer(orders, found))
        slope, bend = orders @ turned.imag, (orders**2) @ turned.real
        found = found + np.clip(slope / np.maximum(bend, 1e-300), -top / _STEPS, top / _STEPS)
    return np.asarray(found)
