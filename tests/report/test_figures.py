"""Figures as SVG: scales, units, labels, many points, colours, nothing that text from logs can break."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest

from pipeline.findings.figures import Axis, Band, Figure, Line, Mark, Matrix, Panel, Points, Rule
from pipeline.report.figure import figure_view, thumbnail
from pipeline.report.marks import thinned
from pipeline.report.palette import GRID, INK, PAPER, QUIET, all_styles, css_colour, style
from pipeline.report.scale import equal, extent, scale, unit_for
from pipeline.report.svg import inline
from pipeline.report.words import clean, wrapped

HOSTILE = 'run $\\frac{1}$ <script>alert(1)</script> & "quoted" fill: #0067a5 \x00\x1b[31m \u202e k_{MR} \ud800 轴'


def one(marks: Sequence[Mark], x: Axis | None = None, y: Axis | None = None, **panel: object) -> Figure:
    panels = [Panel(marks, x or Axis("x", "m"), y or Axis("y", "N"), **panel)]
    return Figure("figure", "Title", "Caption.", "Alternative text.", panels)


def svgs(figure: Figure, number: int = 1) -> list[ElementTree.Element]:
    return [ElementTree.fromstring(str(svg)) for _, grid in figure_view(figure, number).grids for svg in grid]


def texts(svg: ElementTree.Element) -> list[str]:
    return [element.text or "" for element in svg.iter("text")]


def curve(n: int = 50) -> Line:
    return Line(np.linspace(0, 1e-3, n), np.linspace(0, 250.0, n))


def test_axes_carry_their_labels_with_units_made_for_reading():
    (wide, narrow) = svgs(one([curve()], Axis("displacement", "m"), Axis("stiffness", "N/m")))
    for svg in (wide, narrow):
        assert "displacement (mm)" in texts(svg)
        assert "stiffness (N/m)" in texts(svg)


def test_a_ratio_has_no_unit():
    assert "loss factor" in texts(svgs(one([curve()], y=Axis("loss factor", "1")))[0])


def test_panels_that_share_an_axis_have_the_same_limits_and_unit():
    small, large = curve(), Line(np.linspace(0, 5e-3, 9), np.linspace(0, 9000.0, 9))
    panels = [Panel([mark], Axis("x", "m"), Axis("force", "N")) for mark in (small, large)]
    figure = Figure("f", "t", "c", "a", panels, columns=2, share_x=True, share_y=True)
    shared = [set(texts(svg)) for svg in svgs(figure)]
    assert shared[0] == shared[1]
    apart = [texts(svg) for svg in svgs(replace(figure, share_x=False, share_y=False))]
    assert set(apart[0]) != set(apart[1])
    assert all("force (kN)" in found for found in apart)  # one quantity has one unit in a figure


def test_equal_axes_draw_a_circle_round():
    x = scale(Axis("x", "m"), unit_for(Axis("x", "m"), [(-1e-6, 1e-6)]), (-1e-6, 1e-6))
    y = scale(Axis("y", "m"), unit_for(Axis("y", "m"), [(-3e-6, 3e-6)]), (-3e-6, 3e-6))
    x, y = equal(x, y, 400.0, 300.0)
    assert (x.high - x.low) / 400 == pytest.approx((y.high - y.low) / 300)
    assert y.low < -3
    assert y.high > 3
    angle = np.linspace(0, 2 * np.pi, 100)
    marks = [Line(2e-5 * np.cos(angle), 2e-5 * np.sin(angle))]
    for svg in svgs(one(marks, Axis("x", "m"), Axis("y", "m"), equal=True)):
        path = next(e for e in svg.iter("path") if e.get("d", "").count(" ") > 50)
        numbers = np.array([float(v) for v in re.findall(r"-?\d+(?:\.\d+)?", path.get("d", ""))]).reshape(-1, 2)
        width, height = np.ptp(numbers, axis=0)
        assert width == pytest.approx(height, abs=0.3)


def test_a_logarithmic_axis_leaves_out_what_it_cannot_show():
    marks = [Line(np.array([1.0, 10, 100]), np.array([-1.0, 0.0, 5.0])), curve()]
    assert extent(marks[:1], "y", log=True) == (5.0, 5.0)
    found = texts(svgs(one([Points(np.array([1.0, 10, 100]), np.array([1e-3, 1.0, 1e3]), low=np.array([-1, 0.5, 9e2]),
                                   high=np.array([2e-3, 2, 1.1e3]))], Axis("f", "Hz", "log"), Axis("A", "1", "log")))[0])  # fmt: skip
    assert {"1", "10", "100", "0.001", "1000"} <= set(found)


@pytest.mark.parametrize("limits", [(0.0, 0.0), (5.0, 5.0), (1e-300, 1e-300), (300.001, 300.002), (-1e9, 1e9)])
def test_every_span_gets_different_ticks(limits):
    axis = Axis("y", "N")
    made = scale(axis, unit_for(axis, [limits]), limits)
    places, words = made.ticks(6)
    assert len(places) >= 2
    assert len(set(words)) == len(words)
    assert all(made.low <= place <= made.high for place in places)


def test_a_full_turn_is_ticked_in_quarters():
    axis = Axis("angle", "rad")
    assert scale(axis, unit_for(axis, [(0, 2 * np.pi)]), (0, 2 * np.pi)).ticks(6)[1] == ["0", "90", "180", "270", "360"]


@pytest.mark.parametrize(
    "marks",
    [
        [],
        [Line(np.array([]), np.array([]))],
        [Line(np.full(5, np.nan), np.full(5, np.inf))],
        [Points(np.array([1.0]), np.array([np.nan]))],
    ],
)
def test_a_panel_without_data_says_so(marks):
    assert all("no data" in texts(svg) for svg in svgs(one(marks)))


def test_rules_that_a_logarithmic_axis_cannot_show_are_left_out():
    svgs(one([curve(), Rule(x=0.0, label="a"), Rule(y=-1.0, label="b")], Axis("x", "m", "log"), Axis("y", "N", "log")))


def test_one_point_and_constant_curves_are_drawn():
    svgs(
        one([Points(np.array([1.0]), np.array([2.0])), Line(np.arange(3.0), np.full(3, 2.0)), Rule(y=2.0), Rule(x=1.0)])
    )


def test_text_from_logs_neither_breaks_nor_enters_the_drawing():
    marks = [
        Line(np.arange(3.0), np.arange(3.0), 0, HOSTILE[:14]),
        Points(np.arange(3.0), np.arange(3.0), "fault", HOSTILE, texts=[HOSTILE] * 3),
        Rule(y=1.0, label=HOSTILE),
        Rule(x=1.0, label=HOSTILE),
    ]
    figure = one(marks, Axis(HOSTILE, "m"), Axis(HOSTILE, "1"), title=HOSTILE)
    matrix = Figure(HOSTILE, HOSTILE, HOSTILE, HOSTILE, [Panel([Matrix(np.eye(2), [HOSTILE, "a"], [HOSTILE, "b"])])])
    for view in (figure_view(figure, 1), figure_view(matrix, 2)):
        markup = str(view.key) + "".join(str(svg) for _, grid in view.grids for svg in grid)
        assert "<script" not in markup
        assert "\x00" not in markup
        assert "\u202e" not in markup
        markup.encode("utf-8")
        for _, grid in view.grids:
            for svg in grid:
                root = ElementTree.fromstring(str(svg))
                assert not list(root.iter("script"))
                assert any("$" in text for text in texts(root))


def test_ids_differ_between_all_drawings_of_a_page(drawn_figures):
    seen: set[str] = set()
    for number, figure in enumerate([*drawn_figures, drawn_figures[0]], 1):
        for svg in svgs(figure, number):
            ids = [element.get("id") for element in svg.iter() if element.get("id")]
            assert len(ids) == len(set(ids))
            assert not seen & set(ids)
            seen |= set(ids)
            refers = set(
                re.findall(r"#([\w-]+)", "".join(e.get("href", "") + " " for e in svg.iter() if e.tag == "use"))
            )
            refers |= {r for e in svg.iter() for r in re.findall(r"url\(#([\w-]+)\)", e.get("clip-path", ""))}
            assert refers <= set(ids)


def test_the_same_figure_gives_the_same_bytes(drawn_figures):
    for number, figure in enumerate(drawn_figures, 1):
        assert figure_view(figure, number) == figure_view(figure, number)


def test_many_points_become_a_picture_and_few_stay_vectors():
    rng = np.random.default_rng(0)
    for n, pictures in ((2000, 0), (20_000, 1)):
        for svg in svgs(one([Points(rng.normal(size=n), rng.normal(size=n))])):
            images = list(svg.iter("image"))
            assert len(images) == pictures
            for image in images:
                assert base64.b64decode(image.get("href", "").partition(",")[2])[:4] == b"\x89PNG"


def test_a_million_samples_stay_small_and_keep_their_extremes():
    x = np.linspace(0, 10, 1_000_000)
    y = np.random.default_rng(0).normal(size=x.size)
    y[123_456], y[654_321], y[500_000] = 40.0, -40.0, np.nan
    kept_x, kept_y = thinned(x, y, 1000)
    assert kept_x.size < 1600
    assert np.all(np.diff(kept_x) > 0)
    assert (np.nanmax(kept_y), np.nanmin(kept_y)) == (40.0, -40.0)
    assert np.isnan(kept_y).sum() == 1
    assert sum(len(str(svg)) for _, grid in figure_view(one([Line(x, y)]), 1).grids for svg in grid) < 120_000


def test_functions_are_named_at_their_ends_and_loops_in_a_key():
    f = np.array([5.0, 10, 15])
    lines = [Line(f, f * (i + 1), i, f"{2 * i} A") for i in range(4)]
    view = figure_view(one(lines), 1)
    assert str(view.key) == ""
    assert all(
        {"0 A", "2 A", "4 A", "6 A"} <= set(texts(ElementTree.fromstring(str(s)))) for _, g in view.grids for s in g
    )
    angle = np.linspace(0, 6.28, 50)
    loops = [Line(np.cos(angle), np.sin(angle), "measured"), Line(np.cos(angle), np.sin(angle), "model")]
    assert re.findall(r"<span>(.*?)</span>", str(figure_view(one(loops), 1).key)) == ["measured", "model"]


def test_labels_at_ends_do_not_cover_each_other():
    f = np.array([5.0, 10, 15])
    lines = [Line(f, f + 1e-3 * i, i, f"line {i}") for i in range(6)]
    for svg in svgs(one(lines)):
        heights = sorted(float(e.get("y", "0")) for e in svg.iter("text") if (e.text or "").startswith("line"))
        assert min(np.diff(heights)) > 12


def test_a_lone_role_is_not_named_again():
    assert "residual" not in texts(svgs(one([replace(curve(), role="residual")]))[0])


def test_uncertainty_is_drawn():
    x = np.arange(5.0)
    bare, with_limits = one([Points(x, x)]), one([Points(x, x, low=x - 1, high=x + 1)])
    count = [sum(1 for e in svgs(figure)[0].iter() if e.tag in ("path", "use")) for figure in (bare, with_limits)]
    assert count[1] >= count[0] + 5
    styles = [element.get("style", "") for element in svgs(one([Band(x, x, x + 1)]))[0].iter()]
    assert any("fill:var(--model)" in text and "fill-opacity:0.2" in text for text in styles)


def test_a_heat_map_carries_its_numbers():
    values = np.array([[1.0, -0.5, np.nan], [-0.5, 1.0, 0.25], [0.0, 0.25, 1.0]])
    found = texts(svgs(Figure("m", "t", "c", "a", [Panel([Matrix(values, ["a", "b", "c"], ["a", "b", "c"])])]))[0])
    assert [text for text in found if text[0] in "−–01"] == [
        "1.00", "−0.50", "–", "−0.50", "1.00", "0.25", "0.00", "0.25", "1.00",
    ]  # fmt: skip


def test_all_text_lies_within_the_drawing(drawn_figures):
    for number, figure in enumerate(drawn_figures, 1):
        for svg in svgs(figure, number):
            _, _, width, height = (float(v) for v in svg.get("viewBox", "").split())
            for element in svg.iter("text"):
                assert -1 <= float(element.get("x", 0)) <= width + 1, element.text
                assert -1 <= float(element.get("y", 0)) <= height + 1, element.text


def test_a_thumbnail_has_no_text(drawn_figures):
    for figure in drawn_figures:
        assert not texts(ElementTree.fromstring(str(thumbnail(figure, "campaign"))))


def luminance(colour: str) -> float:
    parts = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one_: str, other: str) -> float:
    low, high = sorted((luminance(one_), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_every_colour_that_writes_stands_out_from_the_page():
    for dark in (0, 1):
        for pair in [INK, QUIET, *((look.light, look.dark) for look in all_styles())]:
            assert contrast(pair[dark], PAPER[dark]) >= 4.5


# Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB.
DEFICIENCIES = [
    np.eye(3),
    np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]),
    np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]]),
]


def lab(colour: str, deficiency: np.ndarray) -> np.ndarray:
    parts = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(deficiency @ linear, 0, 1) / [0.95047, 1, 1.08883]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("deficiency", DEFICIENCIES, ids=["none", "protan", "deutan", "tritan"])
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_roles_and_series_are_told_apart_by_colour_blind_eyes(dark, deficiency):
    roles = [style(role) for role in ("measured", "model", "reference", "residual", "fault")]
    for looks in (roles, [style(n) for n in range(8)]):
        for a, b in combinations(looks, 2):
            colours = [look.dark if dark else look.light for look in (a, b)]
            assert np.linalg.norm(lab(colours[0], deficiency) - lab(colours[1], deficiency)) > 12
            assert a.marker != b.marker


def test_colours_of_the_drawing_follow_the_page(drawn_figures):
    known = {GRID[0], INK[0], QUIET[0], PAPER[0], *(look.light for look in all_styles())}
    assert css_colour("#0067a5") == "var(--measured)"
    assert css_colour("#123456") == "#123456"
    for svg in svgs(drawn_figures[1]):
        for element in svg.iter():
            assert not known & set(re.findall(r"#[0-9a-f]{6}", element.get("style", "")))


def test_a_text_that_looks_like_a_style_is_left_alone():
    svg = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><text style="fill: #0067a5">fill: #0067a5</text></svg>'
    assert inline(svg) == (
        '<svg class="panel" viewBox="0 0 9 9" focusable="false" aria-hidden="true">'
        '<text style="fill:var(--measured)">fill: #0067a5</text></svg>'
    )


def test_long_words_are_broken_or_end_in_an_ellipsis():
    assert wrapped("a title of several words", 80, 10) == ["a title of", "several words"]
    assert wrapped("x" * 100, 60, 10)[0].endswith("…")
    assert clean(" a\n\tb\x07 ") == "a  b"
