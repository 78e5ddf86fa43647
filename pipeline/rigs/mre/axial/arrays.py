"""Tables beside the findings of `mre.axial`: what figures are drawn from and others can go on with. SI."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.rigs.mre.axial.levels import Level
from pipeline.rigs.mre.axial.run_fit import RunFit, curves_of
from pipeline.rigs.mre.axial.theory import Theory, theory_of

_SAMPLES = 1200


def arrays_of(levels: Sequence[Level]) -> dict[str, pd.DataFrame]:
    """Return the tables that there are, by name."""
    fits = [(level, fit) for level in levels for fit in level.runs]
    tables = {
        "runs": pd.DataFrame([_run(level, fit) for level, fit in fits]),
        "samples": pd.concat([_samples(fit) for _, fit in fits], ignore_index=True),
        "loops": pd.concat([_loop(fit) for _, fit in fits], ignore_index=True),
        "theory": _theory([fit for _, fit in fits]),
    }
    return {name: table for name, table in tables.items() if len(table)}


def _run(level: Level, found: RunFit) -> dict[str, float | str | None]:
    fit = found.fit
    row: dict[str, float | str | None] = {
        "run": found.run,
        "current": level.current,
        "d_max": found.d_max,
        "rate": found.rate,
        "gauge_step": fit.data.motion.step,
        "motion": _motion(found),
        "samples": float(fit.n),
        "effective": fit.effective,
        "residual": fit.sigma,
        "nrmse": found.nrmse,
        "offset": fit.offset,
    }
    for name, e in found.numbers.estimates.items():
        row |= {name: e.value, f"{name}_error": e.std_error}
        row |= {f"{name}_low": (e.ci95 or (None, None))[0], f"{name}_high": (e.ci95 or (None, None))[1]}
    return row


def _motion(found: RunFit) -> str:
    degrees = {stroke.degree for stroke in found.fit.data.motion.strokes}
    if found.fit.data.motion.shift_spread is not None:
        return "as read"
    if 0 in degrees:
        return "not smooth"
    return "constant rate" if degrees == {1} else "changing rate"


def _samples(found: RunFit) -> pd.DataFrame:
    fit = found.fit
    kept = np.unique(np.linspace(0, fit.n - 1, min(fit.n, _SAMPLES)).round().astype(int))
    extra = fit.data.extra @ fit.z[5 + len(fit.standing) : 5 + len(fit.standing) + fit.data.extra.shape[1]]
    return pd.DataFrame(
        {
            "run": found.run,
            "time": fit.data.time[kept],
            "displacement": fit.path.d[kept],
            "reading": fit.data.d_read[kept] if fit.data.d_read is not None else np.nan,
            "force": (fit.data.force - fit.offset - extra)[kept],
            "residual": fit.residual[kept],
        }
    )


def _loop(found: RunFit) -> pd.DataFrame:
    d, F, half, stroke = curves_of(found)
    return pd.DataFrame({"run": found.run, "displacement": d, "model": F, "half_width": half, "stroke": stroke})


def _theory(fits: Sequence[RunFit]) -> pd.DataFrame:
    found = {theory for fit in fits if isinstance(theory := theory_of(fit.recording.conditions), Theory)}
    return pd.DataFrame(
        [
            {"modulus": t.modulus, "stiffness": t.stiffness, "shape_factor": t.shape_factor, "bonded": t.bonded}
            for t in sorted(found, key=lambda t: t.stiffness)
        ]
    )
