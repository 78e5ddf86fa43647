"""Tables that tell whether the dynamic model holds: agreement by run, tests of the residual, law of the field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.estimation.residuals import chi_square, normality, runs_test, whiteness
from pipeline.findings import Parameter
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.model.loop_noise import effective_sd
from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.shear.parameters import run_metrics
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.over_runs import MANY

METRICS = ("stiffness_secant", "stiffness_storage", "damping", "loss_factor")
_RECORDS_TESTED = 4


def agreement(runs: SortedRuns, fit: DynamicFit | None) -> pd.DataFrame:
    """Return each run's metrics over those of the model for the same motion, with the measured interval."""
    rows = []
    fitted = {loop.run for loop in fit.loops} if fit is not None and not fit.rejected else set()
    for usable in runs.loops:
        if fit is None or usable.loop is None or usable.run not in fitted:
            continue
        lag = fit.force_lag.value or 0.0
        modelled = {
            e.name: e.value for e in loop_metrics(replace(usable.loop, F=fit.predicted(usable.loop)), force_lag=lag)
        }
        for metric in run_metrics(usable, fit):
            model = modelled.get(metric.name)
            if metric.name in METRICS and metric.value is not None and metric.ci95 is not None and model:
                low, high = sorted(limit / model for limit in metric.ci95)
                ratio = metric.value / model
                rows.append({"run": usable.run, "metric": metric.name, "ratio": ratio, "low": low, "high": high})
    return pd.DataFrame(rows)


def normalised(fit: DynamicFit, loop: Loop) -> np.ndarray:
    """Return the misfit of each kept harmonic over its standard deviation, complex; of many runs with their own gains taken out."""
    gain = fit.gain_by_run[loop.run] if len(fit.loops) > MANY else 0.0
    return np.asarray(((loop.F - (1 + gain) * fit.predicted(loop)) / effective_sd(loop))[loop.kept])


def residual_checks(fit: DynamicFit | None, times: Sequence[TimeFit]) -> pd.DataFrame:
    """Return the tests of what the fits leave over."""
    rows = []
    if fit is not None:
        left = np.concatenate([normalised(fit, loop) for loop in fit.loops])
        parts = np.concatenate([left.real, left.imag])
        checks = [chi_square(fit.chi2, fit.dof), normality(parts)]
        rows += [{"of": "all harmonics", "name": c.name, "p_value": c.p_value, "verdict": c.verdict} for c in checks]
    series = [(run, values) for time_fit in times for run, values in time_fit.series.items()]
    for run, values in series[:_RECORDS_TESTED]:
        residual = values["force"] - values["model"]
        checks = [whiteness(residual), runs_test(residual)]
        rows += [{"of": run, "name": c.name, "p_value": c.p_value, "verdict": c.verdict} for c in checks]
    return pd.DataFrame(rows)


def field_laws(parameters: Sequence[Parameter]) -> pd.DataFrame:
    """Hold k_MR and s_MR against a straight line through zero: is saturation seen up to the largest current?

    At least two currents are needed. The interval's half width is taken as two standard errors.
    """
    rows = []
    for name in ("k_mr", "s_mr"):
        found = [
            (float(p.at["coil_current"]), float(p.value), (p.ci95[1] - p.ci95[0]) / 4)
            for p in parameters
            if p.name == name and p.value is not None and p.ci95 is not None and p.at.get("coil_current")
        ]
        if len(found) < 2:
            continue
        current, value, sd = np.array(sorted(found)).T
        sd = np.maximum(sd, 1e-12 * np.abs(value).max())
        slope = float((current * value / sd**2).sum() / (current**2 / sd**2).sum())
        off = (value - slope * current) / sd
        check = chi_square(float(off @ off), current.size - 1)
        rise = (value[-1] - value[-2]) / (current[-1] - current[-2]) / (value[0] / current[0])
        if check.p_value >= 0.01:
            verdict = f"straight up to {current[-1]:g} A within its errors, saturation is not reached"
        elif rise < 0.7:
            verdict = f"bends: the last step rises {100 * rise:.0f} % as steeply as the first, so saturation begins"
        else:
            verdict = (
                f"not quite straight (last step {100 * rise:.0f} % as steep as the first), saturation is not reached"
            )
        rows.append({"name": name, "slope": slope, "verdict": verdict, "p_value": check.p_value})
    return pd.DataFrame(rows)
