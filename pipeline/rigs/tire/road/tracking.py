"""Tracks of load, force and rotation along a drive: one Kalman filter each, one update a revolution (5.12).

A track can follow no faster than the wheel turns: `nyquist`. Filtered values use the past only; `smoothed` both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

_GATE = 10.8
# How far from its start value q may be tuned.
_TUNED_WITHIN = 100.0
_LEAST_FOR_TUNING = 30
_Z95 = 1.959964


@dataclass(frozen=True, eq=False)
class Track:
    """A quantity filtered along a drive; arrays of shape (m,).

    Attributes
    ----------
    time, value, se, rate, rate_se
        Filtered value and its rate (per s) at each revolution, with standard errors.
    nis
        Normalised innovation squared; NaN where nothing was measured.
    gated
        Whether the measurement was passed over as wild.
    q
        Root of the spectral density that drives the rate, per s^1.5.
    tuned
        How q was found: "given", "likelihood", or "mean NIS" where the likelihood's q leaves the NIS out of its band.
    mean_nis, band
        Mean NIS without what was gated, and the band that holds it with 95 % where the filter is consistent.
    """

    time: np.ndarray
    value: np.ndarray
    se: np.ndarray
    rate: np.ndarray
    rate_se: np.ndarray
    nis: np.ndarray
    gated: np.ndarray
    q: float
    tuned: str
    mean_nis: float
    band: tuple[float, float]
    covariance: np.ndarray

    @property
    def consistent(self) -> bool:
        """Whether the mean NIS lies in its band: errors are as large as the filter says."""
        return self.band[0] <= self.mean_nis <= self.band[1]

    @property
    def verdict(self) -> str:
        """What the test of consistency says, in a sentence."""
        low, high = self.band
        told = f"mean NIS {self.mean_nis:.2f}, 95 % band {low:.2f} to {high:.2f}"
        if not math.isfinite(self.mean_nis):
            return "not tested: no innovations"
        if self.consistent:
            return f"consistent ({told})"
        if self.mean_nis > high:
            return f"too sure of itself: innovations are larger than its errors tell ({told})"
        return f"too careful: innovations are smaller than its errors tell ({told})"


class RevolutionFilter(KalmanFilter):  # type: ignore[misc]
    """x = [f, f'], driven by white noise of density q^2 on f''; `advance` carries it along a drive."""

    x: np.ndarray
    P: np.ndarray

    def __init__(self, value: float, variance: float, rate_variance: float, q: float, *, compiled: bool = True) -> None:
        super().__init__(dim_x=2, dim_z=1)
        self.x = np.array([value, 0.0])
        self.P = np.diag([variance, rate_variance])
        self.H = np.array([[1.0, 0.0]])
        self.q, self.compiled = q, compiled

    def advance(self, steps: np.ndarray, measured: np.ndarray, R: np.ndarray, gate: float) -> _Course:
        """Carry the filter along: steps (s), measurements (NaN: predict only) and their variances, shape (m,) each."""
        m = measured.size
        made = _Course(np.zeros((m, 2)), np.zeros((m, 2, 2)), np.zeros(m), np.zeros(m, dtype=bool), 0.0)
        if self.compiled:
            from pipeline.rigs.tire.road.tracking_loop import run

            out = (made.states, made.covariances, made.nis, made.gated)
            likelihood = run(steps, measured, R, self.q**2, self.x, self.P, gate, *out)
            return _Course(*out, float(likelihood))
        return self._by_filterpy(steps, measured, R, gate, made)

    def _by_filterpy(
        self, steps: np.ndarray, measured: np.ndarray, R: np.ndarray, gate: float, made: _Course
    ) -> _Course:
        from pipeline.rigs.tire.road.tracking_loop import borne_out

        likelihood = 0.0
        for i, dt in enumerate(steps):
            F = np.array([[1.0, dt], [0.0, 1.0]])
            self.predict(F=F, Q=Q_continuous_white_noise(2, dt=dt, spectral_density=self.q**2))
            made.nis[i] = np.nan
            if np.isfinite(measured[i]):
                x, P = self.x.copy(), self.P.copy()
                self.update(measured[i], R=R[i])
                S = float(self.S[0, 0])
                made.nis[i] = float(self.y[0]) ** 2 / S
                made.gated[i] = made.nis[i] > gate and not borne_out(steps, measured, i, x[0], x[1], float(self.y[0]))
                likelihood -= 0.5 * (math.log(2.0 * math.pi * S) + (gate if made.gated[i] else made.nis[i]))
                if made.gated[i]:
                    self.x, self.P = x, P
            made.states[i], made.covariances[i] = self.x, self.P
        return _Course(made.states, made.covariances, made.nis, made.gated, likelihood)


@dataclass(frozen=True, eq=False)
class _Course:
    """What steps gave: states (m, 2), covariances (m, 2, 2), NIS and gated (m,), log-likelihood."""

    states: np.ndarray
    covariances: np.ndarray
    nis: np.ndarray
    gated: np.ndarray
    likelihood: float


def track(
    time: np.ndarray,
    values: np.ndarray,
    se: np.ndarray,
    *,
    q: float,
    tune: bool = True,
    gate: float = _GATE,
    usable: np.ndarray | None = None,
    compiled: bool = True,
) -> Track:
    """Return the filtered track of a quantity measured once a revolution.

    Parameters
    ----------
    time, values, se
        Moments (s, rising), measurements and their standard errors, shape (m,) each; NaN: no measurement.
    q
        Start value of the noise that drives the rate, per s^1.5 (N s^-1.5, rad s^-2.5).
    tune
        Whether q is tuned: by the likelihood of the innovations, then, if the mean NIS is out of its band, to a mean of 1.
    gate
        NIS beyond which a measurement is passed over, two in a row at most.
    usable
        Which measurements count, bool, shape (m,).

    Raises
    ------
    ValueError
        If nothing is measured.
    """
    known = np.isfinite(values) & np.isfinite(se) & (se > 0.0)
    if usable is not None:
        known &= usable
    if not known.any():
        raise ValueError("no revolution tells this quantity: there is nothing to track")
    measured = np.where(known, values, np.nan)
    R = np.where(known, se, 1.0) ** 2
    steps = np.diff(time, prepend=time[:1])
    first = int(np.flatnonzero(known)[0])
    around = float(np.median(np.diff(time))) if time.size > 1 else 1.0

    def filtered(log_q: float) -> _Course:
        density = math.exp(log_q)
        # At the start the rate is as uncertain as a few seconds of wandering make it.
        begun = RevolutionFilter(
            float(values[first]),
            100.0 * float(R[first]) + density**2 * around**3,
            4.0 * density**2,
            density,
            compiled=compiled,
        )
        return begun.advance(steps, measured, R, gate)

    best, tuned = math.log(q), "given"
    course = filtered(best)
    if tune and int(known.sum()) >= _LEAST_FOR_TUNING:
        from scipy.optimize import brentq, minimize_scalar

        reach = math.log(_TUNED_WITHIN)
        least, most = best - reach, best + reach
        found = minimize_scalar(
            lambda x: -filtered(x).likelihood, bounds=(least, most), method="bounded", options={"xatol": 0.02}
        )
        best, tuned = float(found.x), "likelihood"
        course = filtered(best)
        mean, band = _consistency(course)
        if not band[0] <= mean <= band[1]:
            off = [_consistency(filtered(x))[0] - 1.0 for x in (least, most)]
            if off[0] > 0.0 > off[1]:
                best = float(brentq(lambda x: _consistency(filtered(x))[0] - 1.0, least, most, xtol=0.01))
                course, tuned = filtered(best), "mean NIS"
    mean, band = _consistency(course)
    return Track(
        time=time,
        value=course.states[:, 0],
        se=np.sqrt(course.covariances[:, 0, 0]),
        rate=course.states[:, 1],
        rate_se=np.sqrt(course.covariances[:, 1, 1]),
        nis=course.nis,
        gated=course.gated,
        q=math.exp(best),
        tuned=tuned,
        mean_nis=mean,
        band=band,
        covariance=course.covariances,
    )


def _consistency(course: _Course) -> tuple[float, tuple[float, float]]:
    """Return the mean NIS of what was not passed over, the band that holds it with 95 %."""
    counted = np.isfinite(course.nis) & ~course.gated
    n = int(counted.sum())
    if n == 0:
        return math.nan, (math.nan, math.nan)
    spread = _Z95 * math.sqrt(2.0 / n)
    return float(course.nis[counted].mean()), (max(0.0, 1.0 - spread), 1.0 + spread)


def nyquist(time: np.ndarray) -> np.ndarray:
    """Return half the rate of revolutions, Hz, shape (m,): no faster change shows in a track."""
    if time.size < 2:
        return np.full(time.size, math.nan)
    return np.asarray(0.5 / np.gradient(time))


def smoothed(found: Track) -> tuple[np.ndarray, np.ndarray]:
    """Return values and standard errors with the future used as well, shape (m,) each (Rauch, Tung and Striebel 1965).

    Only for figures and events after the drive; the filtered track is what a driver would have seen.
    """
    dt = np.diff(found.time, prepend=found.time[:1])
    F = np.zeros((dt.size, 2, 2))
    F[:, 0, 0] = F[:, 1, 1] = 1.0
    F[:, 0, 1] = dt
    Q = np.moveaxis(
        found.q**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, np.where(dt > 0.0, dt, 1e-12)]]), -1, 0
    )
    begun = KalmanFilter(dim_x=2, dim_z=1)
    states = np.stack([found.value, found.rate], axis=1)
    x, P, _, _ = begun.rts_smoother(states, found.covariance, Fs=F, Qs=Q)
    return np.asarray(x[:, 0]), np.sqrt(P[:, 0, 0])
