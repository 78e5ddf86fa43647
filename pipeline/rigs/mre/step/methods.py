"""The methods paragraphs of `mre.step`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted
from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    steps = findings.arrays["steps"]
    rises, falls = int((steps["direction"] == "rise").sum()), int((steps["direction"] == "fall").sum())
    return [
        f"{counted(rises, 'rising step')} and {counted(falls, 'falling step')} were found in the measured coil current, from the levels that it is held at. The onset of a change is where the exponential of a coil through "
        "its passages of 5 and 25 % begins; where no two samples lie in the change, it is the middle of the interval, with its uncertainty added to the delay and to t63 and t90.",
        "The model of the force is F_0 plus, for each step, its gain g times y, less creep: c for each decade of 1 s + t, t from the start of the log; y is the part of the measured current that belongs to the step, delayed by L and passed through one "
        "or two first-order lags (Brancati et al. 2019, test with current steps); L and the lags are those of its direction, each step has a gain g of its own. The lags are exact for a current that is straight "
        "between its samples. Where 'force_filter' is told, the current is passed through the same first-order low-pass before, so that the filter is in none of the times; "
        "'force_lag' is taken off delay, t63 and t90; a filter that is not told acts as one more lag and is part of them. The force is linear in F_0, c and the gains, so variable projection was used (Golub and Pereyra 1973, Kaufman 1975) with analytic derivatives from several starts.",
        "One lag or two was chosen for each direction by BIC (Schwarz 1978) with the effective number of samples; a second lag must win by 6. Residuals that are correlated in time widen the standard errors by the "
        "effective number of samples. Intervals hold 95 %, symmetric in the logarithm for time constants; where a second lag is not told, those of the delay and of the first lag are profiles with a second one admitted. "
        "t63 and t90 are those of the model for the measured current, and so contain the coil. Two time constants whose logarithms differ by less than 4.7 standard errors (the data know the square of their difference) or by less than 0.1, or that a change of the current within one sample "
        "hides, are told as a sum only. A step whose onset, or most of whose answer, lies in a hole or a freeze of force or current tells nothing; "
        "where the current looks like the set-point, what the coil's time may be part of is withheld.",
    ]
