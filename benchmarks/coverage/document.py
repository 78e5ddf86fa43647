"""Writes the tables of docs/uncertainty.md from the numbers that the studies left in docs/uncertainty/."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

DOCUMENT = Path(__file__).parents[2] / "docs" / "uncertainty.md"
FOLDER = DOCUMENT.with_suffix("")
_MARK = "<!-- written by python -m benchmarks.coverage --write -->"


def write() -> None:
    """Write the tables anew, all that stands below the mark."""
    head = DOCUMENT.read_text(encoding="utf-8").partition(_MARK)[0]
    parts = [head.rstrip() + "\n\n" + _MARK]
    for path in sorted(FOLDER.glob("*.json")):
        parts += [_case(path.stem, name, told) for name, told in json.loads(path.read_text(encoding="utf-8")).items()]
    DOCUMENT.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _case(experiment: str, name: str, told: Mapping[str, Any]) -> str:
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in told["verdicts"].items())
    lines = [
        f"### {experiment}, {name}",
        "",
        f"{told['about']} {told['campaigns']} campaigns from seed {told['first']}; verdicts: {verdicts}.",
        "",
        "| parameter | told | not told | interval holds | of 95 % | bias / error | spread / error | rms error | efficiency | |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|---|",
        *(_line(line) for line in told["parameters"]),
    ]
    return "\n".join(lines)


def _line(line: Mapping[str, Any]) -> str:
    star = " *" if line["over_seeds"] else ""
    if not line["told"]:
        return f"| {line['name']}{star} | 0 | {line['untold']} | | | | | | | |"
    low, high = line["share95"]
    return (
        f"| {line['name']}{star} | {line['told']} | {line['untold'] or ''} | {_percent(line['share'])} | "
        f"{_percent(low)} to {_percent(high)} | {_number(line['bias'])} | {_number(line['spread'])} | {_rms(line['rms'])} | "
        f"{_number(line['efficiency'])} | {line['judged']} |"
    )


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _rms(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.2g} %"
