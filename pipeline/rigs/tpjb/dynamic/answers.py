"""What the captions of a dynamic test answer, from what was found: so that they stay true of any other campaign."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.errors import listing

_DEGREES = {0: "constant", 1: "a straight line", 2: "a parabola"}
_UNITS = {"k": (1e6, "MN/m"), "c": (1e6, "MN s/m")}
_CONDITION_LIMIT = 10.0
_NEAR = 0.2  # of the stator's mass


def of_frequency(tables: dict[str, pd.DataFrame], letter: str) -> str:
    """Answer whether the entries change with frequency, and what the direct ones are at shaft speed."""
    if "laws" not in tables or tables["laws"].empty:
        return "No law could be fitted over the tones."
    laws = tables["laws"]
    taken = (
        laws[laws["taken"].astype(bool) & laws["name"].str.startswith(letter)]
        .groupby("name", sort=False)["degree"]
        .first()
    )
    bent = [
        f"{name} {_DEGREES.get(int(degree), f'of degree {degree}')}" for name, degree in taken.items() if degree > 0
    ]
    answer = f"Yes: {listing(bent, 4)}" if bent else "No: a constant is enough for all four"
    return f"{answer}. {_at_shaft(tables['synchronous'], letter)}" if "synchronous" in tables else f"{answer}."


def _at_shaft(table: pd.DataFrame, letter: str) -> str:
    size, unit = _UNITS[letter]
    told = []
    for _, row in table[table["name"].isin([f"{letter}xx", f"{letter}yy"])].iterrows():
        if pd.isna(row["value"]):
            continue
        half = (row["high"] - row["low"]) / 2 / size
        digits = max(1 - int(np.floor(np.log10(half))), 0) if half > 0 else 3
        told.append(f"{row['name']} = {row['value'] / size:.{digits}f} ± {half:.{digits}f} {unit}")
    return f"At shaft speed {listing(told, 2)}." if told else "At shaft speed nothing is told, see the parameters."


def of_parts(table: pd.DataFrame, letter: str) -> str:
    """Answer what rules the error of the synchronous values."""
    own = table[table["name"].str.startswith(letter) & table["value"].notna()]
    if own.empty:
        return "Nothing is told, see the parameters."
    shares = {
        name: 100 * (own[column].astype(float) / own["value"].abs())
        for name, column in (("scatter", "std_error"), ("gains", "type_b_gain"), ("inertia", "type_b_inertia"))
        if own[column].notna().any()
    }
    together = pd.DataFrame(shares).fillna(0.0)
    ruling = [str(together.columns[place]) for place in together.to_numpy().argmax(axis=1)]
    parts = [
        f"{what} most for {listing([str(name) for name, by in zip(own['name'], ruling, strict=True) if by == what], 4)}"
        for what in dict.fromkeys(ruling)
    ]
    told = "; ".join(parts)
    return f"{told[0].upper()}{told[1:]}."


def of_tones(table: pd.DataFrame) -> str:
    """Answer how well single tones tell the direct stiffness."""
    direct = table[table["name"] == "kxx"]
    errors = (100 * direct["std_error"] / direct["value"].abs()).to_numpy()
    if not np.isfinite(errors).any():
        return "It cannot be told."
    best, worst = (direct.iloc[int(place)]["frequency"] for place in (np.nanargmin(errors), np.nanargmax(errors)))
    return f"kxx to {np.nanmin(errors):.2g} % at {best:g} Hz and to {np.nanmax(errors):.2g} % at {worst:g} Hz (standard errors)."


def of_added_mass(table: pd.DataFrame, stator: float | None) -> str:
    """Answer whether the stator's mass is left: it would be the same in xx and yy, of the stator's size."""
    rows = {
        str(axes): (float(m), float(sd)) for axes, m, sd in table[["axes", "mass", "std_error"]].itertuples(index=False)
    }
    told = listing((f"M_{axes} = ({rows[axes][0]:.0f} ± {1.96 * rows[axes][1]:.0f}) kg" for axes in ("xx", "yy")), 2)
    if not any(abs(mass) > 3 * sd for mass, sd in rows.values()):
        return f"No: none stands out of its error; {told}."
    if stator is None or not np.isfinite(stator):
        return f"Some: {told}."
    direct = [rows[axes][0] / stator for axes in ("xx", "yy")]
    alike = abs(direct[0] - direct[1]) < _NEAR and abs(abs(direct[0]) - 1) < _NEAR
    if alike:
        return f"Yes, one like the stator's {stator:.0f} kg: {told}."
    return f"A trend like a mass, but not that of the stator, whose {stator:.0f} kg would stand in xx and yy alike: {told}."


def of_loads(table: pd.DataFrame) -> str:
    """Answer how the direct stiffness changes from the first to the last operating point."""
    told = []
    for name in ("kxx", "kyy", "cxx", "cyy"):
        values = table.loc[(table["name"] == name) & table["value"].notna(), "value"].to_numpy(float)
        if values.size > 1 and values[0] != 0.0:
            told.append(f"{name} {values[-1] / values[0]:.2f} times")
    return f"The last over the first: {listing(told, 4)}." if told else "There is one value only."


def of_products(shares: pd.DataFrame) -> str:
    """Answer whether motion stands out of the noise where a linear bearing has none."""
    sure = shares[shares["share"] > 3 * shares["std_error"]]
    if sure.empty:
        most = 100 * float((shares["share"] + 2 * shares["std_error"]).max())
        return f"Yes: nothing stands out of the noise, which hides up to {most:.1g} % of the motion."
    worst = sure.iloc[int(sure["share"].argmax())]
    return f"Not quite: {100 * worst['share']:.2g} % of the motion stands out of the noise at {worst['point']}."


def of_tone_quality(table: pd.DataFrame) -> str:
    """Answer whether both excitations tell both directions."""
    used = table[table["used"].astype(bool)]
    if used.empty:
        return "No: no tone could be used."
    worst = float(used["condition"].max())
    word = "Yes" if worst <= _CONDITION_LIMIT else "Hardly"
    snr = [column for column in used if str(column).startswith("snr_")]
    noise = f", signal to noise at least {float(used[snr].min().min()):.0f} dB" if snr else ""
    return f"{word}: {len(used)} of {len(table)} tones are used, cond(D) is at most {worst:.2f}{noise}."
