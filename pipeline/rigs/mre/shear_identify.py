"""`mre.shear`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.dynamic_fit import DynamicFit
from pipeline.rigs.mre.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.leave_one_out import leave_one_out
from pipeline.rigs.mre.loop import Loop, group_levels
from pipeline.rigs.mre.preload import PreloadTable, preload_table, split_by_preload
from pipeline.rigs.mre.shear import ShearSettings
from pipeline.rigs.mre.shear_arrays import arrays_of
from pipeline.rigs.mre.shear_faults import say_faults
from pipeline.rigs.mre.shear_parameters import Labels, loop_parameters, models_of, parameters_of
from pipeline.rigs.mre.shear_published import published
from pipeline.rigs.mre.shear_runs import SortedRuns, UsableRun, sort_runs
from pipeline.rigs.mre.shear_verdict import judge
from pipeline.rigs.mre.time_columns import Record
from pipeline.rigs.mre.time_fit import TimeFit, fit_records
from pipeline.rigs.mre.time_model import TimeOptions

# What a mass column must gain in BIC before an untared mass is believed.
_MASS_GAIN = 10.0
# chi2 per degree of freedom beyond which one is looked for.
_MISFIT_OF_MASS = 1.5


def identify(recordings: Sequence[Recording], settings: ShearSettings, context: Context) -> Findings:
    """Identify a shear campaign.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    runs = sort_runs(recordings, settings)
    if not runs.usable:
        told = "; ".join(f"{run}: {reason}" for run, reason in runs.left_out.items())
        raise InputError(f"campaign '{context.campaign}': no run can be used. {told}.")
    options = _options(settings, recordings)
    dynamic, others = _dynamic(runs, options, settings)
    fit = dynamic.selected if dynamic else None
    without = leave_one_out(fit, options) if fit is not None and len(fit.loops) > 1 else None
    preloads = _preloads(runs, fit)
    times = _records(runs, settings) if not runs.loops else []
    if runs.loops and runs.records:
        names = ", ".join(usable.run for usable in runs.records)
        runs.say(
            "note", None, f"the dynamic model is that of the steady loops; records without a period only: {names}."
        )
    odd = say_faults(runs, recordings, fit, without)
    judgement = judge(runs, fit, times, odd)
    if others:
        names = ", ".join(loop.run for loop in others)
        runs.say("note", None, f"runs of another preload do not enter the dynamic fit: {names}.")
    labels = Labels.of(recordings, fit)
    return Findings(
        campaign=context.campaign,
        experiment="mre.shear",
        verdict=judgement.verdict,
        reasons=judgement.reasons,
        advice=judgement.advice,
        parameters=[*parameters_of(fit, times, preloads, labels), *loop_parameters(runs, fit)],
        models=models_of(dynamic, without, times),
        published=published(runs, preloads),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in runs.quality
        ],
        runs=_runs(recordings, runs),
        arrays=arrays_of(runs, fit, without, times, preloads),
    )


def _options(settings: ShearSettings, recordings: Sequence[Recording]) -> FitOptions:
    lags = {r.conditions["force_lag"] for r in recordings if isinstance(r.conditions.get("force_lag"), float)}
    lag = settings.force_lag if settings.force_lag != "fit" else next(iter(lags)) if len(lags) == 1 else None
    return FitOptions(
        fit_lag=lag is None,
        force_lag=float(lag) if lag is not None else 0.0,
        fit_mass=settings.moving_mass == "fit",
        moving_mass=settings.moving_mass if isinstance(settings.moving_mass, float) else 0.0,
        scatter=settings.run_scatter,
        current_tolerance=settings.current_tolerance,
        starts=settings.starts,
    )


def _dynamic(
    runs: SortedRuns, options: FitOptions, settings: ShearSettings
) -> tuple[Identification | None, list[Loop]]:
    """Fit the dynamic model to the loops of the preload that has most of them; return the others beside it."""
    loops = [usable.loop for usable in runs.loops if usable.loop is not None]
    if not loops:
        return None, []
    main, others = split_by_preload(loops)
    main = _known_currents(main, runs)
    try:
        found = identify_loops(main, options)
    except ValueError as error:
        runs.say("warning", None, f"the dynamic model was not fitted: {error}.")
        return None, others
    plain = next(v for v in found.variants if v.variant == found.selected.variant)
    if settings.moving_mass == "auto" and plain.chi2 > _MISFIT_OF_MASS * plain.dof:
        heavier = identify_loops(main, replace(options, fit_mass=True))
        mass = heavier.selected.one("moving_mass")
        gain = _bic(found) - _bic(heavier)
        if gain > _MASS_GAIN and mass.ci95 is not None and mass.ci95[0] > 0:
            runs.say(
                "warning",
                None,
                f"the force contains the inertia of an untared mass of {mass.value:.3g} kg (BIC better by {gain:.0f}); "
                "it is fitted along. Weigh platelet and rod and set 'moving_mass'.",
                "force",
            )
            found = heavier
    return found, others


def _bic(found: Identification) -> float:
    return next(v.bic for v in found.variants if v.variant == found.selected.variant)


def _known_currents(loops: list[Loop], runs: SortedRuns) -> list[Loop]:
    """Leave out loops without a current where others have one: their field terms are unknown."""
    unknown = [loop.run for loop in loops if loop.current is None]
    if unknown and len(unknown) < len(loops):
        runs.say(
            "warning",
            None,
            f"no coil current is known of {', '.join(unknown)}: they do not enter the dynamic fit; give "
            "'coil_current'.",
        )
        return [loop for loop in loops if loop.current is not None]
    return loops


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


def _records(runs: SortedRuns, settings: ShearSettings) -> list[TimeFit]:
    """Fit records without a period, one current after the other."""
    labels, levels = group_levels([usable.current for usable in runs.records], settings.current_tolerance)
    fits = []
    for level in range(len(levels)):
        members = [usable for usable, label in zip(runs.records, labels, strict=True) if label == level]
        fits.append(fit_records([_record(usable) for usable in members], _time_options(settings, members)))
    return fits


def _record(usable: UsableRun) -> Record:
    series = usable.series
    return Record(usable.run, series.time, series.x, series.F, usable.current)


def _time_options(settings: ShearSettings, members: list[UsableRun]) -> TimeOptions:
    return TimeOptions(
        cutoff=settings.cutoff,
        viscous=bool(members[0].current),
        fit_lag=settings.force_lag == "fit",
        force_lag=settings.force_lag if isinstance(settings.force_lag, float) else 0.0,
        fit_mass=settings.moving_mass == "fit",
        starts=settings.starts,
    )


def _runs(recordings: Sequence[Recording], runs: SortedRuns) -> list[Run]:
    return [Run(run=r.run, used=r.run not in runs.left_out, reason=runs.left_out.get(r.run, "")) for r in recordings]
