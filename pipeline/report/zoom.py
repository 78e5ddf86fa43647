"""Long signals to look into: which panels have more samples than pixels, and what of them a page carries for its script.

The drawing stays as it is; `zoom.js` sets uPlot in its place when the reader asks for it. What a
drawing shows whole is not carried a second time.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.findings.figures import Band, Figure, Line, Mark, Panel, Points, Rule
from pipeline.report.labels import label_of
from pipeline.report.marks import layers, thinned, under_a_model
from pipeline.report.packed import Packed, pack
from pipeline.report.palette import Style, style
from pipeline.report.scale import Scale
from pipeline.report.spoken import spoken_title
from pipeline.report.words import clean

_TIMES = ("s", "min", "h")
_MORE, _CLEARLY_MORE = 1.2, 2.0  # samples a pixel: over time, and over anything else
_AS_IT_IS = 10_000  # samples of a line that runs to and fro, which cannot be thinned
_MOST = (20_000, 10_000, 5_000, 2_500)  # samples of a mark, the most for which the page has room
_LARGEST_PAGE = 4_500_000  # bytes, drawings and signals
_LARGEST = 1_500_000  # bytes, signals
_ALONG_X = ("x", "left", "right")
_Drawn = Line | Points | Band


@dataclass(frozen=True, eq=False)
class Signal:
    """A panel that shows less than there is: where it stands in the page, and on which scales it is drawn."""

    figure: int
    place: int
    shared: bool
    panel: Panel
    x: Scale
    y: Scale

    @property
    def samples(self) -> int:
        """The number of samples of the longest mark."""
        return max(np.size(mark.x) for mark in self.panel.marks if isinstance(mark, _Drawn))


@dataclass(frozen=True)
class Zoom:
    """What a page with long signals carries: their data as JSON, scripts, style sheets; all empty without them."""

    data: str = ""
    scripts: Sequence[str] = ()
    styles: Sequence[str] = ()


def signals(figure: Figure, number: int, scales: Sequence[tuple[Scale, Scale]], width: float) -> list[Signal]:
    """Return the panels of a figure in which a reader sees more when it is enlarged.

    Parameters
    ----------
    figure, number
        The figure, and its number in the page.
    scales
        Of each panel.
    width
        Of the axes where they are drawn largest, pixels.
    """
    return [
        Signal(number, place, figure.share_x, panel, x, y)
        for place, (panel, (x, y)) in enumerate(zip(figure.panels, scales, strict=True))
        if _hides_something(panel, width)
    ]


def _hides_something(panel: Panel, width: float) -> bool:
    if panel.equal or not all(isinstance(mark, _Drawn | Rule) for mark in panel.marks):
        return False
    over_time = panel.x.unit in _TIMES
    drawn = [mark for mark in panel.marks if isinstance(mark, _Drawn)]
    backward = [mark for mark in drawn if not isinstance(mark, Points) and not _rises(mark)]
    if any(not over_time or np.size(mark.x) > _AS_IT_IS for mark in backward):
        return False
    long = [mark for mark in drawn if _rises(mark) and (over_time or isinstance(mark, Line))]
    return max((np.size(mark.x) for mark in long), default=0) > width * (_MORE if over_time else _CLEARLY_MORE)


def _rises(mark: _Drawn) -> bool:
    x = np.asarray(mark.x, float)
    return bool(np.all(np.diff(x) >= 0))  # False where there is NaN


def zoom(found: Iterable[Signal], drawn: int) -> Zoom:
    """Return what a page carries for its long signals; the same signals give the same bytes.

    Each mark keeps so many samples as there is room for, the lowest and the highest of each stretch; where there is
    no room for a few thousand of each, the shortest signals stay drawings.

    Parameters
    ----------
    found
        The panels of the whole page.
    drawn
        Bytes of the drawings in the page.
    """
    kept = list(found)
    room = min(_LARGEST, _LARGEST_PAGE - drawn)
    texts = (_as_json(kept, most) for most in _MOST)
    text = next((text for text in texts if len(text) <= room), "")
    if not text:
        kept = _longest(kept, room)
        text = _as_json(kept, _MOST[-1])
    return Zoom(text, _scripts(), _styles()) if kept else Zoom()


def _longest(found: Sequence[Signal], room: int) -> list[Signal]:
    """Return the longest signals that fit into so many bytes, in the order of the page."""
    kept = []
    for signal in sorted(found, key=lambda signal: -signal.samples):
        room -= len(_as_json([signal], _MOST[-1]))
        if room < 0:
            break
        kept.append(signal)
    return [signal for signal in found if signal in kept]


@cache
def _scripts() -> tuple[str, ...]:
    licence = _beside("vendored/uPlot.LICENSE").rstrip()
    own = (_beside(name) for name in ("zoom_numbers.js", "zoom_marks.js", "zoom.js"))
    return f"/*\n{licence}\n*/\n{_beside('vendored/uPlot.iife.min.js')}", *own


@cache
def _styles() -> tuple[str, str]:
    return _beside("vendored/uPlot.min.css"), _beside("zoom.css")


def _beside(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


class _Arrays:
    """The arrays of a page; one that several marks share is carried once."""

    def __init__(self) -> None:
        self.packed: list[Packed] = []
        self._places: dict[tuple[object, ...], int] = {}

    def place(self, values: np.ndarray, log: bool) -> int:
        packed = pack(values, log)
        key = tuple(packed.values())
        if key not in self._places:
            self._places[key] = len(self.packed)
            self.packed.append(packed)
        return self._places[key]


def _as_json(found: Sequence[Signal], most: int) -> str:
    arrays = _Arrays()
    panels = [_panel(signal, most, arrays) for signal in found]
    text = json.dumps({"arrays": arrays.packed, "panels": panels}, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _panel(signal: Signal, most: int, arrays: _Arrays) -> dict[str, Any]:
    marks = signal.panel.marks
    order = np.argsort(layers(marks), kind="stable")
    pale = under_a_model(marks)
    return {
        "figure": signal.figure,
        "place": signal.place,
        "shared": signal.shared,
        "name": spoken_title(signal.panel),
        "title": clean(signal.panel.title),
        "x": _axis(signal.x),
        "y": _axis(signal.y),
        "marks": [_mark(marks[at], signal, most, arrays, pale[at]) for at in order],
    }


def _axis(scale: Scale) -> dict[str, Any]:
    return {
        "name": clean(scale.label), "label": scale.unit.heading(clean(scale.label)), "unit": scale.unit.name, "log": scale.log,
        "low": scale.low, "high": scale.high,
    }  # fmt: skip


def _mark(mark: Mark, signal: Signal, most: int, arrays: _Arrays, pale: bool) -> dict[str, Any]:
    x, y = signal.x, signal.y
    if isinstance(mark, Rule):
        scale, at = (y, mark.y) if mark.x is None else (x, mark.x)
        value = float(scale.shown(at))
        told = {"y" if mark.x is None else "x": value if np.isfinite(value) else None}
        return {"kind": "rule", "label": clean(mark.label), **_look(style(mark.role)), **told}
    assert isinstance(mark, _Drawn)
    found = _kept(mark, x, y, most)
    kept = {name: arrays.place(values, (x if name in _ALONG_X else y).log) for name, values in found.items()}
    look = _look(style(mark.role))
    if isinstance(mark, Line):
        look |= {"dashed": mark.dashed or look["hollow"], "series": isinstance(mark.role, int), "pale": pale}
    label = clean(mark.label) if isinstance(mark, Band) else label_of(mark, True)
    return {"kind": type(mark).__name__.lower(), "label": label, **look, **kept}


def _look(look: Style) -> dict[str, Any]:
    return {"colour": f"--{look.variable}", "width": look.width, "shape": look.marker_path, "hollow": look.hollow}


def _kept(mark: _Drawn, x: Scale, y: Scale, most: int) -> Mapping[str, np.ndarray]:
    """Return the coordinates of a mark in the units for reading, at most about `most` of each."""
    xs = x.shown(mark.x)
    if isinstance(mark, Band):
        low, high = y.shown(mark.low), y.shown(mark.high)
        low = np.where(np.isnan(low) & np.isfinite(high), y.low, low)  # below what a logarithmic axis shows
        if _rises(mark) and xs.size > most:
            starts = np.arange(0, xs.size, -(-xs.size // most))
            xs, low, high = xs[starts], np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
        return {"x": xs, "low": low, "high": high}
    ys = y.shown(mark.y)
    found = {"x": xs, "y": ys}
    if isinstance(mark, Points):
        beside = {"low": (mark.low, y), "high": (mark.high, y), "left": (mark.left, x), "right": (mark.right, x)}
        found |= {name: scale.shown(values) for name, (values, scale) in beside.items() if values is not None}
        order = np.argsort(xs, kind="stable")
        found = {name: values[order] for name, values in found.items()}
    elif mark.closed:
        return {name: np.append(values, values[:1]) for name, values in found.items()}
    elif not _rises(mark):
        return found
    at, _ = thinned(np.arange(xs.size), found["y"], most)
    return {name: values[at] for name, values in found.items()}
