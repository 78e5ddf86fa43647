"""Words inside a panel: names of rules and of points, each on the first side where it hits nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings.figures import Line, Mark, Points, Rule
from pipeline.report.palette import INK, PAPER, style
from pipeline.report.scale import Scale
from pipeline.report.words import clean, shortened, text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GROUND = {"facecolor": PAPER[0], "edgecolor": "none", "alpha": 0.8, "pad": 0.8}  # below the words of a rule
_GAP = 3.0  # px between a rule and its name
_LEADER = 14.0  # px from the axes to the names above them
_MOST_OVER = 120.0  # longest name above the axes, px
_ON_A_CURVE = 300  # places
_POINT = 4.0  # half of a point's size, px


@dataclass(frozen=True)
class Box:
    """A place for a word in pixels from the lower left corner of the axes."""

    left: float
    bottom: float
    right: float
    top: float

    def meets(self, other: Box) -> bool:
        """Tell whether two boxes overlap."""
        return (
            self.left < other.right and other.left < self.right and self.bottom < other.top and other.bottom < self.top
        )

    def within(self, width: float, height: float) -> bool:
        """Tell whether the box lies in the axes; a word may reach a little beyond on the right and on top."""
        return self.left >= 0 and self.bottom >= 0 and self.right <= width + 4 and self.top <= height + 4


def write_texts(axes: Axes, marks: Sequence[Mark], x: Scale, y: Scale, inner: tuple[float, float], font: float) -> None:
    """Write the names of rules and the texts of points on axes of size `inner` (pixels)."""
    taken: list[Box] = []
    upright = _upright(marks, x, inner[0])
    level = [(_pixel(mark.y, y, inner[1]), mark) for mark in marks if isinstance(mark, Rule) and mark.y is not None]
    lines = [Box(at - 0.5, 0, at + 0.5, inner[1]) for at, _ in upright]
    lines += [Box(0, at - 0.5, inner[0], at + 0.5) for at, _ in level if np.isfinite(at)]
    if any(rule.label for _, rule in (*upright, *level)):
        lines += _along_curves(marks, x, y, inner)
    if room_over(marks, x, inner[0], font):
        _name_over(axes, upright, inner, font)
    else:
        for at, rule in upright:
            _name_rule(axes, rule, _beside, at, inner, font, taken, lines)
    for at, rule in level:
        if np.isfinite(at):
            _name_rule(axes, rule, _along, at, inner, font, taken, lines)
    for mark in marks:
        if isinstance(mark, Points) and mark.texts:
            _name_points(axes, mark, x, y, inner, font - 1, taken)


def room_over(marks: Sequence[Mark], x: Scale, width: float, font: float) -> float:
    """Return the height above the axes that the names of upright rules need; 0 where they have room in the axes."""
    named = [(at, shortened(clean(rule.label), _MOST_OVER, font - 0.5)) for at, rule in _upright(marks, x, width)]
    places = [at for at, text in named if text]
    if all(b - a >= 1.3 * font for a, b in pairwise(places)):
        return 0.0
    return _LEADER + max(text_width(text, font - 0.5) for _, text in named) + 4


def apart(places: Sequence[float], gap: float, high: float) -> list[float]:
    """Move sorted `places` until they are `gap` apart and end at `high` or below where there is room."""
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + gap) if moved else place)
    limit = high
    for number in reversed(range(len(moved))):
        moved[number] = min(moved[number], limit)
        limit = moved[number] - gap
    return moved


def _pixel(value: float, scale: Scale, length: float) -> float:
    """Return where an SI number lies along an axis of that length; NaN where the scale cannot show it."""
    shown = float(scale.shown(value))
    return scale.fraction(shown) * length if np.isfinite(shown) else np.nan


def _upright(marks: Sequence[Mark], x: Scale, width: float) -> list[tuple[float, Rule]]:
    """Return the rules at an x that can be shown, from left to right, with their places in pixels."""
    found = [(_pixel(mark.x, x, width), mark) for mark in marks if isinstance(mark, Rule) and mark.x is not None]
    return sorted((one for one in found if np.isfinite(one[0])), key=lambda one: one[0])


def _along_curves(marks: Sequence[Mark], x: Scale, y: Scale, inner: tuple[float, float]) -> list[Box]:
    """Return places along the curves, so close that no word lies between two of them."""
    boxes = []
    for mark in marks:
        if not isinstance(mark, Line) or mark.x.size < 2:
            continue
        at = np.linspace(0, mark.x.size - 1, _ON_A_CURVE)
        index = np.arange(mark.x.size)
        shown = (np.interp(at, index, values) for values in (x.shown(mark.x), y.shown(mark.y)))
        for a, b in zip(*(values.tolist() for values in shown), strict=True):
            if math.isfinite(a) and math.isfinite(b):
                left, bottom = x.fraction(a) * inner[0], y.fraction(b) * inner[1]
                boxes.append(Box(left - 2, bottom - 2, left + 2, bottom + 2))
    return boxes


def _name_over(axes: Axes, upright: Sequence[tuple[float, Rule]], inner: tuple[float, float], font: float) -> None:
    """Write the names of crowded rules above the axes, side by side, each with a line to its rule."""
    width, height = inner
    named = [(at, rule) for at, rule in upright if clean(rule.label)]
    for (at, rule), place in zip(named, apart([at for at, _ in named], 1.2 * font, width), strict=True):
        colour = style(rule.role).light
        axes.plot([at / width, place / width], [1, 1 + (_LEADER - 1) / height], transform=axes.transAxes, color=colour,
                  linewidth=0.8, clip_on=False)  # fmt: skip
        axes.text(place / width, 1 + _LEADER / height, shortened(clean(rule.label), _MOST_OVER, font - 0.5),
                  transform=axes.transAxes, ha="center", va="bottom", rotation=90, color=colour,
                  fontsize=font - 0.5)  # fmt: skip


def _name_rule(
    axes: Axes, rule: Rule, places: Callable[[float, tuple[float, float], float, float], Iterator[Box]], at: float,
    inner: tuple[float, float], font: float, taken: list[Box], lines: Sequence[Box],
) -> None:  # fmt: skip
    width, height = inner
    upright = rule.x is not None
    text = shortened(clean(rule.label), 0.9 * (height if upright else width), font - 0.5)
    if not text:
        return
    boxes = list(places(at, inner, text_width(text, font - 0.5), 1.15 * font))
    inside = [box for box in boxes if box.within(width, height)]
    apart = [box for box in inside if not any(box.meets(other) for other in taken)]
    clear = [box for box in apart if not any(box.meets(line) for line in lines)]
    box = (clear or apart or inside or boxes)[0]
    taken.append(box)
    axes.text((box.left + box.right) / 2 / width, (box.bottom + box.top) / 2 / height, text,
              transform=axes.transAxes, ha="center", va="center", rotation=90 if upright else 0,
              color=style(rule.role).light, fontsize=font - 0.5, bbox=_GROUND, zorder=5)  # fmt: skip


def _beside(at: float, inner: tuple[float, float], long: float, tall: float) -> Iterator[Box]:
    """Yield places for an upright word at a rule at `at`: at the top on either side, then lower and lower."""
    height = inner[1]
    top = height - 2
    while top - long >= 0:
        for left in (at + _GAP, at - _GAP - tall):
            yield Box(left, top - long, left + tall, top)
        top -= max(tall, 8.0)
    for left in (at + _GAP, at - _GAP - tall):
        yield Box(left, height - 2 - long, left + tall, height - 2)


def _along(at: float, inner: tuple[float, float], long: float, tall: float) -> Iterator[Box]:
    """Yield places for a word at a rule at height `at`: at the right above and below, then further to the left."""
    width = inner[0]
    right = width - _GAP
    while right - long >= 0:
        for bottom in (at + 1, at - 1 - tall):
            yield Box(right - long, bottom, right, bottom + tall)
        right -= max(long / 2, 20.0)
    yield Box(width - _GAP - long, at + 1, width - _GAP, at + 1 + tall)


def _name_points(
    axes: Axes, mark: Points, x: Scale, y: Scale, inner: tuple[float, float], font: float, taken: list[Box]
) -> None:
    width, height = inner
    xs, ys = x.shown(mark.x), y.shown(mark.y)
    places = [
        (x.fraction(float(a)) * width, y.fraction(float(b)) * height) if np.isfinite(a) and np.isfinite(b) else None
        for a, b in zip(xs, ys, strict=True)
    ]
    taken += (
        []
        if mark.bare
        else [Box(at[0] - _POINT, at[1] - _POINT, at[0] + _POINT, at[1] + _POINT) for at in places if at]
    )
    for at, raw in zip(places, mark.texts, strict=False):
        text = clean(raw)
        if not at or not text:
            continue
        long, tall = text_width(text, font), 1.1 * (font + 1)
        boxes = [
            Box(at[0] + dx, at[1] + dy, at[0] + dx + long, at[1] + dy + tall)
            for dx, dy in ((6, -tall / 2), (-6 - long, -tall / 2), (-long / 2, 6), (-long / 2, -6 - tall),
                           (5, 4), (5, -4 - tall), (-5 - long, 4), (-5 - long, -4 - tall))
        ]  # fmt: skip
        if mark.bare:
            boxes = [Box(at[0] - long / 2, at[1] - tall / 2, at[0] + long / 2, at[1] + tall / 2)]
        free = [box for box in boxes if box.within(width, height) and not any(box.meets(other) for other in taken)]
        box = (free or boxes)[0]
        taken.append(box)
        axes.text(box.left / width, (box.bottom + tall / 2) / height, text, transform=axes.transAxes, ha="left",
                  va="center_baseline", fontsize=font, color=INK[0])  # fmt: skip
