"""Run the benchmarks named, or all; print one table, and of all write `docs/performance.md` too."""

from __future__ import annotations

import datetime
import os
import platform
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

NAMES = {
    "startup": "Commands",
    "csv_ingest": "Reading logs",
    "mcap_ingest": "Reading logs",
    "tdms_ingest": "Reading logs",
    "bag_ingest": "Reading logs",
    "many_logs": "Many logs",
    "shear_fit": "Identification",
    "tpjb_dynamic": "Identification",
    "memory": "Memory",
    "tpjb_bias": "Identification",
    "tpjb_rotating": "Identification",
    "tire_ring": "Identification",
    "tire_drive": "Identification",
    "rap_therapy": "Identification",
    "repro": "Commands",
}
PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "numba", "lmfit", "mcap", "npTDMS", "asammdf", "rosbags", "dvc")
HEADINGS = ("what", "against", "ours", "theirs", "theirs / ours", "goal")


def main() -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 150)
    unknown = sorted(set(sys.argv[1:]) - set(NAMES))
    if unknown:
        sys.exit(f"no such benchmark: {', '.join(unknown)}; known are {', '.join(NAMES)}")
    table = Table(title=machine())
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("what", "against", "goal") else "right")
    chapters: dict[str, list[list[str]]] = {}
    for name in sys.argv[1:] or NAMES:
        console.print(f"{name} ...", style="dim")
        rows = [cells(row) for row in import_module(f"benchmarks.{name}").measure()]
        chapters.setdefault(NAMES[name], []).extend(rows)
        for row in rows:
            table.add_row(*row)
        if not sys.argv[1:]:  # after each, as all together take half an hour
            PAGE.write_text(page(chapters), encoding="utf-8")
    console.print(table)


def cells(row: dict[str, Any]) -> list[str]:
    """Return a row of the table as text."""
    unit = row.get("unit", "s")
    numbers = [f"{_three_digits(row[key])} {unit}" if row[key] is not None else "" for key in ("ours", "theirs")]
    ratio = f"{row['theirs'] / row['ours']:.3g}" if row["theirs"] is not None else ""
    return [row["what"], row["against"], *numbers, ratio, row["goal"]]


def _three_digits(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 1000 else f"{number:.3g}"


def machine() -> str:
    """Return what was measured on."""
    return f"{processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def processor() -> str:
    """Return the processor's name, its kind where the system does not tell it."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.exists() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def page(chapters: dict[str, list[list[str]]]) -> str:
    """Return the text of `docs/performance.md`."""
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    lines = [
        "# How fast it is",
        "",
        "Written by `make benchmark`; each row holds rigfit against what a user would otherwise run, in one run on one",
        "machine, and the ratio theirs / ours is what counts. Both results are held against each other where they should be",
        "equal.",
        "",
        f"{datetime.date.today().isoformat()}, {machine()}; {versions}.",
    ]
    for title, rows in chapters.items():
        lines += ["", f"## {title}", "", f"| {' | '.join(HEADINGS)} |", "|---|---|--:|--:|--:|---|"]
        lines += [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]
    return "\n".join(lines) + "\n"


main()
