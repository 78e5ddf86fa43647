"""How the answers under figures and tables are worded: lists, signs, intervals. Knows no experiment."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from pipeline.findings import Parameter


def joined(parts: Sequence[str]) -> str:
    """Return ``"a, b and c"``."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))


def signed(value: float, digits: int) -> str:
    """Return a number with its sign and so many decimals; what rounds to zero has none."""
    text = f"{value:+.{digits}f}"
    return text if any(digit in "123456789" for digit in text) else text[1:]


def grouped(pairs: Iterable[tuple[str, str]], everywhere: str) -> str:
    """Return what is said of whom, alike together: ``"within at access and return; outside at ultrafiltrate"``.

    Where the same is said of several and of nobody else, `everywhere` stands for them: ``"every tap"``.
    """
    by: dict[str, list[str]] = {}
    for whom, said in pairs:
        by.setdefault(said, []).append(whom)
    alike = len(by) == 1 and len(next(iter(by.values()))) > 1
    return "; ".join(f"{said} at {everywhere if alike else joined(whom)}" for said, whom in by.items())


def plus_minus(value: float, half: float, unit: str = "", sign: bool = False) -> str:
    """Return a number with half of its interval, two digits of it deciding: ``"39.70 ± 0.46 ppm"``."""
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 and math.isfinite(half) else 2
    number = signed(value, digits) if sign else signed(value, digits).lstrip("+")
    return f"{number} +- {half:.{digits}f} {unit}".rstrip()


def told(parameter: Parameter | None, size: float, unit: str) -> str:
    """Return a parameter with half of its 95 % interval in a unit of that SI size; '' where it is not determined."""
    if parameter is None or parameter.value is None or parameter.ci95 is None:
        return ""
    low, high = parameter.ci95
    if unit.startswith("10"):
        return f"({plus_minus(parameter.value / size, 0.5 * (high - low) / size)})·{unit}"
    return plus_minus(parameter.value / size, 0.5 * (high - low) / size, unit)


def holding(off: Iterable[float], half: Iterable[float]) -> tuple[int, int]:
    """Return how many of the differences are within their 95 % halves, and how many there are."""
    pairs = [(abs(d), h) for d, h in zip(off, half, strict=True) if math.isfinite(d) and math.isfinite(h)]
    return sum(d <= h for d, h in pairs), len(pairs)
