"""Runs of other preloads, and the MR effect at equal force and at equal amplitude (mre.md T6).

The dynamic fit belongs to one preload. A run at another one keeps its shape (tau, rho, C, n, lag, k1,
alpha_bw) and gets a stiffness and a viscous coefficient of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.loop import Loop, half_range
from pipeline.rigs.mre.model.loop_noise import effective_sd
from pipeline.rigs.mre.pads import group_levels
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics

# Force amplitudes that differ by less count as equal.
_EQUAL_FORCE = 0.05
_CURRENT_TOLERANCE = 0.25
# So many repeats of one state tell how the model's numbers there follow its parameters.
_REPEATS = 6


@dataclass(frozen=True, eq=False)
class PreloadState:
    """Stiffness at one preload (N), current (A) and frequency (Hz).

    Attributes
    ----------
    amplitude, force_amplitude
        Of the measured loops, m and N (half peak-to-peak).
    secant
        Measured F_max/x_max, N/m.
    static
        k2 + k_MR of the model at this preload and current, N/m.
    secant_equal
        Secant stiffness at `equal_amplitude`, that of the run with the least current at this preload
        and frequency: measured secant times the ratio that the model gives between the amplitudes.
    """

    preload: float
    current: float
    frequency: float
    runs: tuple[str, ...]
    amplitude: float
    force_amplitude: float
    equal_amplitude: float
    secant: Estimate
    static: Estimate
    secant_equal: Estimate


@dataclass(frozen=True, eq=False)
class PreloadTable:
    """States by preload, frequency and current, and what the field adds relative to the least current.

    `effects` are `mr_effect_force` and `mr_effect_amplitude` at {"coil_current", "preload"}.
    """

    states: tuple[PreloadState, ...]
    effects: tuple[Estimate, ...]


def split_by_preload(loops: Sequence[Loop], tolerance: float = 25.0) -> tuple[list[Loop], list[Loop]]:
    """Return the loops of the preload with most runs (the dynamic fit takes them) and the others.

    Loops without a preload are a group of their own. Of groups of one size the lower preload wins.
    """
    known = [loop for loop in loops if loop.preload is not None]
    labels, levels = group_levels([loop.preload for loop in known], tolerance)
    groups = [[loop for loop, label in zip(known, labels, strict=True) if label == g] for g in range(len(levels))]
    groups.append([loop for loop in loops if loop.preload is None])
    largest = max(groups, key=len)
    return largest, [loop for loop in loops if not any(loop is other for other in largest)]


def preload_table(fit: DynamicFit | None, loops: Sequence[Loop], tolerance: float = 25.0) -> PreloadTable:
    """Compare currents at equal force and at equal amplitude, per preload and frequency.

    `loops` are those of T6, each with its preload and current; without a `fit` only what is measured
    directly is told.
    """
    usable = [loop for loop in loops if loop.preload is not None and loop.current is not None]
    p_label, preloads = group_levels([loop.preload for loop in usable], tolerance)
    i_label, currents = group_levels([loop.current for loop in usable], _CURRENT_TOLERANCE)
    f_label, frequencies = group_levels([loop.frequency for loop in usable], 0.1)
    members: dict[tuple[int, int, int], list[Loop]] = {}
    for loop, p, f, i in zip(usable, p_label, f_label, i_label, strict=True):
        members.setdefault((p, f, i), []).append(loop)
    states: list[PreloadState] = []
    effects: list[Estimate] = []
    for p, f in sorted({key[:2] for key in members}):
        group: list[PreloadState] = []
        for i in sorted(key[2] for key in members if key[:2] == (p, f)):
            equal = group[0].amplitude if group else None
            at = (preloads[p], currents[i], frequencies[f])
            group.append(_state(fit, members[p, f, i], at, equal))
        states += group
        effects += [effect for state in group[1:] for effect in _effects(group[0], state)]
    return PreloadTable(tuple(states), tuple(effects))


def _state(
    fit: DynamicFit | None, loops: list[Loop], at: tuple[float, float, float], equal: float | None
) -> PreloadState:
    preload, current, frequency = at
    lag = fit.force_lag if fit is not None else None
    scatter = fit.run_scatter if fit is not None else 0.0
    rows = [
        {
            e.name: e
            for e in loop_metrics(
                loop,
                force_lag=(lag.value or 0.0) if lag is not None else 0.0,
                force_lag_sd=(lag.std_error or 0.0) if lag is not None else 0.0,
                run_scatter=scatter,
                scatter_dof=fit.scatter.dof if fit is not None else math.inf,
            )
        }
        for loop in loops
    ]

    def mean(name: str) -> tuple[float, float, float]:
        values = [row[name] for row in rows]
        sd = math.sqrt(sum((e.std_error or 0.0) ** 2 for e in values)) / len(values)
        return float(np.mean([e.value for e in values])), sd, values[0].dof

    where: dict[str, float | str | bool] = {"preload": preload, "coil_current": current}
    secant = estimate("stiffness_secant", *mean("stiffness_secant")[:2], dof=mean("stiffness_secant")[2], at=where)
    amplitude = mean("amplitude")[0]
    equal = amplitude if equal is None else equal
    static, secant_equal = _by_model(fit, loops, secant, equal, where)
    return PreloadState(
        preload=preload,
        current=current,
        frequency=frequency,
        runs=tuple(loop.run for loop in loops),
        amplitude=amplitude,
        force_amplitude=mean("force_amplitude")[0],
        equal_amplitude=equal,
        secant=secant,
        static=static,
        secant_equal=secant_equal,
    )


def _by_model(
    fit: DynamicFit | None,
    loops: list[Loop],
    secant: Estimate,
    equal: float,
    where: dict[str, float | str | bool],
) -> tuple[Estimate, Estimate]:
    """Return the static stiffness and the secant stiffness at the equal amplitude."""
    if fit is None or fit.rejected:
        reason = "needs the dynamic model, which was not identified" if fit is None else "the dynamic model is rejected"
        return undetermined("k_static", reason, where), undetermined("stiffness_secant", reason, where)
    scatter, number = fit.run_scatter, math.sqrt(len(loops))
    some = [loops[i] for i in sorted({round(at) for at in np.linspace(0, len(loops) - 1, min(len(loops), _REPEATS))})]

    def static_of(values: np.ndarray) -> float:
        return float(np.mean([_own_terms(fit, loop, values)[0] for loop in some]))

    _, sd, dof = fit.errors.through(static_of, fit.values)
    terms = [_own_terms(fit, loop, fit.values) for loop in loops]
    value = float(np.mean([stiffness for stiffness, _, _ in terms]))
    own = float(np.mean([spread for _, spread, _ in terms])) / number
    gain = scatter * abs(secant.value or 0.0) / number
    static = estimate("k_static", value, math.sqrt(sd**2 + own**2 + gain**2), dof=min(dof, secant.dof), at=where)

    def ratio_of(values: np.ndarray) -> float:
        return float(np.mean([_secant_ratio(fit, loop, values, equal) for loop in some]))

    ratio, ratio_sd, _ = fit.errors.through(ratio_of, fit.values)
    measured, measured_sd = float(secant.value or 0.0), float(secant.std_error or 0.0)
    total = math.hypot(ratio * measured_sd, measured * ratio_sd)
    return static, estimate("stiffness_secant", ratio * measured, total, dof=secant.dof, at=where)


def _shared_force(fit: DynamicFit, X: np.ndarray, frequency: float, values: np.ndarray) -> np.ndarray:
    """Return the force of the terms that preload and current leave alone: k1 u + alpha w [+ mass]."""
    reference = fit.levels[fit.layout.reference]
    held = values.copy()
    held[fit.names.index("k2")] = 0.0
    return fit.force(X, frequency, reference, held)


def _own_columns(fit: DynamicFit, loop: Loop, X: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the columns of stiffness and viscous damping, late by the lag, shape (N_F, 2)."""
    lag = float(values[4]) if fit.held_lag is None else fit.held_lag
    angular = loop.omega * np.arange(1, loop.F.size + 1)
    full = np.zeros(loop.F.size, dtype=complex)
    full[: X.size] = X
    late = np.exp(-1j * angular * lag)
    return np.stack([full * late, 1j * angular * full * late], axis=1)


def _own_terms(fit: DynamicFit, loop: Loop, values: np.ndarray) -> tuple[float, float, float]:
    """Return a loop's own stiffness (N/m), its error from the noise, and its viscous coefficient."""
    A = _own_columns(fit, loop, loop.X, values)[loop.kept]
    rest = (loop.F - _shared_force(fit, loop.X, loop.frequency, values))[loop.kept]
    weight = 1 / effective_sd(loop)[loop.kept]
    A, rest = A * weight[:, None], rest * weight
    rows = np.concatenate([A.real, A.imag])
    information = np.linalg.inv(rows.T @ rows)
    own = information @ rows.T @ np.concatenate([rest.real, rest.imag])
    return float(own[0]), math.sqrt(information[0, 0]), float(own[1])


def _secant_ratio(fit: DynamicFit, loop: Loop, values: np.ndarray, equal: float) -> float:
    """Return the modelled secant stiffness at the equal amplitude over that at the loop's own."""
    stiffness, _, viscous = _own_terms(fit, loop, values)
    secants = []
    for X in (loop.X * (equal / loop.amplitude), loop.X):
        F = _shared_force(fit, X, loop.frequency, values)
        F = F + _own_columns(fit, loop, X, values) @ np.array([stiffness, viscous])
        secants.append(half_range(F) / half_range(X))
    return secants[0] / secants[1]


def _effects(least: PreloadState, state: PreloadState) -> list[Estimate]:
    """Return the relative gain of stiffness over the least current, at equal force and equal amplitude."""
    where: dict[str, float | str | bool] = {"coil_current": state.current, "preload": state.preload}
    if abs(state.force_amplitude / least.force_amplitude - 1) > _EQUAL_FORCE:
        reason = (
            f"force amplitudes differ: {least.force_amplitude:.1f} N at {least.current:g} A and "
            f"{state.force_amplitude:.1f} N at {state.current:g} A"
        )
        at_force = undetermined("mr_effect_force", reason, where)
    else:
        at_force = _gain("mr_effect_force", least.secant, state.secant, where)
    if state.secant_equal.value is None:
        return [at_force, undetermined("mr_effect_amplitude", state.secant_equal.reason, where)]
    return [at_force, _gain("mr_effect_amplitude", least.secant, state.secant_equal, where)]


def _gain(name: str, low: Estimate, high: Estimate, where: dict[str, float | str | bool]) -> Estimate:
    a, b = float(low.value or 0.0), float(high.value or 0.0)
    sd = b / a * math.hypot((low.std_error or 0.0) / a, (high.std_error or 0.0) / b)
    return replace(estimate(name, b / a - 1, sd, dof=min(low.dof, high.dof)), at=where)
