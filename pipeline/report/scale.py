"""The scale of an axis: limits, unit for reading, ticks and their texts, known before anything is drawn."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.findings.figures import Axis, Band, Line, Mark, Outline, Points, Rule, Stems
from pipeline.report.numbers import MINUS, fixed
from pipeline.report.reading_units import ReadingUnit, power_of_ten, reading_unit

_MARGIN = 0.045  # of the span, free on both sides of the data
_LOG_PLAIN = (-3, 4)  # decades written out: 0.001 to 1000


@dataclass(frozen=True)
class Scale:
    """An axis ready to draw: `low` and `high` in the unit for reading."""

    label: str
    unit: ReadingUnit
    log: bool
    low: float
    high: float
    whole: bool = False

    def shown(self, si: object) -> np.ndarray:
        """Return SI numbers in the unit for reading; what a logarithmic axis cannot show becomes NaN."""
        values = (np.asarray(si, dtype=float) - self.unit.zero) / self.unit.size
        return np.where(values > 0, values, np.nan) if self.log else values

    def fraction(self, value: float) -> float:
        """Return where `value` (unit for reading) lies between `low` (0) and `high` (1)."""
        low, high, at = (math.log10(v) for v in (self.low, self.high, value)) if self.log else (
            self.low, self.high, value)  # fmt: skip
        return (at - low) / (high - low)

    def ticks(self, most: int) -> tuple[list[float], list[str]]:
        """Return at most about `most` round places within the limits, and their texts."""
        if self.log:
            places = _log_places(self.low, self.high, most)
            if places:
                return places, [_log_text(place) for place in places]
        places = _linear_places(self.low, self.high, most, self.unit.name == "°", self.whole)
        return places, _linear_texts(places)

    def read_in(self, unit: ReadingUnit) -> Scale:
        """Return the same scale in another unit of the same kind."""
        low, high = (unit.read(at * self.unit.size + self.unit.zero) for at in (self.low, self.high))
        return replace(self, unit=unit, low=low, high=high)

    def widened(self, low: float, high: float) -> Scale:
        """Return the same scale with other limits (unit for reading)."""
        return replace(self, low=low, high=high)


def coordinates(mark: Mark, axis: str) -> list[np.ndarray]:
    """Return the SI numbers of a mark along ``"x"`` or ``"y"``; a heat map has none."""
    if isinstance(mark, Line | Outline):
        return [np.asarray(mark.x if axis == "x" else mark.y, float)]
    if isinstance(mark, Points):
        all_of_them = (mark.x, mark.left, mark.right) if axis == "x" else (mark.y, mark.low, mark.high)
        return [np.asarray(values, float) for values in all_of_them if values is not None]
    if isinstance(mark, Stems):
        x, half = np.asarray(mark.x, float), (mark.width or 0.0) / 2
        return [x - half, x + half] if axis == "x" else [np.asarray(mark.y, float), np.array([mark.base])]
    if isinstance(mark, Band):
        return [np.asarray(values, float) for values in ((mark.x,) if axis == "x" else (mark.low, mark.high))]
    if isinstance(mark, Rule):
        place = mark.x if axis == "x" else mark.y
        return [] if place is None else [np.array([place], float)]
    return []


def extent(marks: Iterable[Mark], axis: str, log: bool) -> tuple[float, float] | None:
    """Return smallest and largest finite number (SI, positive where `log`), None where there is none."""
    low, high = math.inf, -math.inf
    for mark in marks:
        for values in coordinates(mark, axis):
            usable = values[np.isfinite(values) & (values > 0)] if log else values[np.isfinite(values)]
            if usable.size:
                low, high = min(low, float(usable.min())), max(high, float(usable.max()))
    return (low, high) if low <= high else None


def unit_for(axis: Axis, extents: Sequence[tuple[float, float]]) -> ReadingUnit:
    """Choose one unit for all panels that show the same quantity."""
    if not extents:
        return reading_unit(axis.unit, 0.0)
    low, high = min(e[0] for e in extents), max(e[1] for e in extents)
    size = math.sqrt(low) * math.sqrt(high) if axis.scale == "log" else max(abs(low), abs(high))
    return reading_unit(axis.unit, size)


def scale(axis: Axis, unit: ReadingUnit, limits: tuple[float, float] | None) -> Scale:
    """Return the scale of an axis for data between `limits` (SI), with a margin."""
    log = axis.scale == "log"
    low, high = limits if limits else ((1.0, 10.0) if log else (0.0, 1.0))
    low, high = unit.read(low), unit.read(high)
    if log:
        step = max(_MARGIN * math.log10(high / low), 0.02) if high > low else 0.2
        return Scale(axis.label, unit, True, low / 10**step, high * 10**step)
    span = high - low
    if span <= 1e-12 * max(abs(low), abs(high)):
        span = abs(high) or 1.0
    return Scale(axis.label, unit, False, low - _MARGIN * span, high + _MARGIN * span, axis.whole)


def equal(x: Scale, y: Scale, width: float, height: float) -> tuple[Scale, Scale]:
    """Widen one of two linear scales until a length measures the same along both on `width` x `height`."""
    per_point = max((x.high - x.low) / width, (y.high - y.low) / height)

    def grown(one: Scale, points: float) -> Scale:
        middle, half = (one.low + one.high) / 2, per_point * points / 2
        return one.widened(middle - half, middle + half)

    return grown(x, width), grown(y, height)


def _linear_places(low: float, high: float, most: int, degrees: bool, whole: bool) -> list[float]:
    from matplotlib.ticker import MaxNLocator

    turns = degrees and high - low > 60
    locator = MaxNLocator(
        nbins=max(most, 2), steps=[1, 1.5, 3, 4.5, 9, 10] if turns else [1, 2, 2.5, 5, 10], integer=whole
    )
    slack = 1e-9 * (high - low)
    return [float(place) for place in locator.tick_values(low, high) if low - slack <= place <= high + slack]


def _linear_texts(places: Sequence[float]) -> list[str]:
    if len(places) < 2:
        return [f"{place:.4g}".replace("-", MINUS) for place in places]
    step = places[1] - places[0]
    decimals = next((d for d in range(10) if all(abs(round(p, d) - p) < 1e-3 * step for p in places)), 10)
    return [fixed(place, decimals) for place in places]


def _log_places(low: float, high: float, most: int) -> list[float]:
    """Return 1, 2, 5 of each decade, or decades only; nothing where too few of them lie in the span."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    decades = [10.0**n for n in range(first, last + 1)]
    for digits in ((1, 2, 5), (1, 3), (1,)):
        places = [digit * decade for decade in decades for digit in digits if low <= digit * decade <= high]
        if len(places) <= max(most, 3):
            return places if len(places) >= 3 or (digits == (1,) and len(places) >= 2) else []
    return places[:: math.ceil(len(places) / most)]


def _log_text(place: float) -> str:
    exponent = math.floor(math.log10(place) + 1e-9)
    if _LOG_PLAIN[0] <= exponent < _LOG_PLAIN[1]:
        return f"{place:g}"
    digit = round(place / 10.0**exponent)
    return power_of_ten(exponent) if digit == 1 else f"{digit}×{power_of_ten(exponent)}"
