"""Does the model hold: signs of a wrong friction law, heating, a brake that is not free, or sensors at odds (fact sheet 5.8).

Each check compares numbers that were found elsewhere and says in one sentence what it means where it fails.
Faults of the raw logs are not looked for here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.gearbox.load.inertia import LoadFit
from pipeline.rigs.gearbox.load.load_windows import Windows
from pipeline.rigs.gearbox.torques.nominal import Level
from pipeline.rigs.gearbox.torques.torque_map import Transfer

_SIGMAS = 3.0
# Two-sided probability of 3 sigma: limits of small samples are those of Student's t at the same level.
_LEVEL = 0.9973
# The gearbox's own inertia may take this share off the slope found in a start-up.
_OWN_INERTIA = 0.05
_RIPPLE_SHARE = 0.2
# Runs whose speed and order correlate by more than that are sorted by speed.
_SORTED = 0.8
# Slopes that differ by less are one, as drag in proportion to load allows; so do those of runs at other speeds.
_ONE_SLOPE = 0.05


@dataclass(frozen=True)
class Misfit:
    """A check: what was compared, its value and limit (in sigmas unless `unit` says otherwise), and what it means."""

    name: str
    value: float
    limit: float
    text: str
    unit: str = "sigma"

    @property
    def failed(self) -> bool:
        """Tell whether the value lies beyond the limit."""
        return abs(self.value) > self.limit


def load_law(windows: Sequence[Windows], load: LoadFit) -> Misfit:
    """Ask whether the load's residual still bends with speed: then d0 + d1 w is not its friction law.

    Parameters
    ----------
    windows, load
        Of the runs, and their joint fit; runs that had no part in it do not count.

    Notes
    -----
    The mean speed of a window is the ratio of its columns of d1 and d0.
    """
    windows = [w for w in windows if w.run in load.noises]
    A = np.concatenate([w.columns for w in windows])
    speed_squared = [w.columns[:, 2] ** 2 / w.columns[:, 1] for w in windows]
    extra = np.concatenate(speed_squared)
    scale = np.linalg.norm(A, axis=0)
    basis = np.linalg.qr(A / scale)[0]
    free = extra - basis @ (basis.T @ extra)
    weights = free / (free @ free)
    bend, variance, start = 0.0, 0.0, 0
    for w in windows:
        own = weights[start : start + w.torque.size]
        start += w.torque.size
        bend += float(own @ w.residual(load.values))
        variance += float(own @ w.covariance(load.noises[w.run]) @ own)
    value = bend / math.sqrt(variance) if variance > 0 else 0.0
    return Misfit(
        "load drag over speed",
        value,
        t_quantile(load.covariance.dof, _LEVEL),
        f"the load's drag bends with speed by {bend:+.2g} N m s^2/rad^2: d0 + d1 w is too simple, and J_L leans on it",
    )


def inertia_parts(startup: LoadFit, release: LoadFit) -> Misfit:
    """Compare J_L from the start-up with that from the release."""
    gap = float(release.values[0] - startup.values[0])
    spread = math.hypot(startup.covariance.std_error[0], release.covariance.std_error[0])
    return Misfit(
        "inertia from start-up and release",
        gap / spread if spread > 0 else 0.0,
        t_quantile(min(startup.covariance.dof, release.covariance.dof), _LEVEL),
        f"J_L is {startup.values[0]:.4g} kg m^2 from the start-up and {release.values[0]:.4g} kg m^2 from the release: "
        "the brake is not free after the release, or load goes to ground between sensor and flywheel",
    )


def slopes(startup: Transfer, brake: Transfer) -> Misfit:
    """Compare the slope of output over input torque between start-up and brake rise."""
    gap = startup.slope - brake.slope
    spread = math.hypot(startup.slope_error, brake.slope_error, _OWN_INERTIA / 2 * brake.slope)
    return Misfit(
        "slope in start-up and brake rise",
        gap / spread,
        t_quantile(min(startup.dof, brake.dof), _LEVEL),
        f"the torque map has slope {startup.slope:.3f} in the start-up and {brake.slope:.3f} in the brake's rise: neither "
        "a gain error nor drag in proportion to load explains both",
    )


def dissipated_power(torque_in: Level, torque_out: Level, speed: float) -> Misfit:
    """Ask whether the locked gearbox gives out more power than it takes in."""
    lost = (torque_in.value - torque_out.value) * speed
    spread = math.hypot(torque_in.std_error, torque_out.std_error) * abs(speed)
    return Misfit(
        "dissipated power",
        min(lost / spread, 0.0) if spread > 0 else 0.0,
        _SIGMAS,
        f"locked and at steady speed the gearbox gives out {-lost:.2f} W more than it takes in: a sensor's gain, sign or "
        "offset is wrong",
    )


def same_slope(transfers: Mapping[str, Transfer]) -> Misfit | None:
    """Ask whether the torque map has one slope in all runs, and name the run that has another.

    Parameters
    ----------
    transfers
        Slope of each run by its name.

    Returns
    -------
    None below two runs. The value is the largest distance of a run from all others together; its limit knows how
    many runs were looked at.
    """
    known = {run: one for run, one in transfers.items() if one.slope_error > 0}
    if len(known) < 2:
        return None
    value = np.array([one.slope for one in known.values()])
    error = np.array([one.slope_error for one in known.values()])
    odd, distance, others = _odd_one(value, np.hypot(error, _ONE_SLOPE / 2 * np.median(value)))
    runs = list(known)
    who = f"run {runs[odd]} has {value[odd]:.3f}, the others {others:.3f}"
    if len(runs) == 2:
        who = f"run {runs[0]} has {value[0]:.3f}, run {runs[1]} {value[1]:.3f}"
    dof = min(one.dof for one in known.values())
    return Misfit(
        "slope of the runs",
        distance,
        t_quantile(dof, 1.0 - (1.0 - _LEVEL) / len(runs)),
        f"the runs do not have one slope of the torque map: {who}. The gain of a torque sensor was changed between them, or the unit of "
        "one run's torque",
    )


def _odd_one(value: np.ndarray, error: np.ndarray) -> tuple[int, float, float]:
    """Return which value lies farthest from the weighted mean of the others, its distance in standard errors, and that mean."""
    weight = error**-2.0
    rest = weight.sum() - weight
    others = (weight @ value - weight * value) / rest
    distance = (value - others) / np.sqrt(error**2 + 1.0 / rest)
    odd = int(np.argmax(np.abs(distance)))
    return odd, float(distance[odd]), float(others[odd])


def same_inertia(fits: Mapping[str, LoadFit]) -> Misfit | None:
    """Ask whether all runs move the same inertia, and name the run that does not.

    Parameters
    ----------
    fits
        Load fit of each run alone, by its name.

    Returns
    -------
    None below two runs. The value is the largest distance of a run from all others together; its limit knows how
    many runs were looked at.
    """
    known = {run: fit for run, fit in fits.items() if fit.covariance.std_error[0] > 0}
    if len(known) < 2:
        return None
    value = np.array([fit.values[0] for fit in known.values()])
    error = np.array([fit.covariance.std_error[0] for fit in known.values()])
    odd, distance, others = _odd_one(value, error)
    dof = min(fit.covariance.dof for fit in known.values())
    runs = list(known)
    who = f"run {runs[odd]} moves {1e3 * value[odd]:.4g} g m2, the others {1e3 * others:.4g} g m2"
    if len(runs) == 2:
        who = f"run {runs[0]} moves {1e3 * value[0]:.4g} g m2, run {runs[1]} {1e3 * value[1]:.4g} g m2"
    return Misfit(
        "inertia of the runs",
        distance,
        t_quantile(dof, 1.0 - (1.0 - _LEVEL) / len(runs)),
        f"the runs do not move the same inertia: {who}. Another flywheel, another gain of torque_out, or a brake that rubs",
    )


def run_order(
    values: np.ndarray, errors: np.ndarray, dofs: np.ndarray, what: str, unit: str, speeds: np.ndarray | None = None
) -> Misfit | None:
    """Look for a trend over the order of the runs in what their fit leaves over.

    Parameters
    ----------
    values, errors, dofs
        Residual of each run, its standard error and the error's degrees of freedom, shape (n,), in the order they were run.
    what, unit
        Of the values, for the text.
    speeds
        Of the runs, shape (n,): a trend over runs in the order of their speed may be one over speed.

    Returns
    -------
    None below four runs.

    Notes
    -----
    Few runs and errors that are estimates themselves make trends by chance: the trend's error is that of the runs' own
    errors (Welch-Satterthwaite) or that of their scatter about the line, whichever is larger, with Student's t of its
    degrees of freedom. Equal weights: a run is not the surer for an error that is small by chance.
    """
    if values.size < 4:
        return None
    order = np.arange(values.size, dtype=float)
    centred = order - order.mean()
    information = float(centred @ centred)
    slope = float(centred @ values) / information
    left = values - values.mean() - slope * centred
    spread = math.sqrt(float(left @ left) / (values.size - 2) / information)
    shares = (centred * errors / information) ** 2
    own = math.sqrt(float(shares.sum()))
    error, dof = (own, own**4 / float((shares**2 / dofs).sum())) if own >= spread else (spread, values.size - 2.0)
    why = "the rig warms up or wears"
    if speeds is not None and abs(float(np.corrcoef(order, speeds)[0, 1])) > _SORTED:
        why = f"{why}, or, since the runs stand in the order of their speed, it depends on speed"
    return Misfit(
        f"{what} over the runs",
        slope / error,
        t_quantile(dof, _LEVEL),
        f"{what} changes by {slope:+.2g} {unit} from run to run in the order of the runs: {why}",
    )


def ripple_share(amplitude: float, nominal: float, channel: str) -> Misfit:
    """Ask whether the ripple over the shaft's angle is large against the level it rides on."""
    return Misfit(
        f"ripple of {channel}",
        amplitude / abs(nominal) if nominal else 0.0,
        _RIPPLE_SHARE,
        f"{channel} ripples by {amplitude:.3f} N m with the shaft's angle, on a level of {nominal:.3f} N m: look for "
        "misalignment; peaks are uncertain by as much",
        "1",
    )
