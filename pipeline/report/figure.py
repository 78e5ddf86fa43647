"""A figure as the page shows it: panels drawn at the sizes at which they are read, and its key.

Each panel is a picture of its own, so that a grid of them reflows to one column on a phone. A
figure of one column is drawn twice, wide and narrow, and the page shows the one that fits: text
keeps its size.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

from markupsafe import Markup, escape

from pipeline.findings.figures import Axis, Figure, Mark, Matrix
from pipeline.report.heat_map import label_room, lies_flat
from pipeline.report.labels import Key, ends, keys
from pipeline.report.palette import Style, style
from pipeline.report.panel import Frame, draw_panel, draw_thumbnail, drawing, title_lines, y_label_lines
from pipeline.report.scale import Scale, equal, extent, scale, unit_for
from pipeline.report.symbols import symbols_in
from pipeline.report.texts import room_over
from pipeline.report.words import clean, text_width, typeset
from pipeline.report.zoom import Signal, signals

_MOST_COLUMNS = 4
_MOST_PANELS = 60  # of one figure; more are the experiment's to sum up
# A sheet's width, and the height that a figure may take of it: white space before figures that stay whole grows with them.
_SHEET_WIDTH, _SHEET_HEIGHT = 700.0, 305.0
_LEAST_FONT = 8.7  # px on paper; a figure is made smaller only down to it
_MOST_WHOLE = 450.0  # px; a higher figure of three rows and more breaks between them


@dataclass(frozen=True)
class Shape:
    """How large panels are drawn: width, height, height of equal axes, font size (CSS pixels)."""

    name: str
    width: float
    height: float
    square: float
    font: float


_WIDE = Shape("wide", 780, 330, 560, 13)
_NARROW = Shape("narrow", 360, 270, 350, 12)
_SHAPES = {
    1: (_WIDE, _NARROW),
    2: (Shape("both", 440, 290, 430, 12.5),),
    3: (Shape("both", 350, 265, 345, 12.5),),
    4: (Shape("both", 260, 215, 260, 12.5),),
}


@dataclass(frozen=True)
class FigureView:
    """What the template needs of a figure."""

    kind: ClassVar[str] = "figure"
    number: int
    name: str
    title: str
    caption: str
    alt: str
    columns: int
    key: Markup
    grids: Sequence[tuple[str, Sequence[Markup]]]
    breaks: bool
    share: int = 100
    signals: Sequence[Signal] = field(default=(), compare=False, repr=False)


def figure_view(figure: Figure, number: int) -> FigureView:
    """Draw a figure. The same figure under the same number gives the same bytes.

    Parameters
    ----------
    figure
        What to show, in SI.
    number
        Its number in the page; goes into the ids of the SVG.
    """
    figure = _typeset(_abridged(figure))
    columns = max(1, min(figure.columns, len(figure.panels), _MOST_COLUMNS))
    scales = _scales(figure)
    grids: list[tuple[str, list[Markup]]] = []
    widest, share, breaks = 0.0, 1.0, False
    with drawing():
        for shape in _SHAPES[columns]:
            frames = _frames(figure, scales, columns, shape)
            widest = max([widest, *(frame.inner[0] for frame in frames)])
            if not grids:
                share, breaks = _on_paper(frames, columns)
            drawn = []
            for place, (panel, (x, y), frame) in enumerate(zip(figure.panels, scales, frames, strict=True)):
                if panel.equal and not x.log and not y.log:
                    x, y = equal(x, y, *frame.inner)
                salt = _salt(figure.name, number, shape.name, place)
                drawn.append(draw_panel(panel, x, y, frame, ends(figure, panel, columns), salt))
            grids.append((shape.name, drawn))
    return FigureView(
        number, figure.name, clean(figure.title), clean(figure.caption), _alt(figure), columns,
        key_markup(keys(figure, columns)), grids, breaks, int(100 * share),
        signals(figure, number, scales, widest),
    )  # fmt: skip


def _on_paper(frames: Sequence[Frame], columns: int) -> tuple[float, bool]:
    """Return the share of a sheet's width that a figure takes, and whether it breaks between its rows of panels."""
    rows = [frames[start : start + columns] for start in range(0, len(frames), columns)]
    width = _SHEET_WIDTH / columns
    height = sum(max(frame.height * min(width / frame.width, 1.0) for frame in row) + 6 for row in rows)
    legible = max(_LEAST_FONT * frame.width / (frame.font * width) for frame in frames)
    share = min(max(_SHEET_HEIGHT / height, legible), 1.0)
    breaks = len(rows) > 2 and share * height > _MOST_WHOLE
    return 1.0 if breaks else share, breaks


def _abridged(figure: Figure) -> Figure:
    """Return the figure with as many panels as a reader and a page can bear, and a caption that says so."""
    more = len(figure.panels) - _MOST_PANELS
    if more <= 0:
        return figure
    caption = f"{figure.caption} The first {_MOST_PANELS} of {len(figure.panels)} panels are drawn."
    return replace(figure, panels=figure.panels[:_MOST_PANELS], caption=caption.strip())


def _typeset(figure: Figure) -> Figure:
    """Return the figure with the signs that a typewriter lacks in all its words."""

    def told(mark: Mark) -> Mark:
        return mark if isinstance(mark, Matrix) or not mark.label else replace(mark, label=typeset(mark.label))

    panels = [replace(p, title=typeset(p.title), marks=[told(mark) for mark in p.marks]) for p in figure.panels]
    title, caption, alt = typeset(figure.title), typeset(figure.caption), typeset(figure.alt)
    return replace(figure, panels=panels, title=title, caption=caption, alt=alt)


def thumbnail(figure: Figure, owner: str, width: float = 240, height: float = 130) -> Markup:
    """Draw the first panel of a figure as a small picture without text; `owner` makes its ids unique."""
    panel = figure.panels[0]
    ((x, y),) = _scales(replace(figure, panels=[panel]))
    if panel.equal and not x.log and not y.log:
        x, y = equal(x, y, width, height)
    with drawing():
        return draw_thumbnail(panel, x, y, width, height, _salt("thumbnail", owner))


def _salt(*parts: object) -> str:
    return hashlib.sha256("\0".join(map(str, parts)).encode(errors="replace")).hexdigest()


def _alt(figure: Figure) -> str:
    return clean(figure.alt) or clean(figure.title)


def _scales(figure: Figure) -> list[tuple[Scale, Scale]]:
    along_x = _along(figure, "x", figure.share_x)
    along_y = _along(figure, "y", figure.share_y)
    pairs = []
    for panel, x, y in zip(figure.panels, along_x, along_y, strict=True):
        if panel.equal and panel.x.unit == panel.y.unit and x.unit != y.unit:
            larger = max(x.unit, y.unit, key=lambda unit: unit.size)
            x, y = x.read_in(larger), y.read_in(larger)
        pairs.append((x, y))
    return pairs


def _along(figure: Figure, direction: str, share: bool) -> list[Scale]:
    """Return the scale of each panel along x or y; one quantity has one unit in the whole figure."""
    axes: list[Axis] = [panel.x if direction == "x" else panel.y for panel in figure.panels]
    extents = [
        extent(panel.marks, direction, axis.scale == "log") for panel, axis in zip(figure.panels, axes, strict=True)
    ]
    made = []
    for axis, own in zip(axes, extents, strict=True):
        alike = [found for other, found in zip(axes, extents, strict=True) if other == axis and found]
        limits = (min(e[0] for e in alike), max(e[1] for e in alike)) if share and alike else own
        made.append(scale(axis, unit_for(axis, alike), limits))
    return made


def _frames(figure: Figure, scales: Sequence[tuple[Scale, Scale]], columns: int, shape: Shape) -> list[Frame]:
    """Return the frame of each panel; margins agree, so that axes stand under each other."""
    font = shape.font
    scales = [
        equal(x, y, 0.8 * shape.width, 0.8 * shape.square) if panel.equal and not x.log and not y.log else (x, y)
        for panel, (x, y) in zip(figure.panels, scales, strict=True)
    ]
    most_y = int((shape.height - 60) / (3 * font))
    ticks = [text for _, y in scales for text in y.ticks(most_y)[1]]
    label_lines = max(len(y_label_lines(y, shape.height, font)) for _, y in scales)
    left = max((text_width(text, font) for text in ticks), default=20) + 1.25 * font * label_lines + 15
    labels = [label for panel in figure.panels for label in ends(figure, panel, columns)]
    right = max((text_width(label, font) * 1.08 for label in labels), default=0) + (12 if labels else 14)
    lines = max(len(title_lines(panel, shape.width, font)) for panel in figure.panels)
    inner_width = shape.width - left - right
    over = [room_over(p.marks, x, inner_width, font) for p, (x, _) in zip(figure.panels, scales, strict=True)]
    if columns > 1:
        over = [max(over)] * len(over)
    top = 10 + (lines * 1.25 * font + 6 if lines else 0)
    frames = []
    for panel, above in zip(figure.panels, over, strict=True):
        matrix = next((mark for mark in panel.marks if isinstance(mark, Matrix)), None)
        if matrix is not None:
            frames.append(_matrix_frame(matrix, shape, top))
        else:
            height = above + (shape.square if panel.equal else shape.height)
            frames.append(Frame(shape.width, height, font, left, right, top + above, 2.4 * font + 10, above))
    return frames


def _matrix_frame(matrix: Matrix, shape: Shape, top: float) -> Frame:
    font = shape.font
    left, right = label_room(list(matrix.rows), font), 10.0
    room = shape.width - left - right
    cell = min(room / max(len(matrix.columns), 1), 52.0)
    width = cell * max(len(matrix.columns), 1)
    bottom = 2 * font if lies_flat(matrix, width, font) else label_room(list(matrix.columns), font)
    height = top + bottom + max(len(matrix.rows), 1) * min(cell, 40.0)
    return Frame(shape.width, height, font, left, right + room - width, top, bottom)


def key_markup(entries: Sequence[Key]) -> Markup:
    """Return the key as a list; the swatches show line, dash, marker and band as they are drawn."""
    if not entries:
        return Markup()
    items = Markup().join(
        Markup("<li>{}<span>{}</span></li>").format(_swatch(entry, style(entry.role)), symbols_in(entry.label))
        for entry in entries
    )
    return Markup('<ul class="key">{}</ul>').format(items)


def _swatch(entry: Key, look: Style) -> Markup:
    colour = f"var(--{look.variable})"
    parts = Markup()
    if entry.band:
        parts += Markup('<rect x="0" y="1" width="30" height="10" fill="{}" fill-opacity=".25"/>').format(colour)
    if entry.line:
        dash = Markup(' stroke-dasharray="6 3"') if entry.dashed or look.hollow else ""
        parts += Markup('<path d="M0 6H30" stroke="{}" stroke-width="{}" fill="none"{}/>').format(
            colour, escape(f"{look.width:g}"), dash
        )
    if entry.stems:
        parts += Markup('<path d="M9 12V3M15 12V0M21 12V6" stroke="{}" stroke-width="2.5" fill="none"/>').format(colour)
    if entry.points or (entry.line and not entry.band and isinstance(entry.role, int)):
        inside = "var(--paper)" if look.hollow else colour
        parts += Markup('<path d="{}" transform="translate(15 6)" fill="{}" stroke="{}" stroke-width="1.2"/>').format(
            look.marker_path, inside, colour
        )
    return Markup(
        '<svg viewBox="0 0 30 12" width="30" height="12" aria-hidden="true" focusable="false">{}</svg>'
    ).format(parts)
