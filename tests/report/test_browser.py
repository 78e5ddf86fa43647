"""The pages in a browser: silent, no wider than a phone, usable by keyboard and screen reader, whole on paper."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.pages import browser as look
from pipeline.findings import Findings
from pipeline.findings.comparison import compare
from pipeline.report.compare import render_comparison
from pipeline.report.compare_numbers import Compared
from pipeline.report.index import index_entry, render_index
from pipeline.report.page import render_report
from pipeline.rigs.experiment import Experiment

pytestmark = pytest.mark.skipif(not look.CHROMIUM, reason=look.MISSING)
PAGES = ("report", "index", "comparison")


@pytest.fixture(scope="module")
def window():
    with look.browser() as opened:
        yield opened


def moved(findings: Findings) -> Findings:
    """The findings with every other number gone up by a standard error and a half, and one no longer told."""
    parameters = [
        p.model_copy(update={"value": p.value + 1.5 * p.std_error}) if p.value and p.std_error and place % 2 else p
        for place, p in enumerate(findings.parameters[1:])
    ]  # fmt: skip
    return findings.model_copy(
        update={"parameters": parameters, "verdict": "rejected", "quality": findings.quality[1:]}
    )


@pytest.fixture(scope="module")
def pages(
    findings: Findings, experiment: Experiment, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, Path]]:
    folder = tmp_path_factory.mktemp("pages")
    entry = index_entry(findings, experiment, "Pads of batch 7", "report.html")
    made = {
        "report": render_report(
            findings, experiment, "Pads of batch 7", "rigfit run toy.pads " + "very_long_name " * 20
        ),
        "index": render_index([entry, entry, entry]),
        "comparison": render_comparison(
            [Compared(compare(findings, moved(findings)), experiment)], ("main", "try"), (), "rigfit compare main try"
        ),
    }
    for name, text in made.items():
        (folder / f"{name}.html").write_text(text, "utf-8")
    return {name: folder / f"{name}.html" for name in made}


@pytest.mark.parametrize("name", PAGES)
def test_the_page_fits_every_width_its_texts_lie_free_and_the_console_is_silent(name, pages, window):
    with look.opened(window, pages[name]) as (page, noise):
        for width in (1280, 768, 390, 320):
            page.set_viewport_size({"width": width, "height": 800})
            assert look.faults_of_width(page) == [], width
            assert look.faults_of_texts(page) == [], width
        assert noise == []
    assert look.faults_of_file(pages[name]) == []


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_axe_finds_nothing_serious(name, dark, pages, window):
    with look.opened(window, pages[name], look.PHONE if dark else look.DESK, dark=dark) as (page, _):
        assert look.faults_of_access(page) == []


@pytest.mark.parametrize("name", PAGES)
def test_the_keyboard_goes_down_the_page_from_the_skip_link_and_is_seen(name, pages, window):
    with look.opened(window, pages[name]) as (page, _):
        assert look.faults_of_keyboard(page) == []
    with look.opened(window, pages[name]) as (page, _):
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        assert page.evaluate("location.hash") == "#main"
        top = page.evaluate("document.getElementById('main').getBoundingClientRect().top")
        assert top < look.DESK[1]


@pytest.mark.parametrize("name", PAGES)
def test_without_script_the_page_shows_the_same(name, pages, window):
    with look.opened(window, pages[name], script=False) as (page, noise):
        told = page.locator("main").inner_text()
        assert "k1" in told.replace("\n", "")
        assert noise == []
    with look.opened(window, pages[name]) as (page, _):
        assert set(told.split()) <= set(page.locator("main").inner_text().split())


@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_cut_on_paper(name, pages, window):
    with look.opened(window, pages[name]) as (page, _):
        assert look.faults_on_paper(page) == []


def test_the_report_prints_whole(pages, window, tmp_path):
    paper = tmp_path / "report.pdf"
    with look.opened(window, pages["report"]) as (page, _):
        page.pdf(path=paper, **look.PAPER)
    sheets = look.sheets(paper)
    if not sheets:
        pytest.skip("no pdftotext here; install the package 'poppler-utils' to read the printed page")
    assert look.faults_of_sheets(sheets) == []
    assert 5 < len(sheets) < 20
    text = "\f".join(sheets)
    for said in ("The numbers that matter", "sh_011", "@article{golub1973", "Remarks", "bearing 1"):
        assert said in text
    # A caption stands on the sheet of its figure: its last label is not left behind.
    for label, caption in (("15 Hz, 6 A", "Figure 1."), ("Damping", "Figure 2."), ("run order", "Figure 6.")):
        assert any(label in sheet and caption in sheet for sheet in sheets), caption


@pytest.mark.thorough
def test_faults_are_seen(window, tmp_path):
    """What looks at the pages sees each of the faults that it is there for."""
    bad = tmp_path / "bad.html"
    bad.write_text(
        "<!doctype html><html><head><title>x</title><script>console.error('oh')</script></head><body><p tabindex=2 style='outline:0'>a</p>"
        "<main style='width:900px;color:#ccc;background:#fff'>grey</main><img src='https://nowhere.invalid/x.png'>"
        "<figure data-name=tall style='height:3000px'></figure><svg class=panel width=200 height=50><text y=20>one</text>"
        "<text y=22 x=3>other</text></svg></body></html>",
        "utf-8",
    )
    with look.opened(window, bad, look.PHONE) as (page, noise):
        assert "main" in look.faults_of_width(page)[0]
        assert look.faults_of_texts(page) == ["picture: 'one' on 'other'"]
        told = " ".join(look.faults_of_access(page))
        assert "color-contrast" in told
        assert "image-alt" in told
        keyboard = " ".join(look.faults_of_keyboard(page))
        assert "not the skip link" in keyboard
        assert "is not seen" in keyboard
        assert any("tall is longer than a sheet" in fault for fault in look.faults_on_paper(page))
        assert any("oh" in one for one in noise)
        assert any("nowhere.invalid" in one for one in noise)
    assert len(look.faults_of_file(bad)) == 2
    assert look.faults_of_sheets(["a", " \n"]) == ["sheet 2 of 2 is empty"]
