"""From the outcomes of many campaigns to one line a parameter."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.coverage.study import Outcome, Row

LOW, HIGH = 0.93, 0.97
"""What the share of intervals that hold the truth should be."""


@dataclass(frozen=True)
class Line:
    """How one parameter fares.

    Attributes
    ----------
    told, untold
        How often it was determined, and how often not.
    share, share95
        Intervals that held the truth, and what that share may be given so many campaigns (95 %).
    bias, spread
        Mean and standard deviation of error over standard error. A spread above 1 is a standard error too small.
    rms
        Root mean square error over the truth's magnitude; NaN where the truth is 0.
    efficiency
        Cramér-Rao bound over actual variance; None where there is no bound.
    over_seeds
        Its truth is the mean over the campaigns.
    """

    name: str
    told: int
    untold: int
    share: float
    share95: tuple[float, float]
    bias: float
    spread: float
    rms: float
    efficiency: float | None
    over_seeds: bool

    @property
    def judged(self) -> str:
        """'' within the goal as far as so many campaigns can tell; else what is wrong."""
        if self.told == 0 or math.isnan(self.share):
            return ""
        if self.share95[1] < LOW:
            return "too narrow"
        if self.share95[0] > HIGH:
            return "too wide"
        return ""


def lines(outcomes: Sequence[Outcome]) -> list[Line]:
    """Return one line a label, in the order in which they come."""
    rows: dict[str, list[tuple[int, Row]]] = defaultdict(list)
    for one in outcomes:
        for row in one.rows:
            rows[row.label].append((one.seed, row))
    return [_line(label, found) for label, found in rows.items()]


def _line(label: str, found: Sequence[tuple[int, Row]]) -> Line:
    told = [(seed, row, row.value, row.ci95) for seed, row in found if row.value is not None and row.ci95 is not None]
    over_seeds = any(row.truth is None for _, row in found)
    means = _means((row.place, value) for _, row, value, _ in told) if over_seeds else {}
    held: dict[int, list[bool]] = defaultdict(list)
    z, error, relative, over_bound = [], [], [], []
    for seed, row, value, ci95 in told:
        truth = means[row.place] if row.truth is None else row.truth
        held[seed].append(ci95[0] <= truth <= ci95[1])
        off = value - truth
        error.append(off)
        relative.append(off / abs(truth) if truth else math.nan)
        if row.std_error:
            z.append(off / row.std_error)
        if row.bound:
            over_bound.append(off / row.bound)
    share = float(np.mean([h for one in held.values() for h in one])) if held else math.nan
    return Line(
        name=label,
        told=len(told),
        untold=len(found) - len(told),
        share=share,
        share95=_share95(share, [float(np.mean(one)) for one in held.values()]),
        bias=float(np.mean(z)) if z else math.nan,
        spread=float(np.std(z)) if z else math.nan,
        rms=float(np.sqrt(np.nanmean(np.square(relative)))) if np.isfinite(relative).any() else math.nan,
        efficiency=1.0 / float(np.mean(np.square(over_bound))) if over_bound else None,
        over_seeds=over_seeds,
    )


def _means(told: Iterable[tuple[str, float]]) -> dict[str, float]:
    values: dict[str, list[float]] = defaultdict(list)
    for place, value in told:
        values[place].append(value)
    return {place: float(np.mean(v)) for place, v in values.items()}


def _share95(share: float, shares: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval (Wilson) of a share, with as many trials as the scatter between campaigns leaves."""
    if not shares:
        return (math.nan, math.nan)
    campaigns = len(shares)
    scatter = float(np.var(shares, ddof=1)) if campaigns > 1 else 0.0
    trials = campaigns * share * (1 - share) / scatter if scatter > 0 and 0 < share < 1 else float(campaigns)
    trials = max(trials, float(campaigns)) if 0 < share < 1 else float(campaigns)
    z2 = 1.96**2
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (share * (1 - share) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    return (centre - half, centre + half)


def text(found: Sequence[Line]) -> str:
    """Return the lines as a table for the terminal."""
    width = max([len(line.name) for line in found], default=10) + 2
    head = f"{'':{width}}{'told':>6} {'untold':>6} {'covered':>8} {'of 95 %':>13} {'bias/se':>8} {'spread':>7} {'rms':>8} {'eff.':>6}"
    return "\n".join([head, *(_text(line, width) for line in found)])


def _text(line: Line, width: int) -> str:
    name = f"{line.name} *" if line.over_seeds else line.name
    share = (
        f"{100 * line.share:6.1f} %  {100 * line.share95[0]:5.1f}-{100 * line.share95[1]:5.1f} "
        if line.told
        else " " * 22
    )
    efficiency = "" if line.efficiency is None else f"{line.efficiency:6.2f}"
    return (
        f"{name:{width}}{line.told:6d} {line.untold:6d} {share} {line.bias:8.2f} {line.spread:7.2f} {100 * line.rms:6.2g} % "
        f"{efficiency:>6} {line.judged}"
    )


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return what is kept of a study: the lines, verdicts, refusals."""
    return {
        "campaigns": len(outcomes),
        "first": min(one.seed for one in outcomes),
        "verdicts": dict(Counter(one.verdict for one in outcomes)),
        "refused": sorted({one.refused for one in outcomes if one.refused})[:3],
        "parameters": [_kept(line) for line in lines(outcomes)],
    }


def _kept(line: Line) -> dict[str, Any]:
    def short(value: float | None) -> float | None:
        return None if value is None or not math.isfinite(value) else float(f"{value:.4g}")

    return {
        "name": line.name, "told": line.told, "untold": line.untold, "share": short(line.share),
        "share95": [short(v) for v in line.share95], "bias": short(line.bias), "spread": short(line.spread),
        "rms": short(line.rms), "efficiency": short(line.efficiency), "over_seeds": line.over_seeds, "judged": line.judged,
    }  # fmt: skip
