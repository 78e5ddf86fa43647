"""Findings handed on as flat records: one a parameter, its operating point in columns of their own, each unit said.

``pandas.DataFrame(json.load(file)["parameters"])`` is a table at once; the full findings are findings.json.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from pipeline import __version__
from pipeline.findings.findings import Findings, Parameter

AT = "at."  # begins the names of the columns that are operating points


def as_json(findings: Findings, unit_of: Callable[[str], str]) -> str:
    """Return the text of the JSON file.

    Parameters
    ----------
    unit_of
        Gives the SI unit of a condition or channel that stands in an operating point, '' for text.
    """
    content = {
        "campaign": findings.campaign,
        "experiment": findings.experiment,
        "verdict": findings.verdict,
        "reasons": findings.reasons,
        "rigfit": findings.provenance.get("rigfit", __version__),
        "units": {AT + name: unit_of(name) for name in places(findings)},
        "parameters": records(findings),
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def records(findings: Findings) -> list[dict[str, Any]]:
    """Return one flat record a parameter, all with the same keys; null where a parameter has no such entry."""
    keys = places(findings)
    return [_record(parameter, keys) for parameter in findings.parameters]


def places(findings: Findings) -> list[str]:
    """Return what stands in the operating points of all parameters."""
    return list(dict.fromkeys(key for parameter in findings.parameters for key in parameter.at))


def _record(p: Parameter, keys: list[str]) -> dict[str, Any]:
    low, high = p.ci95 or (None, None)
    return {
        "name": p.name,
        **{AT + key: p.at.get(key) for key in keys},
        "value": p.value,
        "std_error": p.std_error,
        "type_b": p.type_b,
        "ci95_low": low,
        "ci95_high": high,
        "unit": p.unit,
        "symbol": p.symbol,
        "description": p.description,
        "source": p.source,
        "method": p.method,
    }
