"""Both methods on one record: the batch fit in time, and the joint filter along the same samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import undetermined
from pipeline.rigs.mre.model.harmonic_fit import FitOptions
from pipeline.rigs.mre.model.linear_equivalent import LinearEquivalent
from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.rich.declaration import RichSettings
from pipeline.rigs.mre.rich.excitation import Reach, reach_of
from pipeline.rigs.mre.rich.joint_filter import Start
from pipeline.rigs.mre.rich.online import Online
from pipeline.rigs.mre.rich.online_verdict import CONVERGED, MOVING, OnlineVerdict, judge_online
from pipeline.rigs.mre.rich.unmodelled import widened
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.shear.records import fit_all_records
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun
from pipeline.signals.filtering import low_pass

# A mass is looked for where the residual holds one of so many standard errors, and kept where it is known that well and
# the gain of the force does not change besides: a chirp confounds the two at first.
_MASS_SEEN, _MASS_SURE, _GAIN_STEADY = 4.0, 5.0, 1e-3
# A mass predicts the second half from the first as well as it meets the first; a gain that steps does not.
_HALVES_AGREE = 1.3
# A dashpot beside the others is seen from so many standard errors on, and taken where BIC wants it.
DASHPOT_SURE, _BIC_SURE = 5.0, 10.0
_MAXWELL = {"k1", "s1", "tau", "k2", "s_mr", "force_lag", "k1_plus_k2", "k2_plus_alpha_rho"}
# Filter and batch fit disagree where a parameter is this far apart, and more than chance by the filter's own sd.
APART = 0.05


@dataclass(frozen=True, eq=False)
class RichFit:
    """What one record gave. `current` is the level (A) that its numbers stand for, None where none is known."""

    run: str
    usable: UsableRun
    current: float | None
    batch: TimeFit
    reach: Reach | None
    linear: tuple[LinearEquivalent, ...]
    online: Online | None
    verdict: OnlineVerdict | None


def fit_record(
    usable: UsableRun, current: float | None, settings: RichSettings, known_mass: float | None, runs: SortedRuns
) -> RichFit:
    """Fit one record by both methods; what is noticed goes into `runs`."""
    lag = settings.force_lag if settings.force_lag != "fit" else usable.told_lag
    mass = settings.moving_mass if isinstance(settings.moving_mass, float) else known_mass
    options = FitOptions(
        fit_lag=lag is None,
        force_lag=lag or 0.0,
        fit_mass=settings.moving_mass == "fit",
        moving_mass=mass or 0.0,
    )
    batch, linear = _batch(usable, settings, options, runs)
    if usable.current is None and not linear and batch.viscous.times_error > DASHPOT_SURE:
        damped, _ = _batch(usable, settings, options, runs, viscous=True)
        batch = damped if damped.bic < batch.bic - _BIC_SURE else batch
    left, error = batch.inertia
    reach = reach_of(usable, batch.cutoff)
    if reach is not None and reach.is_one_loop and not linear:
        batch = _of_one_loop(batch)
    swept = usable.excitation.kind != "periodic"  # at one frequency a mass is a spring
    if settings.moving_mass == "auto" and mass is None and swept and not linear and left > _MASS_SEEN * error:
        dashpot = True if "s_mr" in batch.names else None
        weighed, _ = _batch(usable, settings, replace(options, fit_mass=True), runs, viscous=dashpot)
        batch = weighed if _with_mass(weighed, usable.run) else batch
    online, verdict = None, None
    if settings.online:
        online = follow(usable, lag, mass or 0.0, settings, viscous=bool(current))
        verdict = _beside(batch, judge_online(online, batch.rms_residual), online)
    return RichFit(usable.run, usable, current, batch if linear else widened(batch), reach, linear, online, verdict)


def _batch(
    usable: UsableRun, settings: RichSettings, options: FitOptions, runs: SortedRuns, *, viscous: bool | None = None
) -> tuple[TimeFit, tuple[LinearEquivalent, ...]]:
    alone = SortedRuns(records=[usable])
    as_shear = ShearSettings(mains_frequency=settings.mains_frequency, starts=settings.starts, cutoff=settings.cutoff)
    found = fit_all_records(alone, as_shear, options, viscous)
    runs.quality.extend(finding for finding in alone.quality if finding not in runs.quality)
    return found.fits[0], tuple(found.linear)


def _of_one_loop(fit: TimeFit) -> TimeFit:
    """Take back what one loop over and over cannot tell, however well it is met: spring and Maxwell branch look alike."""
    reason = "one amplitude at one frequency does not tell the Maxwell branch from springs, dashpots and a lag"
    estimates = tuple(
        undetermined(e.name, f"{e.name} is not determined: {reason}", e.at) if e.name in _MAXWELL else e
        for e in fit.estimates
    )
    lost = {name for name in fit.names if name.split(" ")[0] in _MAXWELL}
    return replace(
        fit,
        estimates=estimates,
        undetermined=tuple(name for name in fit.names if name in lost or name in fit.undetermined),
        statements=(*fit.statements, f"The Maxwell branch is not determined: {reason}."),
    )


def _with_mass(fit: TimeFit, run: str) -> bool:
    """Tell whether a fit with a mass explains what was left: a sure mass that both halves agree on, and a steady gain."""
    found, gain = fit.one("moving_mass"), fit.gain_change[run]
    steady = abs(gain.size) < max(_GAIN_STEADY, _MASS_SURE * gain.std_error)
    holds = fit.nrmse_second_half < _HALVES_AGREE * fit.nrmse_first_half
    sure = found.value is not None and found.std_error and found.value > _MASS_SURE * found.std_error
    return bool(sure and steady and holds)


def follow(
    usable: UsableRun,
    lag: float | None,
    mass: float,
    settings: RichSettings,
    *,
    viscous: bool,
    start: Start | None = None,
    annealed: bool = True,
) -> Online:
    """Run the joint filter over a record, as it would have run while the record came in; `start` as in `Online`."""
    series = usable.series
    force = np.where(series.counts, series.F, np.nan)
    if mass:
        smooth = low_pass(series.time, series.x, settings.online_cutoff)
        force = force - mass * np.gradient(np.gradient(smooth, series.time), series.time)
    online = Online(viscous=viscous, force_lag=lag, cutoff=settings.online_cutoff, start=start, annealed=annealed)
    online.feed(series.time, series.x, force)
    online.finish()
    return online


def _beside(batch: TimeFit, verdict: OnlineVerdict, online: Online) -> OnlineVerdict:
    """Take the word "converged" back where the filter ended elsewhere than the batch fit."""
    if verdict.word != CONVERGED:
        return verdict
    ends = {name: float(values[-1]) for name, values in online.history.band().items()}
    known = {
        e.name: e.value for e in batch.estimates if e.value and e.name in ends and e.name not in ("s_mr", "force_lag")
    }
    off = {name: ends[name] / value - 1 for name, value in known.items()}
    worst = max(off, key=lambda name: abs(off[name]), default=None)
    if worst is None or abs(off[worst]) <= APART:
        return verdict
    return replace(
        verdict,
        word=MOVING,
        reason=f"it settled elsewhere than the batch fit: {worst} by {100 * off[worst]:+.2g} %, though its innovations are "
        f"{verdict.innovation / verdict.noise:.2g} times the noise",
    )
