"""Digits: a number is written as far as its uncertainty warrants, and numbers stand under each other.

Two significant digits of the standard error decide; without an error four significant digits are
shown. What cannot be written shortly gets a power of ten.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.report.reading_units import power_of_ten

MINUS = "−"
THIN = "\u202f"  # narrow space that does not break, between groups of three digits
_DIGIT_SPACE = "\u2007"  # as wide as a digit
_POINT_SPACE = "\u2008"  # as wide as a decimal point
_WITHOUT_ERROR = 4
_MOST_DIGITS = 9
_ROUNDED_TO = 2  # most decimals that are taken for rounded
_SAME_DECIMALS_WITHIN = 100.0  # largest over smallest number of a column
_LEADING_ZEROS = 3  # 0.0012 is still read at a glance
_NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Reading:
    """A number and its uncertainty as text in one unit; '' for what there is not."""

    value: str
    error: str = ""
    low: str = ""
    high: str = ""

    @property
    def interval(self) -> str:
        """The 95 % interval as text."""
        return f"{self.low} … {self.high}" if self.low else ""

    def __str__(self) -> str:
        return f"{self.value} ± {self.error}" if self.error else self.value


def warranted_decimals(error: float) -> int:
    """Return the decimals that show two significant digits of a positive `error`; below 0: tens, hundreds."""
    return 1 - math.floor(math.log10(float(f"{error:.1e}")))


def fixed(value: float, decimals: int) -> str:
    """Write `value` with `decimals` (negative: rounded to tens, hundreds), never as minus zero."""
    if math.isinf(value):
        return f"{MINUS if value < 0 else ''}∞"
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    whole, point, fraction = text.lstrip("-").partition(".")
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", THIN)
    negative = text.startswith("-") and any(digit in "123456789" for digit in text)
    return f"{MINUS if negative else ''}{whole}{point}{fraction}"


def plain(value: float, digits: int = _WITHOUT_ERROR) -> str:
    """Write a number that has no error with `digits` significant digits, without trailing zeros."""
    if not math.isfinite(value):
        return "–"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    exponent = int(power)
    if value != 0 and not -_LEADING_ZEROS <= exponent < _MOST_DIGITS:
        return f"{_without_zeros(fixed(float(mantissa), digits - 1))}×{power_of_ten(exponent)}"
    return _without_zeros(fixed(value, max(digits - 1 - exponent, 0)))


def _without_zeros(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def _error_of(value: float, std_error: float | None, ci95: tuple[float, float] | None) -> float | None:
    """Return what decides the digits: the standard error, else the nearer limit as if normal."""
    if std_error is not None and math.isfinite(std_error):
        return abs(std_error)
    sides = [abs(limit - value) for limit in ci95 or () if math.isfinite(limit) and limit != value]
    return min(sides) / _NORMAL_95 if sides else None


def reading(
    value: float,
    std_error: float | None = None,
    ci95: tuple[float, float] | None = None,
    size: float = 1.0,
    zero: float = 0.0,
) -> Reading:
    """Write a number with its standard error and 95 % interval.

    Parameters
    ----------
    value, std_error, ci95
        In SI; an error of exactly zero means that the value is exact (held, defined).
    size, zero
        Size of the unit for reading, in SI, and the SI value at which it starts to count.

    Examples
    --------
    >>> str(reading(260041.7, 347.0, size=1e3))
    '260.04 ± 0.35'
    >>> str(reading(12.0, 480.0))
    '10 ± 480'
    """
    value, std_error = (value - zero) / size, None if std_error is None else std_error / size
    ci95 = None if ci95 is None else ((ci95[0] - zero) / size, (ci95[1] - zero) / size)
    error = _error_of(value, std_error, ci95)
    if not math.isfinite(value) or not error:
        limits = ("", "") if ci95 is None else (plain(ci95[0]), plain(ci95[1]))
        return Reading(plain(value, 6 if error == 0 else _WITHOUT_ERROR), "0" if error == 0 else "", *limits)
    largest = max(abs(value), error)
    exponent = math.floor(math.log10(largest))
    decimals = warranted_decimals(error)
    scale, tail = 1.0, ""
    if exponent >= _MOST_DIGITS or exponent < -_LEADING_ZEROS:
        scale, tail = 10.0**exponent, f"×{power_of_ten(exponent)}"
        decimals += exponent
        exponent = 0
    kept = min(decimals, _MOST_DIGITS - 1 - max(exponent, 0))

    def text(number: float) -> str:
        return fixed(number / scale, kept) + tail

    shown_error = text(error) if kept == decimals else plain(error, 2)
    low, high = ("", "") if ci95 is None else (text(ci95[0]), text(ci95[1]))
    return Reading(text(value), "" if std_error is None else shown_error, low, high)


def alike(values: Sequence[float]) -> list[str] | None:
    """Write numbers without errors to the same decimals, four significant digits in the largest and more in none.

    Where they differ too much in size for that, decimals to which whoever made them has rounded are kept; else None.
    """
    sizes = [abs(value) for value in values if value != 0]
    if len(sizes) < 2 or max(sizes) >= _SAME_DECIMALS_WITHIN * min(sizes) or not 1e-3 <= min(sizes) < 1e6:
        kept = next((n for n in range(_ROUNDED_TO + 1) if all(round(v, n) == v for v in values)), None)
        return None if kept is None or len(values) < 2 else [fixed(value, kept) for value in values]
    decimals = max(min(_WITHOUT_ERROR - 1 - math.floor(math.log10(size)) for size in sizes), 0)
    while decimals and all(math.isclose(round(value, decimals - 1), round(value, decimals)) for value in values):
        decimals -= 1
    return [fixed(value, decimals) for value in values]


def range_of(values: Sequence[float]) -> str:
    """Write the least and the greatest of numbers without errors, to the same decimals where they allow it."""
    ends = sorted({min(values), max(values)})
    return " … ".join(dict.fromkeys(alike(ends) or [plain(end, 3) for end in ends]))


def _parts(text: str) -> tuple[str, str]:
    whole, point, fraction = text.partition(".")
    return whole, point + fraction


def aligned(texts: Sequence[str]) -> list[str]:
    """Pad numbers with spaces of a digit's width, so that decimal points stand under each other.

    For right-aligned columns of tabular digits. Words and numbers with a power of ten stay as they are.
    """
    numbers = [text for text in texts if _is_plain(text)]
    tails = [len(_parts(text)[1]) for text in numbers]
    longest = max(tails, default=0)

    def padded(text: str) -> str:
        tail = len(_parts(text)[1])
        if tail == longest:
            return text
        return text + ("" if tail else _POINT_SPACE) + _DIGIT_SPACE * (longest - max(tail, 1))

    return [padded(text) if _is_plain(text) else text for text in texts]


def aligned_readings(readings: Sequence[Reading | None]) -> list[str]:
    """Write readings of one column: values aligned at the point, and their errors likewise."""
    values = aligned([shown.value if shown else "" for shown in readings])
    errors = aligned([shown.error if shown else "" for shown in readings])
    whole = [len(_parts(shown.error)[0]) if shown else 0 for shown in readings]
    if not any(errors):
        return values
    written = []
    for shown, value, error, digits in zip(readings, values, errors, whole, strict=True):
        lead = _DIGIT_SPACE * (max(whole) - digits)
        if (
            shown and not shown.error and _is_plain(shown.value)
        ):  # as wide as a value with an error, for the point's sake
            value += "\u00a0" * 2 + _DIGIT_SPACE * (1 + len(max(errors, key=len)))
        written.append(f"{value} ± {lead}{error}" if shown and shown.error else value)
    return written


def _is_plain(text: str) -> bool:
    return text != "" and all(sign in "+0123456789." or sign in (MINUS, THIN) for sign in text)
