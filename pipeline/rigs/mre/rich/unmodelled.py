"""What a record shows that the model does not hold (a curved sensor, a hardening pad, a gain that changes): named, and
the intervals widened by what it would shift. Nothing is corrected: which of the causes it is, one record cannot tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.mre.model.time_evidence import DISPLACEMENT, LOAD_CELL, PAD, Evidence
from pipeline.rigs.mre.model.time_fit import TimeFit

# Standard errors from which on a cause is seen; the least change of gain; and which share of what the best cause
# explains another must explain to be seen besides, and to be as likely.
_SURE, _GAIN_SEEN, _BESIDES, _AS_LIKELY = 5.0, 1e-3, 0.2, 0.8
_LOGARITHMS = ("tau", "rho")


def causes(fit: TimeFit) -> dict[str, Evidence]:
    """Return what is sure to be seen in the residual, by cause, the likeliest first; a gain by the name of its run."""
    found = {name: e for name, e in fit.curves.items() if e.times_error > _SURE}
    found |= {run: e for run, e in fit.gain_change.items() if e.times_error > _SURE and abs(e.size) > _GAIN_SEEN}
    if fit.viscous.times_error > _SURE and "s_mr" not in fit.names:
        found["dashpot"] = fit.viscous
    most = max((e.share for e in found.values()), default=0.0)
    kept = {name: e for name, e in found.items() if e.share >= _BESIDES * most}
    return dict(sorted(kept.items(), key=lambda pair: -pair[1].share))


def curved(fit: TimeFit) -> str:
    """Return the doubt that a cubic in the residual throws on a record, empty where there is none."""
    found = {name: e for name, e in causes(fit).items() if name in fit.curves}
    if not found:
        return ""
    best = next(iter(found.values()))
    likely = [_words(name, e) for name, e in found.items() if e.share >= _AS_LIKELY * best.share]
    return (
        f"the residual follows the cube of the displacement or of the force ({best.times_error:.2g} times its error; "
        f"{100 * best.share:.2g} % of the squared residual): {', or '.join(likely)}. The numbers are those of a model "
        "without it; their intervals are widened by what it would shift. Check the sensors' calibration curves."
    )


def _words(name: str, found: Evidence) -> str:
    much = "much" if found.size > 0 else "little"
    if name == PAD:
        return f"a pad that {'hardens' if found.size > 0 else 'softens'}, k3 = {found.size:.2g} N/m^3"
    sensors = {LOAD_CELL: "a load cell", DISPLACEMENT: "a displacement sensor"}
    return f"{sensors[name]} that reads {100 * abs(found.size):.2g} % too {much} at the largest excursion"


def widened(fit: TimeFit) -> TimeFit:
    """Return the fit with covariance and intervals widened by what the causes that are seen would shift."""
    found = causes(fit)
    if not found:
        return fit
    units = np.array([fit.values[i] if name in _LOGARITHMS else 1.0 for i, name in enumerate(fit.names)])
    # Causes that are alike explain the same residual: the largest shift counts, not their sum.
    shift = max((e.shift * units for e in found.values()), key=lambda s: float(np.max(np.abs(s) / _sd(fit))))
    by_name = dict(zip(fit.names, np.max([np.abs(e.shift * units) for e in found.values()], axis=0), strict=True))
    signed = dict(zip(fit.names, shift, strict=True))
    errors = replace(fit.errors, covariance=fit.errors.covariance + np.outer(shift, shift))
    return replace(fit, estimates=tuple(_wider(e, fit, by_name, signed) for e in fit.estimates), errors=errors)


def _sd(fit: TimeFit) -> np.ndarray:
    return np.sqrt(np.diag(fit.errors.covariance))


def _wider(e: Estimate, fit: TimeFit, largest: Mapping[str, float], signed: Mapping[str, float]) -> Estimate:
    values = dict(zip(fit.names, fit.values.tolist(), strict=True))
    if e.value is None or not e.std_error or e.name in fit.at_bound:
        return e
    if e.name in largest:
        moved = largest[e.name]
    elif e.name == "s1":
        moved = float(np.hypot(largest["k1"] * values["tau"], values["k1"] * largest["tau"]))
    elif e.name == "k1_plus_k2":
        moved = signed["k1"] + signed["k2"]
    elif e.name == "k2_plus_alpha_rho":
        moved = signed["k2"] + signed["alpha_bw"] * values["rho"] + values["alpha_bw"] * signed["rho"]
    else:
        return e
    error = float(np.hypot(e.std_error, moved))
    return estimate(e.name, e.value, error, dof=e.dof, at=e.at, logarithmic=e.name in _LOGARITHMS, reason=e.reason)
