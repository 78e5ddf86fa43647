"""Tables beside the findings of `mre.shear_rich`: what figures are drawn from and others can go on with. SI."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from pipeline.estimation.residuals import whiteness
from pipeline.rigs.mre.rich.comparison import Comparison
from pipeline.rigs.mre.rich.fits import RichFit
from pipeline.rigs.mre.rich.online_verdict import ABSENT
from pipeline.signals.cycles import turning_points

_LOOP_ROWS, _STRETCH, _ONLINE_STEP = 8000, 2.0, 0.2
_SPECTRUM_STEP = 0.5  # Hz
# Of all cycles ordered by stroke, those that are drawn: a small, a middle and a large one.
_DRAWN_CYCLES = (0.1, 0.5, 0.9)
_LEAST_STROKE = 0.02  # of the record's span: less is noise
TRACKED = ("k1", "s1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw")


def arrays_of(fits: Sequence[RichFit], agreement: Comparison | None, flux: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the tables that there are, by name."""
    tables = {
        "records": pd.DataFrame([_record(fit) for fit in fits]),
        "loops": _joined(_loops(fit) for fit in fits),
        "cycles": _joined(_cycles(fit) for fit in fits),
        "series": _joined(_stretch(fit) for fit in fits),
        "online": _joined(_online(fit) for fit in fits),
        "side_by_side": pd.DataFrame([row for fit in fits for row in _side_by_side(fit)]),
        "spectra": _joined(_spectra(fit) for fit in fits),
        "residual_checks": pd.DataFrame([row for fit in fits for row in _checks(fit)]),
        "correlation": _joined(_correlation(fit) for fit in fits),
        "agreement": _agreement(agreement),
        "flux_levels": flux,
    }
    return {name: table for name, table in tables.items() if len(table)}


def _joined(parts: Iterable[pd.DataFrame]) -> pd.DataFrame:
    kept = [part for part in parts if len(part)]
    return pd.concat(kept, ignore_index=True) if kept else pd.DataFrame()


def _record(fit: RichFit) -> dict[str, float | str | None]:
    batch, reach = fit.batch, fit.reach
    row: dict[str, float | str | None] = {
        "run": fit.run,
        "current": fit.current,
        "duration": float(fit.usable.series.time[-1] - fit.usable.series.time[0]),
        "samples": fit.usable.series.time.size,
        "cutoff": batch.cutoff,
        "rms_residual": batch.rms_residual,
        "nrmse": batch.nrmse,
        "prediction_nrmse": batch.nrmse_second_half,
        "condition": batch.condition,
        "effective_share": batch.effective_fraction,
    }
    if reach is not None:
        row |= {"amplitude_low": reach.amplitudes[0], "amplitude_high": reach.amplitudes[1]}
        row |= {"frequency_low": reach.frequencies[0], "frequency_high": reach.frequencies[1]}
    if fit.verdict is not None:
        row |= {"online": fit.verdict.word, "online_reason": fit.verdict.reason, "innovation": fit.verdict.innovation}
        row |= {"noise": fit.verdict.noise}
    if fit.online is not None and fit.online.ahead.started:
        row |= {"online_delay": fit.online.ahead.delay, "online_step": fit.online.ahead.every / fit.online.ahead.rate}
    return row


def _loops(fit: RichFit) -> pd.DataFrame:
    series = fit.batch.series[fit.run]
    step = max(series["time"].size // _LOOP_ROWS, 1)
    table = pd.DataFrame({name: values[::step] for name, values in series.items()})
    table.insert(0, "run", fit.run)
    return table


def _cycles(fit: RichFit) -> pd.DataFrame:
    """Return every sample of a few whole cycles, numbered from the smallest to the largest of them."""
    series = fit.batch.series[fit.run]
    x = series["displacement"]
    turns = turning_points(x, _LEAST_STROKE * float(np.ptp(x)))[1:]  # the record's first sample is no turn
    if turns.size < 3:
        return pd.DataFrame()
    strokes = np.abs(x[turns[1:-1]] - x[turns[:-2]]) + np.abs(x[turns[2:]] - x[turns[1:-1]])
    order = np.argsort(strokes)
    chosen = dict.fromkeys(int(order[round(share * (order.size - 1))]) for share in _DRAWN_CYCLES)
    tables = []
    for number, start in enumerate(chosen, 1):
        samples = slice(turns[start], turns[start + 2] + 1)
        tables.append(pd.DataFrame({"cycle": number} | {name: values[samples] for name, values in series.items()}))
    table = _joined(tables)
    table.insert(0, "run", fit.run)
    return table


def _stretch(fit: RichFit) -> pd.DataFrame:
    """Return two seconds of the second half, every sample that was compared."""
    series = fit.batch.series[fit.run]
    time = series["time"]
    start = time[0] + 0.75 * (time[-1] - time[0])
    part = (time >= start) & (time < start + _STRETCH)
    table = pd.DataFrame({name: values[part] for name, values in series.items()})
    table.insert(0, "run", fit.run)
    return table


def _online(fit: RichFit) -> pd.DataFrame:
    if fit.online is None or not fit.online.history.time.size:
        return pd.DataFrame()
    time = fit.online.history.time
    kept = np.unique(np.searchsorted(time, np.arange(time[0], time[-1], _ONLINE_STEP)).clip(0, time.size - 1))
    kept = np.unique(np.r_[kept, time.size - 1])
    middle, low, high = (fit.online.history.band(width) for width in (0.0, -1.96, 1.96))
    columns: dict[str, object] = {"run": fit.run, "time": time[kept]}
    for name, values in middle.items():
        columns |= {name: values[kept], f"{name}_low": low[name][kept], f"{name}_high": high[name][kept]}
    return pd.DataFrame(columns)


def _side_by_side(fit: RichFit) -> list[dict[str, float | str | None]]:
    ends: dict[str, tuple[float, float, float]] = {}
    if (
        fit.online is not None
        and fit.verdict is not None
        and fit.verdict.word != ABSENT
        and fit.online.history.time.size
    ):
        middle, lower, upper = (fit.online.history.band(width) for width in (0.0, -1.96, 1.96))
        ends = {name: (float(middle[name][-1]), float(lower[name][-1]), float(upper[name][-1])) for name in middle}
    rows: list[dict[str, float | str | None]] = []
    for e in fit.batch.estimates:
        if e.name not in (*TRACKED, "s_mr", "force_lag"):
            continue
        low, high = e.ci95 if e.ci95 is not None else (None, None)
        row: dict[str, float | str | None] = {
            "run": fit.run, "current": fit.current, "name": e.name, "batch": e.value, "batch_sd": e.std_error,
            "batch_low": low, "batch_high": high,
        }  # fmt: skip
        if e.name in ends:
            value, online_low, online_high = ends[e.name]
            row |= {"online": value, "online_low": online_low, "online_high": online_high}
            row["difference"] = value / e.value - 1 if e.value else None
        rows.append(row)
    return rows


def _spectra(fit: RichFit) -> pd.DataFrame:
    """Return power spectral densities (N^2/Hz) of what each method leaves: batch residual, filter innovations."""
    series = fit.batch.series[fit.run]
    parts = [("batch", series["time"], series["force"] - series["model"])]
    if fit.online is not None and fit.online.history.step_time.size:
        time, innovation = fit.online.history.step_time, fit.online.history.innovation
        late = time > 0.5 * (time[0] + time[-1])
        parts.append(("online filter", time[late], innovation[late]))
    tables = []
    for method, time, left in parts:
        kept = np.isfinite(left)
        if kept.sum() < 256:
            continue
        frequency, density = _welch(time[kept], left[kept])
        tables.append(pd.DataFrame({"run": fit.run, "method": method, "frequency": frequency, "density": density}))
    return _joined(tables)


def _welch(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from scipy.signal import welch

    rate = 1 / float(np.median(np.diff(time)))
    size = min(values.size, max(int(rate / _SPECTRUM_STEP), 64))
    frequency, density = welch(values, rate, nperseg=size)
    return frequency[1:], density[1:]


def _checks(fit: RichFit) -> list[dict[str, float | str]]:
    series = fit.batch.series[fit.run]
    parts = {f"batch fit, {fit.run}": series["force"] - series["model"]}
    if fit.online is not None and fit.online.history.step_time.size:
        innovation = fit.online.history.innovation
        parts[f"innovations of the filter, {fit.run}"] = innovation[innovation.size // 2 :]
    checks = {of: whiteness(left) for of, left in parts.items()}
    return [{"of": of, "name": c.name, "p_value": c.p_value, "verdict": c.verdict} for of, c in checks.items()]


def _correlation(fit: RichFit) -> pd.DataFrame:
    table = pd.DataFrame(fit.batch.correlation, columns=list(fit.batch.names))
    table.insert(0, "name", list(fit.batch.names))
    table.insert(0, "run", fit.run)
    table["condition"] = fit.batch.condition
    return table


def _agreement(agreement: Comparison | None) -> pd.DataFrame:
    if agreement is None:
        return pd.DataFrame()
    rows = []
    for i, run in enumerate(agreement.runs):
        for j, name in enumerate(agreement.names):
            rows.append(
                {
                    "run": run, "name": name, "own": agreement.own[i, j], "own_sd": agreement.own_sd[i, j],
                    "common": agreement.common[j], "common_sd": agreement.common_sd[j], "deviation": agreement.deviations[i, j],
                    "chi2": agreement.chi2, "dof": agreement.dof, "p_value": agreement.p_value,
                }
            )  # fmt: skip
    return pd.DataFrame(rows)
