"""Events in hours of running, with the Poisson bound that also holds where none was seen."""

from __future__ import annotations

from pipeline.rigs.rap.alarms.results import Rate


def rate(count: int, seconds: float) -> Rate:
    """Return `count` events in `seconds` as a rate.

    The bound is exact: chi^2 quantile of 2 (count + 1) degrees of freedom, halved, over the time; 3.0/T for none.
    Both are NaN where there was no time.

    Examples
    --------
    >>> round(rate(0, 5 * 3600.0).upper95, 2)
    0.6
    """
    from scipy.special import chdtri

    hours = seconds / 3600.0
    if hours <= 0.0:
        return Rate(count, 0.0, float("nan"), float("nan"))
    return Rate(count, hours, count / hours, float(chdtri(2.0 * (count + 1), 0.05)) / 2.0 / hours)
