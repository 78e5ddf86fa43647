"""Faults that only the whole campaign shows (mre.md section 8): each named with run, size and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import counted, listing
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, identify_loops
from pipeline.rigs.mre.model.loop import N_F, Loop, curve, half_range
from pipeline.rigs.mre.shear.check import MODULUS_RANGE
from pipeline.rigs.mre.shear.labels import say_labels
from pipeline.rigs.mre.shear.operating import Held
from pipeline.rigs.mre.shear.sampling import say_coarse
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.mre.shear.systematic import droop_suspected
from pipeline.rigs.mre.shear.trend import Trend, gains_of_fit, say_changes, say_trend
from pipeline.rigs.mre.shear.unsteady import LAG_SAID, say_unsteady
from pipeline.rigs.over_runs import MANY

_REMANENCE = 5e-3  # T
_PRELOAD_CHANGE = 0.1
# Share of the stroke within 10 % of the largest force that no visco-elastic loop has, and the least friction
# coefficient at which pads slide.
_PLATEAU, _LEAST_FRICTION = 0.25, 0.1
# A gain error from run to run that good rigs do not have.
_LARGE_SCATTER = 0.012


def say_faults(runs: SortedRuns) -> list[str]:
    """Add what the loops alone show to the quality of `runs`; return what casts doubt on the numbers."""
    doubts = [
        *say_labels(runs),
        say_coarse(runs),
        *say_unsteady(runs),
        say_varying(runs.held, runs),
        _shape(runs),
        _slip(runs),
        say_preload_by_field(runs, runs.held),
        say_remanence(runs, runs.held),
    ]
    return [doubt for doubt in doubts if doubt]


def say_faults_of_fit(runs: SortedRuns, fit: DynamicFit, trend: Trend | None) -> tuple[list[str], list[str]]:
    """Add what a fit shows; return what casts doubt on the numbers, and what else is to be told.

    A rejected fit shows no more than a `trend`.
    """
    many = len(fit.loops) > MANY
    if fit.rejected:
        told = say_trend(runs, trend)
        return ([told] if told else []), []
    found = gains_of_fit(runs, fit) if many else None
    changes = say_changes(runs, found) if found is not None else [say_trend(runs, trend)]
    scatter = fit.run_scatter if found is None else found.course.scatter
    doubts = [_lag(runs, fit), _mass(fit), *changes]
    if many or not any(changes):
        doubts.append(_scatter(fit, scatter, many))
    odd = found.odd_sentence() if found is not None else ""
    if odd:
        runs.say("note", None, odd, "force")
    return [doubt for doubt in doubts if doubt], [odd] if odd else []


def mains_instead(fit: DynamicFit, loops: Sequence[Loop], options: FitOptions, mains: float, runs: SortedRuns) -> None:
    """Say where a rejected fit would be accepted without the harmonics on another mains frequency."""
    for other in {50.0, 60.0} - {mains}:
        orders = np.arange(1, N_F + 1)
        spared = [
            replace(loop, kept=loop.kept & (np.abs((loop.frequency * orders + other / 2) % other - other / 2) > 2 / loop.duration))
            for loop in loops
        ]  # fmt: skip
        try:
            without = identify_loops(spared, options)
        except ValueError:
            continue
        if not without.selected.rejected:
            runs.say(
                "warning",
                None,
                f"the misfit lies on multiples of {other:g} Hz, without which it falls from {times_noise(fit.chi2 / max(fit.dof, 1))} to "
                f"{times_noise(without.selected.chi2 / max(without.selected.dof, 1))}: mains hum? "
                f"Set 'mains_frequency: {other:g}' in the recipe.",
                "force",
            )


def _lag(runs: SortedRuns, fit: DynamicFit) -> str:
    """Say how late or early the force is, and doubt stiffness that a filter would bias and no shift of clocks does.

    A first-order filter of the same delay also lowers its signal, by (omega lag)^2 / 2.
    """
    lag = fit.force_lag
    if lag.value is None or abs(lag.value) <= LAG_SAID or fit.held_lag is not None:
        return ""
    late, filtered = ("late", "force") if lag.value > 0 else ("early", "displacement")
    runs.say(
        "warning",
        None,
        f"the force is {abs(lag.value) * 1e6:.0f} us {late} against the displacement; the fit and the loops account for "
        "it. Calibrate it with a rigid link in place of the pads.",
        "force",
    )
    if not droop_suspected(fit):
        return ""
    quick = max(fit.loops, key=lambda loop: loop.frequency)
    droop = 0.5 * (quick.omega * lag.value) ** 2
    off = droop * abs(quick.F[0] / quick.X[0])
    return (
        f"That the force is {abs(lag.value) * 1e6:.0f} us {late} is taken for a shift of the clocks. If it is that of a filter "
        f"of the {filtered} (conditioner, anti-alias), stiffness at {quick.frequency:.3g} Hz is off by {100 * droop:.2g} %, {off:.2g} N/m, which is more than the error of "
        "k1: the intervals hold that. Calibrate it with a rigid link and set 'force_lag'."
    )


def say_units(runs: SortedRuns) -> tuple[str, bool]:
    """Say where the loops mean a shear modulus that no elastomer has; tell whether a factor 1000 explains it.

    Then the unit is wrong, and with it every number of the campaign.
    """
    moduli = [
        abs(u.loop.F[0] / u.loop.X[0]) * u.pads.modulus_per_stiffness
        for u in runs.loops
        if u.loop is not None and u.pads is not None
    ]
    if not moduli and runs.loops:
        told = (
            "Without the size of the pads nothing tells whether force and displacement are in their units: a factor 1000 (N "
            "for kN) would pass unseen. State pad_diameter and pad_height, or hold the stiffness against what you expect."
        )
        runs.say("note", None, told, "force")
    if not moduli or MODULUS_RANGE[0] <= (middle := float(np.median(moduli))) <= MODULUS_RANGE[1]:
        return "", False
    low = middle < MODULUS_RANGE[0]
    likely = "displacement looks like mm taken as m, or force like kN taken as N" if low else (
        "displacement looks like m taken as mm, or force like N taken as kN"
    )  # fmt: skip
    told = (
        f"The loops mean a shear modulus of {middle / 1e6:.2g} MPa, and elastomers have {MODULUS_RANGE[0] / 1e6:g} to "
        f"{MODULUS_RANGE[1] / 1e6:g} MPa: {likely} (factor 1000), or the pad size has a wrong unit."
    )
    runs.say("warning", None, told, "displacement")
    return told, MODULUS_RANGE[0] <= middle * (1e3 if low else 1e-3) <= MODULUS_RANGE[1]


def say_varying(held: Sequence[Held], runs: SortedRuns) -> str:
    """Doubt runs during which the coil was not held at one current or voltage."""
    found: dict[str, str] = {}
    used = {usable.run for usable in runs.usable}
    for one in held:
        for channel, unit, least in (("current", "A", 0.25), ("voltage", "V", 0.5)):
            if one.run in used and channel in one.ranges and one.run not in found:
                low, high = one.ranges[channel]
                if high - low > max(least, 0.1 * abs(low + high)):
                    found[one.run] = f"coil {channel} runs from {low:.2g} to {high:.2g} {unit}"
                    message = f"the {found[one.run]} during the run; the model holds for one operating point."
                    runs.say("warning", one.run, message, channel)
    if not found:
        return ""
    run, told = next(iter(found.items()))
    more = f", and {counted(len(found) - 1, 'more run')} likewise" if len(found) > 1 else ""
    return f"Run {run} is no single operating point: the {told}{more}, while the model knows one only."


def _shape(runs: SortedRuns) -> str:
    """Sum up what of the loops' form the model cannot follow."""
    told = [
        ("the mean displacement drifts", "drifts by"),
        ("the force is asymmetric", "asymmetric force"),
        ("the force has an offset, which does not enter", "force offset"),
    ]
    marked = {words: [q.run for q in runs.quality if q.run is not None and sign in q.message] for words, sign in told}
    grave = marked["the mean displacement drifts"] or marked["the force is asymmetric"]
    if not grave:
        return ""
    parts = [f"{words} ({listing(names, 4)})" for words, names in marked.items() if names]
    return f"The loops are not what the model assumes: {'; '.join(parts)}."


def _slip(runs: SortedRuns) -> str:
    """Say what friction the pads need, and doubt loops with a plateau of force at high need."""
    needed = {
        usable.run: half_range(usable.loop.F) / (2 * usable.preload)
        for usable in runs.loops
        if usable.loop is not None and usable.preload and usable.preload > 0 and usable.pads is not None
    }
    worst = max(needed, key=lambda run: needed[run], default=None)
    if worst is None:
        return ""
    sliding = [
        u.run
        for u in runs.loops
        if u.loop is not None and needed.get(u.run, 0.0) > _LEAST_FRICTION and _plateau(u.loop) > _PLATEAU
    ]
    if sliding:
        run = max(sliding, key=lambda name: needed[name])
        runs.say(
            "warning",
            run,
            f"the force stays on a plateau at F_max/(2 N) = {needed[run]:.2f} while the displacement goes on: the loop may "
            "contain sliding of a pad, which the Bouc-Wen term would absorb. Raise the preload or lower the amplitude.",
            "force",
        )
        return f"Loops of {listing(sliding, 6)} may contain sliding of a pad (plateau of the force)."
    if needed[worst] > 0.5:
        count = sum(value > 0.5 for value in needed.values())
        runs.say(
            "note",
            worst,
            f"without slip the pads need a friction coefficient of {needed[worst]:.2f} here (F_max/(2 N), above 0.5 in "
            f"{count} run{'s' if count > 1 else ''}). No plateau of force is seen; sliding would be absorbed by the "
            "Bouc-Wen term.",
            "force",
        )
    return ""


def _plateau(loop: Loop) -> float:
    """Return over which share of the stroke the force stays within 10 % of its largest value."""
    x, F = curve(loop.X), curve(loop.F)
    shares = []
    for sign in (1.0, -1.0):
        top = sign * F > 0.9 * float((sign * F).max())
        shares.append(float(np.ptp(x[top]) / np.ptp(x)))
    return min(shares)


def say_preload_by_field(runs: SortedRuns, held: Sequence[Held]) -> str:
    """Say where the field changed the axial load that the label gives for 0 A."""
    worst, change, measured = None, 0.0, 0.0
    for one in held:
        preload = one.conditions.get("preload")
        if "force_axial" in one.means and isinstance(preload, float) and preload > 0:
            load = one.means["force_axial"]
            if abs(load / preload - 1) > max(_PRELOAD_CHANGE, abs(change)):
                worst, change, measured = one.run, load / preload - 1, load
    if worst is None:
        return ""
    runs.say(
        "warning",
        worst,
        f"the axial load is {measured:.0f} N, {100 * change:+.0f} % off the preload set at 0 A: at a held gap the "
        "field presses the pads. Stiffness increments contain that.",
        "force_axial",
    )
    return f"The axial load differs from the set preload by up to {100 * change:+.0f} %; increments contain that."


def say_remanence(runs: SortedRuns, held: Sequence[Held]) -> str:
    """Say where flux stays without current, and return that as a doubt; empty where none does."""
    left: dict[str, float] = {}
    for one in held:
        if "flux_density" in one.means and one.conditions.get("coil_current") == 0:
            field = one.means["flux_density"]
            if abs(field) > _REMANENCE:
                left[one.run] = field
                runs.say(
                    "warning",
                    one.run,
                    f"{1e3 * field:.1f} mT remain at 0 A: demagnetise, and mind the order of the runs.",
                    "flux_density",
                )
    return (
        f"Up to {1e3 * max(left.values(), key=abs):.1f} mT remain at 0 A: these are no runs without field."
        if left
        else ""
    )


def _mass(fit: DynamicFit) -> str:
    mass = next((e.value for e in fit.estimates if e.name == "moving_mass"), None)
    return f"The force was not tared for a moving mass of {mass:.3g} kg, which was fitted along." if mass else ""


def _scatter(fit: DynamicFit, scatter: float, many: bool) -> str:
    if not scatter > _LARGE_SCATTER:
        return ""
    if many and fit.scatter.at_cap:
        return (
            f"The force scatters from run to run by {100 * scatter:.1f} %, and no more than {100 * fit.run_scatter:.1f} % is believed: "
            "intervals may be too narrow. Runs of different samples, clampings or gains may be mixed."
        )
    return (
        f"The force scatters by {100 * scatter:.1f} % from run to run; intervals allow for it, but no run can be told "
        "right from wrong. Repeat runs, and check the load cell's mounting."
    )
