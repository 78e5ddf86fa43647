"""A heat map from -1 to 1 with the numbers in its cells: blue below zero, white, red above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings.figures import Matrix
from pipeline.report.numbers import MINUS
from pipeline.report.palette import QUIET
from pipeline.report.words import clean, shortened, text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Not of the palette: cells keep their colours in the dark, and their numbers with them.
_BELOW, _ABOVE, _UNKNOWN = (33, 102, 172), (192, 68, 20), (205, 208, 213)
_ON_LIGHT, _ON_DARK = "#101418", "#fefefe"
_SMALLEST_TEXT = 6.0
_ROOM_FOR_A_ZERO = 30.0
_LABEL = 150.0  # widest label of a row or column, px


def label_room(labels: list[str], font: float) -> float:
    """Return the space that the longest label takes."""
    return max((min(text_width(clean(label), font), _LABEL) for label in labels), default=0.0) + 8


def lies_flat(matrix: Matrix, width: float, font: float) -> bool:
    """Tell whether the column labels fit side by side over cells of that total width."""
    cell = width / max(len(matrix.columns), 1)
    return all(text_width(clean(label), font) < cell - 3 for label in matrix.columns)


def draw_matrix(axes: Axes, matrix: Matrix, inner: tuple[float, float], font: float) -> None:
    """Draw the cells on axes of size `inner`; without texts where `font` is 0."""
    from matplotlib.collections import PolyCollection

    values = np.asarray(matrix.values, float)
    rows, columns = values.shape
    cells = [[(c, r), (c + 1, r), (c + 1, r + 1), (c, r + 1)] for r in range(rows) for c in range(columns)]
    colours = [_colour(value) for value in values.flat]
    gap = 0.8 if inner[0] / max(columns, 1) > 8 else 0.0
    edges = "none" if gap == 0 else QUIET[0]
    axes.add_collection(PolyCollection(cells, facecolors=colours, edgecolors=edges, linewidths=gap / 4))
    axes.set(xlim=(0, columns), ylim=(rows, 0))
    axes.spines[:].set_visible(False)
    if not font:
        return
    rotated = not lies_flat(matrix, inner[0], font)
    axes.set_xticks(np.arange(columns) + 0.5, [shortened(clean(name), _LABEL, font) for name in matrix.columns],
                    rotation=90 if rotated else 0, fontsize=font)  # fmt: skip
    axes.set_yticks(np.arange(rows) + 0.5, [shortened(clean(name), _LABEL, font) for name in matrix.rows],
                    fontsize=font)  # fmt: skip
    axes.tick_params(length=0, pad=4)
    cell = inner[0] / max(columns, 1)
    texts = [_number(value, short=cell < _ROOM_FOR_A_ZERO) for value in values.flat]
    widest = max((text_width(text, 1.0) for text in texts), default=1.0)
    size = min(font, (cell - 3) / widest, inner[1] / max(rows, 1) - 3)
    if size < _SMALLEST_TEXT:
        return
    for place, (text, value) in enumerate(zip(texts, values.flat, strict=True)):
        axes.text(place % columns + 0.5, place // columns + 0.5, text, ha="center", va="center_baseline",
                  fontsize=size, color=_ON_DARK if abs(value) > 0.62 else _ON_LIGHT)  # fmt: skip


def _colour(value: float) -> str:
    if not np.isfinite(value):
        return _hex(_UNKNOWN)
    end = _ABOVE if value > 0 else _BELOW
    share = min(abs(value), 1.0)
    red, green, blue = (round(250 + (part - 250) * share) for part in end)
    return _hex((red, green, blue))


def _hex(colour: tuple[int, int, int]) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour)


def _number(value: float, short: bool) -> str:
    """Write a correlation with two decimals; `short` without the zero before the point."""
    if not np.isfinite(value):
        return "–"
    text = f"{abs(value):.2f}"
    sign = MINUS if value < 0 and float(text) else ""
    return sign + (text.removeprefix("0").removesuffix(".00") if short else text)
