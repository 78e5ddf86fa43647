"""Symbols of the papers as HTML."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import escape

from pipeline.report.symbols import symbol_html


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
