"""What the figures and tables of `gearbox.load_exchange` answer, in words computed from what they draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import counted, listing
from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Cell, Value
from pipeline.rigs.gearbox.declaration import CHANNELS
from pipeline.rigs.gearbox.outcome.paper import RPM
from pipeline.rigs.in_words import known, sentence, span

if TYPE_CHECKING:
    import pandas as pd

# Speeds that close are one; the order of the runs is that of the speeds above this rank correlation.
_ONE_SPEED, _BY_SPEED = 0.01, 0.8


def channel(name: str) -> str:
    """Return where a channel of the vibration sits."""
    words = next((spec.description for spec in CHANNELS if spec.name == name), name)
    return words.removeprefix("acceleration of the ")


def complete(runs: pd.DataFrame, names: Sequence[str]) -> str:
    """Return which of these runs lack a stage."""
    own = runs[runs["run"].isin(names)]
    lacking = [str(run) for run in own[~own["complete"].astype(bool)]["run"]]
    if not lacking:
        return "Yes." if len(own) == 1 else f"Yes, all {len(own)}."
    return "No, stages are missing." if len(own) == 1 else f"No, stages are missing in {listing(lacking)}."


def seen(events: pd.DataFrame, runs: int, names: Sequence[str]) -> str:
    """Return how many of the events were found."""
    found = int(events["event"].isin(names).sum())
    whole = runs * len(names)
    return (
        f"All {len(names)} events are found in all {counted(runs, 'run')}."
        if found == whole
        else f"{found} of {whole} events are found."
    )


def broke(findings: Findings) -> str:
    """Return at which input torques the lock broke."""
    peaks = [p.value for p in findings.find("torque_in_peak", stage="brake") if p.value is not None]
    return (
        f"The lock broke at {span(peaks, 2, 'N m')} of input torque." if peaks else "Where the lock broke is not told."
    )


def clocks(table: pd.DataFrame) -> str:
    """Return how many boards were shifted."""
    applied = int(table["applied"].astype(bool).sum())
    if not applied:
        return f"None of {len(table)} shifts is significant, so that none is applied."
    return f"{applied} of {len(table)} shifts {'is' if applied == 1 else 'are'} significant and applied."


def beside_paper(values: Sequence[tuple[Cell, Cell]]) -> str:
    """Return how far values and what the paper printed are apart at most."""
    off = [
        abs(found.value / printed - 1.0)
        for found, printed in values
        if isinstance(found, Value) and found.value is not None and isinstance(printed, float)
    ]
    return (
        f"From the paper's they differ by {100.0 * max(off):.1f} % at most."
        if off
        else "No run has a speed of the paper's."
    )


def type_b(values: Sequence[float | None]) -> str:
    """Return what the torque sensor leaves uncertain beside the intervals."""
    stated = sorted({1e3 * value for value in values if value is not None and math.isfinite(value)})
    if not stated:
        return "What the sensor itself leaves uncertain is not known, its range is not stated."
    return (
        f"On top comes the sensor's own standard uncertainty (type B) of {span(stated, 1, 'mN m')}, common to all runs."
    )


def transferred(slope: Parameter | None) -> str:
    """Return which part of a further newton metre comes out."""
    if slope is None or slope.value is None or slope.ci95 is None:
        return f"It is not told: {slope.description if slope else 'no brake rise'}"
    said = f"Of each further newton metre that goes in, {known(slope, 1.0, 'N m')} come out"
    return (
        f"{said}: all of it, within the error." if slope.ci95[0] <= 1.0 <= slope.ci95[1] else f"{said}, not all of it."
    )


def slopes(table: pd.DataFrame, words: dict[str, str]) -> str:
    """Return the slopes of each phase over the runs."""
    told = [
        f"{words.get(str(phase), str(phase))} {span(part['slope'], 2)}"
        for phase, part in table.groupby("phase", sort=False)
    ]
    low = max(float(part["slope"].min()) for _, part in table.groupby("phase"))
    high = min(float(part["slope"].max()) for _, part in table.groupby("phase"))
    alike = (
        ""
        if len(told) < 2
        else " The phases agree."
        if low <= high and table["slope"].std() < 0.1
        else " The phases or the runs do not agree."
    )
    return f"{sentence(listing(told))}{alike}"


def powers(findings: Findings) -> str:
    """Return efficiency and heat over the runs."""
    told = []
    for name, words, size, digits, unit in (
        ("efficiency_fos", "efficiency", 0.01, 1, "%"), ("power_dissipated_sos", "heat", 1.0, 1, "W"),
    ):  # fmt: skip
        found = [p.value / size for p in findings.find(name) if p.value is not None]
        told.append(f"{words} {span(found, digits, unit)}" if found else f"{words} not determined")
    return sentence(listing(told))


def burnt(table: pd.DataFrame) -> str:
    """Return which part of what is lost is lost in SOS."""
    lost = table["work_in"] - table["work_out"]
    sos = float(lost[table["stage"] == "sos"].sum())
    whole = float(lost.sum())
    return (
        f"Of {whole:.0f} J that are lost in these runs {sos:.0f} J ({100.0 * sos / whole:.0f} %) become heat in SOS."
        if whole > 0.0
        else ""
    )


def explained(table: pd.DataFrame) -> str:
    """Return what inertia and drag leave of the output torque."""
    left, swing = (
        float(np.sqrt(np.nanmean((table["measured"] - table["predicted"]) ** 2))),
        float(np.nanstd(table["measured"])),
    )
    if not swing > 0.0:
        return "The torque does not change."
    word = "Yes" if left < 0.1 * swing else "Roughly" if left < 0.3 * swing else "No"
    return f"{word}: they leave {1e3 * left:.2g} mN m (rms), {100.0 * left / swing:.2g} % of the torque's change."


def repeats(findings: Findings, names: Sequence[tuple[str, str]]) -> str:
    """Return whether runs of one speed agree within their intervals, and whether drift can be told from speed."""
    runs = findings.arrays["runs"]
    speeds = runs["speed"].to_numpy(dtype=float)
    apart, pairs = [], []
    for k, i in combinations(range(len(runs)), 2):
        if not abs(speeds[i] / speeds[k] - 1.0) < _ONE_SPEED:
            continue
        first, second = str(runs["run"].iloc[k]), str(runs["run"].iloc[i])
        pairs.append(f"{first} and {second}")
        for name, words in names:
            a, b = (next(iter(findings.find(name, run=run)), None) for run in (first, second))
            if (
                a
                and b
                and a.value is not None
                and b.value is not None
                and abs(a.value - b.value) > 1.96 * math.hypot(a.std_error or 0.0, b.std_error or 0.0)
            ):
                apart.append(f"{words} of {first} and {second}")
    said = (
        "No two runs have one speed"
        if not pairs
        else f"Apart are the {listing(apart)}"
        if apart
        else f"Runs of one speed ({listing(pairs)}) agree"
    )
    known_speeds = speeds[np.isfinite(speeds)]
    if (
        known_speeds.size > 2
        and abs(np.corrcoef(np.argsort(np.argsort(known_speeds)), np.arange(known_speeds.size))[0, 1]) > _BY_SPEED
    ):
        said += "; the speed goes along with the order of the runs, so that a drift cannot be told from it"
    return f"{said}."


def over_speed(curves: pd.DataFrame, words: dict[str, str]) -> str:
    """Return what each curve does from its least speed to its highest."""
    told = []
    for kind, name in words.items():
        own = curves[curves["kind"] == kind].sort_values("x")
        if len(own) > 1:
            first, last = float(own["y"].iloc[0]), float(own["y"].iloc[-1])
            told.append(
                f"{name} {'rises' if last > first else 'falls'} from {first:.2f} to {last:.2f} N m ({own['x'].iloc[0] / RPM:.0f} to {own['x'].iloc[-1] / RPM:.0f} rpm)"
            )
    return sentence("; ".join(told)) if told else "Too few speeds for a curve."


def slips(stages: pd.DataFrame, ridge: pd.DataFrame) -> str:
    """Return how long mesh lines stand in FOS and in SOS of these runs, as shares of the stages."""
    shares = {}
    for name, kinds in (("SOS", ("sos",)), ("FOS", ("fos", "fos_after"))):
        hit = whole = 0.0
        for row in stages[stages["stage"].isin(kinds)].to_dict("records"):
            time = ridge.loc[(ridge["run"] == row["run"]) & (ridge["slip"] > 0.0), "time"].to_numpy(dtype=float)
            step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
            hit += step * np.count_nonzero((time >= row["start"]) & (time <= row["end"]))
            whole += float(row["end"] - row["start"])
        shares[name] = min(hit / whole, 1.0) if whole else math.nan
    known_shares = [f"{100.0 * share:.0f} % of {name}" for name, share in shares.items() if math.isfinite(share)]
    return f"Mesh lines stand in {listing(known_shares)}." if known_shares else "Neither FOS nor SOS is there."


def strongest(orders: pd.DataFrame) -> str:
    """Return the strongest order of each stage of these runs."""
    told = []
    for stage in dict.fromkeys(orders["stage"]):
        own = orders[orders["stage"] == stage]
        tops = [
            part["order"].iloc[int(np.argmax(part["amplitude"].to_numpy(dtype=float)))]
            for _, part in own.groupby("run")
        ]
        told.append(f"in {str(stage).upper()} order {span([float(top) for top in tops], 0)}")
    return sentence(f"strongest are {listing(told)}")


def shaken(vibration: pd.DataFrame) -> str:
    """Return how much stronger the vibration is in SOS than in FOS."""
    table = vibration.pivot_table(index=["run", "channel"], columns="stage", values="rms", aggfunc="first")
    if not {"sos", "fos"} <= set(table.columns):
        return "FOS and SOS are not both there."
    return f"In SOS it is {span(table['sos'] / table['fos'], 1)} times as strong as in FOS."
