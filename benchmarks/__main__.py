"""Run the benchmarks named, or all, and print one table."""

from __future__ import annotations

import os
import platform
import sys
from importlib import import_module

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

NAMES = (
    "startup",
    "mcap_ingest",
    "csv_ingest",
    "repro",
    "shear_fit",
    "tpjb_dynamic",
    "tpjb_bias",
    "tpjb_rotating",
    "tire_ring",
    "tire_drive",
    "rap_therapy",
)


def main() -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 150)
    unknown = sorted(set(sys.argv[1:]) - set(NAMES))
    if unknown:
        sys.exit(f"no such benchmark: {', '.join(unknown)}; known are {', '.join(NAMES)}")
    table = Table(title=f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    for heading in ("what", "against", "ours [s]", "theirs [s]", "ratio", "goal"):
        table.add_column(heading, justify="left" if heading in ("what", "against", "goal") else "right")
    for name in sys.argv[1:] or NAMES:
        console.print(f"{name} ...", style="dim")
        for row in import_module(f"benchmarks.{name}").measure():
            numbers = [f"{row[key]:.3g}" if row[key] is not None else "" for key in ("ours", "theirs", "ratio")]
            table.add_row(row["what"], row["against"], *numbers, row["goal"])
    console.print(table)


main()
