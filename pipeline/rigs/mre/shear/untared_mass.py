"""Whether the force holds the inertia of a mass that was not tared, or the runs' gains scatter (mre.md step 6).

Both leave the loops of different frequencies at odds with each other; the likelihood decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.estimation.estimate import undetermined
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.model.many import standing_for
from pipeline.rigs.mre.model.variants import DECISIVE

# It takes two frequencies at one current to tell a mass from a stiffness, and runs beyond that to believe it.
_FREQUENCY_RATIO, _FEWEST = 1.2, 4


@dataclass(frozen=True)
class MassDecision:
    """The fit to go on with; the mass (kg) that it holds or None; a doubt in words where the data do not decide."""

    found: Identification
    mass: float | None = None
    doubt: str = ""


def weigh_mass(found: Identification, loops: Sequence[Loop], options: FitOptions) -> MassDecision:
    """Add the inertia of an untared mass to the model where the data ask for it.

    `found` is the fit without it. The rivals are the mass in place of the run scatter, and both. A rival
    that is better by `DECISIVE` in BIC is taken; where it is as good, `doubt` says what hangs on it.
    """
    fit = found.selected
    if options.fit_mass or options.mass_known or not _can_be_told(fit) or fit.dof < 1:
        return MassDecision(found)
    few = [loops[i] for i in standing_for(loops, fit.layout.labels)] if len(loops) == len(fit.loops) else list(loops)
    if len(few) < len(
        loops
    ):  # where some that stand for all neither ask for a mass nor leave it open, all need not be asked
        decided = weigh_mass(identify_loops(few, options), few, options)
        if decided.mass is None and not decided.doubt:
            return MassDecision(found)
    in_place_of_scatter = fit.run_scatter > 0 or fit.rejected
    tried = (False, True) if in_place_of_scatter and options.scatter else (options.scatter,)
    rivals = [rival for rival in (_with_mass(loops, options, scatter) for scatter in tried) if rival]
    if not rivals:
        return MassDecision(found)
    rival = min(rivals, key=_bic)
    mass = float(rival.selected.one("moving_mass").value or 0.0)
    gain = _bic(found) - _bic(rival)
    if fit.rejected or gain > DECISIVE:
        return MassDecision(rival, mass)
    # One more coefficient always fits a little better; one in place of the scatter does not.
    instead = any(entry.name == "run_scatter" and not entry.determined for entry in rival.selected.estimates)
    if gain > (-DECISIVE if instead else 0.0):
        return MassDecision(found, doubt=_doubt(found, rival, mass))
    return MassDecision(found)


def _can_be_told(fit: DynamicFit) -> bool:
    """Whether some current was run at several frequencies."""
    if len(fit.loops) < _FEWEST:
        return False
    at_level: dict[int, list[float]] = {}
    for loop, level in zip(fit.loops, fit.layout.labels, strict=True):
        at_level.setdefault(level, []).append(loop.frequency)
    return any(max(found) > _FREQUENCY_RATIO * min(found) for found in at_level.values())


def _with_mass(loops: Sequence[Loop], options: FitOptions, scatter: bool) -> Identification | None:
    """Return the fit with a mass, None where there is no such fit or no mass in it."""
    try:
        heavier = identify_loops(loops, replace(options, fit_mass=True, scatter=scatter))
    except ValueError:  # too few data for one more parameter
        return None
    fit = heavier.selected
    mass = fit.one("moving_mass")
    if fit.rejected or mass.ci95 is None or mass.ci95[0] <= 0:
        return None
    if scatter or not options.scatter or len(loops) < 2:
        return heavier
    open_ = undetermined("run_scatter", "the untared mass explains what differs from run to run; no scatter was fitted")
    return replace(heavier, selected=replace(fit, estimates=(*fit.estimates, open_)))


def _bic(found: Identification) -> float:
    return next(v.bic for v in found.variants if v.variant == found.selected.variant)


def _doubt(found: Identification, rival: Identification, mass: float) -> str:
    lighter, heavier = found.selected.one("k2"), rival.selected.one("k2")
    moved = ""
    if lighter.value is not None and heavier.value is not None:
        moved = f"; k2 would be {100 * (heavier.value / lighter.value - 1):+.2g} %"
    scatter = found.selected.run_scatter
    other = f"a gain error from run to run ({100 * scatter:.2g} %)" if scatter > 0 else "noise"
    return (
        f"These runs do not tell {other} from an untared mass of {mass:.2g} kg{moved}. The parameters hold if there is no "
        "such mass: weigh platelet and rod and set 'moving_mass' in the recipe (0 kg where the force is tared)."
    )
