"""One clock against another as a straight line: the convention of every lag and rate of this rig (rap.md, section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


def _unknown() -> np.ndarray:
    return np.full((2, 2), np.nan)


@dataclass(frozen=True, eq=False)
class Clock:
    """``t = t_d + lag + rate (t - reference)`` with t on the bench's clock and t_d on the device's.

    Attributes
    ----------
    reference
        s on the bench's clock; `lag` (s) holds there.
    rate
        Rate error, 1: positive where the device counts too slowly.
    covariance
        Of lag and rate, shape (2, 2); NaN where unknown.

    Examples
    --------
    >>> clock = Clock(100.0, 3.0, 1e-3)
    >>> float(clock.to_bench(np.array(97.0))), float(clock.to_device(np.array(100.0)))
    (100.0, 97.0)
    """

    reference: float
    lag: float
    rate: float = 0.0
    covariance: np.ndarray = field(default_factory=_unknown)

    def to_bench(self, device_time: np.ndarray) -> np.ndarray:
        """Return stamps of the device, shape (n,), on the bench's clock."""
        moved = np.asarray(device_time, dtype=float) + self.lag - self.reference
        return np.asarray(self.reference + moved / (1.0 - self.rate))

    def to_device(self, bench_time: np.ndarray) -> np.ndarray:
        """Return stamps of the bench, shape (n,), on the device's clock."""
        time = np.asarray(bench_time, dtype=float)
        return np.asarray(time - self.lag - self.rate * (time - self.reference))

    def lag_at(self, bench_time: np.ndarray) -> np.ndarray:
        """Return the lag (s) at bench times (s), shape (n,)."""
        return np.asarray(self.lag + self.rate * (np.asarray(bench_time, dtype=float) - self.reference))

    def lag_sd_at(self, bench_time: np.ndarray) -> np.ndarray:
        """Return the standard error (s) of the lag at bench times (s), shape (n,); NaN where unknown."""
        ahead = np.asarray(bench_time, dtype=float) - self.reference
        (ll, lr), (_, rr) = self.covariance
        return np.asarray(np.sqrt(np.maximum(ll + 2.0 * ahead * lr + ahead**2 * rr, 0.0)))

    def moved(self, reference: float) -> Clock:
        """Return the same line told at another bench time (s)."""
        step = np.array([[1.0, reference - self.reference], [0.0, 1.0]])
        return Clock(reference, float(self.lag_at(np.array(reference))), self.rate, step @ self.covariance @ step.T)
