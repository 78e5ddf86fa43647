"""The numbers at which an alarm or a mismatch is due (rap.md, 3.9 and 3.10); the paper's own are lost."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AlarmLimits:
    """When a cause is an alarm.

    Attributes
    ----------
    high, low
        Ratio of a resistance to its baseline above or below which an alarm is due.
    hold
        How long it must stay there, s.
    blanking
        Time after a start of the pump or a change of its set-point in which ratios are not judged, s.
    stagnation
        Longest standstill of the blood, s.
    late
        Delay of a logged code behind the re-derived alarm beyond which it counts as late, s.
    pressure_most
        Magnitude of any pressure beyond which it is out of range, Pa.
    """

    high: float = 1.6
    low: float = 0.5
    hold: float = 1.0
    blanking: float = 3.0
    stagnation: float = 120.0
    late: float = 10.0
    pressure_most: float = 40e3


@dataclass(frozen=True)
class MismatchLimits:
    """When the two units disagree.

    Attributes
    ----------
    threshold, samples
        A difference of more than `threshold` (Pa) in `samples` samples in a row.
    allowance, limit
        kappa and h of the cumulative sums on 1 s means (Page 1954), Pa.
    """

    threshold: float = 300.0
    samples: int = 3
    allowance: float = 20.0
    limit: float = 80.0
