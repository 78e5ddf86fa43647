"""How likely, how large against the noise, how well known: in words for those who read a report and sign it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from pipeline.errors import counted
from pipeline.findings import Parameter

_RARE = 1e-4
_NO_BREAK = "\u00a0"
_SIGNIFICANT = 0.01


def chance(p_value: float) -> str:
    r"""Return a probability in per cent; one below 1 in 10 000 as that, nothing where there is none.

    Examples
    --------
    >>> chance(0.0123)
    '1.2 %'
    >>> chance(1.2e-05)
    'less than 1 in 10\xa0000'
    """
    if math.isnan(p_value):
        return ""
    if p_value < _RARE:
        return f"less than 1 in 10{_NO_BREAK}000"
    return f"{100.0 * p_value:.2g} %" if p_value < 0.99 else "more than 99 %"


def times_noise(chi2_reduced: float) -> str:
    """Return how many times the noise a misfit is (rms), from chi-squared over its degrees of freedom.

    Examples
    --------
    >>> times_noise(9.25)
    '3.04 times the noise'
    """
    times = math.sqrt(chi2_reduced)
    return f"{times:.{2 if times < 10.0 else 0}f} times the noise"


def known(parameter: Parameter | None, size: float, unit: str) -> str:
    """Return a number with its 95 % interval in a unit of that SI size: ``"317.10 mm (95 %: 317.07 to 317.14 mm)"``.

    Two digits of half of the interval decide; '' where there is no number.
    """
    if parameter is None or parameter.value is None:
        return ""
    return known_as(parameter.value, parameter.ci95, size, unit)


def known_as(value: float, ci95: tuple[float, float] | None, size: float, unit: str) -> str:
    """Return a number that is no parameter as `known` does.

    Examples
    --------
    >>> known_as(226425.48, (226283.0, 226568.0), 1e3, "kN/m")
    '226.43 kN/m (95 %: 226.28 to 226.57 kN/m)'
    """
    if ci95 is None:
        return f"{value / size:.4g} {unit}".rstrip()
    low, high = (limit / size for limit in ci95)
    half = 0.5 * (high - low)
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 and math.isfinite(half) else 3
    shown = (f"{number:.{digits}f}" for number in (value / size, low, high))
    return "{} {u} (95 %: {} to {} {u})".format(*shown, u=unit).replace(" )", ")").replace("  ", " ")


def span(values: Iterable[float], digits: int, unit: str = "") -> str:
    """Return the least and the most of some numbers, one where they read alike: ``"0.98 to 1.06"``."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return "unknown"
    low, high = (f"{round(limit, digits) + 0.0:.{digits}f}" for limit in (min(finite), max(finite)))
    return f"{low if low == high else f'{low} to {high}'} {unit}".rstrip()


def found_by_tests(p_values: Iterable[float]) -> str:
    """Return how many tests of a residual find something besides noise: their p-value is below 1 %; NaN is no test.

    Examples
    --------
    >>> found_by_tests([0.2, 0.001])
    '1 of 2 tests finds more.'
    """
    known_ones = [p for p in p_values if math.isfinite(p)]
    found = sum(p < _SIGNIFICANT for p in known_ones)
    if not known_ones:
        return "Not told: there are too few data for a test."
    tests = counted(len(known_ones), "test")
    return (
        f"None of {tests} finds more." if not found else f"{found} of {tests} {'finds' if found == 1 else 'find'} more."
    )


def sentence(text: str) -> str:
    """Return a text as a sentence: its first letter large, a point at its end."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."
