"""Zoom in a browser: mouse, keys and fingers change what is shown, and it all goes back; print keeps the drawing."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from pipeline.findings.figures import Axis, Band, Figure, Line, Panel, Points, Rule, Section
from pipeline.report.page import render_report

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
pytestmark = pytest.mark.skipif(
    not CHROMIUM, reason="no Chromium here; install the package 'chromium' to look at pages"
)
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed; it drives Chromium")

T = np.linspace(0, 100, 5000)
FORCE = 1000 + 300 * np.sin(T / 5)


@pytest.fixture(scope="module")
def report(tmp_path_factory, findings, make_experiment) -> str:
    """Return the address of a report with two long signals of one time, a spectrum, and one short signal."""
    time, force = Axis("time", "s"), Axis("force", "N")
    measured = FORCE + np.random.default_rng(3).normal(0, 8, T.size)
    few = T[::250]
    over_time = Panel(
        [Line(T, measured, "measured"), Line(T, FORCE, "model"), Band(T, FORCE - 20, FORCE + 20, "model", "95 %"),
         Points(few, few + 900, 2, "means", few + 850, few + 950), Rule(x=40.0, label="brake on")],
        time, force, "Run a",
    )  # fmt: skip
    residual = Panel([Line(T, measured - FORCE, "residual"), Rule(y=0.0)], time, Axis("residual", "N"))
    frequency = np.geomspace(1, 1000, 4000)
    spectrum = Panel(
        [Line(frequency, 1 / frequency**2, 0, "noise")], Axis("frequency", "Hz", "log"), Axis("power", "N^2/Hz", "log")
    )
    short = Panel([Line(T[:90], FORCE[:90])], time, force)
    figures = [
        Figure("time", "Force", "What?", "Force and residual.", [over_time, residual], share_x=True),
        Figure("spectrum", "Spectrum", "What?", "A spectrum.", [spectrum]),
        Figure("short", "Short", "What?", "A short signal.", [short]),
    ]
    page = tmp_path_factory.mktemp("zoom") / "report.html"
    shown = make_experiment(lambda _: [Section("long", "Long signals", figures)])
    page.write_text(render_report(findings, shown, "Long signals", "rigfit run toy.pads a.csv"), "utf-8")
    return page.as_uri()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as engine:
        chromium = engine.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser, report) -> Iterator[Callable[..., Any]]:
    """Open the report; whatever the console says is a failure."""
    said: list[str] = []
    contexts = []

    def open_it(width: int = 1200, **how: Any) -> Any:
        contexts.append(browser.new_context(viewport={"width": width, "height": 900}, **how))
        page = contexts[-1].new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(report)
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert said == []


def button(page: Any, name: str = "Run a") -> Any:
    return page.locator(f'.zoom-button[aria-label="Zoom: {name}"]:visible')


def window(page: Any, at: int = 0) -> tuple[float, float]:
    """Return the span of time that a panel says it shows."""
    said = page.locator(".zoom-range").nth(at).inner_text()
    if said == "whole signal":
        return -4.5, 104.5
    low, high = re.fullmatch(r"(\S+) to (\S+) s", said).groups()
    return float(low.replace("−", "-")), float(high)


def drag(page: Any, start: float, end: float) -> None:
    box = page.locator(".u-over").first.bounding_box()
    height = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + start * box["width"], height)
    page.mouse.down()
    page.mouse.move(box["x"] + end * box["width"], height, steps=3)
    page.mouse.up()


def test_keys_open_zoom_and_go_back(open_page):
    page = open_page()
    assert page.locator(".zoom-button:visible").count() == 3  # none at the short signal
    button(page).focus()
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.className") == "zoom-view"
    assert window(page) == (-4.5, 104.5)
    page.keyboard.press("+")
    low, high = window(page)
    assert (low, high) == pytest.approx((22.75, 77.25), abs=0.1)
    page.keyboard.press("Shift+ArrowRight")
    assert window(page) == pytest.approx((33.65, 88.15), abs=0.1)
    page.keyboard.press("-")
    page.keyboard.press("-")
    assert window(page) == (-4.5, 104.5)
    page.keyboard.press("+")
    page.keyboard.press("Escape")
    assert window(page) == (-4.5, 104.5)
    page.keyboard.press("Escape")
    assert page.locator(".zoom-view").count() == 0
    assert page.evaluate("document.activeElement.getAttribute('aria-label')") == "Zoom: Run a"
    assert page.locator(".zoomable > svg.panel:visible").count() == 3


def test_a_drag_zooms_and_a_double_click_goes_back(open_page):
    page = open_page()
    button(page).click()
    drag(page, 0.5, 0.75)
    assert window(page) == pytest.approx((50.0, 77.25), abs=0.5)
    drag(page, 0.2, 0.3)
    low, high = window(page)
    assert (low, high) == pytest.approx((55.5, 58.2), abs=0.5)
    page.locator(".u-over").dblclick()
    assert window(page) == (-4.5, 104.5)
    page.get_by_role("button", name="Zoom in").click()
    assert window(page)[1] - window(page)[0] == pytest.approx(54.5, abs=0.1)
    page.get_by_role("button", name="Close").click()
    assert page.locator(".zoom-view").count() == 0


def test_the_wheel_zooms_about_the_cursor_with_control_and_scrolls_without(open_page):
    page = open_page()
    button(page).click()
    box = page.locator(".u-over").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 4, box["y"] + box["height"] / 2)
    page.mouse.wheel(0, -30)
    page.wait_for_timeout(100)
    assert window(page) == (-4.5, 104.5)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -30)
    page.wait_for_timeout(100)
    page.keyboard.up("Control")
    low, high = window(page)
    assert low < (low + high) / 2 < 49
    assert low + (high - low) / 4 == pytest.approx(22.75, abs=0.3)


def test_the_values_under_the_cursor_are_those_of_the_signal(open_page):
    page = open_page()
    button(page).click()
    drag(page, 0.4, 0.45)
    box = page.locator(".u-over").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 40)
    page.wait_for_timeout(50)
    said = page.locator(".zoom-values").inner_text()
    moment = float(re.search(r"time ([\d.]+) s", said)[1])
    model = float(re.search(r"model ([\d.]+) kN", said)[1])
    low, high = (float(limit) for limit in re.search(r"95 % ([\d.]+) to ([\d.]+) kN", said).groups())
    expected = np.interp(moment, T, FORCE) / 1e3
    assert model == pytest.approx(expected, abs=2e-3)  # the nearest sample
    assert (low, high) == pytest.approx((expected - 0.02, expected + 0.02), abs=2e-3)


def test_arrow_keys_move_the_cursor_and_its_values_are_told(open_page):
    page = open_page()
    button(page).focus()
    page.keyboard.press("Enter")
    said = page.locator(".zoom-said")
    assert (said.get_attribute("aria-live"), said.inner_text()) == ("polite", "")

    def told() -> tuple[float, float]:
        words = said.inner_text()
        assert words.replace("; ", "") == re.sub(r"\n", "", page.locator(".zoom-values").inner_text())
        return float(re.match(r"time ([\d.]+) s; ", words)[1]), float(re.search(r"model ([\d.]+) kN", words)[1])

    for key, moment in (("ArrowRight", 51.1), ("ArrowRight", 52.2), ("ArrowLeft", 51.1)):
        page.keyboard.press(key)
        at, model = told()
        assert at == pytest.approx(moment, abs=0.15)  # a hundredth of the window from its middle
        assert model == pytest.approx(np.interp(at, T, FORCE) / 1e3, abs=2e-3)
    page.keyboard.press("+")
    assert window(page)[0] == pytest.approx(51.1 - 0.51 * 54.5, abs=0.2)  # about the cursor
    for _ in range(50):
        page.keyboard.press("ArrowRight")
    at, _ = told()
    low, high = window(page)
    assert low == pytest.approx(51.1 - 0.51 * 54.5 + 10.9, abs=0.3)  # the window went along at its edge
    assert low < at < high
    assert at == pytest.approx(51.1 + 50 * 0.545, abs=0.8)


def test_panels_of_one_time_are_zoomed_together(open_page):
    page = open_page()
    button(page).click()
    button(page, "residual over time").click()
    drag(page, 0.5, 0.75)
    assert window(page, 1) == window(page, 0)
    assert window(page, 0)[0] == pytest.approx(50, abs=0.5)


def test_fingers_pinch_and_move(open_page):
    page = open_page(width=390, has_touch=True)
    button(page).click()
    page.evaluate("""() => {
      const over = document.querySelector(".u-over"), box = over.getBoundingClientRect();
      const finger = (kind, id, share) => over.dispatchEvent(new PointerEvent(kind, {
        pointerType: "touch", pointerId: id, clientX: box.left + share * box.width, clientY: box.top + 20, bubbles: true }));
      finger("pointerdown", 1, .4); finger("pointerdown", 2, .6); finger("pointermove", 1, .3); finger("pointermove", 2, .7);
      finger("pointerup", 2, .7); finger("pointermove", 1, .2); finger("pointerup", 1, .2);
    }""")
    low, high = window(page)
    assert high - low == pytest.approx(54.5, abs=0.2)  # twice as far apart
    assert low == pytest.approx(22.75 + 5.45, abs=0.2)  # then a tenth to the left
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert button(page).count() == 0  # while the panel is enlarged


def test_a_logarithmic_axis_zooms_by_decades(open_page):
    page = open_page()
    button(page, "power over frequency").click()
    page.keyboard.press("+")
    low, high = (float(text) for text in re.findall(r"[\d.]+", page.locator(".zoom-range").inner_text()))
    assert low * high == pytest.approx(1000, rel=0.02)
    assert high / low == pytest.approx(1e3**0.545, rel=0.02)


def test_print_shows_the_drawing(open_page):
    page = open_page()
    button(page).click()
    page.keyboard.press("+")
    page.emulate_media(media="print")
    assert page.locator(".zoom-view:visible, .zoom-button:visible").count() == 0
    assert page.locator('figure[data-name="time"] .grid.wide svg.panel:visible').count() == 2


def test_without_script_the_drawing_is_all_there_is(open_page):
    page = open_page(java_script_enabled=False)
    assert page.locator(".zoom-button").count() == 0
    assert page.locator('figure[data-name="time"] svg.panel:visible').count() == 2


def test_the_canvas_takes_the_colours_of_the_page_light_and_dark(open_page):
    page = open_page(color_scheme="light")
    button(page, "residual over time").click()
    count = """colour => {
      const canvas = document.querySelector(".zoom-view canvas"), { width, height } = canvas;
      const copy = new OffscreenCanvas(width, height).getContext("2d");
      copy.drawImage(canvas, 0, 0);
      const data = copy.getImageData(0, 0, width, height).data;
      let found = 0;
      for (let i = 0; i < data.length; i += 4) found += colour.every((value, k) => Math.abs(data[i + k] - value) < 3) && data[i + 3] > 250;
      return found; }"""
    light, dark = [0x0F, 0x5A, 0x3E], [0xAD, 0xF2, 0xC7]
    assert page.evaluate(count, light) > 500
    assert page.evaluate(count, dark) == 0
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(100)
    assert page.evaluate(count, dark) > 500
    assert page.evaluate(count, light) == 0


@pytest.mark.parametrize(("scheme", "width"), [("light", 390), pytest.param("dark", 1200, marks=pytest.mark.thorough)])
def test_axe_finds_nothing_at_an_enlarged_panel(open_page, scheme, width):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    page = open_page(width, color_scheme=scheme)
    button(page).click()
    found = axe.Axe().run(page).response["violations"]
    assert [rule["id"] for rule in found if rule["impact"] in ("serious", "critical")] == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
