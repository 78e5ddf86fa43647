"""The design matrix of a harmonic regression, block by block, and its normal equations.

Columns are [1, Legendre drift, cos and -sin of each order]. What the coefficients mean is told by
`harmonic`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial import legendre

from pipeline.errors import InputError

# Rows that are held at a time: 31 columns of them stay within the cache and far below the memory.
_ROWS = 1 << 14
# Elements of a design matrix that is kept (16 MB) instead of being computed a second time.
_KEPT = 1 << 21


def scaled(time: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """Return time mapped so that `span` becomes -1..1."""
    return (time - 0.5 * (span[0] + span[1])) / max(0.5 * (span[1] - span[0]), 1e-300)


def in_blocks(time: np.ndarray, frequency: float) -> Iterator[tuple[slice, np.ndarray]]:
    """Yield rows and the cycles passed since t = 0, block by block."""
    for start in range(0, time.size, _ROWS):
        rows = slice(start, start + _ROWS)
        yield rows, frequency * time[rows]


def exponentials(cycles: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """Return exp(j h 2 pi cycles), shape (k, n); consecutive orders by multiplication."""
    out = np.empty((orders.size, cycles.size), dtype=complex)
    step = np.exp(2j * np.pi * (cycles % 1.0))
    for k, order in enumerate(orders):
        if k % 16 and order == orders[k - 1] + 1:
            np.multiply(out[k - 1], step, out=out[k])
        else:
            out[k] = step if order == 1 else np.exp(2j * np.pi * ((order * cycles) % 1.0))
    return out


class Regression:
    """Columns [1, drift, cos, -sin, ...] and the least-squares solution by their normal equations."""

    def __init__(
        self,
        time: np.ndarray,
        values: np.ndarray,
        frequency: float,
        orders: np.ndarray,
        drift: int,
        span: tuple[float, float],
    ) -> None:
        self.time, self.frequency, self.orders, self.drift, self.span = time, frequency, orders, drift, span
        count = 1 + drift + 2 * orders.size
        self._kept = list(self._computed()) if count * time.size < _KEPT else None
        gram, product = np.zeros((count, count)), np.zeros(count)
        for rows, columns in self.blocks():
            gram += columns @ columns.T
            product += columns @ values[rows]
        # A column that vanishes at all samples (a sine at half the rate) must not be blown up.
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-12 * time.size))
        eigenvalues, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
        if not eigenvalues[0] > 1e-11 * eigenvalues[-1]:
            cycles = frequency * (span[1] - span[0])
            raise InputError(
                f"the samples cannot tell {orders.size} harmonics of {frequency:.6g} Hz apart: {cycles:.2f} cycles "
                f"were logged with {time.size / max(cycles, 1e-9):.1f} samples a cycle. Fit fewer orders or log longer."
            )
        self.condition = float(eigenvalues[-1] / eigenvalues[0])
        self.inverse = (vectors / eigenvalues) @ vectors.T / np.outer(scale, scale)
        self.solution = self.inverse @ product

    def blocks(self) -> Iterator[tuple[slice, np.ndarray]]:
        """Return rows and their columns of the design matrix, shape (columns, rows), block by block."""
        return self._computed() if self._kept is None else iter(self._kept)

    def _computed(self) -> Iterator[tuple[slice, np.ndarray]]:
        first = 1 + self.drift
        for rows, cycles in in_blocks(self.time, self.frequency):
            columns = np.empty((first + 2 * self.orders.size, cycles.size))
            columns[:first] = legendre.legvander(scaled(self.time[rows], self.span), self.drift).T
            turning = exponentials(cycles, self.orders)
            columns[first::2] = turning.real
            np.negative(turning.imag, out=columns[first + 1 :: 2])
            yield rows, columns

    def apply(self, solution: np.ndarray) -> np.ndarray:
        """Return the fitted curve at the stamps."""
        return np.concatenate([solution @ columns for _, columns in self.blocks()])
