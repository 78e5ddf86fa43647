"""What the figures and tables of `tire.road` answer, in words computed from what they draw."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.rigs.in_words import known, sentence, span

if TYPE_CHECKING:
    import pandas as pd

# Median of chi-squared with one degree of freedom, its 95 % point, and the gate.
_MEDIAN, LIMIT, GATE = 0.455, 3.84, 10.8
_WHITE = 2.0  # largest over smallest density


def loaded(revolutions: pd.DataFrame, findings: Findings, run: str) -> str:
    """Return what speed, load and force go through, and how far the filtered ones are off their references."""
    told = [f"speed {span(3.6 * revolutions['speed_filtered'], 0, 'km/h')}"]
    told += [
        f"{words} {span(1e-3 * revolutions[name], 2, 'kN')}"
        for name, words in (("vertical_load_filtered", "load"), ("longitudinal_force_filtered", "longitudinal force"))
        if np.isfinite(revolutions[name]).any()
    ]
    off = []
    for name, words in (("load_rms_error", "load"), ("force_rms_error", "force")):
        size = known(next(iter(findings.find(name, run=run)), None), 1.0, "N")
        off += [f"the {words} by {size}"] if size else []
    beside = f" Filtered they are off their reference channels (rms): {listing(off)}." if off else ""
    return f"{sentence(listing(told))}{beside}"


def consistent(innovations: dict[str, np.ndarray], means: dict[str, float]) -> str:
    """Return whether normalised innovations squared, by track, are as large as the filter expects; `means` as it was tuned to."""
    told, few = [], []
    for words, nis in innovations.items():
        own = nis[np.isfinite(nis)]
        if not own.size:
            continue
        told.append(
            f"{words} mean {means[words]:.2f}, median {_two(float(np.median(own)))}, {100.0 * np.mean(own > LIMIT):.0f} % above {LIMIT}"
        )
        if np.median(own) < 0.5 * _MEDIAN:
            few.append(words)
    if not told:
        return "No track is told."
    said = sentence(f"{'; '.join(told)} (expected: mean 1, median 0.45, 5 %)")
    if few:
        said += f" Where the median is that low ({listing(few)}) a few sudden changes make the mean: between them the bands are too wide."
    return said


def _two(value: float) -> str:
    return f"{value:.2f}" if value >= 0.005 else "below 0.01"


def events(table: pd.DataFrame) -> str:
    """Return how many events of each kind there are, and the largest."""
    kinds = [f"{count} {kind}" for kind, count in table["kind"].value_counts().items()]
    most = table.iloc[int(np.argmax(np.abs(table["change"].to_numpy(dtype=float))))]
    return f"{listing(kinds)}, the largest {most['change']:+.0f} N at {most['time']:.1f} s."


def fits_ring(table: pd.DataFrame) -> str:
    """Return what the ring leaves of the mean waveform of one drive."""
    outside = float(np.mean(table["residual"].abs() > 2.0 * table["std_error"]))
    left = float(np.sqrt(np.mean(table["residual"] ** 2)))
    peak = float(np.ptp(table["signal"]))
    word = "Yes" if outside < 0.1 else "Nearly" if left < 0.01 * peak else "No"
    return (
        f"{word}: it leaves {1e3 * left:.2g} mV (rms) of the {1e3 * peak:.0f} mV from dip to peak; {100.0 * outside:.0f} % of the angles lie outside "
        "of the band, 5 % by noise alone."
    )


def deepened(table: pd.DataFrame, model: pd.DataFrame) -> str:
    """Return the slope of the dips' asymmetry over the force beside that of the ring."""
    x, y = table["force"].to_numpy(dtype=float), table["asymmetry"].to_numpy(dtype=float)
    if x.size < 4 or np.ptp(x) <= 0.0:
        return "One force does not tell."
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    left = y - y.mean() - slope * centred
    half = 1.96 * math.sqrt(float(left @ left) / (x.size - 2) / float(centred @ centred))
    said = (
        f"A grows by {slope:.3f} +- {half:.3f} ohm/N (95 %)"
        if slope > half
        else f"A does not grow: {slope:.3f} +- {half:.3f} ohm/N (95 %)"
    )
    if len(model) > 1:
        ring = float(np.polyfit(model["force"], model["asymmetry"], 1)[0])
        said += f", by the ring {ring:.3f} ohm/N"
    return f"{said}."


def bonded(drives: list[dict[str, Any]]) -> str:
    """Return for each drive whether flex sensor and film keep their ratio."""
    return " ".join(f"Run {row['run']}: {str(row['bonding']).rstrip('.')}." for row in drives)


def extrapolated(drives: list[dict[str, Any]]) -> str:
    """Return how far beyond the bench's highest load the drives go."""
    told = []
    for row in drives:
        if not row["bench"]:
            told.append(f"run {row['run']} has no bench")
        elif row["extrapolated"] > 0.0:
            told.append(
                f"run {row['run']} goes up to {row['highest_load'] / row['most_bench_load']:.2f} times the bench's highest load"
            )
        else:
            told.append(f"run {row['run']} stays within the bench's loads")
    return sentence(listing(told))


def largest_source(table: pd.DataFrame) -> str:
    """Return what most of the common uncertainty of the load comes from, by run."""
    told = []
    for run, part in table.groupby("run", sort=False):
        total = float(np.sqrt((part["load"] ** 2).sum()))
        worst = part[part["load"] > 0.95 * part["load"].max()]
        told.append(
            f"run {run}: most from {listing(worst['source'])} ({part['load'].max():.2g} N each of {total:.2g} N of load)".replace(
                " each", "" if len(worst) < 2 else " each"
            )
        )
    return sentence("; ".join(told))


def lost(drives: list[dict[str, Any]]) -> str:
    """Return what of each drive is lost."""
    return " ".join(
        f"Run {row['run']}: {100.0 * row['packet_loss']:.1f} % of the packets lost, {row['passages_lost']:.0f} of {row['revolutions']:.0f} passages without a number."
        for row in drives
        if math.isfinite(row["packet_loss"])
    )


def worst_stretch(gaps: pd.DataFrame) -> str:
    """Return where most samples were lost."""
    own = gaps[np.isfinite(gaps["share"])]
    if own.empty or not own["share"].max() > 0.0:
        return "Nowhere: no sample is lost."
    share, gap = own.loc[own["share"].idxmax()], own.loc[own["longest"].idxmax()]
    return f"Worst at {share['time']:.0f} s, {100.0 * share['share']:.1f} % of the samples; the longest gap is {1e3 * gap['longest']:.0f} ms at {gap['time']:.0f} s."


def white(noise: pd.DataFrame) -> str:
    """Return whether the noise has one density at all frequencies."""
    worst = max(
        (
            math.sqrt(float(part["density"].max() / part["density"].min()))
            for _, part in noise.groupby("run")
            if part["density"].min() > 0.0
        ),
        default=math.nan,
    )
    if not math.isfinite(worst):
        return "It is not told."
    return f"{'Yes' if worst < _WHITE else 'No'}: the largest density is {worst:.1f} times the smallest."
