"""Runs that contradict all others: found by leaving each out, set aside, and told with what explains them.

A gain error, a late force, a swapped current label or a bent signal of one run spoils the fit of all
(mre.md section 8); without it the others agree. Nothing is set aside unless they do.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.mre.dynamic_fit import DynamicFit
from pipeline.rigs.mre.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.leave_one_out import leave_one_out
from pipeline.rigs.mre.loop import Loop

# So many runs must stay for each that is set aside, and so many at least.
_STAY_PER_ODD, _FEWEST = 5, 4
# A run stands out whose gain is this much, and this many robust standard deviations, off the others; to
# be set aside, the scatter of the others must be less than this share of the scatter with it.
_GAIN_SIZE, _GAIN_APART, _CALMER = 0.01, 6.0, 0.5
# Another run is a rival where chi2 without it is less than that without the odd run over this.
_RIVAL = 0.4
# An explanation holds that leaves less than this share of the misfit.
_EXPLAINED = 0.3


@dataclass(frozen=True)
class OddRun:
    """A run set aside, and in one sentence why."""

    run: str
    reason: str


def set_odd_runs_aside(
    found: Identification, loops: Sequence[Loop], options: FitOptions
) -> tuple[Identification, tuple[OddRun, ...], tuple[str, ...]]:
    """Return the identification without the runs that contradict the others, those runs, and rivals.

    `loops` are those that `found` was made from. Where no few runs explain the contradiction, or others
    would explain it as well (these are the rivals), `found` comes back as it is.
    """
    best, kept = found, list(loops)
    odd: list[Loop] = []
    most = (len(kept) - _FEWEST + _STAY_PER_ODD - 1) // _STAY_PER_ODD
    while len(odd) < most and (name := _suspect(best.selected, options)) is not None:
        trial = [loop for loop in kept if loop.run != name]
        try:
            without = identify_loops(trial, options)
        except ValueError:  # too few data are left
            break
        calmer = without.selected.run_scatter < _CALMER * best.selected.run_scatter
        if not best.selected.rejected and (without.selected.rejected or not calmer):
            break
        odd += [loop for loop in kept if loop.run == name]
        best, kept = without, trial
    if best.selected.rejected or not odd:
        return found, (), ()
    for loop in odd:
        rivals = _rivals(loop, kept, best.selected, options)
        if rivals:
            return found, (), (loop.run, *rivals)
    reasons = tuple(OddRun(loop.run, _reason(loop, best.selected, found.selected)) for loop in odd)
    return best, reasons, ()


def _rivals(odd: Loop, kept: Sequence[Loop], fit: DynamicFit, options: FitOptions) -> tuple[str, ...]:
    """Return the runs whose absence would make the others agree about as well as that of `odd`."""
    plain = replace(options, scatter=False, variants=(fit.variant,) if len(fit.levels) > 1 else options.variants)
    together = identify_loops([*kept, odd], plain).selected
    without = leave_one_out(together, plain).chi2_without
    limit = max(without[odd.run], 1.0) / _RIVAL
    return tuple(run for run, chi2 in without.items() if run != odd.run and chi2 < limit)


def _suspect(fit: DynamicFit, options: FitOptions) -> str | None:
    """Return the run that stands out most, if one does."""
    if len(fit.loops) <= _FEWEST:
        return None
    if fit.rejected:
        without = {run: c for run, c in leave_one_out(fit, options).chi2_without.items() if np.isfinite(c)}
        return min(without, key=lambda run: without[run], default=None)
    names = list(fit.gain_by_run)
    gains = np.array([fit.gain_by_run[name] for name in names])
    apart = np.zeros(gains.size)
    for i in range(gains.size):
        others = np.delete(gains, i)
        middle = float(np.median(others))
        spread = max(1.4826 * float(np.median(np.abs(others - middle))), 1e-3)
        off = abs(gains[i] - middle)
        apart[i] = off / spread if off > _GAIN_SIZE else 0.0
    return names[int(np.argmax(apart))] if apart.max() > _GAIN_APART else None


def _reason(loop: Loop, fit: DynamicFit, before: DynamicFit) -> str:
    if before.rejected:
        gained = (
            f"without it chi2 per degree of freedom of the other runs falls from {before.chi2 / max(before.dof, 1):.3g} "
            f"to {fit.chi2 / max(fit.dof, 1):.3g}"
        )
    else:
        gained = (
            f"without it the scatter of the other runs falls from {100 * before.run_scatter:.2g} % to "
            f"{100 * fit.run_scatter:.2g} %"
        )
    return f"it contradicts the other runs: {_explanation(loop, fit)}; {gained}"


def _explanation(loop: Loop, fit: DynamicFit) -> str:
    """Tell what turns the others' prediction into the measured force: a gain, a lag, or another current."""
    known = loop.current is None or abs(fit.levels[fit.level_of(loop.current)] - loop.current) < 0.25
    if not known:
        return f"no other run is at {loop.current:g} A to tell why"
    kept = loop.kept
    F, expected = loop.F[kept], fit.predicted(loop)[kept]
    angular = loop.omega * (np.flatnonzero(kept) + 1)

    def missed(force: np.ndarray) -> float:
        return float(np.linalg.norm(F - force) / np.linalg.norm(F))

    gain = float(np.vdot(expected, F).real / np.vdot(expected, expected).real)
    late = -cmath.phase(np.vdot(expected[:1], F[:1])) / float(angular[0])
    direction = "later" if late > 0 else "earlier"
    tried = {
        f"its force is {100 * (gain - 1):+.1f} % off (gain of the load cell, or another preload)": missed(
            gain * expected
        ),
        f"its force comes {1e6 * abs(late):.0f} us {direction} than theirs": missed(
            expected * np.exp(-1j * angular * late)
        ),
    }
    for level in fit.levels if loop.current is not None else ():
        if abs(level - (loop.current or 0.0)) > 0.25:
            text = f"it goes with the runs at {level:.3g} A but is labelled {loop.current:.3g} A"
            tried[text] = missed(fit.force(loop.X, loop.frequency, level)[kept])
    likely = min(tried, key=lambda text: tried[text])
    whole = missed(expected)
    if tried[likely] < _EXPLAINED * whole:
        return likely
    return (
        f"{100 * whole:.2g} % of its force (rms) is not as they predict, and no gain, lag or other current explains it"
    )
