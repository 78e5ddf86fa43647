"""One pair of axes as SVG: where everything stands is settled first, then matplotlib draws it once.

Lengths are CSS pixels. No pyplot, no layout engine: a report holds hundreds of panels.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from pipeline.findings.figures import Line, Matrix, Panel, Points
from pipeline.report.heat_map import draw_matrix
from pipeline.report.marks import draw_marks
from pipeline.report.palette import GRID, INK, QUIET, style
from pipeline.report.scale import Scale, extent
from pipeline.report.spoken import spoken, spoken_title
from pipeline.report.svg import inline
from pipeline.report.texts import apart
from pipeline.report.words import clean, shortened, text_width, wrapped

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RASTER_DPI = 190  # of points drawn as a picture; the page shows them at 72 to 110


@dataclass(frozen=True)
class Frame:
    """Size of a panel, of its text, and the free space around the axes; `over` of it, above, is for names of rules."""

    width: float
    height: float
    font: float
    left: float
    right: float
    top: float
    bottom: float
    over: float = 0.0

    @property
    def inner(self) -> tuple[float, float]:
        """Width and height of the axes."""
        return self.width - self.left - self.right, self.height - self.top - self.bottom

    def most_ticks(self, x: Scale) -> int:
        """Return how many tick texts stand beside each other under the axes."""
        width = self.inner[0]
        widest = max((text_width(text, self.font) for text in x.ticks(6)[1]), default=20.0)
        return max(2, min(8, int(width / (widest + 1.6 * self.font))))


@contextmanager
def drawing() -> Iterator[None]:
    """Set matplotlib up for panels: text stays text, dollar signs are dollar signs, paths are simplified."""
    import matplotlib

    settings: Any = {
        "svg.fonttype": "none", "text.parse_math": False, "text.usetex": False, "font.family": ["DejaVu Sans"],
        "path.simplify": True, "path.simplify_threshold": 0.15, "axes.unicode_minus": True,
        "axes.edgecolor": QUIET[0], "axes.linewidth": 0.9, "axes.axisbelow": True, "agg.path.chunksize": 20000,
        "axes.spines.top": False, "axes.spines.right": False, "axes.facecolor": "none", "figure.facecolor": "none",
        "axes.labelcolor": INK[0], "xtick.color": QUIET[0], "ytick.color": QUIET[0], "text.color": INK[0],
    }  # fmt: skip
    with matplotlib.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # the reader's fonts have it, not ours
        yield


def draw_panel(panel: Panel, x: Scale, y: Scale, frame: Frame, ends: Mapping[str, Line | Points], salt: str) -> Markup:
    """Draw a panel; call within `drawing()`.

    Parameters
    ----------
    panel, x, y
        What to draw and the scales to draw it on.
    frame
        Size and margins.
    ends
        Labels that are written beside the right end of their mark.
    salt
        Makes the ids in the SVG unique in the page.
    """
    from matplotlib.figure import Figure

    inner = frame.inner
    figure = Figure(figsize=(frame.width / 72, frame.height / 72), dpi=_RASTER_DPI)
    box = (frame.left / frame.width, frame.bottom / frame.height, inner[0] / frame.width, inner[1] / frame.height)
    axes = figure.add_axes(box)
    matrix = next((mark for mark in panel.marks if isinstance(mark, Matrix)), None)
    if matrix is not None:
        draw_matrix(axes, matrix, inner, frame.font)
    else:
        _draw_axes(axes, x, y, frame)
        draw_marks(axes, panel.marks, x, y, inner, frame.font)
        _write_ends(axes, ends, x, y, frame)
        if extent(panel.marks, "x", x.log) is None or extent(panel.marks, "y", y.log) is None:
            axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center", color=QUIET[0], fontsize=frame.font)
    for line, text in enumerate(reversed(title_lines(panel, frame.width, frame.font))):
        place = 1 + (7 + frame.over + line * 1.25 * frame.font) / inner[1]
        axes.text(-(frame.left - 4) / inner[0], place, text, transform=axes.transAxes, ha="left", va="bottom",
                  fontsize=frame.font + 0.5, fontweight="bold")  # fmt: skip
    return inline(_svg(figure, salt), spoken_title(panel), spoken(panel, x, y), f"panel-{salt[:16]}")


def draw_thumbnail(panel: Panel, x: Scale, y: Scale, width: float, height: float, salt: str) -> Markup:
    """Draw the marks alone, for a glance; call within `drawing()`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72), dpi=_RASTER_DPI)
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
    matrix = next((mark for mark in panel.marks if isinstance(mark, Matrix)), None)
    if matrix is not None:
        draw_matrix(axes, matrix, (width, height), 0.0)
    else:
        axes.set(xscale="log" if x.log else "linear", yscale="log" if y.log else "linear")
        axes.set(xlim=(x.low, x.high), ylim=(y.low, y.high))
        draw_marks(axes, panel.marks, x, y, (width, height), 0.0)
    axes.axis("off")
    return inline(_svg(figure, salt))


def title_lines(panel: Panel, width: float, font: float) -> list[str]:
    """Return the title broken into lines as wide as the panel."""
    return wrapped(panel.title, width - 12, font + 1) if panel.title else []


def y_label_lines(y: Scale, height: float, font: float) -> list[str]:
    """Return the label of the y axis broken into lines as long as the panel is high."""
    return wrapped(y.unit.heading(clean(y.label)), height - 8, font)


def _draw_axes(axes: Axes, x: Scale, y: Scale, frame: Frame) -> None:
    axes.set(xscale="log" if x.log else "linear", yscale="log" if y.log else "linear")
    width, height = frame.inner
    for axis, scale, most in ((axes.xaxis, x, frame.most_ticks(x)), (axes.yaxis, y, int(height / (3 * frame.font)))):
        places, texts = scale.ticks(most)
        axis.set_ticks([], minor=True)
        axis.set_ticks(places, texts)
        axis.set_tick_params(length=0, pad=4, labelsize=frame.font - 0.5)
        axis.grid(True, color=GRID[0], linewidth=0.8)
    axes.set(xlim=(x.low, x.high), ylim=(y.low, y.high))
    x_label = shortened(x.unit.heading(clean(x.label)), frame.width - 12, frame.font)
    # long labels use the margin beside the axes too: centred on them only as far as the panel goes
    middle = min(max(0.5, (text_width(x_label, frame.font) / 2 - frame.left + 4) / width), 1.0)
    right = (width + frame.right - 4 - text_width(x_label, frame.font) / 2) / width
    axes.text(min(middle, right), -(frame.bottom - 4) / height, x_label, transform=axes.transAxes, ha="center",
              va="bottom", fontsize=frame.font)  # fmt: skip
    for line, text in enumerate(y_label_lines(y, frame.height, frame.font)):
        place = -(frame.left - 5 - line * 1.2 * frame.font) / width
        axes.text(place, _middle_of(text, frame), text, transform=axes.transAxes, ha="center", va="top",
                  rotation=90, rotation_mode="anchor", fontsize=frame.font)  # fmt: skip


def _middle_of(y_label: str, frame: Frame) -> float:
    """Return where the y label is centred along the axes, moved so that it ends within the panel."""
    height, half = frame.inner[1], text_width(y_label, frame.font) / 2
    low, high = half - frame.bottom + 2, height + frame.top - 2 - half
    return min(max(height / 2, low), high) / height


def _write_ends(axes: Axes, ends: Mapping[str, Line | Points], x: Scale, y: Scale, frame: Frame) -> None:
    """Write labels beside the right ends of their marks, moved apart, with a hair line where they moved."""
    import numpy as np

    width, height = frame.inner
    places = []
    for label, mark in ends.items():
        xs, ys = x.shown(mark.x), y.shown(mark.y)
        last = np.flatnonzero(np.isfinite(xs) & np.isfinite(ys))
        if last.size:
            end = (x.fraction(float(xs[last[-1]])) * width, y.fraction(float(ys[last[-1]])) * height)
            places.append((end, label, style(mark.role).light))
    places.sort(key=lambda place: place[0][1])
    heights = apart([place[0][1] for place in places], 1.2 * frame.font, height)
    for ((end_x, end_y), label, colour), at in zip(places, heights, strict=True):
        if abs(at - end_y) > 0.35 * frame.font or end_x < width - 16:
            axes.plot([end_x / width, 1 + 5 / width], [end_y / height, at / height], transform=axes.transAxes,
                      color=colour, linewidth=0.6, linestyle=(0, (1, 2)), clip_on=False)  # fmt: skip
        axes.text(1 + 7 / width, at / height, label, transform=axes.transAxes, color=colour, va="center_baseline",
                  fontsize=frame.font, fontweight="bold")  # fmt: skip


def _svg(figure: Any, salt: str) -> str:
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    matplotlib.rcParams["svg.hashsalt"] = salt
    text = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    FigureCanvasSVG(figure).print_svg(text, metadata=nothing)  # type: ignore[no-untyped-call]
    return text.getvalue()
