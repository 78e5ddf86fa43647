"""The pages in a browser: no sideways scroll on a phone, silent console, whole pages on paper."""

from __future__ import annotations

import re
import shutil
import subprocess
from html import escape
from pathlib import Path

import pytest

from pipeline.findings import Findings
from pipeline.report.index import index_entry, render_index
from pipeline.report.page import render_report
from pipeline.rigs.experiment import Experiment

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
pytestmark = pytest.mark.skipif(
    not CHROMIUM, reason="no Chromium here; install the package 'chromium' to look at pages"
)
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--enable-logging=stderr",
]  # fmt: skip


@pytest.fixture(scope="module")
def pages(findings: Findings, experiment: Experiment) -> dict[str, str]:
    entry = index_entry(findings, experiment, "Pads of batch 7", "report.html")
    return {
        "report": render_report(
            findings, experiment, "Pads of batch 7", "rigfit run toy.pads " + "very_long_name " * 20
        ),
        "index": render_index([entry, entry, entry]),
    }


def chromium(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [CHROMIUM, *FLAGS, f"--user-data-dir={folder / 'profile'}", *words]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("name", ["report", "index"])
def test_the_page_fits_a_phone_and_the_console_is_silent(name, pages, tmp_path):
    # A headless window is never narrower than 500 px; a frame is.
    frames = "".join(
        f'<iframe width="{width}" height="800" srcdoc="{escape(pages[name])}"></iframe>'
        for width in (390, 320, 768, 1280)
    )
    measure = (
        "onload=()=>{document.title=[...document.querySelectorAll('iframe')].map(f=>{const d=f.contentDocument.documentElement;"
        "return f.width+':'+d.scrollWidth}).join(' ')}"
    )
    outer = tmp_path / "outer.html"
    outer.write_text(
        f"<!doctype html><meta charset=utf-8><title></title><body>{frames}<script>{measure}</script>", "utf-8"
    )
    result = chromium(tmp_path, "--dump-dom", "--virtual-time-budget=5000", outer.as_uri())
    title = re.search(r"<title>(.*?)</title>", result.stdout)
    assert title
    widths = [tuple(map(int, pair.split(":"))) for pair in title[1].split()]
    assert len(widths) == 4
    assert all(needed <= given for given, needed in widths), widths
    assert "CONSOLE" not in result.stderr, result.stderr


def test_the_page_prints_whole(pages, tmp_path):
    if not shutil.which("pdftotext"):
        pytest.skip("no pdftotext here; install the package 'poppler-utils' to read the printed page")
    source, paper = tmp_path / "report.html", tmp_path / "report.pdf"
    source.write_text(pages["report"], "utf-8")
    chromium(tmp_path, "--no-pdf-header-footer", f"--print-to-pdf={paper}", source.as_uri())
    text = subprocess.run(["pdftotext", "-layout", paper, "-"], check=True, capture_output=True, text=True).stdout
    sheets = text.split("\f")[:-1]
    assert 5 < len(sheets) < 20
    assert all(sheet.strip() for sheet in sheets)  # no empty page
    for said in ("The numbers that matter", "sh_011", "@article{golub1973", "Remarks", "bearing 1"):
        assert said in text
    # A caption stands on the sheet of its figure: its last label is not left behind.
    for label, caption in (("15 Hz, 6 A", "Figure 1."), ("Damping", "Figure 2."), ("run order", "Figure 6.")):
        assert any(label in sheet and caption in sheet for sheet in sheets), caption
