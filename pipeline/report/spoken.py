"""What a screen reader says of a panel: its title, what is drawn over which axes, and where the data lie."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from pipeline.findings.figures import Band, Line, Mark, Matrix, Outline, Panel, Points, Rule, Stems
from pipeline.report.numbers import plain
from pipeline.report.scale import Scale, extent
from pipeline.report.words import clean

_KINDS = {Line: "line", Points: "points", Outline: "outline", Stems: "stems", Band: "band", Rule: "marker line"}
_MOST_MARKS = 12


def spoken_title(panel: Panel) -> str:
    """Return the panel's title, what its axes show where it has none."""
    return clean(panel.title) or f"{clean(panel.y.label) or 'heat map'} over {clean(panel.x.label) or 'its columns'}"


def spoken(panel: Panel, x: Scale, y: Scale) -> str:
    """Return one or two sentences on what a panel shows; numbers in the units of its axes."""
    matrix = next((mark for mark in panel.marks if isinstance(mark, Matrix)), None)
    if matrix is not None:
        rows, columns = np.asarray(matrix.values).shape
        return f"Heat map of {rows} rows ({_listed(matrix.rows)}) and {columns} columns ({_listed(matrix.columns)})."
    drawn = [_mark(mark, x, y) for mark in panel.marks]
    told = [words for words, _ in groupby(drawn)]
    more = f" and {len(told) - _MOST_MARKS} more" if len(told) > _MOST_MARKS else ""
    axes = f"{_axis(panel, 'y', y)} over {_axis(panel, 'x', x)}"
    return f"{axes}. Drawn: {', '.join(told[:_MOST_MARKS])}{more}." if told else f"{axes}. No data."


def _axis(panel: Panel, direction: str, scale: Scale) -> str:
    heading = scale.unit.heading(clean(scale.label)) or direction
    found = extent(panel.marks, direction, scale.log)
    if found is None:
        return heading
    low, high = (plain(scale.unit.read(limit), 3) for limit in found)
    return f"{heading} from {low} to {high}" + (", logarithmic" if scale.log else "")


def _mark(mark: Mark, x: Scale, y: Scale) -> str:
    if isinstance(mark, Rule):
        scale, at = (y, mark.y) if mark.x is None else (x, mark.x)
        place = "" if at is None else f" at {plain(scale.unit.read(at), 3)} {scale.unit.name}".rstrip()
        return f"{clean(mark.label)} (marker line{place})".strip()
    if isinstance(mark, Matrix):
        return "heat map"
    name = clean(mark.label) or (mark.role if isinstance(mark.role, str) else "")
    count = f"{np.size(mark.x)} " if isinstance(mark, Points | Stems) else ""
    return f"{name} ({count}{_KINDS[type(mark)]})".strip()


def _listed(names: Sequence[str]) -> str:
    return ", ".join(clean(name) for name in names)
