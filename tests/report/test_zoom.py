"""Long signals: what a page carries of them is what was drawn, fits, and is the same every time."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from pipeline.findings.figures import Axis, Band, Figure, Line, Panel, Points, Rule, Section, Stems
from pipeline.report.figure import figure_view
from pipeline.report.marks import thinned
from pipeline.report.packed import LEVELS, pack, unpack
from pipeline.report.page import render_report
from pipeline.report.reading_units import ReadingUnit
from pipeline.report.scale import scale
from pipeline.report.zoom import Zoom, signals, zoom

TIME, FORCE = Axis("time", "s"), Axis("force", "N")
T = np.linspace(0, 100, 5000)
WAVE = 1500 + 300 * np.sin(T) + np.random.default_rng(4).normal(0, 20, T.size)


def zoomed(*panels: Panel, columns: int = 1, share_x: bool = False) -> Zoom:
    view = figure_view(Figure("long", "Long", "", "", panels, columns, share_x), 7)
    return zoom(view.signals, 0)


def carried(*panels: Panel, **more: bool) -> list[dict]:
    """Return the panels that the script gets, with the numbers of their marks."""
    data = json.loads(zoomed(*panels, **more).data)
    for panel in data["panels"]:
        for mark in panel["marks"]:
            for name in {"x", "y", "low", "high", "left", "right"} & set(mark):
                if mark["kind"] != "rule":
                    mark[name] = unpack(data["arrays"][mark[name]])
    return data["panels"]


@pytest.mark.parametrize("spread", [1e-12, 1.0, 1e9])
def test_packed_numbers_come_back_within_half_a_step(spread):
    values = spread * np.random.default_rng(1).normal(3, 1, 1001)
    found = unpack(pack(values))
    assert np.abs(found - values).max() <= 0.5001 * np.ptp(values) / LEVELS
    assert found.min() == values.min()


def test_packed_numbers_keep_what_is_missing_and_what_does_not_change():
    np.testing.assert_array_equal(unpack(pack(np.array([np.nan, 2.0, np.inf, 5.0]))), [np.nan, 2.0, np.nan, 5.0])
    np.testing.assert_array_equal(unpack(pack(np.full(5, 7.25))), np.full(5, 7.25))
    assert unpack(pack(np.empty(0))).size == 0
    assert np.isnan(unpack(pack(np.full(3, np.nan)))).all()


def test_uniform_times_are_carried_as_first_and_step():
    packed = pack(np.arange(100_000) / 2048.0)
    assert "codes" not in packed
    np.testing.assert_allclose(unpack(packed), np.arange(100_000) / 2048.0, atol=1e-6)
    assert "codes" in pack(np.cumsum(np.r_[np.ones(50), 3.0, np.ones(50)]))


def test_numbers_of_a_logarithmic_axis_keep_their_relative_precision():
    values = np.geomspace(1e-9, 1e4, 300) * np.random.default_rng(2).uniform(0.9, 1.1, 300)
    np.testing.assert_allclose(unpack(pack(values, log=True)), values, rtol=2e-6)
    assert np.isnan(unpack(pack(np.array([0.0, -1.0, 2.0]), log=True))).tolist() == [True, True, False]


def test_the_page_carries_the_signal_as_drawn_in_the_units_of_its_axes():
    (panel,) = carried(Panel([Line(T, WAVE, "measured"), Line(T, WAVE - 5, "model")], TIME, FORCE, "Run a"))
    assert (panel["figure"], panel["place"], panel["title"], panel["x"]["label"]) == (7, 0, "Run a", "time (s)")
    assert panel["y"]["label"] == "force (kN)"
    measured, model = panel["marks"]  # in the order of drawing
    assert [measured["label"], model["label"], measured["colour"], model["colour"]] == ["measured", "model", "--measured", "--model"]  # fmt: skip
    assert (measured["pale"], model["pale"]) == (True, False)
    np.testing.assert_allclose(measured["x"], T, atol=1e-5)
    np.testing.assert_allclose(measured["y"], WAVE / 1e3, atol=np.ptp(WAVE) / 1e3 / LEVELS)
    assert panel["y"]["low"] < WAVE.min() / 1e3 < WAVE.max() / 1e3 < panel["y"]["high"]


def test_of_a_signal_too_long_the_peaks_are_kept():
    t = np.arange(1_000_003) / 1000.0
    y = np.zeros(t.size)
    y[[17, 400_001, 1_000_001]] = 5.0, -3.0, 9.0
    y[600_000:600_010] = np.nan
    (panel,) = carried(Panel([Line(t, y)], TIME, FORCE))
    (mark,) = panel["marks"]
    assert mark["x"].size < 50_000
    for place in (17, 400_001, 1_000_001):
        nearest = np.abs(mark["x"] - t[place]).argmin()
        assert mark["x"][nearest] == pytest.approx(t[place], abs=1e-4)
        assert mark["y"][nearest] == pytest.approx(y[place], abs=1e-5)
    assert np.isnan(mark["y"]).any()


def test_the_last_samples_of_a_thinned_curve_count_as_well():
    y = np.zeros(1009)
    y[1006] = 1.0
    assert thinned(np.arange(1009.0), y, 100)[1].max() == 1.0


def test_every_mark_of_a_panel_is_carried_with_its_limits():
    few = T[::50]
    (panel,) = carried(
        Panel(
            [Line(T, WAVE, "measured"), Band(T, WAVE - 9, WAVE + 9, "model", "95 %"), Rule(x=30.0, label="brake on"),
             Rule(y=1e3), Points(few[::-1], few + 1e3, 3, "means", few + 9e2, few + 11e2)],
            TIME, FORCE,
        )
    )  # fmt: skip
    assert [mark["kind"] for mark in panel["marks"]] == ["band", "rule", "rule", "line", "points"]
    band, upright, level, _, points = panel["marks"]
    np.testing.assert_allclose(band["high"], (WAVE + 9) / 1e3, atol=1e-6)
    assert (upright["x"], upright["label"], level["y"]) == (30.0, "brake on", 1.0)
    np.testing.assert_allclose(points["x"], few, atol=1e-4)  # sorted, for the script's search
    np.testing.assert_allclose(points["high"] - points["low"], 0.2, atol=1e-6)
    assert points["colour"] == "--series-3"


def test_what_the_drawing_shows_whole_is_not_carried():
    nothing = Zoom()
    assert zoomed(Panel([Line(T[:500], WAVE[:500])], TIME, FORCE)) == nothing
    assert zoomed(Panel([Line(WAVE, T)], FORCE, TIME)) == nothing  # a loop
    assert zoomed(Panel([Line(T, WAVE)], TIME, TIME, equal=True)) == nothing
    assert zoomed(Panel([Stems(T, WAVE)], TIME, FORCE)) == nothing
    assert zoomed(Panel([Points(T, WAVE)], Axis("speed", "m/s"), FORCE)) == nothing  # a cloud
    order = Axis("order")
    assert zoomed(Panel([Line(T[:1200], WAVE[:1200])], order, FORCE)) == nothing
    assert len(carried(Panel([Line(T, WAVE)], order, FORCE), Panel([Line(T[:9], WAVE[:9])], order, FORCE))) == 1


def test_arrays_that_panels_share_are_carried_once():
    jittered = T + 1e-3 * np.sin(7 * T)
    panel = Panel([Line(jittered, WAVE, "measured")], TIME, FORCE)
    data = json.loads(zoomed(panel, panel, share_x=True).data)
    assert len(data["panels"]) == 2
    assert len(data["arrays"]) == 2
    assert all(panel["shared"] for panel in data["panels"])


def test_many_long_signals_fit_the_page_and_the_longest_come_first():
    noise = np.random.default_rng(5).normal(size=60_000)
    t = np.cumsum(1 + np.random.default_rng(6).uniform(size=noise.size))
    lengths = (3000, 60_000, *range(3001, 3090))
    panels = [Panel([Line(t[:n], noise[:n] * n)], TIME, FORCE) for n in lengths]
    scales = [(scale(TIME, ReadingUnit("s"), (0.0, 1e5)), scale(FORCE, ReadingUnit("N"), (-1e5, 1e5)))] * len(panels)
    found = signals(Figure("long", "Long", "", "", panels), 1, scales, 700.0)
    plenty = zoom(found, 0).data
    assert 1_450_000 < len(plenty) <= 1_500_000
    kept = [lengths[panel["place"]] for panel in json.loads(plenty)["panels"]]
    assert kept == [60_000, *range(3090 - len(kept) + 1, 3090)]
    assert zoom(found, 0).data == plenty
    assert 0 < len(zoom(found, 4_400_000).data) <= 100_000
    assert zoom(found, 4_499_000) == Zoom()


def test_texts_of_logs_cannot_leave_the_data():
    text = zoomed(Panel([Line(T, WAVE, "measured", "</script><!--\u202e")], TIME, Axis("a&b", "N"), "<b>")).data
    assert not set("<>&") & set(text)
    assert json.loads(text)["panels"][0]["marks"][0]["label"] == "</script><!--"


def test_a_report_carries_the_script_and_its_licence_where_a_signal_is_long_only(findings, make_experiment):
    def page(samples: int) -> str:
        panel = Panel([Line(T[:samples], WAVE[:samples])], TIME, FORCE)
        shown = make_experiment(lambda _: [Section("s", "S", [Figure("f", "F", "", "", [panel])])])
        return render_report(findings, replace(shown), "", "x")

    long, short = page(5000), page(300)
    assert page(5000) == long
    for words in ("uPlot", "Leon Sorokin", 'id="zoom"', ".u-over", "script-src 'sha256-"):
        assert words in long
    for words in ("uPlot", 'id="zoom"', "<script", ".zoom", "script-src 'sha256-"):
        assert words not in short
    assert len(long) - len(short) < 132_000
