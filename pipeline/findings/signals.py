"""Which arrays of findings hold signals over time, for programs that show them beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Signals:
    """An array with the columns ``run`` and ``time`` (s, of that run): measured, modelled, left over.

    Attributes
    ----------
    array
        Its name among ``Findings.arrays``.
    units
        SI unit of each column that is a signal ('1' for a ratio).
    about
        What it shows, in a sentence.
    by
        A column that tells signals of one run apart (a channel, a plane); '' where there is none.
    """

    array: str
    units: Mapping[str, str]
    about: str = ""
    by: str = ""
