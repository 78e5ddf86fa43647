"""What other rigs draw: orbits, outlines, spectra with marked lines, many series, cells that judge."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
import pytest

from pipeline.findings import Published
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Outline,
    Panel,
    Points,
    Rule,
    Status,
    Stems,
    Table,
    Value,
)
from pipeline.report.accounts import paper_table, published_table
from pipeline.report.figure import figure_view
from pipeline.report.labels import keys
from pipeline.report.numbers import alike
from pipeline.report.palette import style
from pipeline.report.parameters import condition_text
from pipeline.report.table import table_view
from pipeline.report.texts import Box, apart

ANGLE = np.linspace(0, 2 * np.pi, 90, endpoint=False)


def figure(marks: Sequence[Mark], x: Axis | None = None, y: Axis | None = None, equal: bool = False) -> Figure:
    panel = Panel(marks, x or Axis("x", "m"), y or Axis("y", "m"), "panel", equal)
    return Figure("f", "title", "caption", "alt", [panel])


def drawn(
    marks: Sequence[Mark], x: Axis | None = None, y: Axis | None = None, equal: bool = False
) -> ElementTree.Element:
    return ElementTree.fromstring(figure_view(figure(marks, x, y, equal), 1).grids[0][1][0])


def vertices(svg: ElementTree.Element, least: int) -> list[np.ndarray]:
    paths = [path.get("d", "") for path in svg.iter("path")]
    found = [np.array(re.findall(r"-?\d+(?:\.\d+)?", d), float) for d in paths if "C" not in d]
    return [numbers[: numbers.size // 2 * 2].reshape(-1, 2) for numbers in found if numbers.size >= 2 * least]


def written(svg: ElementTree.Element) -> dict[str, tuple[float, float]]:
    """Return where each upright text stands."""
    places = {}
    for text in svg.iter("text"):
        turned = re.search(r"translate\(([\d.]+) ([\d.]+)\) rotate\(-90\)", text.get("transform", ""))
        if turned:
            places["".join(text.itertext())] = (float(turned[1]), float(turned[2]))
    return places


def test_a_closed_curve_ends_where_it_begins() -> None:
    x, y = 4e-5 * np.cos(ANGLE), 2e-5 * np.sin(ANGLE)
    for closed in (False, True):
        (curve,) = vertices(drawn([Line(x, y, "model", closed=closed)], equal=True), 60)
        gap = np.hypot(*(curve[0] - curve[-1]))
        assert (gap < 0.11) == closed


def test_an_outline_is_closed_and_tinted_and_keeps_its_shape() -> None:
    x, y = np.array([0, 0.08, 0.08, 0]), np.array([0, 0, 0.02, 0.02])
    svg = drawn([Outline(x, y, "reference", "as drawn")], equal=True)
    outline = next(v for v in vertices(svg, 4) if np.ptp(v[:, 1]) > 5 and np.ptp(v[:, 0]) / np.ptp(v[:, 1]) > 2)
    width, height = np.ptp(outline, axis=0)
    assert width / height == pytest.approx(4, rel=0.02)
    assert any("fill-opacity" in e.get("style", "") or "opacity" in e.get("style", "") for e in svg.iter("path"))


def test_stems_stand_on_their_base_on_both_sides_of_zero() -> None:
    order, height = np.array([-2.3, -1.3, 1.3, 2.3]), np.array([1e-6, -3e-6, 5e-6, 2e-6])
    svg = drawn([Stems(order, height, "measured")], Axis("order", whole=True), Axis("amplitude", "m"))
    stems = {round(v[0, 0], 1): np.ptp(v[:, 1]) for v in vertices(svg, 2) if len(v) == 2 and v[0, 0] == v[1, 0]}
    grid = max(stems.values())  # its lines go through the whole panel
    lengths = [stems[x] for x in sorted(stems) if stems[x] < 0.99 * grid]
    assert np.array(lengths) / lengths[0] == pytest.approx([1, 3, 5, 2], rel=0.02)
    labels = ["".join(text.itertext()) for text in svg.iter("text")]
    assert not any("." in label for label in labels if re.fullmatch(r"[−\d.]+", label) and label in "−2 −1 0 1 2")


def test_bars_have_a_width_and_reach_below_zero() -> None:
    svg = drawn([Stems(np.arange(4.0), np.array([1.0, -1.0, 2.0, 0.5]), 0, width=0.8)], Axis("order"), Axis("share"))
    bars = [v for v in vertices(svg, 4) if len(v) == 4 and np.ptp(v[:, 0]) > 20]
    heights = np.array([np.ptp(bar[:, 1]) for bar in bars])
    assert heights / heights[0] == pytest.approx([1, 1, 2, 0.5], rel=0.02)
    assert bars[1][:, 1].min() == pytest.approx(bars[0][:, 1].max(), abs=0.2)


def test_stems_on_a_logarithmic_axis_stand_on_its_lower_end() -> None:
    drawn([Stems(np.arange(1.0, 4.0), np.array([1.0, 1e-3, 0.0]))], Axis("order"), Axis("amplitude", "m", "log"))
    drawn(
        [Stems(np.arange(1.0, 4.0), np.array([1.0, 1e-3, 0.0]), width=0.8)],
        Axis("order"),
        Axis("amplitude", "m", "log"),
    )


def test_limits_along_x_are_drawn() -> None:
    x, y = np.array([1.0, 2.0]), np.array([1.0, 2.0])
    svg = drawn([Points(x, y, "measured", "", left=x - 0.5, right=x + 0.5)], Axis("x"), Axis("y"))
    level = [v for v in vertices(svg, 2) if len(v) == 2 and v[0, 1] == v[1, 1] and 50 < np.ptp(v[:, 0]) < 400]
    assert len(level) == 2


def test_names_of_crowded_rules_do_not_cover_each_other_and_keep_their_order() -> None:
    places = {"1X": 47.0, "2X": 94.0, "mains": 100.0, "outer race": 104.0, "inner race": 106.0, "cage": 110.0}
    rules = [Rule(x=at, label=name) for name, at in places.items()]
    f = np.linspace(0, 500, 300)
    at = written(drawn([Line(f, np.exp(-f / 100)), *rules], Axis("frequency", "Hz"), Axis("a", "m")))
    x = [at[name][0] for name in places]
    assert x == sorted(x)
    assert np.diff(x).min() > 13


def test_names_of_rules_with_room_stay_at_their_rules() -> None:
    f = np.linspace(0, 500, 300)
    lone = figure_view(figure([Line(f, f), Rule(x=100.0, label="1X")], Axis("f", "Hz"), Axis("a")), 1)
    crowd = figure_view(
        figure([Line(f, f), *(Rule(x=100.0 + i, label="resonance") for i in range(3))], Axis("f", "Hz"), Axis("a")), 1
    )
    heights = [float(ElementTree.fromstring(v.grids[0][1][0]).get("viewBox", "").split()[3]) for v in (lone, crowd)]
    assert heights[1] > heights[0] + 50


def test_names_of_level_rules_close_to_each_other_are_apart() -> None:
    f = np.linspace(0, 10, 50)
    svg = drawn([Line(f, f), Rule(y=5.0, label="B/C"), Rule(y=5.1, label="C/D")], Axis("t", "s"), Axis("a"))
    places = {"".join(t.itertext()): float(t.get("y", "nan")) for t in svg.iter("text")}
    assert abs(places["B/C"] - places["C/D"]) > 12


def test_names_of_rules_keep_off_curves() -> None:
    t = np.linspace(0, 10, 400)
    svg = drawn([Line(t, 1 - np.exp(-t)), Line(t, 0.95 + 0 * t), Rule(x=2.0, label="t_63")], Axis("t", "s"), Axis("a"))
    tick = next(float(text.get("y", "nan")) for text in svg.iter("text") if "".join(text.itertext()) == "0.8")
    assert written(svg)["t63"][1] > tick


def test_boxes_meet_where_they_overlap_only() -> None:
    box = Box(0, 0, 10, 10)
    assert box.meets(Box(5, 5, 15, 15))
    assert not box.meets(Box(10, 0, 20, 10))


def test_places_are_moved_apart_and_stay_below_the_end() -> None:
    moved = apart([95.0, 96.0, 99.0], 10.0, 100.0)
    assert np.diff(moved).min() >= 10
    assert max(moved) <= 100


def test_sixteen_series_look_different_and_their_key_stands_outside_the_panel() -> None:
    looks = {(style(i).light, style(i).marker, style(i).hollow) for i in range(16)}
    assert len(looks) == 16
    x = np.arange(5.0)
    many = figure([Line(x, x + i, i, f"run {i}") for i in range(12)])
    assert len(keys(many, 1)) == 12
    view = figure_view(many, 1)
    assert view.key.count("<li>") == 12
    assert "run 7" not in {"".join(t.itertext()) for t in ElementTree.fromstring(view.grids[0][1][0]).iter("text")}


def test_texts_that_stand_on_their_points_need_no_entry_in_the_key() -> None:
    x = np.arange(5.0)
    on_it = Points(x[:1], x[:1], "reference", texts=["I_s"], bare=True)
    assert not keys(figure([Points(x, x, "measured"), on_it]), 1)
    assert [entry.label for entry in keys(figure([Line(x, -x, 0, "law"), Points(x[::-1], x, 1, "up"), on_it]), 3)] == [
        "law",
        "up",
    ]


def test_a_panel_is_told_to_a_screen_reader() -> None:
    x = np.linspace(0, 1e-3, 20)
    marks: list[Mark] = [
        Points(x, 2e5 * x, "measured", "samples"),
        Line(x, 2e5 * x, "model"),
        Rule(y=100.0, label="limit"),
    ]
    svg = drawn(marks, Axis("displacement", "m"), Axis("force", "N"))
    assert svg.get("role") == "img"
    title, description = (svg.find(tag) for tag in ("title", "desc"))
    assert title is not None
    assert title.text == "panel"
    assert description is not None
    told = description.text or ""
    for said in ("force (N) from 0 to 200", "displacement (mm) from 0 to 1", "samples (20 points)", "model (line)",
                 "limit (marker line at 100 N)"):  # fmt: skip
        assert said in told
    assert {svg.get("aria-labelledby"), svg.get("aria-describedby")} == {title.get("id"), description.get("id")}


def test_a_status_is_a_word_and_a_colour() -> None:
    rows: list[list[Cell]] = [
        ["k", Status.agrees],
        ["c", Status.contradicts],
        ["m", Status.not_checkable],
        ["<b>", Status("a<b", "ok")],
    ]
    view = table_view(Table("t", "t", "", [Column("claim"), Column("status")], rows))
    cells = [row[1].text for row in view.rows]
    assert [re.sub("<.*?>", "", cell) for cell in cells] == ["agrees", "contradicts", "not checkable", "a&lt;b"]
    assert [re.search(r"badge (\w+)", cell)[1] for cell in cells] == ["ok", "rejected", "unsaid", "ok"]


def test_temperatures_are_read_in_degrees_celsius_and_their_errors_in_kelvin() -> None:
    cells: list[list[Cell]] = [[313.15], [Value(323.15, 0.5, (322.15, 324.15))]]
    view = table_view(Table("t", "t", "", [Column("oil", "degC")], cells))
    assert view.heads[0].unit == "°C"
    assert [row[0].text.strip().rstrip("\u2007\u2008") for row in view.rows] == ["40", "50.00 ± 0.50"]
    assert view.rows[1][0].below == "49.00 … 51.00"
    assert condition_text(293.15, "degC") == "20 °C"
    svg = drawn([Line(np.array([0.0, 1.0]), np.array([293.15, 313.15]))], Axis("time", "s"), Axis("oil", "degC"))
    texts = ["".join(t.itertext()) for t in svg.iter("text")]
    assert "oil (°C)" in texts
    assert "20" in texts
    assert "40" in texts


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        ([9.996, 10.0, 14.99], ["10.00", "10.00", "14.99"]),
        ([200.0, 700.0], ["200", "700"]),
        ([0.25, 0.5, 1.0], ["0.25", "0.50", "1.00"]),
        ([1e-3, 10.0], None),
    ],
)
def test_numbers_of_a_column_have_the_same_decimals(values: list[float], shown: list[str] | None) -> None:
    assert alike(values) == shown


def test_what_the_paper_says_of_itself_stands_apart_from_what_was_found() -> None:
    mine = Published(name="stiffness", published=330e3, found=329e3, unit="N/m", agrees=True)
    own = Published(name="modulus", published=0.66e6, found=0.658e6, unit="Pa", agrees=True, basis="paper")
    found, paper = published_table([mine, own]), paper_table([mine, own])
    assert found is not None
    assert paper is not None
    assert [[row[0].text for row in view.rows] for view in (found, paper)] == [["stiffness"], ["modulus"]]
    assert "Found" not in [head.text for head in paper.heads]
    assert published_table([own]) is None
    assert paper_table([mine]) is None
