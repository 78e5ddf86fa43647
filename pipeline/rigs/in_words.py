"""How likely, and how large against the noise: in words for those who read a verdict, not for those who test hypotheses."""

from __future__ import annotations

import math

_RARE = 1e-4


def chance(p_value: float) -> str:
    """Return a probability in per cent; one below 1 in 10 000 as that, nothing where there is none.

    Examples
    --------
    >>> chance(0.0123)
    '1.2 %'
    >>> chance(1.2e-05)
    'less than 1 in 10 000'
    """
    if math.isnan(p_value):
        return ""
    if p_value < _RARE:
        return "less than 1 in 10 000"
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
