"""Loops that run the wrong way round, as if the sample gave energy: what likely turned them (mre.md section 8).

A wrong sign puts the phase near 180 deg at every frequency, a late force turns it in proportion to
frequency, swapped channels make compliance of stiffness. What samples are too few for is an alias.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import listing
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.shear.sampling import may_be_alias, rate_of
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun

# "Stiffness" (N/m) of swapped channels, or as a share of that of the other runs.
_COMPLIANCE, _COMPLIANCE_SHARE = 10.0, 1e-3
# Phases (rad) that samples have: of most, and of those whose sign is wrong, short of 180 deg.
_LOSS_ANGLE, _USUAL_LOSS = 0.6, 0.15
# How far phases may lie off those of a delay, and the ratio of frequencies that tells one.
_PHASE_APART, _FREQUENCIES_APART = 0.2, 1.2
_LONGEST_DELAY = 0.5  # s


@dataclass(frozen=True)
class _Delay:
    """A delay of the force (s, negative where early) and the phase (rad) of the sample beside it."""

    seconds: float
    phase: float

    def said(self) -> str:
        word = "late" if self.seconds > 0 else "early"
        return f"{word} by about {_milliseconds(abs(self.seconds))}"


def runs_backward(loop: Loop, force_lag: float = 0.0) -> bool:
    """Tell whether a loop gives energy by more than its error, its force set right by a known lag (s)."""
    area = next(e for e in loop_metrics(loop, force_lag=force_lag) if e.name == "loop_area")
    return area.value is not None and area.value < -2 * (area.std_error or 0.0)


def say_backward(runs: SortedRuns) -> None:
    """Leave out the loops that run the wrong way round, each with its likely cause.

    A force that is late in these and in all other runs alike makes all of them useless.
    """
    backward = [usable for usable in runs.backward if usable.loop is not None]
    if not backward:
        return
    turned: list[UsableRun] = []
    for usable in backward:
        cause = _alias(usable) or _swapped(usable, runs)
        if cause:
            _leave_out(runs, usable, cause)
        else:
            turned.append(usable)
    if not turned:
        return
    wrong_sign = [usable for usable in turned if 0 <= _phase(usable) + math.pi < _LOSS_ANGLE]
    late = None if len(wrong_sign) == len(turned) and _alike(wrong_sign) else delay_of([*turned, *runs.loops])
    if late is not None:
        _all_late(runs, turned, late)
        return
    signs_alike = _alike(wrong_sign)
    others = [usable for usable in turned if not (usable in wrong_sign and signs_alike)]
    together = delay_of(others)
    for usable in turned:
        if usable not in others:
            _leave_out(runs, usable, _sign(usable, wrong_sign))
        elif together is not None:
            _leave_out(runs, usable, _told_delay(together, others))
        else:
            _leave_out(runs, usable, _some_delay(usable, runs))


def delay_of(usables: Sequence[UsableRun]) -> _Delay | None:
    """Return the delay that turns the phases of several frequencies; None where none does, or one frequency only."""
    loops = [usable.loop for usable in usables if usable.loop is not None]
    if not loops or max(lp.frequency for lp in loops) < _FREQUENCIES_APART * min(lp.frequency for lp in loops):
        return None
    omega = np.array([loop.omega for loop in loops])
    phase = np.array([float(np.angle(loop.F[0] / loop.X[0])) for loop in loops])
    step = 0.1 * _PHASE_APART / omega.max()
    trial = step * np.arange(-round(_LONGEST_DELAY / step), round(_LONGEST_DELAY / step) + 1)
    turned = np.exp(1j * (phase[:, None] + omega[:, None] * trial))
    middle = np.angle(turned.mean(axis=0))
    apart = np.abs(np.angle(turned * np.exp(-1j * middle))).max(axis=0)
    fits = (apart < _PHASE_APART) & (middle > 0) & (middle < _LOSS_ANGLE)
    if not fits.any():
        return None
    start = trial[fits][int(np.argmin(np.abs(trial[fits])))]
    nearby = fits & (np.abs(trial - start) < 2 * math.pi / omega.max() / 2)
    best = int(np.flatnonzero(nearby)[np.argmin(apart[nearby])])
    return _Delay(float(trial[best]), float(middle[best]))


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f} ms" if seconds > 0.01 else f"{1e3 * seconds:.2g} ms"


def _phase(usable: UsableRun) -> float:
    assert usable.loop is not None
    return float(np.angle(usable.loop.F[0] / usable.loop.X[0]))


def _alike(usables: Sequence[UsableRun]) -> bool:
    """Tell whether phases are those of one sample, whatever the frequency."""
    phases = [_phase(usable) for usable in usables]
    return bool(phases) and max(phases) - min(phases) < 2 * _PHASE_APART


def _leave_out(runs: SortedRuns, usable: UsableRun, cause: str) -> None:
    assert usable.loop is not None
    area = next(e.value for e in loop_metrics(usable.loop) if e.name == "loop_area")
    runs.leave_out(
        usable.run,
        f"the loop runs the wrong way round (area {area:.3g} J: the sample would give energy), {cause}",
        "force",
    )
    runs.faulty.append(usable)


def _alias(usable: UsableRun) -> str:
    assert usable.loop is not None
    if not may_be_alias(usable, usable.loop.frequency):
        return ""
    rate = rate_of(usable)
    return (
        f"and it is logged at only {rate:.4g} samples a second: most likely the alias of a motion faster than {rate / 2:.3g} Hz, "
        "which runs backwards. Log faster, and give 'frequency'"
    )


def _swapped(usable: UsableRun, runs: SortedRuns) -> str:
    def ratio(loop: Loop) -> float:
        return float(abs(loop.F[0] / loop.X[0]))

    assert usable.loop is not None
    own, others = ratio(usable.loop), [ratio(u.loop) for u in runs.loops if u.loop is not None]
    if own > _COMPLIANCE and not (others and own < _COMPLIANCE_SHARE * float(np.median(others))):
        return ""
    return f"and force over displacement is {own:.2g} N/m: most likely they are swapped. Mend the channels' names in the recipe"


def _sign(usable: UsableRun, alike: Sequence[UsableRun]) -> str:
    frequencies = [u.loop.frequency for u in alike if u.loop is not None]
    several = max(frequencies) > _FREQUENCIES_APART * min(frequencies)
    at = f"at {listing(dict.fromkeys(f'{f:.3g} Hz' for f in sorted(frequencies)), 4)} alike" if several else "here"
    or_clock = (
        ""
        if several
        else f", unless the clocks are offset by about half a period ({_milliseconds(0.5 / frequencies[0])})"
    )
    return (
        f"the force falls as the displacement rises (phase {math.degrees(_phase(usable)):.0f} deg, {at}): most likely the sign of "
        f"one of them is wrong{or_clock}. Mend the recipe ('sign: -1')"
    )


_MEND_CLOCK = (
    "Mend the clocks, filter both channels alike, or calibrate the delay with a rigid link in place of the sample and set "
    "'force_lag'"
)


def _told_delay(delay: _Delay, usables: Sequence[UsableRun]) -> str:
    ordered = sorted((u.loop.frequency, _phase(u)) for u in usables if u.loop is not None)
    (low, first), (high, last) = ordered[0], ordered[-1]
    return (
        f"and its phase turns with frequency as that of a delay ({math.degrees(first):.0f} deg at {low:.3g} Hz, "
        f"{math.degrees(last):.0f} deg at {high:.3g} Hz): the force is {delay.said()} (a filter, or clocks that are offset). "
        f"{_MEND_CLOCK}"
    )


def _some_delay(usable: UsableRun, runs: SortedRuns) -> str:
    assert usable.loop is not None
    usual = [_phase(u) for u in runs.loops if u.loop is not None]
    period = 1 / usable.loop.frequency
    turned = ((float(np.median(usual)) if usual else _USUAL_LOSS) - _phase(usable)) % (2 * math.pi)
    late = turned / usable.loop.omega
    return (
        f"with a phase of {math.degrees(_phase(usable)):.0f} deg: the force is late by about {_milliseconds(late)} (a filter, or "
        f"clocks that are offset) or early by about {_milliseconds(period - late)}, give or take whole periods; one frequency "
        f"does not tell. {_MEND_CLOCK}"
    )


def _all_late(runs: SortedRuns, turned: Sequence[UsableRun], delay: _Delay) -> None:
    """Leave out all runs: what turns some loops backward is in the others as well."""
    first, *others = turned
    _leave_out(runs, first, _told_delay(delay, [*turned, *runs.loops]))
    for usable in others:
        _leave_out(runs, usable, f"as that of run {first.run}: the force of all runs is {delay.said()}")
    for usable in list(runs.loops):
        runs.set_aside(
            usable.run,
            f"the force of all runs is {delay.said()}, by which the loop of run {first.run} runs the wrong way round",
            "force",
        )
        runs.faulty.append(replace(usable, wander=None))
