"""Draws one mark on matplotlib axes: lines thinned to what the eye can see, many points as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings.figures import Band, Line, Mark, Points, Rule
from pipeline.report.palette import INK, PAPER, style
from pipeline.report.scale import Scale
from pipeline.report.words import clean, text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RASTER_FROM = 3000
_CAPS_UP_TO = 60
_BIG_POINTS_UP_TO = 60
_SHAPED_POINTS_UP_TO = 600
_SHAPES_ON_A_LINE = 6
_UNDER_A_MODEL = {"linewidth": 2.8, "alpha": 0.6}  # a measured curve stays visible below a model that follows it
_GROUND = {"facecolor": PAPER[0], "edgecolor": "none", "alpha": 0.75, "pad": 1.0}  # below the words of a rule
_Z = {"Band": 1.0, "Rule": 1.5, "Line": 2.5, "Points": 3.0}
_Z_ROLE = {"measured": -0.3, "model": 0.2, "fault": 0.4}


def draw_marks(axes: Axes, marks: Sequence[Mark], x: Scale, y: Scale, inner: tuple[float, float], font: float) -> None:
    """Draw marks, later ones on top of others of their kind.

    Parameters
    ----------
    axes, marks
        Where to draw what.
    x, y
        The scales of the axes.
    inner
        Width and height of the axes in pixels.
    font
        Size of texts in pixels; 0 leaves them away.
    """
    has_model = any(isinstance(mark, Line) and mark.role == "model" for mark in marks)
    for order, mark in enumerate(marks):
        z = _Z.get(type(mark).__name__, 0.0) + 0.001 * order
        if isinstance(mark, Line | Points):
            z += _Z_ROLE.get(str(mark.role), 0.0)
        if isinstance(mark, Line):
            _line(axes, mark, x, y, inner[0], z, below=has_model and mark.role == "measured")
        elif isinstance(mark, Points):
            _points(axes, mark, x, y, z)
            if font and mark.texts:
                _texts(axes, mark, x, y, inner, font)
        elif isinstance(mark, Band):
            _band(axes, mark, x, y, inner[0], z)
        elif isinstance(mark, Rule):
            _rule(axes, mark, x, y, inner, font, z)


def thinned(x: np.ndarray, y: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Keep the lowest and the highest of each stretch of a curve, and its gaps.

    Parameters
    ----------
    x, y
        Shape (n,); `x` does not fall.
    most
        Number of points kept, about; fewer points than that are returned as they are.
    """
    if x.size <= most:
        return x, y
    stretch = -(-2 * x.size // most)
    count = x.size // stretch
    rows = y[: count * stretch].reshape(count, stretch)
    start = np.arange(count) * stretch
    gap = ~np.isfinite(rows)
    low = start + np.where(gap, np.inf, rows).argmin(axis=1)
    high = start + np.where(gap, -np.inf, rows).argmax(axis=1)
    gaps = (start + gap.argmax(axis=1))[gap.any(axis=1)]
    keep = np.unique(np.concatenate(([0, x.size - 1], low, high, gaps)))
    return x[keep], y[keep]


def _rises(x: np.ndarray) -> bool:
    finite = x[np.isfinite(x)]
    return bool(np.all(np.diff(finite) >= 0))


def _line(axes: Axes, mark: Line, x: Scale, y: Scale, width: float, z: float, below: bool) -> None:
    look = style(mark.role)
    xs, ys = x.shown(mark.x), y.shown(mark.y)
    if _rises(xs):
        xs, ys = thinned(xs, ys, int(4 * width))
    shapes: dict[str, Any] = {}
    if isinstance(mark.role, int) and not _has_points(axes, look.light):
        every = max(xs.size // _SHAPES_ON_A_LINE, 1)
        shapes = {"marker": look.marker, "markersize": 4.5, "markevery": (every // 2, every)}
    (drawn,) = axes.plot(xs, ys, color=look.light, linewidth=look.width, zorder=z,
                         linestyle=(0, (4, 2.2)) if mark.dashed else "-", **shapes)  # fmt: skip
    if below:
        drawn.set(**_UNDER_A_MODEL)
    drawn.set_rasterized(xs.size > _RASTER_FROM)


def _has_points(axes: Axes, colour: str) -> bool:
    """Tell whether points of that colour were drawn: shapes on the line would be taken for data."""
    return any(line.get_linestyle() == "None" and line.get_color() == colour for line in axes.lines)


def _points(axes: Axes, mark: Points, x: Scale, y: Scale, z: float) -> None:
    look = style(mark.role)
    xs, ys = x.shown(mark.x), y.shown(mark.y)
    many = xs.size > _RASTER_FROM
    if mark.low is not None and mark.high is not None:
        low, high = y.shown(mark.low), y.shown(mark.high)
        low = np.where(np.isnan(low) & np.isfinite(high), y.low, low)  # below what a logarithmic axis shows
        bars = axes.vlines(xs, low, high, colors=look.light, linewidth=1.1, zorder=z - 0.05)
        bars.set_rasterized(many)
        if xs.size <= _CAPS_UP_TO:
            for limit in (low, high):
                axes.plot(xs, limit, linestyle="none", marker="_", color=look.light, markersize=6, zorder=z - 0.05)
    shape = look.marker if xs.size <= _SHAPED_POINTS_UP_TO else "."
    size = 5.5 if xs.size <= _BIG_POINTS_UP_TO else 3.6 if xs.size <= _SHAPED_POINTS_UP_TO else 2.6
    (drawn,) = axes.plot(xs, ys, linestyle="None", marker=shape, color=look.light, markersize=size,
                         markeredgewidth=0.0, alpha=0.5 if many else None, zorder=z)  # fmt: skip
    drawn.set_rasterized(many)


def _band(axes: Axes, mark: Band, x: Scale, y: Scale, width: float, z: float) -> None:
    xs, low, high = x.shown(mark.x), y.shown(mark.low), y.shown(mark.high)
    if _rises(xs) and xs.size > 2 * width:
        step = -(-xs.size // int(width))
        starts = np.arange(0, xs.size, step)
        xs, low, high = xs[starts], np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
    low = np.where(np.isnan(low) & np.isfinite(high), y.low, low) if y.log else low
    axes.fill_between(xs, low, high, color=style(mark.role).light, alpha=0.2, linewidth=0, zorder=z)


def _rule(axes: Axes, mark: Rule, x: Scale, y: Scale, inner: tuple[float, float], font: float, z: float) -> None:
    look = style(mark.role)
    line: dict[str, Any] = {"color": look.light, "linewidth": 1.2, "linestyle": (0, (4, 2.2)), "zorder": z}
    label = clean(mark.label)
    if mark.y is not None:
        at = float(y.shown(mark.y))
        axes.axhline(at, **line)
        if label and font and np.isfinite(at):
            below = y.fraction(at) > 1 - 1.3 * font / inner[1]
            axes.annotate(label, (1, at), xycoords=("axes fraction", "data"), textcoords="offset points",
                          xytext=(-3, -3 if below else 3), ha="right", va="top" if below else "bottom",
                          color=look.light, fontsize=font - 0.5, bbox=_GROUND, zorder=5)  # fmt: skip
    if mark.x is not None:
        at = float(x.shown(mark.x))
        axes.axvline(at, **line)
        if label and font and np.isfinite(at):
            left = x.fraction(at) > 1 - 1.5 * font / inner[0]
            axes.annotate(label, (at, 1), xycoords=("data", "axes fraction"), textcoords="offset points",
                          xytext=(-3 if left else 3, -2), ha="right" if left else "left", va="top", rotation=90,
                          color=look.light, fontsize=font - 0.5, bbox=_GROUND, zorder=5)  # fmt: skip


def _texts(axes: Axes, mark: Points, x: Scale, y: Scale, inner: tuple[float, float], font: float) -> None:
    """Write each point's text beside it, on the first side where it hits neither a point nor another text."""
    width, height = inner
    xs, ys = x.shown(mark.x), y.shown(mark.y)
    places = [
        (x.fraction(float(a)) * width, y.fraction(float(b)) * height) if np.isfinite(a) and np.isfinite(b) else None
        for a, b in zip(xs, ys, strict=True)
    ]
    taken = [(at[0] - 4, at[1] - 4, at[0] + 4, at[1] + 4) for at in places if at]
    for at, raw in zip(places, mark.texts, strict=False):
        text = clean(raw)
        if not at or not text:
            continue
        long, tall = text_width(text, font - 1), 1.1 * font
        boxes = [
            (at[0] + dx, at[1] + dy, at[0] + dx + long, at[1] + dy + tall)
            for dx, dy in ((6, -tall / 2), (-6 - long, -tall / 2), (-long / 2, 6), (-long / 2, -6 - tall),
                           (5, 4), (5, -4 - tall), (-5 - long, 4), (-5 - long, -4 - tall))
        ]  # fmt: skip
        free = [box for box in boxes if _inside(box, width, height) and not any(_meet(box, other) for other in taken)]
        box = (free or boxes)[0]
        taken.append(box)
        axes.text(box[0] / width, (box[1] + tall / 2) / height, text, transform=axes.transAxes, ha="left",
                  va="center_baseline", fontsize=font - 1, color=INK[0])  # fmt: skip


_Box = tuple[float, float, float, float]


def _inside(box: _Box, width: float, height: float) -> bool:
    return box[0] >= 0 and box[1] >= 0 and box[2] <= width + 4 and box[3] <= height + 4


def _meet(one: _Box, other: _Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
