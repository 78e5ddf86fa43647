"""What is laid out for a sheet of paper, and words as a typesetter writes them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.findings.figures import Axis, Column, Figure, Line, Panel, Points, Table, Value
from pipeline.report.figure import figure_view
from pipeline.report.table import table_view
from pipeline.report.words import typeset

X = np.linspace(0.0, 1.0, 5)
TIME, FORCE = Axis("time", "s"), Axis("force", "N")


def stacked(panels: int, columns: int = 1) -> Figure:
    return Figure("f", "F", "Why?", "", [Panel([Line(X, X, "measured")], TIME, FORCE)] * panels, columns)


def test_a_figure_is_as_wide_as_lets_it_stay_on_a_sheet_and_breaks_where_that_is_too_small():
    whole = figure_view(stacked(1), 1)
    assert (whole.share, whole.breaks) == (100, False)
    smaller = figure_view(stacked(3), 1)
    assert 70 <= smaller.share < 100
    assert not smaller.breaks
    assert smaller.share / 100 * 3 * 330 * 700 / 780 < 830
    long = figure_view(stacked(6), 1)
    assert (long.share, long.breaks) == (100, True)
    assert not figure_view(stacked(6, 3), 1).breaks


@pytest.mark.parametrize(("columns", "size"), [(3, "short"), (7, "wide short"), (14, "widest short")])
def test_tables_whose_numbers_are_long_take_smaller_type(columns, size):
    row = [Value(12.34, 0.12, (12.1, 12.58))] * columns
    assert table_view(Table("t", "T", "", [Column("value")] * columns, [row])).size == size


def test_seven_short_columns_keep_their_type():
    assert table_view(Table("t", "T", "", [Column("n")] * 7, [list(range(7))])).size == "short"


def test_points_of_one_panel_are_named_in_one_place_and_a_title_is_not_repeated():
    early, late = Points(X / 3, X, 0, "rising"), Points(X, X, 1, "falling")
    view = figure_view(Figure("f", "F", "Why?", "", [Panel([early, late], TIME, FORCE)]), 1)
    assert "rising" in view.key
    assert "falling" in view.key
    closed = Line(np.cos(6 * X), np.sin(6 * X), "model", "1X")
    view = figure_view(Figure("f", "F", "Why?", "", [Panel([closed], FORCE, FORCE, "1X")]), 1)
    assert "1X" not in view.key


@pytest.mark.parametrize(
    ("typed", "shown"),
    [
        ("1.2 +- 0.3 um rms", "1.2 ± 0.3 µm rms"),
        ("by -0.28 % (-3 to -1)", "by −0.28 % (−3 to −1)"),
        ("59 us late at 20 degC", "59 µs late at 20 °C"),
        ("sh-2 of 2024-05-01, tells us the sum", "sh-2 of 2024-05-01, tells us the sum"),
        ("tpjb-rotating-4pad, 3e-05 rad/s", "tpjb-rotating-4pad, 3e-05 rad/s"),
    ],
)
def test_signs_that_a_typewriter_lacks_are_set(typed, shown):
    assert typeset(typed) == shown
