"""What a report shows, as data: sections of figures, tables and text.

Rigs say *what* is shown (quantities, roles, captions); `pipeline.report` decides *how* (colours,
fonts, size, raster or vector, display units). Numbers here are SI.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

# What a mark stands for decides its colour everywhere; "series 0..7" for things that differ by a condition.
Role = Literal["measured", "model", "reference", "residual", "fault"] | int


@dataclass(frozen=True)
class Axis:
    """Label without unit, SI unit, scale. The report picks mm for m and the like.

    `whole` keeps the ticks at whole numbers (orders, runs).
    Units that are no SI units say how numbers are read: '%' a ratio, 'degC' an absolute temperature in K, 'km/h' a
    speed in m/s, 'mmHg' a pressure in Pa, 'mL', 'mL/min', 'mL/h', 'mL/h/mmHg', 'W h', 'min', 'h'.
    """

    label: str
    unit: str = "1"
    scale: Literal["linear", "log"] = "linear"
    whole: bool = False


@dataclass(frozen=True)
class Line:
    """A curve; x and y of shape (n,). NaN breaks it; the last point is joined to the first where `closed`."""

    x: np.ndarray
    y: np.ndarray
    role: Role = "measured"
    label: str = ""
    dashed: bool = False
    closed: bool = False


@dataclass(frozen=True)
class Outline:
    """A polygon or any closed curve with its inside tinted; x and y of shape (n,), closed by itself."""

    x: np.ndarray
    y: np.ndarray
    role: Role = "measured"
    label: str = ""


@dataclass(frozen=True)
class Stems:
    """Bars that stand on `base` at each x, shape (n,): spectra and full spectra (orders below zero too).

    `width` in units of x makes them bars; without it they are thin stems with a head.
    """

    x: np.ndarray
    y: np.ndarray
    role: Role = "measured"
    label: str = ""
    width: float | None = None
    base: float = 0.0


@dataclass(frozen=True)
class Points:
    """Markers, with 95 % limits where given: `low`, `high` along y, `left`, `right` along x (shape (n,) each).

    With `bare` no marker is drawn and each of `texts` stands on its point.
    """

    x: np.ndarray
    y: np.ndarray
    role: Role = "measured"
    label: str = ""
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    texts: Sequence[str] = ()
    left: np.ndarray | None = None
    right: np.ndarray | None = None
    bare: bool = False


@dataclass(frozen=True)
class Band:
    """An area between `low` and `high` over x, shape (n,) each."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    role: Role = "model"
    label: str = ""


@dataclass(frozen=True)
class Rule:
    """A straight line across the panel at x or at y; labels of several are kept apart."""

    x: float | None = None
    y: float | None = None
    role: Role = "reference"
    label: str = ""


@dataclass(frozen=True)
class Matrix:
    """A heat map, values of shape (rows, columns) from -1 to 1, the numbers written into the cells."""

    values: np.ndarray
    rows: Sequence[str]
    columns: Sequence[str]


Mark = Line | Points | Outline | Stems | Band | Rule | Matrix


@dataclass(frozen=True)
class Panel:
    """One pair of axes. `equal` draws both axes to the same scale (orbits)."""

    marks: Sequence[Mark]
    x: Axis = Axis("")
    y: Axis = Axis("")
    title: str = ""
    equal: bool = False


@dataclass(frozen=True)
class Figure:
    """Panels in a grid. The caption states the question that the figure answers and the answer."""

    name: str
    title: str
    caption: str
    alt: str
    panels: Sequence[Panel]
    columns: int = 1
    share_x: bool = False
    share_y: bool = False


@dataclass(frozen=True)
class Value:
    """A number in a table: shown with the digits that its error warrants, in a unit made for reading."""

    value: float | None
    std_error: float | None = None
    ci95: tuple[float, float] | None = None
    note: str = ""


Mood = Literal["ok", "warning", "rejected", "unsaid"]


@dataclass(frozen=True)
class Status:
    """A cell that judges: the `word` says it, the colour of `mood` repeats it.

    `Status.agrees`, `Status.contradicts` and `Status.not_checkable` are the words for a claim held
    against what was found; others are made as ``Status("not determined", "warning")``.
    """

    word: str
    mood: Mood = "unsaid"
    agrees: ClassVar[Status]
    contradicts: ClassVar[Status]
    not_checkable: ClassVar[Status]


Status.agrees = Status("agrees", "ok")
Status.contradicts = Status("contradicts", "rejected")
Status.not_checkable = Status("not checkable")

Cell = str | float | int | bool | None | Value | Status


@dataclass(frozen=True)
class Column:
    """Heading, SI unit of its numbers ('' for text; '%', 'degC', 'mmHg' and the like as in `Axis`)."""

    heading: str
    unit: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of cells; numbers of one column share a display unit and align at the decimal point."""

    name: str
    title: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True)
class Text:
    """Paragraphs of plain text; the report escapes them."""

    paragraphs: Sequence[str]


@dataclass(frozen=True)
class Section:
    """A chapter of the report."""

    name: str
    title: str
    blocks: Sequence[Figure | Table | Text] = field(default_factory=tuple)
