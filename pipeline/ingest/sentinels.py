"""Numbers that stand for "no value": -9999 and its like, told from measured numbers by where they lie.

Loggers and converters write them where a sensor gave nothing. They are looked for in the numbers as logged, before
any unit or calibration, which hide them.
"""

from __future__ import annotations

import math

import numpy as np

# As loggers, data bases and instruments write them; 9.91e37 is the "not a number" of SCPI instruments.
_USUAL = (-9999.0, 9999.0, -999.25, -999.0, 999.25, -9999.25, 9999.25, -99999.0, 99999.0, -999999.0, 999999.0)
_HUGE = tuple(
    sign * size for size in (1e20, 1e30, 1e31, 1e32, 1e35, 9.9e37, 9.91e37, 1e38, 9.96921e36) for sign in (1, -1)
)
SENTINELS = frozenset((*_USUAL, *_HUGE, *(float(np.float32(value)) for value in _HUGE), float(np.float32(-999.25))))
# One alone may be a spike, unless nothing can measure it.
_REPEATED = 2
_BEYOND_MEASURE = 1e20
_MOST = 0.3


class SentinelWatch:
    """Looks through one channel, block by block, for numbers that stand for no value.

    Attributes
    ----------
    masked
        The numbers that are taken as missing.
    """

    def __init__(self) -> None:
        self.masked: frozenset[float] = frozenset()
        self._counts: dict[float, int] = {}
        self._n = 0
        self._low, self._high = math.inf, -math.inf

    def _add(self, logged: np.ndarray) -> None:
        """Take the next block of numbers as logged (n,)."""
        if not logged.size:
            return
        low, high = float(logged.min()), float(logged.max())
        if not (math.isfinite(low) and math.isfinite(high)):
            self._add(logged[np.isfinite(logged)])
            return
        self._n += logged.size
        if low in SENTINELS or high in SENTINELS:
            is_one = np.isin(logged, list(SENTINELS))
            for value in np.unique(logged[is_one]).tolist():
                self._counts[value] = self._counts.get(value, 0) + int(np.count_nonzero(logged == value))
            if is_one.all():
                return
            low, high = float(logged[~is_one].min()), float(logged[~is_one].max())
        self._low, self._high = min(self._low, low), max(self._high, high)

    def found(self) -> frozenset[float]:
        """Return the numbers that stand for no value: repeated, and farther from all others than these are apart.

        Beside a number that never changes they must be few: two levels are those of a switch.
        """
        if not self._counts or not self._high >= self._low:
            return frozenset()
        apart = self._high - self._low
        least = max(apart, 1e-3 * max(abs(self._high), abs(self._low)))
        return frozenset(
            value
            for value, count in self._counts.items()
            if (count >= _REPEATED or abs(value) >= _BEYOND_MEASURE)
            and max(self._low - value, value - self._high) > least
            and (apart > 0 or count < _MOST * self._n)
        )

    def look(self, logged: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Take a block of numbers (n,) and return it with NaN for those in `masked`, and which these are (None: none)."""
        if not self.masked:
            self._add(logged)
            return logged, None
        gone = np.isin(logged, list(self.masked))
        return (np.where(gone, np.nan, logged), gone) if gone.any() else (logged, None)
