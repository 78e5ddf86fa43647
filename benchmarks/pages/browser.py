"""A page in a headless Chromium, and what is wrong with it there: on a desk, on a phone, in the dark, on paper.

The browser is the system's; none is downloaded. Each `faults_*` returns one line for each fault that it finds.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
MISSING = "no Chromium here; install the package 'chromium' to look at pages"
DESK, PHONE, SMALL_PHONE = (1280, 900), (390, 844), (320, 640)
LARGEST = 5_000_000  # bytes of a page
PAPER = {"format": "A4", "prefer_css_page_size": True, "print_background": False}
# A4 less the margins of style.css, in CSS pixels of 1/96 inch.
_SHEET = (round((210 - 24) / 25.4 * 96), round((297 - 28) / 25.4 * 96))
_SERIOUS = ("serious", "critical")

_CUT = """sheet => [...document.querySelectorAll('figure:not(.long), .panel, tr')]
  .filter(e => e.getBoundingClientRect().height > sheet)
  .map(e => (e.closest('[data-name]') || e).dataset.name || e.tagName)"""
_BESIDE = """() => [...document.querySelectorAll('body *')].filter(e => {
    const at = e.getBoundingClientRect();
    return at.width && at.right > document.documentElement.clientWidth + 1 && !e.closest('svg *, .scroll table, .skip') })
  .map(e => e.tagName.toLowerCase() + '.' + e.getAttribute('class')).slice(0, 5)"""
# Texts of one drawing that lie on each other by more than a hair, and those that leave the window.
_TEXTS = """() => { const found = [];
  for (const drawing of document.querySelectorAll('svg.panel')) {
    const name = drawing.closest('[data-name]')?.dataset.name ?? 'picture';
    const texts = [...drawing.querySelectorAll('text')].filter(t => t.textContent.trim())
      .map(t => [t.textContent.trim(), t.getBoundingClientRect(), /rotate\\((?!-?0[ ,)])/.test(t.getAttribute('transform') || '')])
      .filter(([, r]) => r.width);
    texts.forEach(([one, r], i) => {
      if (r.right > document.documentElement.clientWidth + 2 || r.left < -2) found.push(`${name}: '${one}' leaves the window`);
      for (const [other, s] of texts.slice(i + 1)) {
        const wide = Math.min(r.right, s.right) - Math.max(r.left, s.left), high = Math.min(r.bottom, s.bottom) - Math.max(r.top, s.top);
        if (wide > 2 && high > .4 * Math.min(r.height, s.height, r.width, s.width)) found.push(`${name}: '${one}' on '${other}'`);
      } });
  } return found }"""
_FOCUSED = """() => { const e = document.activeElement, look = getComputedStyle(e), at = e.getBoundingClientRect();
  return {what: (e.textContent || '').trim().slice(0, 40) || e.tagName, body: e === document.body,
    ring: look.outlineStyle !== 'none' && parseFloat(look.outlineWidth) >= 2,
    seen: at.width > 0 && at.right > 0 && at.bottom > 0 && at.top < innerHeight && at.left < innerWidth,
    place: [...document.querySelectorAll('*')].indexOf(e)} }"""


@contextmanager
def browser() -> Iterator[Browser]:
    """Start the system's Chromium without a window."""
    flags = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
    with sync_playwright() as playwright:
        window = playwright.chromium.launch(executable_path=CHROMIUM, args=flags)
        try:
            yield window
        finally:
            window.close()


@contextmanager
def opened(
    window: Browser, path: Path, size: tuple[int, int] = DESK, *, dark: bool = False, script: bool = True
) -> Iterator[tuple[Page, list[str]]]:
    """Open a file; yield the page and what went wrong so far: messages of the console, errors, requests to elsewhere."""
    context = window.new_context(
        viewport={"width": size[0], "height": size[1]}, color_scheme="dark" if dark else "light",
        java_script_enabled=script,
    )  # fmt: skip
    page = context.new_page()
    noise: list[str] = []
    page.on("console", lambda message: noise.append(f"console: {message.text}"))
    page.on("pageerror", lambda error: noise.append(f"script: {error}"))
    page.on("request", lambda asked: None if _own(asked.url, path) else noise.append(f"request: {asked.url[:200]}"))
    page.goto(path.resolve().as_uri(), wait_until="load")
    try:
        yield page, noise
    finally:
        context.close()


def _own(url: str, path: Path) -> bool:
    return url.split("#")[0] == path.resolve().as_uri() or url.startswith(("data:", "blob:"))


def faults_of_file(path: Path) -> list[str]:
    """A page is one file of bearable size whose first paint waits for nothing but its own bytes."""
    text = path.read_text(encoding="utf-8")
    faults = [f"{len(text.encode()):,} bytes"] if path.stat().st_size > LARGEST else []
    head = text.split("</head>")[0]
    if "<script" in head:
        faults.append("a script in the head delays the first paint")
    return faults + [
        f"needs {link}"
        for link in re.findall(r"<(?:script|img|link|iframe)[^>]*(?:src|href)=[\"'](?!data:)[^>]*", text)
    ]


def first_paint(page: Page) -> str:
    """Say how long the page took from being asked for to the first thing seen."""
    found = page.evaluate(
        "performance.getEntriesByName('first-contentful-paint').map(entry => entry.startTime)[0] ?? null"
    )
    return "first paint not measured" if found is None else f"first paint after {found:.0f} ms"


def faults_of_width(page: Page) -> list[str]:
    """Nothing is wider than the window."""
    needed, given = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    if needed <= given:
        return []
    return [f"scrolls sideways: {needed} px needed in {given} px, by {', '.join(page.evaluate(_BESIDE))}"]


def faults_of_texts(page: Page) -> list[str]:
    """Texts in drawings neither lie on each other nor leave the window."""
    return list(page.evaluate(_TEXTS))


def faults_of_access(page: Page) -> list[str]:
    """axe-core finds nothing serious or critical."""
    from axe_playwright_python.sync_playwright import Axe

    found: dict[str, Any] = Axe().run(page).response
    return [
        f"axe {one['id']} ({one['impact']}), {len(one['nodes'])} times: {one['help']}; first {one['nodes'][0]['html'][:160]}"
        for one in found["violations"]
        if one["impact"] in _SERIOUS
    ]


def faults_of_keyboard(page: Page, most: int = 60) -> list[str]:
    """Tab goes to the skip link first, then down the page; what has the focus is seen and marked."""
    faults: list[str] = []
    last = -1
    page.evaluate("scrollTo(0, 0)")
    for step in range(most):
        page.keyboard.press("Tab")
        at = page.evaluate(_FOCUSED)
        if at["body"]:
            break
        if step == 0 and not at["what"].startswith("Skip to"):
            faults.append(f"the first stop is '{at['what']}', not the skip link")
        if at["place"] <= last:
            faults.append(f"the focus goes back to '{at['what']}'")
        if not (at["ring"] and at["seen"]):
            faults.append(f"the focus on '{at['what']}' is not seen")
        last = at["place"]
    return faults


def faults_on_paper(page: Page, sheet: tuple[int, int] = _SHEET) -> list[str]:
    """Nothing is wider than a sheet, and nothing that must stay whole is longer than one. Leaves the page printed on screen."""
    page.emulate_media(media="print", color_scheme="light")
    page.set_viewport_size({"width": sheet[0], "height": sheet[1]})
    cut = [f"{name} is longer than a sheet" for name in page.evaluate(_CUT, sheet[1])]
    return [f"paper {fault}" for fault in faults_of_width(page) + cut + faults_of_texts(page)]


def sheets(paper: Path) -> list[str]:
    """Return the text of each sheet of a PDF; empty where pdftotext is not installed."""
    if not shutil.which("pdftotext"):
        return []
    told = subprocess.run(["pdftotext", "-layout", paper, "-"], check=True, capture_output=True, text=True).stdout
    return told.split("\f")[:-1]


def faults_of_sheets(texts: list[str]) -> list[str]:
    """No sheet is empty."""
    return [f"sheet {number} of {len(texts)} is empty" for number, text in enumerate(texts, 1) if not text.strip()]
