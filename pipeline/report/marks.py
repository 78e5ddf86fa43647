"""Draws one mark on matplotlib axes: lines thinned to what the eye can see, many points as a picture.

The words beside marks are `texts`'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings.figures import Band, Line, Mark, Outline, Points, Rule, Stems
from pipeline.report.palette import PAPER, style
from pipeline.report.scale import Scale
from pipeline.report.texts import write_texts

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RASTER_FROM = 3000
_CAPS_UP_TO = 60
_BIG_POINTS_UP_TO = 60
_SHAPED_POINTS_UP_TO = 600
_ONE_PATH_FROM = 200  # bars
_DOTS_UP_TO = 12_000  # more are a picture
_DOT = 2.6  # px
_SHAPES_ON_A_LINE = 6
_ROOM_FOR_A_HEAD = 9.0  # px between stems
_UNDER_A_MODEL = {"linewidth": 2.8, "alpha": 0.6}  # a measured curve stays visible below a model that follows it
_MEASURED_UNDER_A_MODEL = {"marker": "o", "markersize": 6.5}  # samples show on both sides of its line
_DASH = (0, (4, 2.2))
_Z = {"Outline": 0.8, "Band": 1.0, "Rule": 1.5, "Stems": 2.0, "Line": 2.5, "Points": 3.0}
_Z_ROLE = {"measured": -0.3, "model": 0.2, "fault": 0.4}


_Ends = tuple[np.ndarray, np.ndarray]  # x and y of points


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
    narrowest = _narrowest([mark for mark in marks if isinstance(mark, Stems)], x, inner[0])
    for mark, z, below in zip(marks, layers(marks), under_a_model(marks), strict=True):
        if isinstance(mark, Line):
            _line(axes, mark, x, y, inner[0], z, below)
        elif isinstance(mark, Points) and not mark.bare:
            _points(axes, mark, x, y, z, below)
        elif isinstance(mark, Outline):
            _outline(axes, mark, x, y, z)
        elif isinstance(mark, Stems):
            _stems(axes, mark, x, y, narrowest, z)
        elif isinstance(mark, Band):
            _band(axes, mark, x, y, inner[0], z)
        elif isinstance(mark, Rule):
            _rule(axes, mark, x, y, z)
    if font:
        write_texts(axes, marks, x, y, inner, font)


def under_a_model(marks: Sequence[Mark]) -> list[bool]:
    """Tell of each mark whether it is measured and a model is drawn over it: then it is drawn broad and pale."""
    has_model = any(isinstance(mark, Line) and mark.role == "model" for mark in marks)
    return [
        has_model and (isinstance(mark, Line) or (isinstance(mark, Points) and mark.low is None)) and mark.role == "measured"
        for mark in marks
    ]  # fmt: skip


def layers(marks: Sequence[Mark]) -> list[float]:
    """Return how high each mark lies over the others."""
    heights = []
    for order, (mark, below) in enumerate(zip(marks, under_a_model(marks), strict=True)):
        z = _Z.get(type(mark).__name__, 0.0) + 0.001 * order
        if isinstance(mark, Line | Points):
            z += _Z_ROLE.get(str(mark.role), 0.0)
        heights.append(z - 1.0 if below and isinstance(mark, Points) else z)
    return heights


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
    count = -(-x.size // stretch)
    rows = np.pad(y, (0, count * stretch - x.size), mode="edge").reshape(count, stretch)
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
    xs, ys = _ring(x.shown(mark.x), y.shown(mark.y)) if mark.closed else (x.shown(mark.x), y.shown(mark.y))
    if _rises(xs):
        xs, ys = thinned(xs, ys, int(4 * width))
    shapes: dict[str, Any] = {}
    if isinstance(mark.role, int) and not _has_points(axes, look.light):
        every = max(xs.size // _SHAPES_ON_A_LINE, 1)
        shapes = {"marker": look.marker, "markersize": 4.5, "markevery": (every // 2, every)}
        shapes["markerfacecolor"] = PAPER[0] if look.hollow else look.light
    (drawn,) = axes.plot(xs, ys, color=look.light, linewidth=look.width, zorder=z,
                         linestyle=_DASH if mark.dashed or look.hollow else "-", **shapes)  # fmt: skip
    if below:
        drawn.set(**_UNDER_A_MODEL)
    drawn.set_rasterized(xs.size > _RASTER_FROM)


def _has_points(axes: Axes, colour: str) -> bool:
    """Tell whether points of that colour were drawn: shapes on the line would be taken for data."""
    return any(line.get_linestyle() == "None" and line.get_color() == colour for line in axes.lines)


def _ring(xs: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve that ends where it begins."""
    return np.append(xs, xs[:1]), np.append(ys, ys[:1])


def _outline(axes: Axes, mark: Outline, x: Scale, y: Scale, z: float) -> None:
    look = style(mark.role)
    xs, ys = _ring(x.shown(mark.x), y.shown(mark.y))
    axes.fill(xs, ys, color=look.light, alpha=0.15, linewidth=0, zorder=z)
    axes.plot(xs, ys, color=look.light, linewidth=look.width, linestyle=_DASH if look.hollow else "-", zorder=z + 0.05)


def _narrowest(stems: Sequence[Stems], x: Scale, width: float) -> float:
    """Return the least distance of neighbouring stems in pixels: what a stem may be thick."""
    places = np.unique(np.concatenate([x.shown(mark.x) for mark in stems] or [np.empty(0)]))
    places = places[np.isfinite(places)]
    if places.size < 2:
        return width
    shares = np.array([x.fraction(float(place)) for place in places]) if places.size <= _CAPS_UP_TO else None
    step = np.diff(shares).min() if shares is not None else np.diff(places).min() / (places[-1] - places[0])
    return float(step * width)


def _stems(axes: Axes, mark: Stems, x: Scale, y: Scale, narrowest: float, z: float) -> None:
    look = style(mark.role)
    xs, ys = x.shown(mark.x), y.shown(mark.y)
    foot = y.low if y.log else float(y.shown(mark.base))
    if mark.width is not None:
        axes.bar(xs, ys - foot, width=mark.width / x.unit.size, bottom=foot, color=look.light, alpha=0.85,
                 linewidth=0, zorder=z)  # fmt: skip
        return
    thick = float(np.clip(0.4 * narrowest, 0.8, 3.0))
    drawn = axes.vlines(xs, foot, ys, colors=look.light, linewidth=thick, zorder=z)
    drawn.set_rasterized(xs.size > _RASTER_FROM)
    if narrowest > _ROOM_FOR_A_HEAD:
        axes.plot(xs, ys, linestyle="None", marker=look.marker, color=look.light, markersize=5.0, markeredgewidth=1.0,
                  markerfacecolor=PAPER[0] if look.hollow else look.light, zorder=z + 0.05)  # fmt: skip


def _points(axes: Axes, mark: Points, x: Scale, y: Scale, z: float, below: bool) -> None:
    look = style(mark.role)
    xs, ys = x.shown(mark.x), y.shown(mark.y)
    many = xs.size > _RASTER_FROM
    if mark.low is not None and mark.high is not None:
        low, high = y.shown(mark.low), y.shown(mark.high)
        low = np.where(np.isnan(low) & np.isfinite(high), y.low, low)  # below what a logarithmic axis shows
        _bars(axes, (xs, low), (xs, high), look.light, z - 0.05)
        if xs.size <= _CAPS_UP_TO:
            for limit in (low, high):
                axes.plot(xs, limit, linestyle="none", marker="_", color=look.light, markersize=6, zorder=z - 0.05)
    if mark.left is not None and mark.right is not None:
        left, right = x.shown(mark.left), x.shown(mark.right)
        left = np.where(np.isnan(left) & np.isfinite(right), x.low, left)
        _bars(axes, (left, ys), (right, ys), look.light, z - 0.05)
    if _SHAPED_POINTS_UP_TO < xs.size <= _DOTS_UP_TO and not below:
        _dots(axes, xs, ys, look.light, z)
        return
    shape = look.marker if xs.size <= _SHAPED_POINTS_UP_TO else "."
    size = 5.5 if xs.size <= _BIG_POINTS_UP_TO else 3.6 if xs.size <= _SHAPED_POINTS_UP_TO else 2.6
    (drawn,) = axes.plot(xs, ys, linestyle="None", marker=shape, color=look.light, markersize=size,
                         markeredgewidth=1.1 if look.hollow else 0.0, alpha=0.5 if many else None, zorder=z,
                         markerfacecolor=PAPER[0] if look.hollow else look.light)  # fmt: skip
    if below:
        drawn.set(alpha=min(max(64 / xs.size, 0.15), 0.7), **_MEASURED_UNDER_A_MODEL)
    drawn.set_rasterized(many)


def _bars(axes: Axes, ends: _Ends, others: _Ends, colour: str, z: float) -> None:
    """Draw a bar from each of `ends` to the one of `others`: a few as lines, many as one path, very many as a picture."""
    count = ends[0].size
    if _ONE_PATH_FROM < count <= _RASTER_FROM:
        _segments(axes, ends, others, colour, z, linewidth=1.1, capstyle="butt")
        return
    along_y = ends[0] is others[0]
    draw = axes.vlines if along_y else axes.hlines
    at, low, high = (ends[0], ends[1], others[1]) if along_y else (ends[1], ends[0], others[0])
    draw(at, low, high, colors=colour, linewidth=1.1, zorder=z).set_rasterized(count > _RASTER_FROM)


def _dots(axes: Axes, xs: np.ndarray, ys: np.ndarray, colour: str, z: float) -> None:
    """Draw dots as segments without length and with round ends, sharp at any size."""
    crowded = xs.size > _RASTER_FROM
    _segments(axes, (xs, ys), (xs, ys), colour, z, capstyle="round",
              linewidth=_DOT / 2 if crowded else _DOT, alpha=0.5 if crowded else None)  # fmt: skip


def _segments(axes: Axes, ends: _Ends, others: _Ends, colour: str, z: float, **look: Any) -> None:
    """Draw segments as one path, which is one element of the page; those with an end that is not finite are left out."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    corners = np.stack([np.column_stack(ends), np.column_stack(others)], axis=1)
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    path = Path(corners.reshape(-1, 2), np.tile([Path.MOVETO, Path.LINETO], corners.shape[0]))
    path.should_simplify = False
    axes.add_patch(PathPatch(path, edgecolor=colour, facecolor="none", zorder=z, **look))


def _band(axes: Axes, mark: Band, x: Scale, y: Scale, width: float, z: float) -> None:
    xs, low, high = x.shown(mark.x), y.shown(mark.low), y.shown(mark.high)
    if _rises(xs) and xs.size > 2 * width:
        step = -(-xs.size // int(width))
        starts = np.arange(0, xs.size, step)
        xs, low, high = xs[starts], np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
    low = np.where(np.isnan(low) & np.isfinite(high), y.low, low) if y.log else low
    axes.fill_between(xs, low, high, color=style(mark.role).light, alpha=0.2, linewidth=0, zorder=z)


def _rule(axes: Axes, mark: Rule, x: Scale, y: Scale, z: float) -> None:
    line: dict[str, Any] = {"color": style(mark.role).light, "linewidth": 1.2, "linestyle": _DASH, "zorder": z}
    if mark.y is not None:
        axes.axhline(float(y.shown(mark.y)), **line)
    if mark.x is not None:
        axes.axvline(float(x.shown(mark.x)), **line)
