"""Symbols of the papers as HTML."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import escape

from pipeline.findings.figures import Axis, Figure, Line, Panel
from pipeline.report.figure import figure_view
from pipeline.report.naming import Naming
from pipeline.report.symbols import symbol_html, symbols_in
from pipeline.report.table import Note, TableView


@pytest.mark.parametrize(
    ("latex", "html"),
    [
        ("k_{MR}", "<var>k</var><sub>MR</sub>"),
        ("$k_1$", "<var>k</var><sub>1</sub>"),
        ("k_MR", "<var>k</var><sub>MR</sub>"),
        (r"\alpha_{BW}", "<var>α</var><sub>BW</sub>"),
        (r"\dot{x}", "<var>x\u0307</var>"),
        (r"\hat{k}_1", "<var>k\u0302</var><sub>1</sub>"),
        ("K'", "<var>K</var>′"),
        (r"\Delta k/k", "<var>Δ</var><var>k</var>/<var>k</var>"),
        (r"\frac{k_1}{k_2}", "<var>k</var><sub>1</sub>/<var>k</var><sub>2</sub>"),
        (r"K_\mathrm{sec}", "<var>K</var><sub>sec</sub>"),
        (r"F_{max}/x_{max}", "<var>F</var><sub>max</sub>/<var>x</var><sub>max</sub>"),
        (r"\sigma_{F,\mathrm{rms}}", "<var>σ</var><sub><var>F</var>,rms</sub>"),
        ("10^{-3}", "10<sup>−3</sup>"),
        ("a_{", "a_{"),
        ("}", "}"),
        ("\\", "\\"),
        ("", ""),
        ("<b>", "&lt;<var>b</var>&gt;"),
    ],
)
def test_a_symbol_becomes_html(latex, html):
    assert str(symbol_html(latex)) == html


def test_a_bomb_of_braces_is_shown_as_it_stands():
    bomb = "{" * 500 + "k" + "}" * 500
    assert symbol_html(bomb) == escape(bomb)


@given(st.text(max_size=40))
def test_no_text_can_bring_in_markup(text):
    html = str(symbol_html(text))
    for allowed in ("<var>", "</var>", "<sub>", "</sub>", "<sup>", "</sup>", "<b>", "</b>"):
        html = html.replace(allowed, "")
    assert "<" not in html
    assert ">" not in html


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("P_pre & d_max", "<var>P</var><sub>pre</sub> &amp; <var>d</var><sub>max</sub>"),
        ("Δp_f, V_p,n", "<var>Δp</var><sub>f</sub>, <var>V</var><sub>p,n</sub>"),
        ("µV/Hz^0.5, K^-1", "µV/Hz<sup>0.5</sup>, K<sup>−1</sup>"),
    ],
)
def test_symbols_and_powers_in_running_text_are_set_as_such(text, html):
    assert str(escape(symbols_in(text))) == html


@pytest.mark.parametrize("text", ["n_pads", "ax_0", "a2_in_phase", "x_1.csv", "column 'F_x'", "e^(i n)", "run r_1"])
def test_names_of_files_channels_and_runs_stay_as_they_are(text):
    assert Naming((), ["r_1"]).text(text) == text
    assert not hasattr(Naming((), ["r_1"]).text(text), "__html__")


def test_symbols_in_a_drawing_have_an_index_and_runs_have_none():
    line = Line(np.array([0.0, 1.0]), np.array([0.0, 1.0]), "model", "k_xx")
    figure = Figure("f", "Title", "", "", [Panel([line], Axis("time", "s"), Axis("k_xx", "N/m"), "run r_1")])
    view = figure_view(Naming((), ["r_1"]).drawn(figure), 1)
    svg = str(view.grids[0][1][0])
    assert re.search(
        r'<tspan font-style="italic">k</tspan><tspan [^>]*dy="0.32em">xx</tspan><tspan dy="-0.24em"> \(', svg
    )
    assert ">run r_\u20601</text>" in svg


def test_lines_below_a_table_have_symbols():
    view = TableView("t", "Title", "", [], [], notes=[Note(symbol_html("k"), "over 80 % of d_max")])
    (note,) = Naming(()).view(view).notes
    assert str(note.text) == "over 80\xa0% of <var>d</var><sub>max</sub>"
