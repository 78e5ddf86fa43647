"""What all runs together tell: slope of the torque map, load inertia and drag, drag and slip torque over speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.gearbox.load.checks import Misfit, load_law, same_inertia, same_slope
from pipeline.rigs.gearbox.load.friction_fit import Curve, drag_curve, shared_covariance, slip_line
from pipeline.rigs.gearbox.load.inertia import LoadFit, load_parameters
from pipeline.rigs.gearbox.load.load_windows import Windows
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.torques.derived import NO_OFFSET, Slope, drag_locked, lock_torque, slip_torque
from pipeline.rigs.gearbox.torques.torque_map import Transfer, pooled

# Inertias that differ by more than that share of their median are not one.
_UNLIKE = 0.1
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
        found: dict[float, list[str]] = {}
        for run in self.runs:
            if math.isfinite(run.speed):
                found.setdefault(float(f"{run.speed:.4g}"), []).append(run.name)
        return dict(sorted(found.items()))


def campaign_of(runs: Sequence[RunNumbers]) -> CampaignNumbers:
    """Return what the runs share."""
    phases = {}
    for phase in PHASES:
        together = pooled([run.transfers[phase] for run in runs if phase in run.transfers], phase)
        if together is not None:
            phases[phase] = together
    rises = {run.name: run.transfers["brake"] for run in runs if "brake" in run.transfers}
    unlike = same_slope(rises)
    common = None if unlike is not None and unlike.failed else phases.get("brake") or phases.get("loaded")
    slope = _slope(common)
    slopes = {run.name: _slope(common or rises.get(run.name)) for run in runs}
    windows = [run.windows for run in runs if run.windows is not None]
    # A zero offset that is unknown goes into d0: such runs count only where there are no others.
    zeroed = [run.windows for run in runs if run.windows is not None and run.zeroed]
    drag, lock, slip = {}, {}, {}
    for run in runs:
        fos_in, fos_out = run.level("torque_in", "fos"), run.level("torque_out", "fos")
        sos_in, sos_out = run.level("torque_in", "sos"), run.level("torque_out", "sos")
        drag[run.name] = drag_locked(fos_in, fos_out, slopes[run.name])
        slip[run.name] = slip_torque(sos_in, sos_out, fos_in, fos_out, slopes[run.name])
    load = _load(zeroed or windows, bool(zeroed))
    reason = _mixed(runs)
    if load is not None and reason:
        load = replace(load, undetermined={**load.undetermined, "inertia_load": reason})
    law = _drag_law(runs, drag, slope, load if load is not None and not load_law(windows, load).failed else None)
    for run in runs:
        fos_in, fos_out = run.level("torque_in", "fos"), run.level("torque_out", "fos")
        grown = _drag_grown(run, drag[run.name], law)
        lock[run.name] = lock_torque(run.unlocking, fos_in, fos_out, slopes[run.name], grown)
    return CampaignNumbers(
        runs, common, phases, load, drag, lock, slip, law,
        _slip_law(runs, slip, slope), bool(reason), unlike,
    )  # fmt: skip


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
    covariance = shared_covariance(np.hypot(error_in, error_out / a), carried, a, slope.std_error)
    if load is not None and len(rows) > 1:
        carried, spread = load.steady_torque(speed)
        covariance = shared_covariance(error_in, carried, a, slope.std_error) + spread / a**2
    return drag_curve(speed, driving - carried / a, covariance)


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
    return slip_line(speed, value, shared_covariance(own, t_out, slope.value, slope.std_error))
