"""What all runs together tell: slope of the torque map, load inertia and drag, drag and slip torque over speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.gearbox.load.checks import Misfit, load_law, same_inertia, same_slope
from pipeline.rigs.gearbox.load.friction_fit import (
    Curve,
    drag_curve,
    mean_of_runs,
    scatter_of_groups,
    shared_errors,
    slip_line,
)
from pipeline.rigs.gearbox.load.inertia import LoadFit, load_parameters
from pipeline.rigs.gearbox.load.load_windows import Windows
from pipeline.rigs.gearbox.many.watched import exceptions, speed_groups, watched_of
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.torques.derived import NO_OFFSET, Slope, drag_locked, lock_torque, slip_torque, welch
from pipeline.rigs.gearbox.torques.pooled_map import pooled
from pipeline.rigs.gearbox.torques.torque_map import LEAD, Transfer
from pipeline.rigs.over_runs import MANY, OverRuns

# Inertias that differ by more than that share of their median are not one.
_UNLIKE = 0.1
# Standard uncertainty of the slope, as a share, that comes from the shafts' being slowed in the rise. Simulated without noise at
# 60 to 240 rpm it is 0.16 to 0.51 % too high: the gearbox's inertia lifts it by more than its drag, which grows, takes off.
# That is not corrected: no log tells this inertia to better than the correction, and other boxes have more of it.
_NOT_STEADY = 0.005
PHASES = ("startup", "brake", "loaded", "steady")


@dataclass(frozen=True, eq=False)
class CampaignNumbers:
    """What the runs share.

    Attributes
    ----------
    runs
        One entry a run, in the order of the campaign.
    transfer
        The brake rises of all runs together, or where there are none the loaded FOS; `phases` those of each phase. None
        where the runs have no common slope: `unlike` says so, and T_0, lock and slip torque rest on that of their own run.
    load
        J_L, d0, d1 of all runs together; `mixed` where their inertias differ so much that they have no common one.
    drag, lock, slip
        T_0, M_lock, M_slip of each run, by name.
    drag_law, slip_law
        Their course over speed, None where there are too few speeds.
    watched
        Of many runs, what their numbers do over the campaign.
    exceptions
        Runs on which what the runs share does not lean, and the number in which they are unlike the others.
    """

    runs: Sequence[RunNumbers]
    transfer: Transfer | None
    phases: Mapping[str, Transfer]
    load: LoadFit | None
    drag: Mapping[str, Estimate]
    lock: Mapping[str, Estimate]
    slip: Mapping[str, Estimate]
    drag_law: Curve | None
    slip_law: Curve | None
    mixed: bool = False
    unlike: Misfit | None = None
    watched: tuple[OverRuns, ...] = ()
    exceptions: Mapping[str, str] = field(default_factory=dict)

    @property
    def slope(self) -> Slope | None:
        """The slope a that turns output torques into torques at the lock."""
        return _slope(self.transfer)

    @property
    def no_slope(self) -> str:
        """Say why the slope is not known: what was lost in the rises, else that there are none."""
        if self.unlike is not None and self.unlike.failed:
            return self.unlike.text
        lost = [
            (run.name, run.torques.withheld["slope", "brake"])
            for run in self.runs
            if ("slope", "brake") in run.torques.withheld
        ]
        if lost:
            return "; ".join(f"{run}: {why}" for run, why in lost[:3])
        return "no brake rise between locked steady motion and unlock was found, or it is saturated"

    @property
    def speeds(self) -> dict[float, list[str]]:
        """Names of the runs at each speed (rad/s, four digits)."""
        return speed_groups(self.runs)

    def mean_drag(self, names: Sequence[str]) -> tuple[Estimate, int]:
        """Return T_0 over runs of one speed, N m, and of how many runs; exceptions count where there are no others."""
        known = [name for name in names if self.drag[name].value is not None]
        known = [name for name in known if name not in self.exceptions] or known
        if len(known) < 2:
            return self.drag[(known or list(names))[0]], len(known)
        values, errors, dofs, common = self._drags(known)
        mean, error, dof = mean_of_runs(values, errors, dofs, common, self._drag_scatter)
        slope = self.slope
        total, dof = welch([(error, dof), (float(common.mean()), slope.dof if slope is not None else math.inf)])
        return estimate("drag_locked", mean, total, dof=dof), len(known)

    def _drags(self, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return T_0 of runs, its standard errors, their dof and what of them all runs share, shape (n,) each."""
        slope, by_name = self.slope, {run.name: run for run in self.runs}
        carried = np.array(
            [out.value for name in names if (out := by_name[name].level("torque_out", "fos")) is not None]
        )
        common = carried / slope.value**2 * slope.std_error if slope is not None else np.zeros(len(names))
        told = [self.drag[name] for name in names]
        values, errors, dofs = (
            np.array([getattr(one, what) for one in told]) for what in ("value", "std_error", "dof")
        )
        return values, errors, dofs, common

    @cached_property
    def _drag_scatter(self) -> tuple[float, float]:
        """Of many runs: how many times its own variance T_0 scatters by within its speeds, all speeds together, and the dof."""
        if len(self.runs) <= MANY:
            return 1.0, math.inf
        told = [
            self._drags(alike)
            for names in self.speeds.values()
            if len(alike := [n for n in names if n not in self.exceptions and self.drag[n].value is not None]) > 1
        ]
        return scatter_of_groups([(values, np.sqrt(errors**2 - common**2)) for values, errors, _, common in told])


def campaign_of(runs: Sequence[RunNumbers], begins: Mapping[str, float | None] | None = None) -> CampaignNumbers:
    """Return what the runs share; of many runs, what those that are no exceptions share.

    Parameters
    ----------
    begins
        When the log of each run began, s since 1970, None where it does not say.
    """
    watched = watched_of(runs, begins or dict.fromkeys(run.name for run in runs)) if len(runs) > MANY else ()
    odd = exceptions(watched)
    alike = [run for run in runs if run.name not in odd]
    phases = {}
    speeds = {name: speed for speed, names in speed_groups(alike).items() for name in names}
    for phase in PHASES:
        told = [run for run in alike if phase in run.transfers]
        # A run whose speed is not known is taken for one of its own.
        together = pooled(
            [run.transfers[phase] for run in told], phase, [speeds.get(run.name, run.name) for run in told]
        )
        if together is not None:
            phases[phase] = together
    rises = {run.name: run.transfers["brake"] for run in runs if "brake" in run.transfers}
    unlike = same_slope({run.name: rises[run.name] for run in alike if run.name in rises})
    common = None if unlike is not None and unlike.failed else phases.get("brake") or phases.get("loaded")
    common = None if common is None else _not_quite_steady(common, alike)
    slope = _slope(common)
    slopes = {run.name: _slope(common or rises.get(run.name)) for run in runs}
    windows = [run.windows for run in alike if run.windows is not None]
    # A zero offset that is unknown goes into d0: such runs count only where there are no others.
    zeroed = [run.windows for run in alike if run.windows is not None and run.zeroed]
    drag, lock, slip = {}, {}, {}
    for run in runs:
        fos_in, fos_out = run.level("torque_in", "fos"), run.level("torque_out", "fos")
        sos_in, sos_out = run.level("torque_in", "sos"), run.level("torque_out", "sos")
        drag[run.name] = drag_locked(fos_in, fos_out, slopes[run.name])
        slip[run.name] = slip_torque(sos_in, sos_out, fos_in, fos_out, slopes[run.name])
    load = _load(zeroed or windows, bool(zeroed))
    reason = _mixed(alike)
    if load is not None and reason:
        load = replace(load, undetermined={**load.undetermined, "inertia_load": reason})
    law = _drag_law(alike, drag, slope, load if load is not None and not load_law(windows, load).failed else None)
    for run in runs:
        fos_in, fos_out = run.level("torque_in", "fos"), run.level("torque_out", "fos")
        grown = _drag_grown(run, drag[run.name], law)
        lock[run.name] = lock_torque(run.unlocking, fos_in, fos_out, slopes[run.name], grown)
    return CampaignNumbers(
        runs, common, phases, load, drag, lock, slip, law,
        _slip_law(alike, slip, slope), bool(reason), unlike, watched, odd,
    )  # fmt: skip


def _not_quite_steady(transfer: Transfer, runs: Sequence[RunNumbers]) -> Transfer:
    """Return the slope with what a rise that slows the shafts a little leaves in it: no number of runs takes that out.

    The drag T_0 changes with the speed and the gearbox's own inertia gives some torque back; both are in proportion to the
    rise. On T_00 the slope acts with the lever of the mean torque that was fitted: most of it is FOS before the rise.
    """
    off = _NOT_STEADY * transfer.slope
    error, dof = welch([(transfer.slope_error, transfer.dof), (off, math.inf)])
    means = [mean for run in runs if (mean := _mean_of_rise(run)) is not None]
    lever = abs(float(np.median(means)) - transfer.intercept) if means else 0.0
    error_00, dof_00 = welch(
        [(transfer.intercept_error, transfer.intercept_dof or transfer.dof), (lever * _NOT_STEADY, math.inf)]
    )
    return replace(transfer, slope_error=error, dof=dof, intercept_error=error_00, intercept_dof=dof_00)


def _mean_of_rise(run: RunNumbers) -> float | None:
    """Return the mean input torque of what is fitted, N m: FOS before the rise and the rise; None where it is not known."""
    fos, onset, unlock = (
        run.level("torque_in", "fos"),
        *(run.run.events.get(name) for name in ("brake_onset", "unlock")),
    )
    if fos is None or run.unlocking is None or onset is None or unlock is None:
        return None
    rising = unlock - onset
    return fos.value + 0.5 * (run.unlocking.value - fos.value) * rising / (LEAD + rising)


def _drag_grown(run: RunNumbers, drag: Estimate, law: Curve | None) -> tuple[float, float]:
    """Return how much T_0 grows while the brake slows the shaft until the lock breaks, and its standard error, N m.

    Without a law over speed T_0 may change by as large a share as the speed does, either way.
    """
    fos, slowed = run.speed_out[0], run.speed_at_unlock
    if not math.isfinite(fos) or not math.isfinite(slowed):
        return 0.0, 0.0
    loosely = abs((drag.value or 0.0) * (slowed / fos - 1.0)) / math.sqrt(3.0)
    if law is None:
        return 0.0, loosely
    before, after = law.at(np.array([fos, slowed]))
    # The parts of the law are strongly correlated, and its slope is uncertain at the lowest and highest speed.
    return float(after - before), 0.5 * loosely


def _mixed(runs: Sequence[RunNumbers]) -> str:
    """Say why the runs have no common inertia: they differ significantly, and by more than a tenth; empty where they have."""
    fits = {run.name: run.load for run in runs if run.load is not None}
    check = same_inertia(fits)
    if check is None or not check.failed:
        return ""
    values = [float(fit.values[0]) for fit in fits.values()]
    return check.text if max(values) - min(values) > _UNLIKE * float(np.median(values)) else ""


def _load(windows: Sequence[Windows], zeroed: bool) -> LoadFit | None:
    fit = load_parameters(windows) if windows else None
    if fit is None or zeroed:
        return fit
    return replace(fit, undetermined={**fit.undetermined, "drag_coulomb": NO_OFFSET})


def _slope(transfer: Transfer | None) -> Slope | None:
    return None if transfer is None else Slope(transfer.slope, transfer.slope_error, transfer.dof)


def _drag_law(
    runs: Sequence[RunNumbers], drag: Mapping[str, Estimate], slope: Slope | None, load: LoadFit | None
) -> Curve | None:
    """Fit T_0 over speed; where the load's law holds, T_out is that of all runs together, which is quieter."""
    rows = [
        (run.speed_out[0], t_in.value, t_in.std_error, t_out.value, t_out.std_error)
        for run in runs
        if drag[run.name].value is not None
        and math.isfinite(run.speed_out[0])
        and (t_in := run.level("torque_in", "fos")) is not None
        and (t_out := run.level("torque_out", "fos")) is not None
    ]
    if not rows or slope is None:
        return None
    speed, driving, error_in, carried, error_out = np.array(rows, dtype=float).T
    a = slope.value
    errors = shared_errors(np.hypot(error_in, error_out / a), straight_course(speed, carried), a, slope.std_error)
    if load is not None and len(rows) > 1:
        carried, common = load.steady_torque(speed)
        errors = shared_errors(error_in, carried, a, slope.std_error, common)
    return drag_curve(speed, driving - carried / a, errors)


def _slip_law(runs: Sequence[RunNumbers], slip: Mapping[str, Estimate], slope: Slope | None) -> Curve | None:
    rows = [
        (run.speed_in.value, found.value, t_out.std_error / slope.value, t_out.value)
        for run in runs
        if (found := slip[run.name]).value is not None
        and slope is not None
        and run.speed_in is not None
        and run.speed_in.source != "nominal"
        and (t_out := run.level("torque_out", "sos")) is not None
    ]
    if len(rows) < 2 or slope is None:
        return None
    speed, value, own, t_out = np.array(rows, dtype=float).T
    return slip_line(speed, value, shared_errors(own, straight_course(speed, t_out), slope.value, slope.std_error))


def straight_course(speed: np.ndarray, torque_out: np.ndarray) -> np.ndarray:
    """Return the output torque's straight course over speed, N m, same shape.

    What an error of the slope does to all runs must not follow their noise: the fit would then move the slope to where the
    noise is smallest, the farther the more runs there are (Peelle's puzzle).
    """
    if np.ptp(speed) == 0.0:
        return np.full(speed.size, torque_out.mean())
    return np.asarray(np.polyval(np.polyfit(speed, torque_out, 1), speed))
