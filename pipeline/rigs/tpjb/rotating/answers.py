"""What the captions of a rotating-load test answer, from what was found: so that they stay true of any other campaign."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.errors import listing

_POOR_CONTROL = 0.02  # backward turning part of the load
_HOLDS_UP_TO = 2.0  # chi-square per degree of freedom
_TOLD = 4


def of_load(runs: pd.DataFrame) -> str:
    """Answer whether the load turns as one vector of constant size."""
    told = runs[runs["circularity"].notna()]
    if told.empty:
        return "It cannot be told, the harmonics of the load were refused."
    worst = told.iloc[int(told["circularity"].argmax())]
    share, limit = 100 * float(worst["circularity"]), f"{100 * _POOR_CONTROL:.0f} %"
    if share > 100 * _POOR_CONTROL:
        return f"No: the backward turning part is {share:.2g} % of the load in {worst['run']}; above {limit} control is poor."
    return f"Yes: the backward turning part is at most {share:.2g} % of the load ({worst['run']}), below {limit}."


def of_place(samples: pd.DataFrame, zero: str) -> str:
    """Answer how far from the zero the stator moves."""
    away = np.hypot(samples["dx"].to_numpy(), samples["dy"].to_numpy())
    if not np.isfinite(away).any():
        return "It cannot be told."
    at = int(np.nanargmax(away))
    return f"At most {1e3 * float(away[at]):.3f} mm from the {zero} (in {samples['run'].iloc[at]})."


def of_orbit(curves: pd.DataFrame) -> str:
    """Answer which law makes an orbit: what the selected one leaves, and the nearest and the farthest of the others."""
    left = curves.drop_duplicates("model").set_index("model")["rms"].dropna() * 1e9
    chosen = curves.loc[curves["selected"].astype(bool), "model"].unique()
    others = left.drop(list(chosen), errors="ignore").sort_values()
    beside = ""
    if len(others) > 1:
        beside = f"of the others {others.index[0]} leaves {others.iloc[0]:.0f} nm, {others.index[-1]} {others.iloc[-1]:.0f} nm"
    if not len(chosen) or chosen[0] not in left:
        return f"None was selected; {beside}." if beside else "None was selected."
    return f"{chosen[0]}, selected, leaves {left[chosen[0]]:.0f} nm rms an axis{'; ' if beside else ''}{beside}."


def of_residual(largest: float, models: pd.DataFrame | None) -> str:
    """Answer what the selected laws leave, and whether it is noise."""
    size = f"At most {1e9 * largest:.0f} nm rms an axis"
    chosen = models[models["selected"].astype(bool)] if models is not None else None
    if chosen is None or chosen.empty:
        return f"{size}."
    worst = float(chosen["chi2_reduced"].max())
    what = "which is noise" if worst < _HOLDS_UP_TO else "which is more than noise"
    return (
        f"{size}, {what}: chi2 is {worst:.2f} a degree of freedom ({_HOLDS_UP_TO:.0f} and more: a law does not hold)."
    )


def of_harmonics(row: pd.Series) -> str:
    """Answer whether a run's orbit is distorted by more than its load explains."""
    shares = (
        f"2X/1X is {100 * row['second_x']:.2g} % in x, {100 * row['second_y']:.2g} % in y and "
        f"{100 * row['second_load']:.2g} % in the load"
    )
    if not np.isfinite(row["thd"]) or not np.isfinite(row["thd_sd"]):
        return f"{shares[0].upper()}{shares[1:]}."
    sure = row["thd"] > 3 * row["thd_sd"]
    thd = f"{100 * row['thd']:.2f} ± {196 * row['thd_sd']:.2f} %"
    return f"{'Yes' if sure else 'Not surely'}: {shares}; the THD that the load does not explain is {thd}."


def of_direction(harmonics: pd.DataFrame, runs: pd.DataFrame) -> str:
    """Answer which way 2X turns in the run that is distorted most."""
    told = runs[runs["thd"].notna()]
    if told.empty:
        return "The distortion was not told."
    run = str(told["run"].iloc[int(told["thd"].argmax())])
    part = harmonics[harmonics["run"] == run]
    size = {int(k): float(motion) for k, motion in zip(part["k"], part["motion"], strict=True)}
    sigma = {int(k): float(s) for k, s in zip(part["k"], part["motion_sigma"], strict=True)}
    first = float(np.hypot(size[1], size[-1]))
    way = "more forward" if size[2] > size[-2] else "more backward"
    if abs(size[2] - size[-2]) <= 3 * float(np.hypot(sigma[2], sigma[-2])):
        way = "both ways alike"
    shares = f"{100 * size[2] / first:.2g} % forward and {100 * size[-2] / first:.2g} % backward"
    return f"In {run}, distorted most, 2X turns {way}: {shares}."


def of_filtered(row: pd.Series) -> str:
    """Answer what shape the 2X orbit has."""
    if not np.isfinite(row["openness"]):
        return "The 2X orbit is too small for its shape to be told."
    shape = "open" if row["open"] else "a line within its error"
    return (
        f"The 2X orbit is {shape}: its circles differ by ({100 * row['openness']:.0f} ± {max(196 * row['openness_sd'], 1):.0f}) %. "
        "Open above 10 %: eqs (3) and (4) only make lines."
    )


def of_models(part: pd.DataFrame) -> str:
    """Answer which law is selected, by how much, and whether it holds."""
    chosen = part[part["selected"].astype(bool)]
    if chosen.empty:
        return "None is selected."
    one = chosen.iloc[0]
    ordered = part.sort_values("bic")
    best = ordered.iloc[0]
    if best["model"] == one["model"]:
        ahead = f", {ordered.iloc[1]['bic'] - one['bic']:.0f} below {ordered.iloc[1]['model']}" if len(part) > 1 else ""
        why = f"{one['model']}, of the smallest BIC{ahead}"
    else:
        why = (
            f"{one['model']}; the BIC of {best['model']} is smaller by {one['bic'] - best['bic']:.0f}, but "
            f"{one['model']} differs from the best of the fitted laws by {100 * one['effect']:.2g} % of the 1X only"
        )
    chi2 = float(one["chi2_reduced"])
    holds = "it holds" if chi2 < _HOLDS_UP_TO else "it does not hold"
    return f"{why}; {holds}, with chi2 {chi2:.2f}."


def of_coefficients(shown: pd.DataFrame, part: pd.DataFrame) -> str:
    """Answer which of the rows `shown` of all models of a group count."""
    failing = [str(row["model"]) for _, row in shown.iterrows() if row["chi2_reduced"] >= _HOLDS_UP_TO]
    chosen = [str(row["model"]) for _, row in part.iterrows() if row["selected"]]
    counts = "No law is selected. "
    if chosen and chosen[0] in failing:
        return f"No more than a description: {chosen[0]}, selected, does not hold either, and its coefficients carry no meaning beyond this fit."
    if chosen:
        counts = f"{chosen[0]}, selected, has none of these. "
        if chosen[0] in set(shown["model"]):
            counts = f"Those of {chosen[0]}, selected, count. "
    return counts + (
        f"Those of laws that do not hold ({listing(failing, 20)}) mean nothing." if failing else "All laws hold."
    )


def of_runs(words: list[str]) -> str:
    """Answer how many runs are linear, marginal, nonlinear."""
    return ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words)).capitalize() + "."


def of_comparison(part: pd.DataFrame) -> str:
    """Answer how many comparisons agree, and by how much the worst differs."""
    known = part[part["z"].notna()]
    if known.empty:
        return "Nothing could be compared."
    agree = int(known["holds"].astype(bool).sum())
    worst = known.iloc[int(known["z"].abs().argmax())]
    return (
        f"In {agree} of {len(known)} cases; the largest difference is {_to_three(abs(worst['z']))} standard errors ({str(worst['name']).replace('dk', 'd k')}, "
        f"{worst['group']})."
    )


def _to_three(number: float) -> str:
    return f"{number:.1f}" if number < 100.0 else f"{number:.3g}"
