"""What captions of the report of `mre.shear_rich` answer, read from the tables of the findings; '' where nothing is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import counted, listing
from pipeline.rigs.in_words import known_as, span

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.findings import Parameter

_BEYOND_YIELD = 1.5  # amplitudes times rho that the design rules ask for
_NEAR = 0.05  # of the value of the batch fit
_WATCHED = ("k1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw")
_WHITE = 1.1  # power density where the motion is, over that elsewhere
_TOLD = 3


def reaches(records: pd.DataFrame, side_by_side: pd.DataFrame) -> str:
    """Say whether strokes lie on both sides of where the force yields and of where the Maxwell branch relaxes."""
    found = {(row["run"], row["name"]): row["batch"] for row in side_by_side.to_dict("records")}
    lacking, yields, corners, unknown = [], [], [], []
    for row in records.to_dict("records"):
        rho, tau = (found.get((row["run"], name)) for name in ("rho", "tau"))
        small, large, slow, fast = (
            row.get(name, math.nan) for name in ("amplitude_low", "amplitude_high", "frequency_low", "frequency_high")
        )
        if not (rho and tau and math.isfinite(rho * tau * small * slow)):
            unknown.append(str(row["run"]))
            continue
        corner = 1 / (2 * math.pi * tau)
        yields.append(1e3 / rho)
        corners.append(corner)
        missing = {
            "amplitudes below 1/rho": small * rho < 1,
            "amplitudes above 1.5/rho": large * rho > _BEYOND_YIELD,
            "frequencies below 1/(2π tau)": slow < corner,
            "frequencies above 1/(2π tau)": fast > corner,
        }
        lacks = [what for what, there in missing.items() if not there]
        lacking += [f"{row['run']} lacks {' and '.join(lacks)}"] if lacks else []
    told = [f"Not everywhere: {'; '.join(lacking[:_TOLD])}."] if lacking else []
    if yields and not lacking:
        told = [
            f"Yes: amplitudes lie on both sides of 1/rho = {span(yields, 2, 'mm')}, frequencies on both sides of "
            f"1/(2π tau) = {span(corners, 2, 'Hz')}."
        ]
    told += [f"Not told of {listing(unknown, _TOLD)}, where rho or tau is not determined."] if unknown else []
    return " ".join(told)


def followed(records: pd.DataFrame, loops: pd.DataFrame) -> str:
    """Say of which record the model misses most, and whether more at the ends of the strokes than in the middle."""
    worst = records.iloc[int(records["nrmse"].argmax())]
    told = f"It misses at most {100 * worst['nrmse']:.2g} % of the force's rms ({worst['run']})"
    times = []
    for _, part in loops.groupby("run"):
        left, reach = part["force"] - part["model"], part["displacement"].abs()
        ends, middle = left[reach > 0.8 * reach.max()], left[reach < 0.2 * reach.max()]
        if len(ends) and len(middle):
            times.append(math.sqrt((ends**2).mean() / max((middle**2).mean(), 1e-300)))
    return (
        f"{told}; at the ends of the strokes {span(times, 1)} times what it misses in the middle."
        if times
        else f"{told}."
    )


def missed(series: pd.DataFrame) -> str:
    """Say how much of the force is missed at most in the stretch that is drawn."""
    left = (series["force"] - series["model"]).abs().groupby(series["run"]).max()
    share = left / series["force"].abs().groupby(series["run"]).max()
    worst = str(share.idxmax())
    return f"It is at most {left.loc[worst]:.2g} N off, {100 * share.loc[worst]:.2g} % of the largest force ({worst})."


def trusted(records: pd.DataFrame) -> str:
    """Say in how many records the filter has converged, and how large its innovations are there."""
    sound = records[records["online"] == "converged"]
    if sound.empty:
        return "In no record: its numbers are not to be used."
    times = span(sound["innovation"] / sound["noise"], 1)
    left = [str(run) for run in records["run"] if run not in set(sound["run"])]
    rest = f" Not in {listing(left, _TOLD)}: its numbers there are not to be used." if left else ""
    return f"It has converged in {len(sound)} of {counted(len(records), 'record')}, with innovations {times} times the noise.{rest}"


def found_online(online: pd.DataFrame, ends: pd.DataFrame) -> str:
    """Say from when on the filter stays near the batch fit of one record; `ends` holds both methods at the end."""
    batch = ends.set_index("name")["batch"]
    last = {}
    for name in _WATCHED:
        if name in online and name in batch.index and batch[name] and math.isfinite(batch[name]):
            off = (online[name] / batch[name] - 1).abs() > _NEAR
            last[name] = float(online["time"][off].max()) if off.any() else 0.0
    if not last:
        return ""
    slowest = max(last, key=lambda name: last[name])
    if last[slowest] >= float(online["time"].max()):
        return f"It does not: {slowest} is more than {100 * _NEAR:.0f} % off it at the end."
    return f"From {last[slowest]:.2g} s on it stays within {100 * _NEAR:.0f} % of it; {slowest} is found last."


def agree(ends: pd.DataFrame) -> str:
    """Say which numbers of the batch fit of one record lie outside the 95 % that the filter claims."""
    if "online" not in ends:
        return ""
    both = ends[ends["batch"].notna() & ends["online"].notna()]
    if both.empty:
        return ""
    out = both[(both["batch"] < both["online_low"]) | (both["batch"] > both["online_high"])]
    if out.empty:
        return f"Yes: all {len(both)} lie within the 95 % that the filter claims."
    names = listing((f"{row['name']} ({100 * row['difference']:+.1f} %)" for row in out.to_dict("records")), _TOLD)
    return f"{len(both) - len(out)} of {len(both)} within the 95 % that the filter claims; not {names}."


def added(k2: Sequence[Parameter], s_mr: Parameter | None, verdict: str) -> str:
    """Say what the field adds from the least to the largest current, with k2 in the order of the current."""
    base, top = k2[0], k2[-1]
    least, most = (float(p.at["coil_current"]) for p in (base, top))
    if verdict == "rejected":
        return "Not told: the model does not hold."
    if not most > least:
        return "Not told: the records are all at one current."
    gain = (top.value or 0.0) - (base.value or 0.0)
    half = 1.96 * math.hypot(top.std_error or 0.0, base.std_error or 0.0)
    said = (
        f"From {least:g} to {most:g} A {known_as(gain, (gain - half, gain + half) if half > 0 else None, 1e3, 'kN/m')}"
    )
    if s_mr is not None and s_mr.value is not None:
        said += f", and s_MR = {known_as(s_mr.value, s_mr.ci95, 1.0, 'N s/m')}"
    return f"{said}."


def left_where_moved(spectra: pd.DataFrame, records: pd.DataFrame) -> str:
    """Say how much more the batch fit leaves where the motion is than elsewhere."""
    ratios = []
    for row in records.to_dict("records"):
        part = spectra[(spectra["run"] == row["run"]) & (spectra["method"] == "batch")]
        low, high = (row.get(name, math.nan) for name in ("frequency_low", "frequency_high"))
        moved = (part["frequency"] >= low) & (part["frequency"] <= high)
        if moved.any() and not moved.all():
            ratios.append(float(part["density"][moved].mean() / part["density"][~moved].median()))
    if not ratios:
        return ""
    times = f"where the motion is, the batch fit leaves {span(ratios, 1)} times the power density of the rest"
    return f"{'Yes' if np.max(ratios) < _WHITE else 'Not only white noise'}: {times}."
