"""`mre.shear`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from pipeline.errors import InputError, listing
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.flux_levels import flux_table
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.model.leave_one_out import leave_one_out
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.model.other_optima import without_other_optima
from pipeline.rigs.mre.model.variants import DECISIVE, undecided
from pipeline.rigs.mre.pads import group_levels
from pipeline.rigs.mre.shear.arrays import arrays_of
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.shear.faults import mains_instead, say_faults, say_faults_of_fit, say_units
from pipeline.rigs.mre.shear.odd_among_many import odd_among, spells
from pipeline.rigs.mre.shear.odd_causes import told_causes
from pipeline.rigs.mre.shear.odd_runs import set_odd_runs_aside
from pipeline.rigs.mre.shear.operating import Held
from pipeline.rigs.mre.shear.parameters import (
    VARIANT_TEXTS,
    Labels,
    linear_parameters,
    loop_parameters,
    models_of,
    parameters_of,
)
from pipeline.rigs.mre.shear.preload import PreloadTable, preload_table, split_by_preload
from pipeline.rigs.mre.shear.published import published
from pipeline.rigs.mre.shear.records import RecordFits, fit_all_records
from pipeline.rigs.mre.shear.runs import sort_runs
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.mre.shear.systematic import with_systematic
from pipeline.rigs.mre.shear.trend import order_of, trend_of
from pipeline.rigs.mre.shear.unsteady import say_faults_of_records
from pipeline.rigs.mre.shear.untared_mass import weigh_mass
from pipeline.rigs.mre.shear.verdict import judge
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.over_runs import MANY

_LEAST_CYCLES = 1.95


def identify(recordings: Sequence[Recording], settings: ShearSettings, context: Context) -> Findings:
    """Identify a shear campaign.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    runs = sort_runs(recordings, settings, context.each)
    condemned = not runs.usable
    if condemned:
        if not runs.faulty:
            raise InputError(nothing_usable(runs.left_out, recordings))
        runs.loops = runs.faulty
    options = _options(settings, runs.held)
    unit, wrong_unit = say_units(runs)
    doubts = [*([unit] if unit and not wrong_unit else []), *say_faults(runs)]
    outcome = _Dynamic() if condemned else _dynamic(runs, options, settings)
    dynamic, fit = outcome.found, outcome.found.selected if outcome.found else None
    without = leave_one_out(fit, options) if fit is not None and len(fit.loops) > 1 else None
    preloads = _preloads(runs, fit)
    records = fit_all_records(runs, settings, options) if not runs.loops else RecordFits()
    if runs.loops and runs.records:
        for usable in list(runs.records):
            runs.set_aside(usable.run, f"no steady cycles ({usable.excitation.reason}), which the other runs have")
    trend = trend_of(runs, fit) if fit is not None else None
    of_fit, remarks = say_faults_of_fit(runs, fit, trend) if fit is not None else ([], [])
    doubts += of_fit
    doubts += say_faults_of_records(runs, records.fits)
    doubts += _undecided(dynamic) if dynamic is not None else []
    doubts += outcome.doubts
    judgement = judge(runs, fit, records.fits, doubts, remarks, condemned, unit if wrong_unit else "")
    labels = Labels.of(runs.held, fit)
    parameters = [
        *parameters_of(fit, records.fits, preloads, labels),
        *loop_parameters(runs, fit),
        *linear_parameters(runs, records.linear),
    ]
    if fit is not None and not fit.rejected:
        parameters = with_systematic(parameters, fit, options, trend, labels)
    return Findings(
        campaign=context.campaign,
        experiment="mre.shear",
        verdict=judgement.verdict,
        reasons=judgement.reasons,
        advice=judgement.advice,
        parameters=parameters,
        models=models_of(dynamic, without, records.fits),
        published=published(runs, preloads),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in runs.quality
        ],
        runs=_runs(runs, outcome.beside),
        arrays=arrays_of(
            runs, fit, without, records.fits, preloads, parameters, flux_table(held.flux for held in runs.held)
        ),
    )


def _undecided(dynamic: Identification) -> list[str]:
    chosen = dynamic.selected.variant
    rivals = undecided(dynamic.variants, chosen)
    if not rivals or dynamic.selected.rejected:
        return []
    return [
        f"These runs do not tell what the field changes: {', '.join(rivals)} fit as well as {chosen} (BIC within "
        f"{DECISIVE:g}). The parameters hold if {chosen} is right: {VARIANT_TEXTS[chosen]}."
    ]


def _options(settings: ShearSettings, held: Sequence[Held]) -> FitOptions:
    lag = settings.force_lag if settings.force_lag != "fit" else _told_by_runs("force_lag", "s", held)
    told = _told_by_runs("moving_mass", "kg", held) if settings.moving_mass == "auto" else None
    mass = settings.moving_mass if told is None else told
    return FitOptions(
        fit_lag=lag is None,
        force_lag=float(lag) if lag is not None else 0.0,
        fit_mass=mass == "fit",
        moving_mass=mass if isinstance(mass, float) else 0.0,
        mass_known=isinstance(mass, float),
        scatter=settings.run_scatter,
        current_tolerance=settings.current_tolerance,
        starts=settings.starts,
    )


def _told_by_runs(name: str, unit: str, held: Sequence[Held]) -> float | None:
    """Return a property of the rig that runs may tell; None where none does.

    Raises
    ------
    InputError
        If two runs tell it differently.
    """
    told = {one.run: float(v) for one in held if isinstance(v := one.conditions.get(name), int | float)}
    if not told:
        return None
    (first, value), *others = told.items()
    for run, other in others:
        if not math.isclose(other, value, rel_tol=1e-6):
            raise InputError(
                f"run '{first}' says {name} {value:g} {unit}, run '{run}' {other:g} {unit}: it belongs to the rig and is "
                f"one for all runs of a campaign. Correct it, set '{name}' in the recipe's settings, or make two campaigns."
            )
    return value


@dataclass
class _Dynamic:
    """The dynamic model as fitted, if it was; loops that do not enter it, with the reason; doubts."""

    found: Identification | None = None
    beside: dict[str, str] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)

    def put_beside(self, loops: Sequence[Loop], reason: str) -> None:
        self.beside.update({loop.run: f"loop metrics only, not in the dynamic fit: {reason}" for loop in loops})


def _dynamic(runs: SortedRuns, options: FitOptions, settings: ShearSettings) -> _Dynamic:
    """Fit the dynamic model to the loops of the preload that has most of them."""
    outcome = _Dynamic()
    loops = [usable.loop for usable in runs.loops if usable.loop is not None]
    if not loops:
        return outcome
    main, others = split_by_preload(loops)
    if others:
        outcome.put_beside(others, "it is at another preload than most runs, or its preload is not known")
        runs.say(
            "note",
            None,
            "runs at another or an unknown preload do not enter the dynamic fit: "
            f"{listing((loop.run for loop in others), 8)}.",
        )
    main = _settled_loops(_known_currents(main, runs, outcome), runs, outcome)
    if not main:
        return outcome
    try:
        found, doubts = (_of_many if len(main) > MANY else _of_few)(main, options, runs, outcome)
    except ValueError as error:
        runs.say("warning", None, f"the dynamic model was not fitted: {error}.")
        return outcome
    found = replace(found, selected=without_other_optima(found.selected))
    if found.selected.rejected:
        mains_instead(found.selected, main, options, settings.mains_frequency, runs)
    outcome.found = found
    outcome.doubts += doubts
    return outcome


def _of_few(
    loops: list[Loop], options: FitOptions, runs: SortedRuns, outcome: _Dynamic
) -> tuple[Identification, list[str]]:
    """Fit all loops, then look for sets of runs that contradict the others; return the fit and what is doubtful."""
    found, doubts = _with_mass(identify_loops(loops, options), loops, options, runs)
    found, odd, pair = set_odd_runs_aside(found, loops, options)
    for run in odd:
        runs.set_aside(run.run, run.reason, "force")
    if pair:
        said = _contradiction(pair)
        runs.say("warning", None, said, "force")
        outcome.doubts.append(said)
    if odd:
        left = {loop.run for loop in found.selected.loops}
        found, doubts = _with_mass(found, [loop for loop in loops if loop.run in left], options, runs)
    return found, doubts


def _of_many(
    loops: list[Loop], options: FitOptions, runs: SortedRuns, outcome: _Dynamic
) -> tuple[Identification, list[str]]:
    """Find the runs that contradict the others first, then fit the others in the order in which they were made."""
    odd = odd_among(loops, options)
    places, _ = order_of(runs.loops)
    place = dict(zip((usable.run for usable in runs.loops), places, strict=True))
    ordered = sorted(loops, key=lambda loop: place[loop.run])
    left = [loop for loop in ordered if loop.run not in set(odd.runs)]
    found, doubts = _with_mass(identify_loops(left, options), left, options, runs)
    aside = set(odd.runs)
    for loop in loops:
        if loop.run in aside:
            reason = f"it contradicts the other runs: {told_causes(loop, found.selected)}"
            runs.set_aside(loop.run, reason, "force")
    for first, last, number in spells([loop.run for loop in ordered], odd.runs):
        said = (
            f"{number} runs one after the other, {first} to {last}, contradict the others and are left out: something was "
            "different meanwhile (clamping, load cell, temperature)."
        )
        runs.say("warning", None, said, "force")
        outcome.doubts.append(said)
    if odd.conditions:
        said = f"Most runs at these conditions contradict the others: {odd.conditions}. They are used all the same."
        runs.say("warning", None, said, "force")
        outcome.doubts.append(said)
    return found, doubts


def _contradiction(rivals: Sequence[str]) -> str:
    *named, last = rivals
    if last.endswith("as a whole"):
        candidates = f"; the strongest candidates: {listing(named)}" if named else ""
        return f"The runs as a whole do not agree{candidates}."
    return f"Runs {listing(rivals)} contradict each other; which of them is wrong cannot be told."


def _with_mass(
    found: Identification, loops: list[Loop], options: FitOptions, runs: SortedRuns
) -> tuple[Identification, list[str]]:
    """Add an untared mass where the data ask for it; return the fit and what is doubtful."""
    decided = weigh_mass(found, loops, options)
    if decided.mass is not None:
        runs.say(
            "warning",
            None,
            f"the force contains the inertia of an untared mass of {decided.mass:.3g} kg; it is fitted along. Weigh platelet "
            "and rod and set 'moving_mass' in the recipe.",
            "force",
        )
    return decided.found, [decided.doubt] if decided.doubt else []


def _settled_loops(loops: list[Loop], runs: SortedRuns, outcome: _Dynamic) -> list[Loop]:
    """Leave out loops of so few cycles that the steady state cannot be seen."""
    short = [loop for loop in loops if loop.duration * loop.frequency < _LEAST_CYCLES]
    if short:
        outcome.put_beside(short, "less than two cycles")
        said = f"less than two cycles in {listing((loop.run for loop in short), 6)}"
        runs.say(
            "warning",
            None,
            f"{said}: whether the loop has settled cannot be seen, so that the model is not fitted to them. Log more cycles.",
        )
        outcome.doubts.append(f"Not in the dynamic fit: {said}.")
    return [loop for loop in loops if loop not in short]


def _known_currents(loops: list[Loop], runs: SortedRuns, outcome: _Dynamic) -> list[Loop]:
    """Leave out loops without a current where others have one: their field terms are unknown."""
    unknown = [loop for loop in loops if loop.current is None]
    if not unknown or len(unknown) == len(loops):
        return loops
    outcome.put_beside(unknown, "its coil current is not known")
    said = f"no coil current is known of {listing((loop.run for loop in unknown), 6)}"
    runs.say("warning", None, f"{said}: they do not enter the dynamic fit; give 'coil_current'.")
    outcome.doubts.append(f"Not in the dynamic fit: {said}.")
    return [loop for loop in loops if loop.current is not None]


def _preloads(runs: SortedRuns, fit: DynamicFit | None) -> PreloadTable | None:
    """Compare stiffness over preloads: runs that say so, else frequencies that several preloads share."""
    known = [u.loop for u in runs.loops if u.loop is not None and u.preload is not None and u.current is not None]
    chosen = [u.loop for u in runs.loops if u.loop is not None and u.test == "preload" and u.loop in known]
    if not chosen and known:
        labels, _ = group_levels([loop.frequency for loop in known], 0.1)
        by_frequency: dict[int, set[float]] = {}
        for loop, label in zip(known, labels, strict=True):
            by_frequency.setdefault(label, set()).add(round(loop.preload or 0.0, -1))
        chosen = [loop for loop, label in zip(known, labels, strict=True) if len(by_frequency[label]) > 1]
    return preload_table(fit, chosen) if len(chosen) > 1 else None


def _runs(runs: SortedRuns, beside: Mapping[str, str]) -> list[Run]:
    reasons = {**beside, **runs.left_out}
    return [Run(run=r.run, used=r.run not in runs.left_out, reason=reasons.get(r.run, "")) for r in runs.held]
