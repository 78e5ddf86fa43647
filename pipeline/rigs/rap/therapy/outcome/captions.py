"""What the figures and tables of `rap.therapy` answer, in words computed from the tables that they draw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings, Parameter
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.therapy.outcome.frames import of_run, records, runs_of
from pipeline.rigs.rap.wording import joined, plus_minus, told

if TYPE_CHECKING:
    import pandas as pd

_HOUR = 3600.0
# Mean of the normalised innovations squared that is right (rap.md, 5.6).
_NIS = (0.9, 1.1)
_VERDICTS = {"match": "logged in time", "late": "logged late", "missed": "not logged", "extra": "logged without a cause", "not logged": "due in a log without codes"}  # fmt: skip


def clocks(table: pd.DataFrame) -> str:
    """Return the rate of each run's clock with its 95 % interval, and the runs in which it is not sure."""
    rates = [
        f"{plus_minus(1e6 * row['rate'], 1.96e6 * row['rate_sd'], 'ppm', sign=True)} in run {row['run']}{'' if row['sure'] else ' (not sure)'}"
        for row in records(table)
        if np.isfinite(row["rate"]) and np.isfinite(row["rate_sd"])
    ]
    return f"The device's clock is off by {joined(rates)}." if rates else "The logs do not tell."


def judged(findings: Findings, run: str, *criteria: str) -> str:
    """Return what was found by the criteria whose names begin so, as the table of verdicts has it."""
    rows = [
        row for row in records(of_run(findings.arrays["checks"], run)) if str(row["criterion"]).startswith(criteria)
    ]
    return "; ".join(f"{row['found']}, {row['word']} (asked: {row['allowed']})" for row in rows)


def volume(findings: Findings, run: str) -> str:
    """Return the rms error after the first echo and the final one, held against what is asked."""
    rms, end = _one(findings, "uf_volume_error_rms", run), judged(findings, run, "final error")
    parts = [
        f"After the first echo it is off by {1e6 * rms.value:.2f} mL (rms)."
        if rms is not None and rms.value is not None
        else "",
        f"At the end by {end}." if end else "",
    ]
    return " ".join(part for part in parts if part) or "No scale tells."


def innovations(account: pd.DataFrame, run: str) -> str:
    """Return whether the innovations are as large as expected, by their normalised mean square."""
    nis = next((float(row["nis"]) for row in records(of_run(account, run))), np.nan)
    if not np.isfinite(nis):
        return "Too few levels tell."
    word = "as large as it expects" if _NIS[0] <= nis <= _NIS[1] else "larger than it expects" if nis > 1 else "smaller than it expects"  # fmt: skip
    return f"They are {word}: their squares over the expected ones are {nis:.2f} on the mean ({_NIS[0]:g} to {_NIS[1]:g} is right)."


def membrane(findings: Findings, run: str) -> str:
    """Return whether the coefficient declines, or why it cannot be told."""
    a = _one(findings, "k_uf_decline", run)
    if a is None or a.value is None or a.ci95 is None:
        return "This run cannot tell a decline."
    low, high = a.ci95
    if low > 0.0:
        lost = [100 * end / (1 + end) for end in (low, high)]
        return f"Its coefficient falls by {lost[0]:.1f} to {lost[1]:.1f} % in 5 h (a = {a.value:.3f}, {low:.3f} to {high:.3f})."
    return f"{'It grows' if high < 0.0 else 'No decline is seen'}: a = {a.value:.3f} ({low:.3f} to {high:.3f})."


def battery(runtime: Parameter | None, needed: float) -> str:
    """Return whether the whole interval of the runtime lies beyond what is needed."""
    if runtime is None or runtime.value is None or runtime.ci95 is None:
        return "That cannot be told: energy or power is missing."
    low, high = (limit / _HOUR for limit in runtime.ci95)
    word = "Yes" if low > needed / _HOUR else "No" if high < needed / _HOUR else "Not surely"
    return f"{word}: {runtime.value / _HOUR:.2f} h ({low:.2f} to {high:.2f} h)."


def alarms(table: pd.DataFrame) -> str:
    """Return how many alarms were due or logged, and how many of each verdict."""
    if table.empty:
        return "No alarm was due and none logged."
    counts = table["verdict"].value_counts(sort=False)
    return f"Of {len(table)} alarms {joined([f'{n} {_plural(n)} {_VERDICTS[str(verdict)]}' for verdict, n in counts.items()])}."


def ratios(own: pd.DataFrame, names: Mapping[str, str], low: float, high: float) -> str:
    """Return which parts reach beyond the limits."""
    above = [word for name, word in names.items() if (own[f"{name}_high"] > high).any()]
    below = [word for name, word in names.items() if (own[f"{name}_low"] < low).any()]
    parts = [f"above {high:g} go {joined(above)}" if above else "", f"below {low:g} {joined(below)}" if below else ""]
    said = "; ".join(part for part in parts if part)
    return f"{said[0].upper()}{said[1:]}." if said else "None: all stay between the limits."


def units(mismatches: pd.DataFrame, run: str) -> str:
    """Return the mismatches of a run, or that there is none."""
    found = [
        f"a {row['kind']} of {row['size']:.3g} {'Pa/s' if row['kind'] == 'drift' else 'Pa'} at {TAP_NAMES.get(str(row['channel']), str(row['channel']))}, "
        f"found {row['time']:.0f} s into the log"
        for row in records(of_run(mismatches, run))
    ]
    return f"No: {'; '.join(found)}." if found else "Yes: no mismatch at any tap."


def warming(findings: Findings, runs: list[str]) -> str:
    """Return time constant and end of the bench's sensor, or else the device's, by run."""
    parts = []
    for run in runs:
        for source, word in (("bench", "bench"), ("rap", "device")):
            tau, end = (
                next(iter(findings.find(name, run=run, source=source)), None)
                for name in ("time_constant", "temperature_final")
            )
            if tau is not None and end is not None and tau.value is not None and end.value is not None:
                parts.append(f"to {end.value - 273.15:.1f} °C with {told(tau, 60.0, 'min')} ({run}, {word})")
                break
    return f"It warms {joined(parts)}." if parts else "No run is long enough to tell."


def temperature_errors(findings: Findings, runs: list[str]) -> str:
    """Return the largest error of each run as the table of verdicts has it."""
    parts = [f"{one} in run {run}" for run in runs if (one := judged(findings, run, "largest temperature"))]
    return f"At most by {'; '.join(parts)}." if parts else ""


def met(checks: pd.DataFrame) -> str:
    """Return how many criteria are met and which runs miss some."""
    good = checks["mood"] == "ok"
    missed = joined(runs_of(checks[~good]))
    return f"{int(good.sum())} of {len(checks)} are met{f'; not all in {missed}' if missed else ''}."


def skews(table: pd.DataFrame) -> str:
    """Return the span of the skews and the false alarms with and without them."""
    known = table[np.isfinite(table["skew"])]
    if known.empty:
        return "No skew could be told."
    raw, kept = int(table["raw"].sum()), int(table["kept"].sum())
    return (
        f"The protective unit samples {1e3 * known['skew'].min():.1f} to {1e3 * known['skew'].max():.1f} ms later; the raw difference passed the threshold {raw} "
        f"{_times(raw)} without a mismatch, and {kept} {_times(kept)} with the skew taken out."
    )


def _one(findings: Findings, name: str, run: str) -> Parameter | None:
    return next(iter(findings.find(name, run=run)), None)


def _plural(n: int) -> str:
    return "was" if n == 1 else "were"


def _times(n: int) -> str:
    return "time" if n == 1 else "times"
