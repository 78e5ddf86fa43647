"""Equations that experiments declare, as MathML: browsers draw it, and screen readers read it, without a script."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from markupsafe import Markup, escape

from pipeline.report.symbols import symbols_in
from pipeline.rigs.experiment import Equation

# A word in an index is a name and stands upright; indices such as xx are pairs of directions.
_INDEX = re.compile(r"_\{([A-Za-z]+(?:,[A-Za-z]+)*)\}")
# The size of something: without fences the bars are set as operators, with gaps.
_SIZE = re.compile(r"\|([^|]+)\|")


@dataclass(frozen=True)
class EquationView:
    """An equation, what it says, and where it stands in the source."""

    drawn: Markup
    about: Markup
    source: str


@dataclass(frozen=True)
class Equations:
    """The equations of a model, one below the other."""

    kind: ClassVar[str] = "equations"
    views: Sequence[EquationView]


def equations(declared: Sequence[Equation]) -> Equations:
    """Return what the page shows of an experiment's equations."""
    return Equations([EquationView(mathml(e.latex), escape(symbols_in(e.about)), e.source) for e in declared])


def mathml(latex: str, display: bool = True) -> Markup:
    """Return LaTeX of an experiment's declaration as MathML, on a line of its own or in running text."""
    from latex2mathml.converter import convert

    fenced = _SIZE.sub(r"\\left|\1\\right|", _INDEX.sub(_upright, latex))
    return Markup(convert(fenced, display="block" if display else "inline"))


def _upright(index: re.Match[str]) -> str:
    words = index[1].split(",")
    named = any(len(word) > 1 and not set(word) <= set("xy") for word in words)
    return rf"_{{\mathrm{{{index[1]}}}}}" if named else index[0]
