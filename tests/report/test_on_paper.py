"""What is laid out for a sheet of paper, and words as a typesetter writes them."""

from __future__ import annotations

import numpy as np
import pytest
from markupsafe import Markup

from pipeline.findings.figures import Axis, Column, Figure, Line, Matrix, Panel, Points, Table, Value
from pipeline.report.figure import figure_view
from pipeline.report.naming import Naming
from pipeline.report.table import table_view
from pipeline.report.words import typeset
from pipeline.rigs.experiment import ParameterSpec

X = np.linspace(0.0, 1.0, 5)
TIME, FORCE = Axis("time", "s"), Axis("force", "N")


def stacked(panels: int, columns: int = 1) -> Figure:
    return Figure("f", "F", "Why?", "", [Panel([Line(X, X, "measured")], TIME, FORCE)] * panels, columns)


def test_a_figure_takes_the_height_that_its_text_needs_and_breaks_between_its_rows_where_it_is_high():
    whole = figure_view(stacked(1), 1)
    assert (whole.share, whole.breaks) == (100, False)
    smaller = figure_view(stacked(2), 1)
    assert not smaller.breaks
    assert smaller.share / 100 * 13 * 700 / 780 > 8  # px of text
    assert smaller.share / 100 * 2 * 330 * 700 / 780 < 450
    assert not figure_view(stacked(4, 4), 1).breaks
    long = figure_view(stacked(6), 1)
    assert (long.share, long.breaks) == (100, True)


@pytest.mark.parametrize(("columns", "size"), [(3, "short"), (7, "wide short"), (14, "widest short")])
def test_tables_whose_numbers_are_long_take_smaller_type(columns, size):
    row = [Value(12.34, 0.12, (12.1, 12.58))] * columns
    assert table_view(Table("t", "T", "", [Column("value")] * columns, [row])).size == size


def test_many_short_columns_keep_their_type_and_symbols_are_as_wide_as_they_are_shown():
    heads = [Column(Markup("<var>k</var><sub>xx</sub>"))] * 12  # type: ignore[arg-type]
    assert table_view(Table("t", "T", "", heads, [list(range(12))])).size == "short"


def test_names_of_parameters_are_set_as_symbols_and_words_stay_words():
    specs = [
        ParameterSpec("kxx2", "k_{xx2}", "N/m^2", "", ""),
        ParameterSpec("contact_stiffness", "k_p", "N/m", "", ""),
        ParameterSpec("rotation", r"\alpha", "rad", "", ""),
    ]
    naming = Naming(specs)
    drawn = naming.drawn(Figure("f", "F", "", "", [Panel([Matrix(np.eye(1), ["contact_stiffness"], ["kxx2 at 2 A"])])]))
    assert [list(names) for names in vars(drawn.panels[0].marks[0]).values()][1:] == [["k_p"], ["k_xx2 at 2 A"]]
    set_text = naming.text("rotation alpha, F/k_p < contact_stiffness, kxx2x and kxx2")
    k_p, k_xx2 = "<var>k</var><sub><var>p</var></sub>", "<var>k</var><sub>xx2</sub>"
    assert str(set_text) == f"rotation <var>α</var>, F/{k_p} &lt; {k_p}, kxx2x and {k_xx2}"


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
        ("tpjb-rotating-4pad, 3e-05 rad/s", "tpjb-rotating-4pad, 3×10⁻⁵ rad/s"),
        ("leaves 9.9e+02 N of 1.2e+05 N", "leaves 990 N of 120000 N"),
        ("chi2 of 2e+12 N/m^2 in 12e45", "χ² of 2×10¹² N/m² in 12e45"),
    ],
)
def test_signs_that_a_typewriter_lacks_are_set(typed, shown):
    assert typeset(typed) == shown
