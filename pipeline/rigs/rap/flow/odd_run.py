"""A calibration run whose meter contradicts all others: left out of the fit and named, not averaged in (rap.md, 5.8)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.calibration import LAWS, solve, usable
from pipeline.rigs.rap.flow.sets import CALIBRATION, Sets
from pipeline.rigs.rap.flow.windows import FlowWindows

# It takes that many runs to tell which is the odd one; it is off by that share, and the rest fits so many times better without it.
_RUNS, _OFF, _BETTER = 3, 0.05, 5.0


def without_odd_run(windows: FlowWindows, sets: Sets) -> Sets:
    """Return the sets without a calibration run that the others agree to contradict by E3; as they are where there is none."""
    inside = usable(LAWS["E3"], windows.of(sets.label == CALIBRATION))
    runs = list(dict.fromkeys(inside.run))
    if len(runs) < _RUNS:
        return sets
    whole = _rms(_errors(inside, inside))
    rest = {run: inside.of(inside.run != run) for run in runs}
    misfit = {run: _rms(_errors(part, part)) for run, part in rest.items()}
    odd = min(misfit, key=misfit.__getitem__)
    error = float(np.mean(_errors(rest[odd], inside.of(inside.run == odd))))
    if not (abs(error) > _OFF and _BETTER * misfit[odd] < whole):
        return sets
    meter = 1.0 / (1.0 + error)
    text = (
        f"its flow meter reads {meter:.3g} times what E3 of the other {len(runs) - 1} calibration runs tells, which agree within {100 * misfit[odd]:.2g} %: it is not "
        "calibrated on. Look at the meter's range and scale in this run"
    )
    label = np.where(windows.run == odd, "", sets.label)
    problem = QualityFinding("warning", text, str(odd), "blood_flow_bench")
    return replace(sets, label=label.astype(object), problems=(*sets.problems, problem))


def _errors(fitted: FlowWindows, tried: FlowWindows) -> np.ndarray:
    """Return E3's relative errors on windows with its coefficients of others, shape (w,)."""
    return np.asarray(LAWS["E3"].columns(tried) @ solve(LAWS["E3"], fitted) / tried.flow - 1.0)


def _rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else float("nan")
