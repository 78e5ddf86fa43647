"""Records without a period (random, chirp): the model fitted in time, and spring and damper of a linear device."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from pipeline.errors import listing
from pipeline.estimation.estimate import undetermined
from pipeline.rigs.mre.model.harmonic_fit import FitOptions
from pipeline.rigs.mre.model.linear_equivalent import LinearEquivalent, linear_equivalent
from pipeline.rigs.mre.model.time_columns import Record
from pipeline.rigs.mre.model.time_fit import TimeFit, fit_records
from pipeline.rigs.mre.model.time_model import TimeOptions
from pipeline.rigs.mre.pads import group_levels
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun


@dataclass(frozen=True)
class RecordFits:
    """Fits in time, one a current, and the equivalent spring and damper of the runs that are linear."""

    fits: list[TimeFit] = field(default_factory=list)
    linear: list[LinearEquivalent] = field(default_factory=list)


def fit_all_records(
    runs: SortedRuns, settings: ShearSettings, options: FitOptions, viscous: bool | None = None
) -> RecordFits:
    """Fit records without a period, one current after the other; `viscous` as in `TimeOptions`, None: with a field."""
    labels, levels = group_levels([usable.current for usable in runs.records], settings.current_tolerance)
    found = RecordFits()
    for level in range(len(levels)):
        members = [usable for usable, label in zip(runs.records, labels, strict=True) if label == level]
        records = [_record(usable) for usable in members]
        fit = fit_records(records, _time_options(settings, options, members, viscous))
        equivalents = [linear_equivalent(record, settings.cutoff) for record in records]
        linear = [e for e in equivalents if e is not None and e.nrmse < _no_worse_than(fit, e.run)]
        found.fits.append(_of_linear_device(fit) if len(linear) == len(records) else fit)
        found.linear.extend(linear)
    if found.linear:
        worst = max(equivalent.nrmse for equivalent in found.linear)
        runs.say(
            "note",
            None,
            f"a spring and a damper alone, F = K x + C v, meet {listing((e.run for e in found.linear), 6)} as well as the "
            f"dynamic model does, to {100 * worst:.2g} % of the force (rms): K and C are told per run.",
        )
    return found


def _no_worse_than(fit: TimeFit, run: str) -> float:
    """Return the misfit below which BIC prefers spring and damper to the many parameters of the model."""
    effective = max(fit.n_data * fit.effective_fraction, 2.0)
    spared = max(fit.n_parameters - 3, 1)  # K, C and one offset stay
    return fit.nrmse_by_run[run] * math.exp(0.5 * spared * math.log(effective) / effective)


def _of_linear_device(fit: TimeFit) -> TimeFit:
    """Take back what a fit of more branches than the device has says of them, the lag among it."""
    reason = "a spring and a damper alone meet the record as well; see stiffness_storage and damping of the run"
    estimates = tuple(undetermined(e.name, f"{e.name} is not determined: {reason}", e.at) for e in fit.estimates)
    return replace(
        fit,
        estimates=estimates,
        undetermined=fit.names,
        statements=(f"The branches of the dynamic model are not determined: {reason}.",),
        at_bound=(),
        inadmissible=(),
    )


def _record(usable: UsableRun) -> Record:
    series = usable.series
    return Record(usable.run, series.time, series.x, series.F, usable.current, series.counts)


def _time_options(
    settings: ShearSettings, options: FitOptions, members: list[UsableRun], viscous: bool | None
) -> TimeOptions:
    return TimeOptions(
        cutoff=settings.cutoff,
        viscous=bool(members[0].current) if viscous is None else viscous,
        fit_lag=options.fit_lag,
        force_lag=options.force_lag,
        fit_mass=options.fit_mass,
        moving_mass=options.moving_mass,
        mains=settings.mains_frequency,
        starts=settings.starts,
    )
