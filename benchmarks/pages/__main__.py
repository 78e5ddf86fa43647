"""Take pictures of all reports and the index, check each page, and say what is wrong: ``make screenshots``.

Pictures go to screenshots/PAGE/: desk-01.png and on, phone-01.png, dark-01.png, print.pdf and print-01.png, cut into
pieces that a viewer shows at their size; columns of a phone and sheets of paper stand side by side. Exit status 1 where
a page has a fault.
"""

from __future__ import annotations

import argparse
import io
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page

from benchmarks.pages.browser import (
    CHROMIUM,
    DESK,
    MISSING,
    PAPER,
    PHONE,
    SMALL_PHONE,
    browser,
    faults_of_access,
    faults_of_file,
    faults_of_keyboard,
    faults_of_sheets,
    faults_of_texts,
    faults_of_width,
    faults_on_paper,
    first_paint,
    opened,
    sheets,
)

_SHEET_DPI = 75
_PIECE = 1600  # pixels of height
_SIDE_BY_SIDE = {"desk": 1, "dark": 1, "phone": 4, "print": 3}


def main(words: list[str] | None = None) -> int:
    asked = argparse.ArgumentParser(prog="python -m benchmarks.pages", description=__doc__)
    asked.add_argument("pages", nargs="*", type=Path, help="pages; all of reports/ where none is named")
    asked.add_argument("--out", type=Path, default=Path("screenshots"))
    asked.add_argument("--check-only", action="store_true", help="no pictures")
    options = asked.parse_args(words)
    if not CHROMIUM:
        print(MISSING, file=sys.stderr)
        return 1
    reports = Path("reports")
    pages = options.pages or sorted([*reports.glob("index.html"), *reports.glob("*/report.html")])
    if not pages:
        print("There is no page in reports/; run 'make reports' first.", file=sys.stderr)
        return 1
    wrong = 0
    with browser() as window:
        for path in pages:
            name = path.stem if path.parent == reports or path.stem != "report" else path.parent.name
            folder = None if options.check_only else options.out / name
            told = looked_at(window, path, folder)
            wrong += bool(told)
            with opened(window, path) as (page, _):
                page.wait_for_timeout(500)  # the entry of the paint comes after the load
                about = f"{path.stat().st_size / 1e6:.2f} MB, {first_paint(page)}"
            print(f"{name} ({about}): {'no fault' if not told else ''}", *told, sep="\n  " if told else "", flush=True)
    print(f"{len(pages)} pages, {wrong} with faults." + ("" if options.check_only else f" Pictures: {options.out}/"))
    return int(wrong > 0)


def looked_at(window: Browser, path: Path, folder: Path | None) -> list[str]:
    """Check a page in all its looks and keep pictures of them in a folder; return its faults."""
    faults = faults_of_file(path)
    for look, size, dark in (("desk", DESK, False), ("phone", PHONE, False), ("dark", DESK, True)):
        with opened(window, path, size, dark=dark) as (page, noise):
            found = [] if look == "phone" else faults_of_access(page)
            found += [] if look == "dark" else faults_of_texts(page)
            found += faults_of_width(page)
            if folder:
                keep(folder, look, _pieces(page))
            if look == "desk":
                found += faults_of_keyboard(page)
            if look == "phone":
                page.set_viewport_size({"width": SMALL_PHONE[0], "height": SMALL_PHONE[1]})
                found += [f"{SMALL_PHONE[0]} px: {fault}" for fault in faults_of_width(page)]
            faults += [f"{look}: {fault}" for fault in found + noise]
    return faults + _printed(window, path, folder)


def _pieces(page: Page) -> list[Image.Image]:
    """Return the whole page in pieces, from its top."""
    size = page.viewport_size or {"width": DESK[0], "height": DESK[1]}
    page.set_viewport_size({"width": size["width"], "height": _PIECE})
    high = page.evaluate("document.documentElement.scrollHeight")
    pieces = []
    for y in range(0, high, _PIECE):
        came_to = page.evaluate("y => { scrollTo({top: y, behavior: 'instant'}); return scrollY }", y)
        piece = Image.open(io.BytesIO(page.screenshot()))
        pieces.append(piece.crop((0, int(y - came_to), piece.width, piece.height)))
    page.set_viewport_size(size)
    return pieces


def keep(folder: Path, look: str, pieces: Sequence[Image.Image]) -> None:
    """Write the pieces of a look side by side, in place of those of an earlier time."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(f"{look}-*.png"):
        old.unlink()
    each = _SIDE_BY_SIDE[look]
    for number, start in enumerate(range(0, len(pieces), each), 1):
        some = pieces[start : start + each]
        gap = 12 if each > 1 else 0
        whole = Image.new("RGB", (sum(one.width + gap for one in some), max(one.height for one in some)), "#888888")
        for place, one in enumerate(some):
            whole.paste(one, (place * (some[0].width + gap), 0))
        whole.save(folder / f"{look}-{number:02d}.png")


def _printed(window: Browser, path: Path, folder: Path | None) -> list[str]:
    with opened(window, path) as (page, _):
        if not folder:
            return faults_on_paper(page)
        folder.mkdir(parents=True, exist_ok=True)
        paper = folder / "print.pdf"
        page.pdf(path=paper, **PAPER)
        faults = faults_on_paper(page)
    if shutil.which("pdftoppm"):
        with tempfile.TemporaryDirectory() as passing:
            subprocess.run(["pdftoppm", "-r", str(_SHEET_DPI), "-png", paper, Path(passing, "sheet")], check=True)
            keep(folder, "print", [Image.open(one).copy() for one in sorted(Path(passing).iterdir())])
    return faults + [f"print: {fault}" for fault in faults_of_sheets(sheets(paper))]


if __name__ == "__main__":
    sys.exit(main())
