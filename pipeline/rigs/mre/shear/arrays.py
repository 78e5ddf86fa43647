"""Tables beside the findings of `mre.shear`: what figures are drawn from and others can go on with. SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from pipeline.findings import Parameter
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.leave_one_out import LeaveOneOut
from pipeline.rigs.mre.model.loop import Loop, curve
from pipeline.rigs.mre.model.many import conditions_of
from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.pads import group_levels
from pipeline.rigs.mre.shear.design import design_tables
from pipeline.rigs.mre.shear.parameters import run_metrics
from pipeline.rigs.mre.shear.preload import PreloadTable
from pipeline.rigs.mre.shear.residuals import METRICS, agreement, field_laws, normalised, residual_checks
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.over_runs import MANY, natural

_POINTS, _SERIES = 256, 3000
_HALF_CYCLES_KEPT = 60
# Of many loops those are kept that stand at these shares of all, from the best met to the worst.
_SHARES = {"best": 0.0, "lower quartile": 0.25, "median": 0.5, "upper quartile": 0.75, "worst": 1.0}
_LEVELS_APART = 0.25  # A
# Model lines: runs whose frequency (or amplitude) differs by less than this ratio share one; how far a line goes
# beyond its runs; points of a long and of a short one.
_LINES, _SAME, _BEYOND = 48, 1.05, (0.85, 1.18)
_LINE_POINTS, _STROKE_POINTS = 25, 7


def arrays_of(
    runs: SortedRuns,
    fit: DynamicFit | None,
    without: LeaveOneOut | None,
    times: Sequence[TimeFit],
    preloads: PreloadTable | None,
    parameters: Sequence[Parameter],
    flux: pd.DataFrame,
) -> dict[str, pd.DataFrame]:
    """Return the tables that there are, by name."""
    stand = _standing(runs, fit)
    tables = {
        "runs": _runs(runs, fit, without, stand),
        "loops": _loops(runs, fit, stand),
        "samples": _samples(runs, stand),
        "half_cycles": _half_cycles(runs),
        "residual_harmonics": _residual_harmonics(fit),
        "correlation": _correlation(fit, times),
        "model_lines": _model_lines(fit),
        "series": _series(times),
        "preload_states": _preload_states(preloads),
        "agreement": agreement(runs, fit),
        "residual_checks": residual_checks(fit, times),
        "field_laws": field_laws(parameters),
        "flux_levels": flux,
        **design_tables(fit),
    }
    return {name: table for name, table in tables.items() if len(table)}


def _standing(runs: SortedRuns, fit: DynamicFit | None) -> dict[str, str]:
    """Return the loops that are kept, and as what: all where they are few, else some at fixed shares of all by misfit."""
    names = [usable.run for usable in runs.loops]
    if len(names) <= MANY:
        return dict.fromkeys(names, "")
    met = fit.nrmse_by_run if fit is not None else {}
    ordered = sorted((run for run in names if run in met or not met), key=lambda run: (met.get(run, 0.0), natural(run)))
    return {ordered[round(share * (len(ordered) - 1))]: word for word, share in _SHARES.items()}


def _conditions(runs: SortedRuns) -> dict[str, str]:
    """Return the condition of each loop in words, where there are many."""
    loops = [usable.loop for usable in runs.loops if usable.loop is not None]
    if len(loops) <= MANY:
        return {}
    labels, levels = group_levels([loop.current for loop in loops], _LEVELS_APART)
    table = pd.DataFrame(conditions_of(loops, labels), columns=["level", "frequency", "amplitude"])
    table["run"] = [loop.run for loop in loops]
    known = any(loop.current is not None for loop in loops)
    named: dict[str, str] = {}
    for _, part in table.groupby(["level", "frequency", "amplitude"]):
        members = [loops[int(i)] for i in part.index.to_numpy()]
        f, X = (float(np.median([getattr(loop, name) for loop in members])) for name in ("frequency", "amplitude"))
        named |= dict.fromkeys(
            part["run"],
            f"{f:.3g} Hz, {1e3 * X:.2g} mm" + (f", {levels[labels[int(part.index[0])]]:g} A" if known else ""),
        )
    return named


def _runs(
    runs: SortedRuns, fit: DynamicFit | None, without: LeaveOneOut | None, stand: Mapping[str, str]
) -> pd.DataFrame:
    rows, conditions = [], _conditions(runs)
    for usable in runs.usable:
        row: dict[str, float | str | None] = {
            "run": usable.run,
            "kind": usable.excitation.kind,
            "frequency": usable.excitation.frequency,
            "current": usable.current,
            "preload": usable.preload,
            "sequence": usable.sequence,
            "samples": usable.series.time.size,
        }
        if usable.loop is not None:
            row |= {
                "samples": usable.loop.n_samples,
                "frequency": usable.loop.frequency,
                "cycles": usable.loop.duration * usable.loop.frequency,
            }
            row |= {"force_noise": usable.loop.sigma_f, "displacement_noise": usable.loop.sigma_x}
            for metric in run_metrics(usable, fit):
                row |= {metric.name: metric.value, f"{metric.name}_low": (metric.ci95 or (None, None))[0]}
                row |= {f"{metric.name}_high": (metric.ci95 or (None, None))[1]}
        if fit is not None and usable.run in fit.chi2_by_run:
            row |= {"chi2_reduced": fit.chi2_by_run[usable.run], "gain": fit.gain_by_run[usable.run]}
            row |= {"nrmse": fit.nrmse_by_run[usable.run]}
            if without is not None:
                row |= {"prediction_nrmse": without.prediction_nrmse.get(usable.run)}
        if conditions:
            row |= {
                "begins": usable.begins,
                "condition": conditions.get(usable.run, ""),
                "stands_for": stand.get(usable.run),
            }
        rows.append(row)
    return pd.DataFrame(rows)


def _loops(runs: SortedRuns, fit: DynamicFit | None, stand: Mapping[str, str]) -> pd.DataFrame:
    parts = []
    for usable in (usable for usable in runs.loops if usable.run in stand):
        assert usable.loop is not None
        loop = usable.loop
        model, residual = _modelled(fit, loop)
        x, F = curve(loop.X, _POINTS), curve(loop.F, _POINTS)
        time = np.arange(_POINTS) / (_POINTS * loop.frequency)
        part = {"run": loop.run, "time": time, "displacement": x, "force": F, "model": model, "residual": residual}
        parts.append(pd.DataFrame(part))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def _modelled(fit: DynamicFit | None, loop: Loop) -> tuple[np.ndarray | float, np.ndarray | float]:
    """Return one cycle of the model and of the residual, harmonics that are no data (mains) left out of it."""
    if fit is None or all(other.run != loop.run for other in fit.loops):
        return float("nan"), float("nan")
    F = fit.predicted(loop)
    return curve(F, _POINTS), curve(np.where(loop.kept, loop.F - F, 0.0), _POINTS)


def _samples(runs: SortedRuns, stand: Mapping[str, str]) -> pd.DataFrame:
    parts = []
    for usable in (usable for usable in runs.loops if usable.run in stand):
        series = usable.series
        parts.append(pd.DataFrame({"run": usable.run, "displacement": series.x, "force": series.F}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def _half_cycles(runs: SortedRuns) -> pd.DataFrame:
    parts = []
    for usable in runs.half_cycles[:_HALF_CYCLES_KEPT]:
        step = max(usable.series.time.size // _SERIES, 1)
        x, F = usable.series.x[::step], usable.series.F[::step]
        parts.append(pd.DataFrame({"run": usable.run, "displacement": x - x[0], "force": F - F[0]}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def _residual_harmonics(fit: DynamicFit | None) -> pd.DataFrame:
    """Return the misfit of each harmonic over its standard deviation; of many runs with their own gains taken out."""
    if fit is None:
        return pd.DataFrame()
    parts = []
    for loop in fit.loops:
        error = normalised(fit, loop)
        order = np.arange(1, loop.F.size + 1)[loop.kept]
        parts.append(pd.DataFrame({"run": loop.run, "order": order, "real": error.real, "imaginary": error.imag}))
    return pd.concat(parts, ignore_index=True)


def _correlation(fit: DynamicFit | None, times: Sequence[TimeFit]) -> pd.DataFrame:
    source = fit if fit is not None else times[0] if times else None
    if source is None:
        return pd.DataFrame()
    table = pd.DataFrame(source.correlation, columns=list(source.names))
    table.insert(0, "name", list(source.names))
    table["condition"] = source.condition
    return table


def _model_lines(fit: DynamicFit | None) -> pd.DataFrame:
    """Return what the model says around the runs: over the frequency at their amplitude, and the other way round.

    Each point has the shape of the motion of the run next to it.

    Runs of one current that differ in `over` alone share a line. Beyond `_LINES` of them there is one line
    a current, at the median of what is held (`own` is false then).
    """
    if fit is None or fit.rejected:
        return pd.DataFrame()
    levels = np.array(fit.levels or (0.0,))
    runs = pd.DataFrame(
        {
            "current": [levels[np.abs(levels - (loop.current or 0.0)).argmin()] for loop in fit.loops],
            "frequency": [loop.frequency for loop in fit.loops],
            "amplitude": [loop.amplitude for loop in fit.loops],
            "loop": fit.loops,
        }
    )
    rows = []
    for over, held in (("frequency", "amplitude"), ("amplitude", "frequency")):
        order = runs.sort_values(["current", held])
        lines = [part for _, level in order.groupby("current") for part in _alike(level, held)]
        own = len(lines) <= _LINES
        if not own:
            lines = [level for _, level in order.groupby("current")]
        for number, part in enumerate(lines):
            low, high = (_BEYOND[0] * part[over].min(), _BEYOND[1] * part[over].max())
            points = _LINE_POINTS if high > 3 * low else _STROKE_POINTS
            current, kept = float(part["current"].iloc[0]), float(part[held].median())
            for value in np.geomspace(low, high, points).tolist():
                at = {held: kept, over: value}
                like = part.iloc[(part[over] - value).abs().argmin()]["loop"]
                found = fit.loop_at(like, at["amplitude"], at["frequency"])
                metrics = {name: found[name] for name in METRICS}
                rows.append({"over": over, "line": number, "own": own, "current": current, **at, **metrics})
    return pd.DataFrame(rows)


def _alike(runs: pd.DataFrame, held: str) -> list[pd.DataFrame]:
    """Part sorted runs so that `held` is the same within `_SAME` in each part, however close its neighbours lie."""
    starts = [0]
    values = runs[held].to_numpy(float)
    for place, value in enumerate(values):
        if value > _SAME * values[starts[-1]]:
            starts.append(place)
    return [runs.iloc[a:b] for a, b in pairwise([*starts, len(runs)])]


def _series(times: Sequence[TimeFit]) -> pd.DataFrame:
    """Return a stretch in the middle of the second half of each record, every sample, and the whole thinned."""
    parts = []
    for fit in times:
        for run, series in fit.series.items():
            n = series["time"].size
            start = min(int(0.75 * n), max(n - _SERIES, 0))
            part = pd.DataFrame({name: values[start : start + _SERIES] for name, values in series.items()})
            part.insert(0, "run", run)
            parts.append(part)
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def _preload_states(preloads: PreloadTable | None) -> pd.DataFrame:
    rows = []
    for state in preloads.states if preloads is not None else ():
        rows.append(
            {
                "preload": state.preload,
                "current": state.current,
                "frequency": state.frequency,
                "runs": ", ".join(state.runs),
                "amplitude": state.amplitude,
                "force_amplitude": state.force_amplitude,
                "equal_amplitude": state.equal_amplitude,
                "secant": state.secant.value,
                "secant_error": state.secant.std_error,
                "secant_equal": state.secant_equal.value,
                "secant_equal_error": state.secant_equal.std_error,
            }
        )
    return pd.DataFrame(rows)
