"""Harmonic regression at the exact time stamps, and the fundamental frequency that it needs.

Made for periodic tests logged with jitter, dropouts and a frequency that is not the nominal one. It
is not an FFT: nothing is resampled, windowed or repaired, and a gap only costs its samples.
Convention: x(t) = offset + Re sum_h X_h exp(j h 2 pi f t), with t as given (absolute phase at t = 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from pipeline.errors import InputError
from pipeline.estimation.harmonic_columns import Regression, exponentials, in_blocks, scaled
from pipeline.estimation.uncertainty import effective_size
from pipeline.signals.periodogram import block_means, strongest_line

# Block means this fine lose no information on a frequency (1 % of the amplitude of order 5).
_SAMPLES_A_CYCLE = 64


@dataclass(frozen=True)
class Frequency:
    """A fundamental frequency and its standard error, Hz."""

    value: float
    std_error: float


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """A periodic signal as its harmonics, with the covariance of the regression.

    Attributes
    ----------
    frequency
        Fundamental, Hz, taken as known.
    orders
        Orders h, shape (k,).
    coefficients
        X_h, complex, shape (k,), in the unit of the signal: |X_h| is the amplitude of order h.
    offset
        Mean level over the span of the record (the drift has zero mean there).
    drift
        Legendre coefficients of the drift over the span of the record, degrees 1, 2, ...; shape (d,).
    covariance
        Of [offset, Re X_1, Im X_1, Re X_2, ...] for white residuals, real, shape (1 + 2 k, 1 + 2 k).
    sigma
        Standard deviation of the residual, degrees of freedom counted.
    n
        Samples used.
    residual
        Measured minus fitted, shape of the time stamps given; NaN where the sample was NaN.
    span
        First and last time used, s.
    """

    frequency: float
    orders: np.ndarray
    coefficients: np.ndarray
    offset: float
    drift: np.ndarray
    covariance: np.ndarray
    sigma: float
    n: int
    residual: np.ndarray
    span: tuple[float, float]

    @cached_property
    def effective_fraction(self) -> float:
        """Effective over actual number of samples (0..1], from the residual's autocorrelation.

        It holds for the mean and for slow terms; `covariance` divided by it is the widened one.
        """
        kept = self.residual[np.isfinite(self.residual)]
        return effective_size(kept) / int(kept.size)

    def periodic(self, time: np.ndarray) -> np.ndarray:
        """Return the harmonics alone (no offset, no drift) at `time` (s), same shape."""
        time = np.asarray(time, dtype=float)
        values = np.empty(time.size)
        for rows, cycles in in_blocks(time.ravel(), self.frequency):
            values[rows] = (self.coefficients @ exponentials(cycles, self.orders)).real
        return values.reshape(time.shape)

    def curve(self, time: np.ndarray) -> np.ndarray:
        """Return offset, drift and harmonics at `time` (s), same shape; the drift is extrapolated."""
        time = np.asarray(time, dtype=float)
        level = legendre.legval(scaled(time, self.span), np.r_[self.offset, self.drift])
        return np.asarray(level + self.periodic(time))


def fit_harmonics(
    time: np.ndarray, values: np.ndarray, frequency: float, orders: Sequence[int] | np.ndarray, drift: int = 0
) -> HarmonicFit:
    """Fit offset, polynomial drift and harmonics by linear least squares at the exact stamps.

    Parameters
    ----------
    time, values
        Stamps (s) and samples, shape (n,); samples that are NaN do not count.
    frequency
        Fundamental, Hz.
    orders
        Multiples of the fundamental, positive; fractions are allowed (sub-harmonics).
    drift
        Degree of the polynomial beside the offset; 0 for none.

    Raises
    ------
    InputError
        If there are not more samples than coefficients, or the samples cannot tell the columns
        apart (less than a cycle, orders above half the sampling rate).

    Notes
    -----
    Normal equations accumulated over blocks of rows, then one step of iterative refinement, which
    gives the digits of a QR factorisation for the condition numbers that are let pass.

    Examples
    --------
    >>> t = np.arange(0, 1, 1e-3)
    >>> fit = fit_harmonics(t, 5 + 2 * np.cos(2 * np.pi * 3 * t) - 1 * np.sin(2 * np.pi * 6 * t), 3.0, [1, 2])
    >>> np.round(fit.coefficients, 9) + 0.0
    array([2.+0.j, 0.+1.j])
    """
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    multiples = np.asarray(orders, dtype=float)
    kept = np.isfinite(values) & np.isfinite(time)
    t, x = time[kept], values[kept]
    columns = 1 + drift + 2 * multiples.size
    if t.size <= columns:
        raise InputError(
            f"{t.size} valid samples are too few to fit {multiples.size} harmonics; more than {columns} are needed."
        )
    span = (float(t.min()), float(t.max()))
    mean = x.mean()  # a large offset would cost digits of the small harmonics
    regression = Regression(t, x - mean, frequency, multiples, drift, span)
    solution = regression.solution
    residual = x - mean - regression.apply(solution)
    if regression.condition > 1e3:
        correction = Regression(t, residual, frequency, multiples, drift, span).solution
        solution = solution + correction
        residual = residual - regression.apply(correction)
    sigma = float(np.sqrt(residual @ residual / (t.size - columns)))
    harmonic = np.r_[0, 1 + drift : columns]
    everywhere = np.full(time.shape, np.nan)
    everywhere[kept] = residual
    return HarmonicFit(
        frequency=float(frequency),
        orders=multiples,
        coefficients=solution[1 + drift :: 2] + 1j * solution[2 + drift :: 2],
        offset=float(solution[0] + mean),
        drift=solution[1 : 1 + drift],
        covariance=sigma**2 * regression.inverse[np.ix_(harmonic, harmonic)],
        sigma=sigma,
        n=t.size,
        residual=everywhere,
        span=span,
    )


def fundamental(time: np.ndarray, values: np.ndarray, guess: float | None = None) -> Frequency:
    """Find the fundamental frequency of a periodic record.

    Coarse value from a periodogram, checked against having picked a harmonic; refined by the phase
    advance between the two halves, then by Gauss-Newton on the model of up to five harmonics and a
    linear drift. The standard error is the Cramer-Rao bound with the noise found next to the lines,
    so a coloured residual or an unsteady frequency widens it.

    Parameters
    ----------
    time, values
        Stamps (s, gaps and jitter allowed) and samples, shape (n,); NaN do not count.
    guess
        Frequency in Hz; only within 20 % of it is searched then.

    Raises
    ------
    InputError
        If fewer than 8 samples are valid, nothing moves, or less than one cycle was logged.

    Examples
    --------
    >>> t = np.arange(0, 2, 1e-3)
    >>> round(fundamental(t, 1 + np.sin(2 * np.pi * 7.03 * t)).value, 6)
    7.03
    """
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    kept = np.isfinite(values) & np.isfinite(time)
    t, x = time[kept], values[kept]
    if t.size < 8:
        raise InputError(f"{t.size} valid samples are too few to find a frequency; at least 8 are needed.")
    line = strongest_line(t, x, None if guess is None else (0.8 * guess, 1.2 * guess))
    line = _by_phase_advance(t, x, line)
    order = 1 if guess is not None else _order_of(line, t, x)
    value = line / order
    t, x = block_means(t, x, int(1 / np.median(np.diff(t)) / (_SAMPLES_A_CYCLE * value)))
    whole_cycles = int(value * (t[-1] - t[0]))  # few of them cannot tell harmonics from drift
    highest = max(order, min(5, int(0.45 / np.median(np.diff(t)) / value), (t.size - 4) // 4, whole_cycles))
    return _refined(t, x, value, order, np.arange(1.0, highest + 1))


def _by_phase_advance(time: np.ndarray, values: np.ndarray, line: float) -> float:
    """Correct a line by the phase that it gains from the first to the second half of the record."""
    if line * (time[-1] - time[0]) < 5:
        return line
    halves = (slice(None, time.size // 2), slice(time.size // 2, None))
    for _ in range(2):
        first, second = (fit_harmonics(time[half], values[half], line, [1]).coefficients[0] for half in halves)
        apart = time[halves[1]].mean() - time[halves[0]].mean()
        line += float(np.angle(second * np.conj(first)) / (2 * np.pi * apart))
    return line


def _order_of(line: float, time: np.ndarray, values: np.ndarray) -> int:
    """Tell which order the strongest line is: k > 1 where lines between its multiples say so.

    Orders of line/k that are no multiples of k must hold 1 % of the power of the multiples and agree
    between the two halves of the record; drift and noise do not agree, mains hum is weaker.
    """
    time, values = block_means(time, values, int(1 / np.median(np.diff(time)) / (40 * line)))
    cycles, half_rate = line * (time[-1] - time[0]), 0.45 / float(np.median(np.diff(time)))
    halves = (slice(None, time.size // 2), slice(time.size // 2, None))
    alone = fit_harmonics(time, values, line, np.arange(1, max(min(3, int(half_rate / line)), 1) + 1), 2)
    if alone.sigma**2 < 0.005 * (np.abs(alone.coefficients) ** 2).sum() / 2:
        return 1  # no room for anything else
    shares = {1: 0.01}
    for k in range(2, 7):
        orders = np.arange(1, min(3 * k, int(half_rate * k / line)) + 1)
        if cycles / k < 2.5 or orders.size < k or time.size < 8 * orders.size + 8:
            continue
        between = orders % k != 0
        try:
            a, b = (fit_harmonics(time[half], values[half], line / k, orders, 2).coefficients for half in halves)
        except InputError:  # a gap leaves too little of a half to tell
            continue
        agreeing = np.real(a * np.conj(b))[between].sum()
        if agreeing > 0.25 * (np.abs(a[between]) ** 2 + np.abs(b[between]) ** 2).sum():
            shares[k] = float(agreeing / np.real(a * np.conj(b))[~between].sum())
    return min(k for k, share in shares.items() if share >= 0.9 * max(shares.values()))


def _refined(time: np.ndarray, values: np.ndarray, value: float, order: int, orders: np.ndarray) -> Frequency:
    """Refine a frequency by Gauss-Newton on harmonics and a linear drift, and give its error."""
    span = (float(time[0]), float(time[-1]))
    duration = span[1] - span[0]
    centred = time - time.mean()
    fit = fit_harmonics(time, values, value, orders, drift=1)
    for _ in range(20):
        slope = np.empty(time.size)
        for rows, cycles in in_blocks(time, value):
            turning = 2j * np.pi * orders * fit.coefficients @ exponentials(cycles, orders)
            slope[rows] = turning.real * centred[rows]
        projection = Regression(time, slope, value, orders, 1, span)
        slope -= projection.apply(projection.solution)
        information = float(slope @ slope)
        step = float(np.clip(slope @ fit.residual / information, -0.3 / duration, 0.3 / duration))
        trial = fit_harmonics(time, values, value + step, orders, drift=1)
        while trial.sigma > fit.sigma * (1 + 1e-12) and abs(step) * duration > 1e-9:
            step /= 4
            trial = fit_harmonics(time, values, value + step, orders, drift=1)
        value, fit = value + step, trial
        if abs(step) * duration < 1e-9:
            break
    if value * duration < 0.9:
        raise InputError(f"{value * duration:.2f} cycles were logged; one full cycle is needed to find its frequency.")
    return Frequency(value, noise_beside(time, fit, order) / float(np.sqrt(information)))


def noise_beside(time: np.ndarray, fit: HarmonicFit, order: int) -> float:
    """Return the sd of white noise as strong as the residual is beside the line of that order.

    ``noise_beside(...) * sqrt(2 / n)`` is the standard error of Re X_h and Im X_h under a coloured
    residual. `time` are the stamps that were fitted, shape (n,).

    Mean of the periodogram 2 to 21 lines of 1/T away, between the harmonics; the residual's sd where
    that mean does not differ from it. In very short records no line is left between the harmonics:
    there the sd is widened by the autocorrelation.
    """
    kept = np.isfinite(fit.residual)
    time, residual = time[kept], fit.residual[kept]
    resolution = 1 / (fit.span[1] - fit.span[0])
    away = np.r_[-21:-1, 2:22] * resolution + order * fit.frequency
    distance = np.abs(away[:, None] - np.r_[0, fit.orders * fit.frequency]).min(axis=1)
    half_rate = 0.5 / np.median(np.diff(time))
    beside = away[(away > 0.75 * resolution) & (away < half_rate) & (distance > 1.25 * resolution)]
    if beside.size < 6:
        return fit.sigma / float(np.sqrt(fit.effective_fraction))
    power = np.mean([abs(np.exp(-2j * np.pi * f * time) @ residual) ** 2 / time.size for f in beside])
    if fit.sigma > 0 and abs(np.log(power / fit.sigma**2)) < 2.5 / np.sqrt(beside.size):
        return fit.sigma
    return float(np.sqrt(power))
