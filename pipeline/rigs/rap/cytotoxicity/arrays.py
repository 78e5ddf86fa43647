"""Tables that go with the findings: samples, cells, differences, slopes, power. The report draws from them alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.rigs.rap.cytotoxicity.analysis import Culture, Outcome, ordered
from pipeline.rigs.rap.cytotoxicity.power import cultures_needed, power

_DESIGNS = (3, 4, 6, 8)


def arrays_of(cultures: Sequence[Culture]) -> dict[str, pd.DataFrame]:
    """Return the tables that hold anything; times in s, shares of 1."""
    tables = {
        "samples": [row for culture in cultures for row in _samples(culture)],
        "differences": [row for culture in cultures for o in ordered(culture) for row in _differences(culture.run, o)],
        "outcomes": [_summary(culture, outcome) for culture in cultures for outcome in ordered(culture)],
        "power": [row for culture in cultures for o in ordered(culture) for row in _power(culture, o)],
    }
    return {name: pd.DataFrame(rows) for name, rows in tables.items() if rows}


def _samples(culture: Culture) -> list[dict[str, Any]]:
    samples = culture.samples
    return [
        {
            "run": culture.run,
            "time": float(culture.times[i]),
            "drawn": float(samples.time[i]),
            "group": "treated" if samples.treated[i] else "control",
            "replicate": samples.culture[i],
            "n": float(samples.weight[i]),
            **{name: float(column[i]) for name, column in samples.values.items()},
        }
        for i in range(samples.time.size)
    ]


def _differences(run: str, outcome: Outcome) -> list[dict[str, Any]]:
    found = outcome.found
    if found is None:
        return []
    return [
        {
            "run": run, "outcome": outcome.name, "time": time, "n_treated": t.n, "n_control": c.n,
            "treated": t.mean, "control": c.mean, "difference": found.value[i], "std_error": found.std_error[i],
            "low90": found.low90[i], "high90": found.high90[i], "low95": found.low95[i], "high95": found.high95[i],
            "p": found.p[i], "margin": outcome.margin,
            "passes": bool(-outcome.margin < found.low90[i] and found.high90[i] < outcome.margin),
        }
        for i, (time, t, c) in enumerate(zip(outcome.times.tolist(), outcome.treated, outcome.controls, strict=True))
    ]  # fmt: skip


def _summary(culture: Culture, outcome: Outcome) -> dict[str, Any]:
    found, slope, nan = outcome.found, outcome.slope, float("nan")
    return {
        "run": culture.run,
        "outcome": outcome.name,
        "verdict": outcome.verdict,
        "reason": outcome.reason,
        "control": culture.control,
        "margin": outcome.margin,
        "deviation": found.deviation if found is not None else nan,
        "dof": found.dof if found is not None else 0,
        "slope": slope.value if slope is not None else nan,
        "slope_error": slope.std_error if slope is not None else nan,
        "slope_low": slope.ci95[0] if slope is not None else nan,
        "slope_high": slope.ci95[1] if slope is not None else nan,
        "slope_p": slope.p if slope is not None else nan,
        "exclusive": _exclusive(culture),
    }


def _exclusive(culture: Culture) -> bool:
    """Tell whether the three shares sum to all cells, so that at most two of them are independent."""
    if len(culture.samples.values) < 3:
        return False
    total = np.sum([*culture.samples.values.values()], axis=0)
    return bool(np.nanmax(np.abs(total - 1.0)) < 0.03) if np.isfinite(total).any() else False


def _power(culture: Culture, outcome: Outcome) -> list[dict[str, Any]]:
    found = outcome.found
    if found is None or not found.deviation > 0.0:
        return []
    each, k = culture.control == "each", outcome.times.size
    own = min(t.n for t in outcome.treated)
    needed = cultures_needed(found.deviation, outcome.margin, k, control_each=each)
    designs = sorted({*_DESIGNS, own, *([needed] if needed is not None else [])} - {0, 1})
    return [
        {
            "run": culture.run, "outcome": outcome.name, "n": n, "deviation": found.deviation,
            "power": power(found.deviation, n, outcome.margin, k, control_each=each), "own": n == own, "needed": n == needed,
        }
        for n in designs
    ]  # fmt: skip
