"""Least squares on known lines, block by block, straight from a stream (tpjb.md section 5, T2 steps 1 and 2).

Columns are offset, drift, the tones and the shaft orders. Only sums of products are kept of a block,
so that memory is that of one piece of the stream. What the lines mean is not known here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.recording import Stream
from pipeline.rigs.tpjb.dynamic.shaft import ShaftPhase

# Samples handled at once: their columns stay in the cache.
_CHUNK = 1 << 13
# Rate of the thinned samples that tell other lines, over the highest of these lines.
_THINNED = 10.0


@dataclass(frozen=True, eq=False)
class Lines:
    """What is fitted: `tones` (Hz, shape (k,)), shaft orders 1..`orders`, and `others` (Hz, shape (p,)).

    The others are not fitted along but looked for in what the fit leaves.
    """

    tones: np.ndarray
    shaft: ShaftPhase | None = None
    orders: int = 4
    others: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class BlockFits:
    """B blocks of c channels. A complex amplitude P stands for Re(P exp(i w t)), t in the run's time.

    Attributes
    ----------
    start
        Where each block begins, s, shape (B,).
    count
        Samples with all channels valid, shape (B,).
    mean, residual
        Level at mid-block and standard deviation of what is left, shape (B, c).
    tones, shaft, others
        Amplitudes, shape (B, k, c), (B, orders, c), (B, p, c); NaN in a block with too few samples.
    invalid
        Samples that are no number, by channel, shape (c,).
    """

    names: tuple[str, ...]
    start: np.ndarray
    length: float
    count: np.ndarray
    mean: np.ndarray
    residual: np.ndarray
    tones: np.ndarray
    shaft: np.ndarray
    others: np.ndarray
    invalid: np.ndarray


def fit_blocks(
    stream: Stream, names: Sequence[str], lines: Lines, start: float, length: float, blocks: int
) -> BlockFits:
    """Fit `blocks` blocks of `length` s, the first of which begins at `start` (s).

    Parameters
    ----------
    stream
        Stamps may jitter and have gaps; rows with a NaN in any of `names` do not count.
    names
        The c channels to fit.
    lines
        They must be further apart than 1/length.
    """
    rate = (stream.size - 1) / max(stream.duration, 1e-12)
    sums = [_Sums(lines, len(names), start + b * length, length, rate) for b in range(blocks)]
    invalid = np.zeros(len(names), dtype=int)
    edges = start + length * np.arange(blocks + 1)
    for time, values in stream.blocks(names):
        cuts = np.searchsorted(time, edges)
        for b in np.flatnonzero(np.diff(cuts)).tolist():
            for first in range(cuts[b], cuts[b + 1], _CHUNK):
                part = slice(first, min(first + _CHUNK, cuts[b + 1]))
                invalid += sums[b].add(time[part], [channel[part] for channel in values])
        done = int(np.searchsorted(edges, time[-1], side="right")) - 1
        for b in range(min(done, blocks)):
            sums[b].close()
    solved = [entry.close() for entry in sums]
    return BlockFits(
        names=tuple(names),
        start=edges[:-1],
        length=length,
        count=np.array([entry.count for entry in solved]),
        mean=np.array([entry.mean for entry in solved]),
        residual=np.array([entry.residual for entry in solved]),
        tones=np.array([entry.tones for entry in solved]),
        shaft=np.array([entry.shaft for entry in solved]),
        others=np.array([entry.others for entry in solved]),
        invalid=invalid,
    )


@dataclass(frozen=True, eq=False)
class _Solved:
    count: int
    mean: np.ndarray
    residual: np.ndarray
    tones: np.ndarray
    shaft: np.ndarray
    others: np.ndarray


class _Sums:
    """Sums of products of one block: columns and channels are the rows of one matrix Z; Z Z^T is summed."""

    def __init__(self, lines: Lines, channels: int, start: float, length: float, rate: float) -> None:
        self._lines, self._middle, self._length = lines, start + length / 2, length
        self._orders = lines.orders if lines.shaft is not None else 0
        self._p = 2 + 2 * lines.tones.size + 2 * self._orders
        self._channels = channels
        self._products: np.ndarray | None = None
        self._offset = np.zeros(channels)
        self._count = 0
        highest = float(lines.others.max()) if lines.others.size else 0.0
        self._group = max(1, int(rate / (_THINNED * highest))) if highest else 0
        self._rate = rate
        self._thinned: list[np.ndarray] = []
        self._solved: _Solved | None = None

    def add(self, time: np.ndarray, values: list[np.ndarray]) -> np.ndarray:
        """Add samples; return how many are no number, by channel."""
        Z = np.empty((self._p + self._channels, time.size))
        for row, channel in zip(Z[self._p :], values, strict=True):
            row[:] = channel
        invalid = np.zeros(self._channels, dtype=int)
        if not np.isfinite(Z[self._p :].sum()):
            finite = np.isfinite(Z[self._p :])
            invalid = (~finite).sum(axis=1)
            keep = finite.all(axis=0)
            time, Z = time[keep], np.ascontiguousarray(Z[:, keep])
        if not time.size:
            return invalid
        if self._products is None:
            self._products = np.zeros((Z.shape[0], Z.shape[0]))
            self._offset = Z[self._p :, 0].copy()  # a large level would cost digits of the small lines
        Z[self._p :] -= self._offset[:, None]
        self._columns(time, Z)
        self._products += Z @ Z.T
        self._count += time.size
        if self._group:
            whole = time.size // self._group * self._group
            kept = np.vstack((time[None, :whole], Z[self._p :, :whole]))
            self._thinned.append(kept.reshape(kept.shape[0], -1, self._group).mean(axis=2))
        return invalid

    def _columns(self, time: np.ndarray, Z: np.ndarray) -> None:
        Z[0] = 1.0
        Z[1] = (time - self._middle) / self._length
        row = 2
        for turning in _turning(time, self._lines.tones):
            Z[row], Z[row + 1] = turning.real, turning.imag
            row += 2
        if self._lines.shaft is not None:
            first = _unit(self._lines.shaft.turns(time))
            turning = first
            for order in range(self._orders):
                turning = turning if order == 0 else turning * first
                Z[row], Z[row + 1] = turning.real, turning.imag
                row += 2

    def close(self) -> _Solved:
        """Solve the block and let its sums go."""
        if self._solved is None:
            self._solved = self._solve()
            self._products, self._thinned = None, []
        return self._solved

    def _solve(self) -> _Solved:
        p, k = self._p, self._lines.tones.size
        expected = self._rate * self._length
        if self._products is None or self._count < max(0.5 * expected, 2 * p):
            none = np.full((k + self._orders + self._lines.others.size, self._channels), np.nan + 0j)
            lost = np.full(self._channels, np.nan)
            return _Solved(self._count, lost, lost, none[:k], none[k : k + self._orders], none[k + self._orders :])
        G, R = self._products[:p, :p], self._products[:p, p:]
        scale = 1 / np.sqrt(np.diag(G))
        solution = scale[:, None] * np.linalg.lstsq(G * np.outer(scale, scale), scale[:, None] * R, rcond=1e-13)[0]
        left = np.diag(self._products)[p:] - (solution * R).sum(axis=0)
        amplitudes = solution[2::2] - 1j * solution[3::2]
        return _Solved(
            self._count,
            solution[0] + self._offset,
            np.sqrt(np.maximum(left, 0.0) / (self._count - p)),
            amplitudes[:k],
            amplitudes[k:],
            self._others(solution),
        )

    def _others(self, solution: np.ndarray) -> np.ndarray:
        """Return the amplitudes of the other lines in what the fit leaves, from the thinned samples."""
        if not self._group:
            return np.zeros((0, self._channels), dtype=complex)
        time, *channels = np.concatenate(self._thinned, axis=1)
        Z = np.empty((self._p, time.size))
        self._columns(time, Z)
        # Averaging over a group of samples scales a line by the Dirichlet kernel.
        kernel = np.ones(self._p)
        lines = [*self._lines.tones]
        if self._lines.shaft is not None:
            lines += [order * self._lines.shaft.frequency(self._middle) for order in range(1, self._orders + 1)]
        kernel[2:] = np.repeat(_dirichlet(np.array(lines) / self._rate, self._group), 2)
        left = np.array(channels) - (solution * kernel[:, None]).T @ Z
        turning = np.exp(-2j * np.pi * self._lines.others[:, None] * time)
        scale = _dirichlet(self._lines.others / self._rate, self._group)
        return np.asarray(2 / time.size * (turning @ left.T) / scale[:, None])


def _turning(time: np.ndarray, tones: np.ndarray) -> Iterator[np.ndarray]:
    """Yield exp(2 pi i f t) for each tone, from powers of their common divisor where there is one."""
    divisor = common_divisor(tones)
    multiples = None if divisor is None else np.rint(tones / divisor).astype(int)
    if divisor is None or multiples is None or multiples.max(initial=0) > 4096 or np.any(np.diff(multiples) < 1):
        for tone in tones:
            yield _unit(tone * time)
        return
    powers = {1: _unit(divisor * time)}
    turning = None
    for step in np.diff(multiples, prepend=0):
        factor = _power(powers, int(step))
        turning = factor if turning is None else turning * factor
        yield turning


def _power(powers: dict[int, np.ndarray], n: int) -> np.ndarray:
    """Return the n-th power of ``powers[1]``, kept for the next time."""
    if n not in powers:
        half = _power(powers, n // 2)
        powers[n] = half * half if n % 2 == 0 else half * half * powers[1]
    return powers[n]


def _unit(turns: np.ndarray) -> np.ndarray:
    """Return exp(2 pi i turns)."""
    angle = 2 * np.pi * (turns - np.rint(turns))
    out = np.empty(turns.shape, dtype=complex)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    return out


def _dirichlet(cycles: np.ndarray, size: int) -> np.ndarray:
    """Return how averaging `size` samples scales a line of `cycles` per sample."""
    below = size * np.sin(np.pi * cycles)
    top = np.sin(np.pi * cycles * size)
    return np.asarray(np.divide(top, below, out=np.ones_like(below), where=np.abs(below) > 1e-12))


def common_divisor(tones: np.ndarray, step: float = 1e-4) -> float | None:
    """Return the greatest common divisor of tones (Hz) on a grid of `step`; None where they are on none.

    Examples
    --------
    >>> common_divisor(np.array([7.0, 10.5, 14.0]))
    3.5
    >>> common_divisor(np.array([7.0, 7.00003])) is None
    True
    """
    counts = np.rint(tones / step).astype(np.int64)
    if not counts.size or np.abs(tones - counts * step).max() > 1e-3 * step:
        return None
    return round(float(np.gcd.reduce(counts)) * step, 9)
