"""What no scatter between runs shows and the intervals must hold (type B): a filter behind the lag, a trend over the campaign.

Each comes as a standard uncertainty beside the fit; which of the two readings is right the logs do not tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Parameter
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, refit
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.shear.parameters import Labels
from pipeline.rigs.mre.shear.trend import Trend
from pipeline.rigs.mre.shear.unsteady import LAG_SAID

# What goes with the gain of the force.
_SCALED = {"k1", "s1", "k2", "alpha_bw", "k_mr", "s_mr", "k1_plus_k2", "k2_plus_alpha_rho", "moving_mass"}
_OF_LOOPS = {"stiffness_secant", "stiffness_storage", "damping", "shear_modulus_storage", "shear_modulus_loss"}
# Relative uncertainty that a filter adds to a loop and that is no trifle.
_LEAST_DROOP = 1e-5

Key = tuple[str, tuple[tuple[str, object], ...]]


def droop_suspected(fit: DynamicFit) -> bool:
    """Tell whether a filter in place of a shift of the clocks would move k1 by more than its error.

    A first-order filter of the same delay also lowers its signal, by (omega lag)^2 / 2.
    """
    lag, k1 = fit.force_lag, next((e for e in fit.estimates if e.name == "k1" and e.std_error is not None), None)
    if fit.held_lag is not None or lag.value is None or abs(lag.value) <= LAG_SAID or k1 is None:
        return False
    quick = max(fit.loops, key=lambda loop: loop.frequency)
    off = 0.5 * (quick.omega * lag.value) ** 2 * abs(quick.F[0] / quick.X[0])
    return bool(off >= 2 * (k1.std_error or 0.0))


def with_systematic(
    parameters: Sequence[Parameter], fit: DynamicFit, options: FitOptions, trend: Trend | None, labels: Labels
) -> list[Parameter]:
    """Widen parameters by what a suspected filter would move them, and by half of a trend."""
    more: dict[Key, float] = {}
    droop = droop_suspected(fit)
    if droop:
        for e, shift in _moved_by_filter(fit, options):
            more[_key(e.name, labels.at(dict(e.at)))] = abs(shift)
    told = []
    for p in parameters:
        own = more.get(_key(p.name, p.at), 0.0)
        if droop and "run" in p.at and p.name in _OF_LOOPS and p.value is not None:
            own = 0.5 * (2 * math.pi * float(p.at["frequency"]) * (fit.force_lag.value or 0.0)) ** 2 * abs(p.value)
        if trend is not None and p.name in _SCALED and "run" not in p.at and p.value is not None:
            own = math.hypot(own, 0.5 * trend.total * abs(p.value))
        told.append(_widened(p, own))
    return told


def _moved_by_filter(fit: DynamicFit, options: FitOptions) -> list[tuple[Estimate, float]]:
    """Return each estimate and by how much it moves if the lag is that of a first-order filter of the force (or of x)."""
    lag = float(fit.force_lag.value or 0.0)

    def restored(loop: Loop) -> Loop:
        turn = 1j * np.arange(1, loop.F.size + 1) * loop.omega * abs(lag)
        gain = (1 + turn) * np.exp(-turn)  # the shift stays for the fit to find
        return replace(loop, F=loop.F * (gain if lag > 0 else 1 / gain))

    try:
        other = refit(fit, [restored(loop) for loop in fit.loops], options)
    except ValueError:
        return []
    known = {_key(e.name, dict(e.at)): e.value for e in other.estimates}
    moved = []
    for e in fit.estimates:
        value = known.get(_key(e.name, dict(e.at)))
        if e.value is not None and value is not None and e.name not in ("force_lag", "run_scatter"):
            moved.append((e, value - e.value))
    return moved


def _widened(p: Parameter, more: float) -> Parameter:
    if p.value is None or p.std_error is None or p.ci95 is None or more <= _LEAST_DROOP * abs(p.value):
        return p
    reach = t_quantile(math.inf) * more
    low, high = (math.hypot(end - p.value, reach) for end in p.ci95)
    return p.model_copy(
        update={
            "std_error": math.hypot(p.std_error, more),
            "type_b": math.hypot(p.type_b or 0.0, more),
            "ci95": (p.value - low, p.value + high),
        }
    )


def _key(name: str, at: Mapping[str, object]) -> Key:
    return name, tuple(sorted(at.items()))
