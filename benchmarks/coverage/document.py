"""Writes the tables of docs/uncertainty.md from the numbers that the studies left in docs/uncertainty/.

What a study says of itself in its docstring (what is compared, what not, why an interval is wide) stands above its tables.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from inspect import getdoc
from pathlib import Path
from typing import Any

from benchmarks.coverage import studies

DOCUMENT = Path(__file__).parents[2] / "docs" / "uncertainty.md"
FOLDER = DOCUMENT.with_suffix("")
_MARK = "<!-- written by python -m benchmarks.coverage --write -->"


def write() -> None:
    """Write the tables anew, all that stands below the mark."""
    head = DOCUMENT.read_text(encoding="utf-8").partition(_MARK)[0]
    kept = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(FOLDER.glob("*.json"))}
    parts = [head.rstrip() + "\n\n" + _MARK, _overview(kept)]
    for experiment, cases in kept.items():
        parts += [f"### {experiment}", *_remarks(experiment)]
        parts += [_case(name, told) for name, told in cases.items()]
    DOCUMENT.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _remarks(experiment: str) -> list[str]:
    """Return the paragraphs of the study's docstring after its first."""
    said = getdoc(import_module(f"{studies.__name__}.{experiment.replace('.', '_')}")) or ""
    return said.split("\n\n")[1:]


def _overview(kept: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [
        "| experiment | campaigns | parameters | within 93 to 97 % as far as can be told | too narrow | too wide |",
        "|---|--:|--:|--:|---|---|",
    ]
    for experiment, cases in kept.items():
        told = [line for case in cases.values() for line in case["parameters"] if line["told"]]
        off = {
            kind: ", ".join(line["name"] for line in told if line["judged"] == kind)
            for kind in ("too narrow", "too wide")
        }
        lines.append(
            f"| {experiment} | {max(case['campaigns'] for case in cases.values())} | {len(told)} | "
            f"{sum(not line['judged'] for line in told)} | {off['too narrow']} | {off['too wide']} |"
        )
    return "\n".join(lines)


def _case(name: str, told: Mapping[str, Any]) -> str:
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in told["verdicts"].items())
    about = told["about"].rstrip(".")
    lines = [
        f"*{name}*: {about}. {told['campaigns']} campaigns from seed {told['first']}; verdicts: {verdicts}.",
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
    # Of what is 0 but for chance, the relative error says nothing.
    return "" if value is None or value >= 1.0 else f"{100 * value:.2g} %"
