"""Words inside a panel: names of rules and of points, each on the first side where it hits nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings.figures import Mark, Points, Rule
from pipeline.report.palette import INK, PAPER, style
from pipeline.report.scale import Scale
from pipeline.report.words import clean, shortened, text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GROUND = {"facecolor": PAPER[0], "edgecolor": "none", "alpha": 0.8, "pad": 0.8}  # below the words of a rule
_GAP = 3.0  # px between a rule and its name
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
    rules = [mark for mark in marks if isinstance(mark, Rule)]
    upright = [x.fraction(float(x.shown(rule.x))) * inner[0] for rule in rules if rule.x is not None]
    lines = [Box(at - 0.5, 0, at + 0.5, inner[1]) for at in upright if np.isfinite(at)]
    for rule in sorted(rules, key=lambda rule: (rule.x is None, rule.x or 0.0)):
        _name_rule(axes, rule, x, y, inner, font, taken, lines)
    for mark in marks:
        if isinstance(mark, Points) and mark.texts:
            _name_points(axes, mark, x, y, inner, font - 1, taken)


def _name_rule(
    axes: Axes, rule: Rule, x: Scale, y: Scale, inner: tuple[float, float], font: float,
    taken: list[Box], lines: Sequence[Box],
) -> None:  # fmt: skip
    width, height = inner
    upright = rule.x is not None
    text = shortened(clean(rule.label), 0.9 * (height if upright else width), font - 0.5)
    at = float(x.shown(rule.x)) if upright else float(y.shown(rule.y))
    if not text or not np.isfinite(at):
        return
    long, tall = text_width(text, font - 0.5), 1.15 * font
    if upright:
        boxes = list(_beside(x.fraction(at) * width, height, long, tall))
    else:
        boxes = list(_along(y.fraction(at) * height, width, long, tall))
    inside = [box for box in boxes if box.within(width, height)]
    apart = [box for box in inside if not any(box.meets(other) for other in taken)]
    clear = [box for box in apart if not any(box.meets(line) for line in lines)]
    box = (clear or apart or inside or boxes)[0]
    taken.append(box)
    axes.text((box.left + box.right) / 2 / width, (box.bottom + box.top) / 2 / height, text,
              transform=axes.transAxes, ha="center", va="center", rotation=90 if upright else 0,
              color=style(rule.role).light, fontsize=font - 0.5, bbox=_GROUND, zorder=5)  # fmt: skip


def _beside(at: float, height: float, long: float, tall: float) -> Iterator[Box]:
    """Yield places for an upright word at a rule at `at`: at the top on either side, then lower and lower."""
    top = height - 2
    while top - long >= 0:
        for left in (at + _GAP, at - _GAP - tall):
            yield Box(left, top - long, left + tall, top)
        top -= max(tall, 8.0)
    for left in (at + _GAP, at - _GAP - tall):
        yield Box(left, height - 2 - long, left + tall, height - 2)


def _along(at: float, width: float, long: float, tall: float) -> Iterator[Box]:
    """Yield places for a word at a rule at height `at`: at the right above and below, then further to the left."""
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
    taken += [Box(at[0] - _POINT, at[1] - _POINT, at[0] + _POINT, at[1] + _POINT) for at in places if at]
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
        free = [box for box in boxes if box.within(width, height) and not any(box.meets(other) for other in taken)]
        box = (free or boxes)[0]
        taken.append(box)
        axes.text(box.left / width, (box.bottom + tall / 2) / height, text, transform=axes.transAxes, ha="left",
                  va="center_baseline", fontsize=font, color=INK[0])  # fmt: skip
