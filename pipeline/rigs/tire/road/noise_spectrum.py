"""The noise of the divider's voltage by frequency, learnt from what the fits of a drive leave over.

Road noise is coloured: its spectrum weighs the orders of a revolution, and makes standard errors true.
"""

from __future__ import annotations

import numpy as np

_LOWEST, _HIGHEST, _PER_OCTAVE = 0.25, 65536.0, 4
_LEAST = 20.0
_EDGES = np.geomspace(_LOWEST, _HIGHEST, 18 * _PER_OCTAVE + 1)


class NoiseSpectrum:
    """Density of the noise, V^2/Hz one-sided, in bands of a quarter of an octave; `add` learns, `density` tells.

    Old revolutions fade as new ones come, `memory` of them count: a drive changes its road.
    """

    def __init__(self, memory: float = 2000.0) -> None:
        self.memory = memory
        self.power = np.zeros(_EDGES.size - 1)
        self.count = np.zeros(_EDGES.size - 1)

    @property
    def known(self) -> bool:
        """Whether enough was learnt to tell a spectrum."""
        return bool(np.count_nonzero(self.count >= _LEAST) >= 3)

    @property
    def frequency(self) -> np.ndarray:
        """Centres of the bands of which enough is known, Hz, shape (k,)."""
        return np.asarray(np.sqrt(_EDGES[1:] * _EDGES[:-1])[self.count >= _LEAST])

    @property
    def values(self) -> np.ndarray:
        """Density there, V^2/Hz, shape (k,)."""
        enough = self.count >= _LEAST
        return np.asarray(self.power[enough] / self.count[enough])

    def add(self, frequency: np.ndarray, density: np.ndarray, share: np.ndarray) -> None:
        """Learn from periodograms.

        Parameters
        ----------
        frequency, density
            Hz and V^2/Hz, shape (m, n) each: m revolutions, n orders.
        share
            What of the noise the fit has left in each, shape (m, n): the rest went into its parameters.
        """
        fade = np.exp(-frequency.shape[0] / self.memory)
        self.power *= fade
        self.count *= fade
        band = np.searchsorted(_EDGES, frequency.ravel()) - 1
        values = (density / share).ravel()
        order = np.argsort(band, kind="stable")
        band, values = band[order], values[order]
        for i in np.unique(band[(band >= 0) & (band < self.power.size)]):
            some = values[np.searchsorted(band, i) : np.searchsorted(band, i, side="right")]
            # Manoeuvres leave a little over in a few revolutions; the median of a periodogram is ln 2 of its mean.
            self.power[i] += some.size * float(np.median(some)) / np.log(2.0)
            self.count[i] += some.size

    def density(self, frequency: np.ndarray) -> np.ndarray:
        """Return the density, V^2/Hz, at frequencies (Hz, any shape), interpolated in logarithms.

        Below the lowest band that order 2 reaches it goes on falling as it does there, but not below the least anywhere.
        """
        x, y = np.log(self.frequency), np.log(self.values)
        at = np.log(frequency)
        first = slice(0, min(4, x.size))
        fall = max(0.0, float(np.polyfit(x[first], y[first], 1)[0])) if x.size > 1 else 0.0
        below = np.maximum(y[0] + fall * np.minimum(at - x[0], 0.0), min(y.min(), y[0]))
        return np.asarray(np.exp(np.where(at < x[0], below, np.interp(at, x, y))))
