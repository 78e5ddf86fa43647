"""From the table of samples to cells: groups told apart, percent read as percent, repeats of one culture averaged, times gathered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.cytotoxicity.declaration import OUTCOMES, CytotoxicitySettings
from pipeline.rigs.rap.cytotoxicity.equivalence import Cell
from pipeline.rigs.rap.cytotoxicity.groups import is_control, treated_word
from pipeline.rigs.rap.cytotoxicity.sample_faults import as_shares, judge_shares, missing_shares

# Samples no further apart than this share of the whole span, or this many seconds, were drawn at one time.
_TOGETHER, _TOGETHER_S = 0.01, 0.5
# A sample within this of a time of the protocol, or this share of it, was drawn then.
_DUE, _DUE_SHARE = 150.0, 0.05


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of one run as logged, shape (n,) each: time of sampling (s), whether treated, culture, outcomes as shares.

    `weight` is how many cultures a row stands for, `spread` the standard deviation between them (NaN for single cultures).
    """

    run: str
    time: np.ndarray
    treated: np.ndarray
    culture: tuple[str, ...]
    values: Mapping[str, np.ndarray]
    weight: np.ndarray
    spread: Mapping[str, np.ndarray]
    problems: tuple[QualityFinding, ...] = ()


def samples_of(recording: Recording, settings: CytotoxicitySettings) -> Samples:
    """Return the rows of a run.

    Raises
    ------
    InputError
        If it holds no outcome, several treated groups, or shares and percent mixed in one column.
    """
    present = [name for name in OUTCOMES if name in recording and np.isfinite(_numbers(recording, name)).any()]
    if not present:
        raise InputError(
            f"run '{recording.run}' holds no number of {listing(OUTCOMES)}. Name the columns in the recipe, under 'channels'."
        )
    time = recording.stream_of(present[0]).time
    n = time.size
    problems: list[QualityFinding] = []
    raw = {name: _column(recording, name, n, problems) for name in present}
    values, percent = as_shares(recording.run, raw, problems)
    spread = {
        name: _column(recording, f"{name}_sd", n, problems) * (0.01 if name in percent else 1.0) for name in present
    }
    weight = _weight(recording, n, spread, problems)
    judge_shares(recording.run, time, values, problems)
    missing_shares(recording.run, time, values, problems)
    words = _words(recording, "group", n) or [_whole_run(recording)] * n
    treated, control = treated_word(words, settings.control_group, settings.treated_group, recording.run)
    kept = np.array([word == treated or word in control for word in words])
    others = sorted({word for word, keep in zip(words, kept, strict=True) if not keep and word})
    if others:
        message = f"rows of the group {listing(others)} are neither control nor treated; they are left out."
        problems.append(QualityFinding("note", message, recording.run, "group"))
    cultures = _words(recording, "replicate", n) or [""] * n
    return Samples(
        recording.run,
        time[kept],
        np.array([word == treated for word in words])[kept],
        tuple(culture for culture, keep in zip(cultures, kept, strict=True) if keep),
        {name: column[kept] for name, column in values.items()},
        weight[kept],
        {name: column[kept] for name, column in spread.items()},
        tuple(problems),
    )


def with_control_of(samples: Samples, control: Samples) -> Samples:
    """Return a run without control with the control rows of another run."""
    rows = ~control.treated
    names = [name for name in samples.values if name in control.values]
    return replace(
        samples,
        time=np.concatenate([samples.time, control.time[rows]]),
        treated=np.concatenate([samples.treated, np.zeros(int(rows.sum()), bool)]),
        culture=(*samples.culture, *(c for c, row in zip(control.culture, rows, strict=True) if row)),
        values={name: np.concatenate([samples.values[name], control.values[name][rows]]) for name in names},
        weight=np.concatenate([samples.weight, control.weight[rows]]),
        spread={name: np.concatenate([samples.spread[name], control.spread[name][rows]]) for name in names},
    )


def times_of(samples: Samples, settings: CytotoxicitySettings) -> np.ndarray:
    """Return for each row the time to which it belongs (s): that of the protocol where it is near one, else the first of those drawn together."""
    order = np.argsort(samples.time, kind="stable")
    stamps = samples.time[order]
    gap = max(_TOGETHER_S, _TOGETHER * float(np.ptp(stamps))) if stamps.size else 0.0
    group = np.concatenate([[0], np.cumsum(np.diff(stamps) > gap)]) if stamps.size else np.zeros(0, int)
    out = np.empty(stamps.size)
    for g in np.unique(group):
        inside = group == g
        centre = round(float(np.median(stamps[inside])), 3)
        near = [due for due in settings.times if abs(centre - due) <= max(_DUE if due else gap, _DUE_SHARE * due)]
        out[order[inside]] = min(near, key=lambda due: abs(due - centre)) if near else centre
    return out


def cells_of(samples: Samples, times: np.ndarray, outcome: str) -> dict[tuple[float, bool], Cell]:
    """Return the cells of one outcome by (time, treated); cultures measured several times enter with their mean."""
    cells: dict[tuple[float, bool], Cell] = {}
    column, spread = samples.values[outcome], samples.spread[outcome]
    for time in np.unique(times):
        for treated in (False, True):
            rows = np.flatnonzero((times == time) & (samples.treated == treated) & np.isfinite(column))
            if rows.size == 0:
                continue
            single = [int(i) for i in rows if samples.weight[i] < 2.0]
            parts = [_summary(samples.weight[i], column[i], spread[i]) for i in rows if samples.weight[i] >= 2.0]
            if single:
                parts.append(Cell.of(_by_culture(samples, single, column)))
            cell = parts[0]
            for part in parts[1:]:
                cell = cell.joined(part)
            cells[float(time), treated] = cell
    return cells


def repeated_cultures(samples: Samples, times: np.ndarray) -> int:
    """Return how many rows are repeats of a culture that the same time and group has already."""
    named = [(t, g, c) for t, g, c in zip(times, samples.treated, samples.culture, strict=True) if c]
    return len(named) - len(set(named))


def _by_culture(samples: Samples, rows: Sequence[int], column: np.ndarray) -> list[float]:
    gathered: dict[str, list[float]] = {}
    for place, i in enumerate(rows):
        gathered.setdefault(samples.culture[i] or f"row {place}", []).append(float(column[i]))
    return [float(np.mean(found)) for found in gathered.values()]


def _summary(weight: float, mean: float, spread: float) -> Cell:
    n = round(float(weight))
    known = bool(np.isfinite(spread))
    return Cell(n, float(mean), (n - 1) * float(spread) ** 2 if known else 0.0, n - 1 if known else 0)


def _weight(
    recording: Recording, n: int, spread: Mapping[str, np.ndarray], problems: list[QualityFinding]
) -> np.ndarray:
    """Return how many cultures each row stands for; a number without standard deviations may as well number the samples."""
    weight = _column(recording, "n", n, problems)
    stands = np.any([np.isfinite(column) for column in spread.values()], axis=0)
    if np.any(~stands & (weight > 1.0)):
        message = (
            "the column 'n' stands beside no standard deviation: its rows are taken for single cultures. If they are means, log "
            "viability_sd and the like with them."
        )
        problems.append(QualityFinding("note", message, recording.run, "n"))
    return np.where(stands & np.isfinite(weight) & (weight >= 1.0), weight, 1.0)


def _numbers(recording: Recording, name: str) -> np.ndarray:
    values = recording.values(name)
    return np.asarray(values, float) if values.dtype.kind in "fiub" else np.full(values.shape, np.nan)


def _column(recording: Recording, name: str, n: int, problems: list[QualityFinding]) -> np.ndarray:
    if name not in recording:
        return np.full(n, np.nan)
    values = _numbers(recording, name)
    if values.size != n:
        message = (
            f"{name} stands in another table than the other outcomes; it is left out. Put all of them in one table."
        )
        problems.append(QualityFinding("warning", message, recording.run, name))
        return np.full(n, np.nan)
    return values


def _words(recording: Recording, name: str, n: int) -> list[str]:
    """Return a text column as words, '' where blank; empty where the run lacks it or it stands in another table."""
    if name not in recording:
        return []
    words = [_word(value) for value in recording.values(name)]
    return words if len(words) == n and any(words) else []


def _word(value: object) -> str:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    text = f"{value:g}" if isinstance(value, int | float | np.number) else str(value).strip()
    return "" if text.lower() == "nan" else text


def _whole_run(recording: Recording) -> str:
    """Return the group of a log that has no column of it: its condition, else what its name says."""
    said = str(recording.conditions.get("group", ""))
    if said:
        return said
    return "control" if is_control(recording.run) else "treated"
