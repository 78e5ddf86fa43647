"""One steady loop of force against displacement: its harmonics with their errors (mre.md 3.5).

No model of the material here, and no decision which part of a record is steady.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.estimation.harmonic import HarmonicFit, fit_harmonics, fundamental
from pipeline.signals.spectra import near_mains

N_X = N_F = 15  # harmonics kept of displacement and of force
_FIRST_X = 5  # of the displacement that are always fitted; the others only where the motion has them
_LINES_BELOW = 3  # multiples of the mains frequency that are fitted beside the harmonics
# Periodogram bins averaged for the noise level at one harmonic: those within a factor of 1.6 in frequency, where a
# coloured noise changes little, but enough for a standard deviation to 8 %.
_FEWEST_BINS, _MOST_BINS, _BAND = 40, 200, 1.6
# Where they reach over a larger ratio of frequencies, the level is taken to bend with it (a quadratic of the logarithms), and
# to differ from their mean by less than a factor.
_FAR, _BENT, _SCORINGS = 1.3, 10.0, 6


@dataclass(frozen=True, eq=False)
class Loop:
    """Steady motion and force of one run: x(t) = x_mean + Re sum_h X_h exp(j h 2 pi f t), F likewise.

    Attributes
    ----------
    run, frequency
        Name of the run; fitted fundamental, Hz.
    X, F
        Harmonics 1..N_X of displacement (m) and 1..N_F of force (N), complex. Those of x beyond the fifth
        are 0 (and have no error) unless they stand out of the noise, as those of a triangle do.
    sd_x, sd_f
        Standard deviation of the real and of the imaginary part of each, from the residual's level
        around that harmonic; shapes (N_X,) and (N_F,).
    level_u_x, level_u_f
        Relative standard errors of their squares: the levels are estimates.
    kept
        Which force harmonics are data, (N_F,): False next to a multiple of the mains frequency and
        above 0.45 times the sampling rate (F is zero there).
    x_mean, f_mean, sigma_x, sigma_f
        Means and residual standard deviations of the samples, m and N.
    n_samples, duration
        Samples used and their span, s.
    current, preload
        Mean measured coil current (A) and preload (N) of the run; None where not given.
    """

    run: str
    frequency: float
    X: np.ndarray
    F: np.ndarray
    sd_x: np.ndarray
    sd_f: np.ndarray
    kept: np.ndarray
    x_mean: float
    f_mean: float
    sigma_x: float
    sigma_f: float
    n_samples: int
    duration: float
    current: float | None = None
    preload: float | None = None
    level_u_x: np.ndarray = field(default_factory=lambda: np.zeros(N_X))
    level_u_f: np.ndarray = field(default_factory=lambda: np.zeros(N_F))

    @property
    def omega(self) -> float:
        """Angular frequency, rad/s."""
        return 2 * np.pi * self.frequency

    @property
    def amplitude(self) -> float:
        """Half peak-to-peak of the fitted displacement, m."""
        return half_range(self.X)


def curve(coefficients: np.ndarray, points: int = 256) -> np.ndarray:
    """Return one cycle of the series at `points` equal phases from 0, shape (points,), without mean."""
    spectrum = np.zeros(points // 2 + 1, dtype=complex)
    spectrum[1 : coefficients.size + 1] = coefficients * (points / 2)
    return np.fft.irfft(spectrum, points)


def drift_degree(cycles: float) -> int:
    """Return the degree of the polynomial that stands for slow drift over so many cycles."""
    return 0 if cycles < 3 else 1 if cycles < 8 else 3


def half_range(coefficients: np.ndarray) -> float:
    """Return half the peak-to-peak value of a harmonic series of shape (k,)."""
    value, _ = half_range_with_slope(coefficients)
    return value


def half_range_with_slope(coefficients: np.ndarray, points: int = 1024) -> tuple[float, np.ndarray]:
    """Return half the peak-to-peak value and d/d(Re) + j d/d(Im) of it for every harmonic."""
    values = curve(coefficients, points)
    orders = np.arange(1, coefficients.size + 1)
    extremes, slopes = [], []
    for sign in (1.0, -1.0):
        i = int(np.argmax(sign * values))
        before, middle, after = values[i - 1], values[i], values[(i + 1) % points]
        bend = before - 2 * middle + after
        shift = 0.5 * (before - after) / bend if bend != 0 else 0.0
        turn = np.exp(2j * np.pi * orders * (i + shift) / points)
        extremes.append(float((coefficients * turn).real.sum()))
        slopes.append(np.conj(turn))
    return 0.5 * (extremes[0] - extremes[1]), 0.5 * (slopes[0] - slopes[1])


def fit_loop(
    run: str,
    time: np.ndarray,
    displacement: np.ndarray,
    force: np.ndarray,
    *,
    frequency: float | None = None,
    current: float | None = None,
    preload: float | None = None,
    mains: float = 50.0,
) -> Loop:
    """Fit the harmonics of a steady record (whole cycles are not needed; dropouts need no repair).

    Parameters
    ----------
    time, displacement, force
        Stamps (s) and samples (m, N), shape (n,).
    frequency
        A guess in Hz; the fundamental of the displacement is fitted.
    mains
        Mains frequency, Hz: its lines are fitted along where no harmonic lies within 2/T of them, and
        the harmonics that do are marked as no data. 0 for none.

    Raises
    ------
    InputError
        If less than a cycle was logged or nothing moves.

    Notes
    -----
    Slow drift of both signals is projected out: a straight line from 3 cycles on, a cubic from 8.
    """
    found = fundamental(time, displacement, frequency)
    f, duration = found.value, float(time[-1] - time[0])
    cycles = f * duration
    drift = drift_degree(cycles)
    rate = (time.size - 1) / duration
    highest = max(int(0.45 * rate / f), 1)
    n_x, n_f = min(_FIRST_X, highest), min(N_F, highest)
    x = fit_harmonics(time, displacement, f, range(1, n_x + 1), drift)
    if _more_harmonics(time, x, np.arange(n_x + 1, min(N_X, highest) + 1)):
        n_x = min(N_X, highest)
        x = fit_harmonics(time, displacement, f, range(1, n_x + 1), drift)

    orders = np.arange(1, N_F + 1)
    sd_x, level_u_x = _noise(time, x, np.arange(1, N_X + 1))
    near, lines = np.zeros(N_F, dtype=bool), np.zeros(0)
    if mains > 0:
        near = near_mains(f * orders, duration, mains)
        multiples = mains * np.arange(1, _LINES_BELOW + 1)
        clear = np.abs(multiples[:, None] - f * orders).min(axis=1) > 2 / duration
        lines = multiples[clear & (multiples < 0.45 * rate)]
    F = fit_harmonics(time, force, f, [*range(1, n_f + 1), *(lines / f)], drift)

    sd_f, level_u_f = _noise(time, F, orders)
    X_h, F_h = np.zeros(N_X, dtype=complex), np.zeros(N_F, dtype=complex)
    X_h[:n_x], F_h[:n_f] = x.coefficients, F.coefficients[:n_f]
    return Loop(
        run=run,
        frequency=f,
        X=X_h,
        F=F_h,
        sd_x=np.where(np.arange(1, N_X + 1) <= n_x, sd_x, 0.0),
        sd_f=sd_f,
        kept=~near & (orders <= n_f),
        x_mean=x.offset,
        f_mean=F.offset,
        sigma_x=x.sigma,
        sigma_f=F.sigma,
        n_samples=F.n,
        duration=duration,
        current=current,
        preload=preload,
        level_u_x=level_u_x,
        level_u_f=level_u_f,
    )


def _more_harmonics(time: np.ndarray, fit: HarmonicFit, orders: np.ndarray) -> bool:
    """Tell whether the residual holds lines at further `orders` that stand out of its noise."""
    if not orders.size:
        return False
    residual = np.where(np.isfinite(fit.residual), fit.residual, 0.0)
    turn = np.exp(-2j * np.pi * fit.frequency * time)
    carried = residual * turn ** (orders[0] - 1)
    lines = np.zeros(orders.size)
    for i in range(orders.size):
        carried *= turn
        lines[i] = 2 * abs(carried.sum()) / fit.n
    return bool(np.any(lines > 5 * _noise(time, fit, orders)[0]))


def _noise(time: np.ndarray, fit: HarmonicFit, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the standard deviation of the real (and imaginary) part of each harmonic, and the relative one of its square.

    White residuals give sigma sqrt(2/n). A coloured residual is worse at some harmonics, most at low ones: the level is
    that of the residual's periodogram there, from the nearest bins that the regression has not emptied, more of them the
    higher the harmonic.
    """
    white = fit.sigma * math.sqrt(2 / fit.n)
    residual = np.where(np.isfinite(fit.residual), fit.residual, 0.0)
    resolution = (time.size - 1) / (time[-1] - time[0]) / time.size
    size = 1 << (residual.size - 1).bit_length()  # zeros behind: prime lengths are slow
    power = np.abs(np.fft.rfft(residual, size)) ** 2 * (2 / residual.size) ** 2 / 2
    spacing = resolution * residual.size / size
    bins = np.arange(power.size) * spacing
    emptied = np.zeros(power.size, dtype=bool)
    for order in fit.orders:
        emptied |= np.abs(bins - order * fit.frequency) < 0.6 * resolution
    emptied[: math.ceil((1 + fit.drift.size) * resolution / spacing)] = True
    bins, power = bins[~emptied], power[~emptied]
    at = orders * fit.frequency
    count = np.clip(at * (_BAND - 1 / _BAND) / resolution, _FEWEST_BINS, _MOST_BINS) * resolution / spacing
    count = np.round(count).astype(int)
    if power.size < 2 * count.max():
        many = max(fit.effective_fraction * fit.n, 1.0)
        return np.full(orders.size, white / math.sqrt(fit.effective_fraction)), np.full(
            orders.size, math.sqrt(2 / many)
        )
    first = np.clip(np.searchsorted(bins, at) - count // 2, 0, power.size - count)
    windows = [slice(start, start + n) for start, n in zip(first, count, strict=True)]
    levels = np.array([_level(bins[w], power[w], f) for w, f in zip(windows, at, strict=True)])
    # The zeros behind put several ordinates where one is independent.
    return np.sqrt(levels[:, 0]), levels[:, 1] * math.sqrt(resolution / spacing)


def _level(frequency: np.ndarray, power: np.ndarray, at: float) -> tuple[float, float]:
    """Return the level of a periodogram at a frequency, and its relative error if the ordinates are independent.

    The level is their mean, or a quadratic of logarithms where the bins reach further.

    At the knee of a filtered noise a mean, or a straight power law, is 15 to 25 % off in variance. Periodogram ordinates are
    exponentially distributed about the level: a gamma regression with a logarithmic link, whose Fisher scoring is ordinary
    least squares of the working response.
    """
    mean = float(power.mean())
    if frequency[-1] < _FAR * max(frequency[0], 1e-300) or not mean > 0:
        return mean, 1 / math.sqrt(power.size)
    x = np.log(frequency / at)
    A = np.column_stack([np.ones(x.size), x, x**2])
    solve = np.linalg.pinv(A)
    found = np.array([math.log(mean), 0.0, 0.0])
    for _ in range(_SCORINGS):
        eta = A @ found
        found = solve @ (eta + power * np.exp(-eta) - 1)
    level = math.exp(min(found[0], 700.0))
    if not mean / _BENT < level < mean * _BENT:
        return mean, 1.0
    return level, float(np.linalg.norm(solve[0]))
