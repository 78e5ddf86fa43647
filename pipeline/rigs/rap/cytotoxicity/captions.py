"""What the figures and tables of `rap.cytotoxicity` answer, in words computed from the tables that they draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.rigs.rap.cytotoxicity.declaration import OUTCOMES
from pipeline.rigs.rap.cytotoxicity.parameters import signed
from pipeline.rigs.rap.wording import joined

if TYPE_CHECKING:
    import pandas as pd

_VERDICTS = {"equivalence": "equivalent in", "different": "different in", "inconclusive": "inconclusive in"}
_CHANGES = 0.05
# A culture stands alone beyond that many standard deviations of the pooled scatter.
_ALONE = 3.0


def verdicts(outcomes: pd.DataFrame) -> str:
    """Return which outcomes are equivalent, different, inconclusive."""
    by = {
        word: [str(o) for o in dict.fromkeys(outcomes[outcomes["verdict"] == verdict]["outcome"])]
        for verdict, word in _VERDICTS.items()
    }
    said = "; ".join(f"{word} {joined(names)}" for word, names in by.items() if names)
    return f"{said[0].upper()}{said[1:]}." if said else "Nothing could be judged."


def differences(own: pd.DataFrame) -> str:
    """Return for each outcome how many intervals lie within the margin, and the interval that reaches farthest."""
    parts = []
    for outcome in (o for o in OUTCOMES if o in set(own["outcome"])):
        rows = own[own["outcome"] == outcome]
        inside = int(((rows["low90"] >= -rows["margin"]) & (rows["high90"] <= rows["margin"])).sum())
        far = rows.iloc[int(np.argmax(np.maximum(-rows["low90"], rows["high90"])))]
        parts.append(
            f"{inside} of {len(rows)} for {outcome}, the farthest {signed(far['low90'])} to {signed(far['high90'])} points at {far['time'] / 60:g} min "
            f"(margin ±{100 * far['margin']:g})"
        )
    return f"{'; '.join(parts)}."


def passing(own: pd.DataFrame) -> str:
    """Return how many tests pass, and the times of those that do not."""
    failed = own[~own["passes"].astype(bool)]
    if failed.empty:
        return f"All {len(own)}."
    named = [f"{row['outcome']} at {row['time'] / 60:g} min" for row in failed.to_dict("records")]
    return f"{len(own) - len(failed)} of {len(own)}; not {joined(named)}."


def scatter(outcomes: pd.DataFrame | None, samples: pd.DataFrame, run: str) -> str:
    """Return the pooled scatter of each outcome, and how many cultures lie far from the mean of theirs."""
    known = outcomes[(outcomes["run"] == run) & outcomes["deviation"].notna()] if outcomes is not None else None
    if known is None or known.empty:
        return "Too few cultures tell."
    alone, parts = 0, []
    for row in known.to_dict("records"):
        parts.append(f"{100 * row['deviation']:.2g} points ({row['outcome']})")
        values = samples[str(row["outcome"])]
        off = values - values.groupby([samples["group"], samples["time"]]).transform("mean")
        alone += int((off.abs() > _ALONE * row["deviation"]).sum())
    return f"Standard deviations of {joined(parts)}; {alone or 'none'} farther than {_ALONE:g} of them from the mean of its group and time."


def slopes(outcomes: pd.DataFrame) -> str:
    """Return which outcomes change with time."""
    changing = [str(row["outcome"]) for row in outcomes.to_dict("records") if row["slope_p"] < _CHANGES]
    steady = [str(row["outcome"]) for row in outcomes.to_dict("records") if not row["slope_p"] < _CHANGES]
    parts = [
        f"it does for {joined(changing)}" if changing else "",
        f"no change is seen for {joined(steady)}" if steady else "",
    ]
    said = "; ".join(part for part in parts if part)
    return f"{said[0].upper()}{said[1:]}."


def power(designs: pd.DataFrame) -> str:
    """Return the power of the test as it was made, by outcome."""
    own = designs[designs["own"].astype(bool)]
    parts = [f"{100 * row['power']:.0f} % for {row['outcome']}" for row in own.to_dict("records")]
    return f"With a probability of {joined(parts)}." if parts else "For the test as it was made that is not known."
