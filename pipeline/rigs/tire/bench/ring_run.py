"""What the joint ring fit is given: averaged waveforms with their loads, and what is known of tire and sensor beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# A standard error estimated from a few revolutions scatters from bin to bin; its mean over neighbours weighs better.
_NEIGHBOURS = 15
_FEWEST_GROUPS = 4
_LEAST_KEPT = 0.2
# Orders that the modes below are made of.
_SMOOTH = 100


@dataclass(frozen=True, eq=False)
class RingRun:
    """One bench run at constant load and speed. SI.

    Attributes
    ----------
    run
        Name.
    theta, resistance, std_error
        A whole turn of even angles (rad, the peak near 0), the averaged R2 there (ohm) and its standard error
        (`incoherent_error` is better than the plain one); NaN
        where nothing was received; shape (n,) each. Values at the angles themselves, not means over bins of angle: the mean
        over a bin of 2 pi/1024 lowers the peak by 4e-4, which reads as 0.5 % of the tread stiffness.
    load, load_se
        Mean of the load cell (N) and the standard error of that mean, without the error of its gain.
    rotation
        Mean rotation, rad/s.
    pressure
        Inflation pressure p0, Pa.
    nominal_load, nominal_speed
        As set, N and m/s: what results are told at.
    hub_height, hub_height_se
        Mean height of the hub over the road and its standard error, m; None where it was not measured.
    """

    run: str
    theta: np.ndarray
    resistance: np.ndarray
    std_error: np.ndarray
    load: float
    load_se: float
    rotation: float
    pressure: float
    nominal_load: float
    nominal_speed: float
    hub_height: float | None = None
    hub_height_se: float | None = None


@dataclass(frozen=True)
class Known:
    """What the ring fit takes from elsewhere. SI; `_u` are relative standard uncertainties.

    Attributes
    ----------
    R, R_u
        Belt radius: the effective rolling radius.
    Ro, outer_radius_u
        Free outer radius: half the nominal diameter, by convention taken as exact.
    sensor_length, sensor_length_u
        Length of the flex sensor; its prior.
    belt_width
        First guess, or None where there is none.
    belt_width_u
        None leaves the belt's width free. A number takes `belt_width` as known to that: it sets the scale of all
        stiffnesses where the loads do not.
    pressure_u, load_gain_u
        Of the inflation pressure and of the load cell's gain, common to all runs.
    loads_set
        Whether loads of the runs are those that were set, not measured: the differences between them are then too uncertain
        to tell the scale of the stiffnesses.
    """

    R: float
    R_u: float
    Ro: float
    sensor_length: float
    sensor_length_u: float = 0.04
    belt_width: float | None = None
    belt_width_u: float | None = None
    pressure_u: float = 0.01
    load_gain_u: float = 0.005
    outer_radius_u: float = 0.0
    loads_set: bool = False


@dataclass(frozen=True)
class Scatter:
    """By how much runs differ, unseen: relative standard deviations, and a factor on what their rotation is uneven by.

    Attributes
    ----------
    load, gain, pressure
        Of the load on the tire beside the measured one, of the flex sensor's gain, of the inflation pressure.
    uneven
        On the share by which rotation may be uneven within a turn (`ring_model.UNEVEN`).
    """

    load: float = 0.0
    gain: float = 0.0
    pressure: float = 0.0
    uneven: float = 1.0

    @property
    def size(self) -> float:
        """Root mean square of the three; 0 where the runs are alike."""
        return float(np.sqrt((self.load**2 + self.gain**2 + self.pressure**2) / 3.0))


def incoherent_error(theta: np.ndarray, mean: np.ndarray, groups: np.ndarray) -> np.ndarray | None:
    """Return the standard error of an average from noise alone, without what makes whole passages higher or shifts them.

    Load and rotation that vary from turn to turn move all angles together. The fit knows them as the error of the load
    and of the angle; taken as noise of each angle for itself they would hide what the peak tells.

    Parameters
    ----------
    theta, mean
        Angles (rad) and averaged R2 (ohm), shape (n,).
    groups
        Averages that each leave one group of revolutions out, shape (G, n).

    Returns
    -------
    Shape (n,), or None where the groups are too few or have gaps.
    """
    if groups.shape[0] < _FEWEST_GROUPS or not (np.all(np.isfinite(groups)) and np.all(np.isfinite(mean))):
        return None
    spectrum = np.fft.rfft(mean)
    orders = 1j * np.arange(spectrum.size)
    spectrum[_SMOOTH + 1 :] = 0.0
    w, slope, bend = np.fft.irfft([spectrum, orders * spectrum, orders**2 * spectrum], mean.size)
    modes = np.stack([np.ones(theta.size), theta, w - w.mean(), slope, theta * slope, theta**2 * slope, bend], axis=1)
    basis = np.linalg.qr(modes)[0]
    off = (groups - groups.mean(axis=0)).T
    off = off - basis @ (basis.T @ off)
    count = groups.shape[0]
    # The modes take a share of each angle's own noise along, at the peak most.
    kept = np.maximum(1.0 - (basis**2).sum(axis=1), _LEAST_KEPT)
    return np.asarray(np.sqrt((count - 1) / count * (off**2).sum(axis=1) / kept))


def noise_error(theta: np.ndarray, mean: np.ndarray, groups: np.ndarray, std_error: np.ndarray) -> np.ndarray:
    """Return `incoherent_error` where the groups give it, the plain standard error otherwise, shape (n,)."""
    found = incoherent_error(theta, mean, groups)
    return std_error if found is None else found


def weights(run: RingRun) -> np.ndarray:
    """Return one over the standard error of each bin, 1/ohm, smoothed; 0 where there is no value, shape (n,)."""
    good = np.isfinite(run.resistance) & np.isfinite(run.std_error) & (run.std_error > 0.0)
    variance = np.where(good, run.std_error, 0.0) ** 2
    window = np.ones(_NEIGHBOURS)
    reach = _NEIGHBOURS // 2

    def around(values: np.ndarray) -> np.ndarray:
        return np.convolve(np.concatenate([values[-reach:], values, values[:reach]]), window, mode="valid")

    mean = around(variance) / np.maximum(around(good.astype(float)), 1.0)
    return np.where(good, 1.0 / np.sqrt(np.where(good, mean, 1.0)), 0.0)
