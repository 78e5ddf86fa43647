"""Tables that the report of `mre.step` is drawn from, SI."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.step.lag_fit import Found
from pipeline.rigs.mre.step.lag_problem import Problem, Rows

_ROWS = 12_000


def arrays_of(found: Sequence[tuple[Found, list[Estimate]]]) -> dict[str, pd.DataFrame]:
    """Return `series` (the whole log, thinned), `responses` (each step, thinned about its onset) and `steps`."""
    return {
        name: pd.concat([make(fits) for fits, _ in found]).reset_index(drop=True)
        for name, make in (("series", _series), ("responses", _responses), ("steps", _steps))
    }


def _series(found: Found) -> pd.DataFrame:
    fit, record = found.fit, found.fit.record
    keep = slice(None, None, max(record.time.size // _ROWS, 1))
    return pd.DataFrame(
        {
            "run": record.run,
            "time": record.time[keep],
            "current": np.interp(record.time[keep], record.grid, record.current),
            "force": record.force[keep],
            "model": fit.model[keep],
            "residual": fit.residual[keep],
        }
    )


def _responses(found: Found) -> pd.DataFrame:
    """Return time from the onset and the share of the change of force and current, creep taken out."""
    fit, record = found.fit, found.fit.record
    parts = []
    for number, step in enumerate(record.steps):
        reach = min(step.end - step.onset, 8 * sum(fit.taus(step.direction)) + 0.1)
        rows = np.flatnonzero((record.time > step.onset - 0.05 * reach) & (record.time < step.onset + reach))
        rows = rows[:: max(rows.size // 600, 1)]
        size = fit.gain(number) * (step.after - step.before)
        # The model without this step leaves the step alone, and what the model misses.
        own = _alone(found, number)
        answer = own[rows] + fit.residual[rows]
        share = np.interp(record.time[rows], record.grid, record.current)
        parts.append(
            pd.DataFrame(
                {
                    "run": record.run,
                    "step": number,
                    "direction": step.direction,
                    "time": record.time[rows] - step.onset,
                    "force": answer / size,
                    "model": own[rows] / size,
                    "current": (share - step.before) / (step.after - step.before),
                }
            )
        )
    return pd.concat(parts)


def _alone(found: Found, number: int) -> np.ndarray:
    """Return the part of the model that answers one step, N, at the samples."""
    fit = found.fit
    everything = np.ones(fit.record.time.size, dtype=bool)
    columns, _ = Problem(fit.record, fit.lags, Rows.all_of(fit.record, everything)).columns(fit.q)
    return np.asarray(columns[:, 2 + number] * fit.c[2 + number])


def _steps(found: Found) -> pd.DataFrame:
    fit, record = found.fit, found.fit.record
    return pd.DataFrame(
        [
            {
                "run": record.run,
                "step": number,
                "direction": step.direction,
                "onset": step.onset,
                "before": step.before,
                "after": step.after,
                "held": step.end - step.onset,
                "gain": fit.gain(number),
                "change": fit.gain(number) * (step.after - step.before),
                "rms_residual": fit.sigma,
            }
            for number, step in enumerate(record.steps)
        ]
    )
