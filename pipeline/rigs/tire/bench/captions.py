"""What the figures and tables of `tire.bench` answer, in words computed from what they draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import listing
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Findings, Parameter
from pipeline.rigs.in_words import chance, known, sentence, span, times_noise
from pipeline.rigs.tire.bench.paper import G0, SENSITIVITY

if TYPE_CHECKING:
    import pandas as pd

LENGTHS = {
    "contact_length": "contact length", "deformation_length": "deformation length", "slope_length": "slope length",
    "zero_length": "zero length",
}  # fmt: skip
# Chi-squared reduced up to which a residual is called noise; chance below which a line is said to miss the origin.
_NOISE, _SIGNIFICANT = 1.25, 0.01
_WITHIN = 0.10  # of the measured amplitude of an order


def explained(findings: Findings) -> str:
    """Return whether the ring explains the waveforms."""
    model = next((m for m in findings.models if m.selected and m.chi2_reduced is not None), None)
    if model is None or model.chi2_reduced is None:
        return "No ring was fitted, see the reasons."
    if not findings.arrays["fit"]["model_fits"].iloc[0]:
        return f"No: it misses them by {times_noise(model.chi2_reduced)} (rms)."
    said = "Yes" if model.chi2_reduced < _NOISE else "Nearly"
    return f"{said}: what it leaves is {times_noise(model.chi2_reduced)} (rms)."


def curved(k: np.ndarray, radius: float) -> str:
    """Return how far the averaged waveform that is drawn reaches towards a flat spot."""
    peak = float(np.nanmax(k)) if np.isfinite(k).any() else math.nan
    if not (math.isfinite(peak) and math.isfinite(radius)):
        return "A voltage; without a ring fit it is not told as curvature."
    return f"The change of curvature, k: here up to {peak:.2f} 1/m, {100.0 * peak * radius:.0f} % of the {1.0 / radius:.2f} 1/m of a flat spot."


def _along_load(findings: Findings, name: str) -> tuple[float, list[tuple[float, float]]]:
    """Return the speed with most loads, and loads and lengths at it, by rising load."""
    found = [p for p in findings.find(name) if p.value is not None]
    by: dict[float, list[tuple[float, float]]] = {}
    for p in found:
        by.setdefault(float(p.at["speed"]), []).append((float(p.at["load"]), float(p.value or 0.0)))
    speed = max(by, key=lambda one: len({load for load, _ in by[one]}), default=math.nan)
    return speed, sorted(by.get(speed, []))


def grown(findings: Findings) -> str:
    """Return by how much each length grows from the least load to the largest."""
    told, ends, at = [], (math.nan, math.nan), math.nan
    for name, words in LENGTHS.items():
        speed, found = _along_load(findings, name)
        if len({load for load, _ in found}) > 1:
            told.append((found[-1][1] / found[0][1] - 1.0, words))
            ends, at = (found[0][0], found[-1][0]), speed
    if not told:
        return "One load does not tell."
    told.sort(reverse=True)
    grows = [f"the {words} by {100.0 * share:.2g} %" for share, words in told]
    return f"From {ends[0]:.0f} to {ends[1]:.0f} N (at {3.6 * at:.3g} km/h) {listing(grows)}."


def ratio(ratios: Sequence[float | None]) -> str:
    """Return how far deformation and contact length are apart."""
    found = [one for one in ratios if one is not None]
    if not found:
        return "The contact length is not determined, see the reasons."
    return f"The deformation length is {span(found, 1)} times the contact length."


def slope(findings: Findings, points: pd.DataFrame) -> str:
    """Return what a newton does to the peak, and how far the runs lie off the curve."""
    found = next(iter(findings.find("load_sensitivity")), None)
    if found is None or found.value is None:
        return f"It is not told: {found.description if found else 'there is no calibration'}"
    left = points.loc[points["used"], "residual"].to_numpy(dtype=float)
    rms = float(np.sqrt(np.nanmean(left**2))) if np.isfinite(left).any() else math.nan
    off = (
        f" The runs lie off the curve by {rms:.2g} ohm (rms); their bars hold the error of each average only."
        if rms > 0.0
        else ""
    )
    return f"In the middle of the loads by {known(found, 1e-6, 'µV')}.{off}"


def beside_paper(value: float) -> str:
    """Return how the sensitivity (V/N) compares with the paper's."""
    share = value / SENSITIVITY - 1.0
    word = "below" if share < 0.0 else "above"
    return f"{1e3 * value * 50.0 * G0:.1f} mV per 50 kg, {100.0 * abs(share):.2g} % {word} the paper's 70, which it gives as an order of magnitude."


def read_back(table: pd.DataFrame) -> str:
    """Return how well the calibration gives its own loads back, and those of the other runs."""
    off = (table["read_load"] - table["load"]).abs()
    held = (table["read_low"] <= table["load"]) & (table["load"] <= table["read_high"])
    used = table["used"].astype(bool)
    told = [
        f"Runs in the calibration come back within {off[used].max():.1f} N"
        if used.any()
        else "No run is in the calibration"
    ]
    if (~used).any():
        told.append(f"the others within {off[~used].max():.0f} N")
    return f"{', '.join(told)}; {int(held.sum())} of {len(table)} intervals hold the load cell's reading."


def rolls(findings: Findings, radius: Parameter) -> str:
    """Return the radius, how far it is below the free one, and whether the line meets the origin."""
    fit = findings.arrays["fit"].iloc[0]
    said = f"On Re = {known(radius, 1e-3, 'mm')}"
    if np.isfinite(fit["Ro"]) and radius.value is not None:
        share = radius.value / float(fit["Ro"]) - 1.0
        said += f", {100.0 * abs(share):.2g} % {'less' if share < 0.0 else 'more'} than half the nominal diameter"
    said += ". An inextensible belt without slip rolls on its own radius R and not on the free radius; R of the ring fit is this Re."
    if np.isfinite(fit["intercept"]):
        p = float(fit["intercept_p"])
        said += (
            f" The line {'misses' if p < _SIGNIFICANT else 'meets'} the origin: a free intercept would be {1e3 * fit['intercept']:+.2f} +- "
            f"{1.96e3 * fit['intercept_sd']:.2g} mm/s (95 %; as far off by chance: {chance(p)})."
        )
    return said


def told_parameters(table: pd.DataFrame) -> str:
    """Return how many of the ring's parameters are determined."""
    told = table["told"].astype(bool)
    return f"{int(told.sum())} of {len(table)} of this table are determined."


def grows_with(table: pd.DataFrame) -> str:
    """Return whether the runs' reduced chi-squared rises with load or speed beyond its 95 % interval."""
    rises, tested = [], []
    for name, words in (("load", "load"), ("rotation", "speed")):
        x, y = np.log(table[name].to_numpy(dtype=float)), np.log(table["chi2_reduced"].to_numpy(dtype=float))
        good = np.isfinite(x) & np.isfinite(y)
        x, y = x[good] - x[good].mean() if good.any() else x[good], y[good]
        if x.size < 3 or np.unique(x.round(2)).size < 3:
            continue
        tested.append(words)
        gain = float(x @ y / (x @ x))
        left = y - y.mean() - gain * x
        if gain - t_quantile(x.size - 2) * math.sqrt(float(left @ left) / (x.size - 2) / float(x @ x)) > 0.0:
            rises.append(words)
    sizes = f"it is {span(table['chi2_reduced'], 2)}"
    if not tested:
        return f"Too few loads and speeds to tell; {sizes}."
    return f"Yes, with {' and '.join(rises)}: {sizes}." if rises else f"Not with {' or '.join(tested)}: {sizes}."


def left_of_peak(table: pd.DataFrame) -> str:
    """Return how much of the peak the fit leaves."""
    return f"It leaves {span(100.0 * table['relative'], 3)} % of the peak (rms)."


def one_belt(findings: Findings) -> str:
    """Return whether the film is what flex says."""
    found = [100.0 * p.value for p in findings.find("pvdf_nrmse") if p.value is not None]
    if not found:
        return "It is not told, see the reasons."
    word = "Yes" if max(found) < 2.0 else "No" if max(found) > 10.0 else "Roughly"
    return f"{word}: the prediction misses the film by {span(found, 2)} % of its voltage (rms)."


def film_words(words: Sequence[str]) -> str:
    """Return how many runs are called what."""
    return sentence(listing(f"{words.count(word)} of {len(words)} {word}" for word in dict.fromkeys(words)))


def holds_up_to(orders: pd.DataFrame) -> str:
    """Return up to which order the prediction is within 10 % in all runs that are drawn."""
    miss = (orders["predicted"] / orders["measured"] - 1.0).abs()
    worst = miss.groupby(orders["order"]).max().sort_index()
    bad = worst[~(worst < _WITHIN)]
    if bad.empty:
        return f"Up to order {int(worst.index.max())}, the highest compared: within {100.0 * worst.max():.1f} % of the amplitude."
    below = worst[worst.index < bad.index[0]]
    return (
        f"Up to order {int(below.index.max())}: within 10 % of the amplitude, no longer at {int(bad.index[0])}."
        if len(below)
        else "At no order within 10 % of the amplitude."
    )


def alike(revolutions: pd.DataFrame) -> str:
    """Return by how much the peaks of one run scatter."""
    whole = revolutions[revolutions["whole"].astype(bool)].groupby("run")["peak"]
    share = (whole.std(ddof=1) / whole.mean().abs()).dropna()
    return (
        f"Peaks of one run scatter by {span(100.0 * share, 2)} % (standard deviation)."
        if len(share)
        else "Too few whole passages to tell."
    )


def passages(table: pd.DataFrame) -> str:
    """Return the worst of what the table holds."""
    used = table["used"].astype(bool)
    lost = int(table["lost"].sum() + table["rejected"].sum())
    count = f"All {len(table)} runs are used" if used.all() else f"{int(used.sum())} of {len(table)} runs are used"
    return (
        f"{count}; at most {100.0 * table['loss'].max():.1f} % of the packets are lost, {lost or 'no'} passage{'s' * (lost != 1)} lost, repaired or "
        f"rejected, first harmonic at most {100.0 * table['first_harmonic'].max():.1g} %."
    )
