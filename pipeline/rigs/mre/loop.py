"""One steady loop of force against displacement: its harmonics and the numbers read from it (mre.md 3.5).

No model of the material here, and no decision which part of a record is steady.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.estimation.harmonic import HarmonicFit, fit_harmonics, fundamental
from pipeline.signals.spectra import near_mains

N_X = N_F = 15  # harmonics kept of displacement and of force
_FIRST_X = 5  # of the displacement that are always fitted; the others only where the motion has them
_LINES_BELOW = 3  # multiples of the mains frequency that are fitted beside the harmonics
_BINS = 200  # periodogram bins averaged for the noise level at one harmonic


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

    @property
    def omega(self) -> float:
        """Angular frequency, rad/s."""
        return 2 * np.pi * self.frequency

    @property
    def amplitude(self) -> float:
        """Half peak-to-peak of the fitted displacement, m."""
        return half_range(self.X)


@dataclass(frozen=True)
class Pads:
    """Geometry for moduli: `count` pads in parallel, diameter and height in m."""

    diameter: float
    height: float
    count: float = 2.0

    @property
    def modulus_per_stiffness(self) -> float:
        """Return h / (count A), 1/m: G = K h / (2 A) for the two pads of the shear rig."""
        return self.height / (self.count * math.pi * self.diameter**2 / 4)


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
    value, _ = _half_range_with_slope(coefficients)
    return value


def _half_range_with_slope(coefficients: np.ndarray, points: int = 1024) -> tuple[float, np.ndarray]:
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
    near, lines = np.zeros(N_F, dtype=bool), np.zeros(0)
    if mains > 0:
        near = near_mains(f * orders, duration, mains)
        multiples = mains * np.arange(1, _LINES_BELOW + 1)
        clear = np.abs(multiples[:, None] - f * orders).min(axis=1) > 2 / duration
        lines = multiples[clear & (multiples < 0.45 * rate)]
    F = fit_harmonics(time, force, f, [*range(1, n_f + 1), *(lines / f)], drift)

    X_h, F_h = np.zeros(N_X, dtype=complex), np.zeros(N_F, dtype=complex)
    X_h[:n_x], F_h[:n_f] = x.coefficients, F.coefficients[:n_f]
    return Loop(
        run=run,
        frequency=f,
        X=X_h,
        F=F_h,
        sd_x=np.where(np.arange(1, N_X + 1) <= n_x, _noise(time, x, np.arange(1, N_X + 1)), 0.0),
        sd_f=_noise(time, F, orders),
        kept=~near & (orders <= n_f),
        x_mean=x.offset,
        f_mean=F.offset,
        sigma_x=x.sigma,
        sigma_f=F.sigma,
        n_samples=F.n,
        duration=duration,
        current=current,
        preload=preload,
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
    return bool(np.any(lines > 5 * _noise(time, fit, orders)))


def _noise(time: np.ndarray, fit: HarmonicFit, orders: np.ndarray) -> np.ndarray:
    """Return the standard deviation of the real (and imaginary) part of each harmonic, shape of `orders`.

    White residuals give sigma sqrt(2/n). A coloured residual is worse at some harmonics: the level is
    the mean of the residual's periodogram over the nearest bins that the regression has not emptied.
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
    count = round(_BINS * resolution / spacing)
    if power.size < 2 * count:
        return np.full(orders.size, white / math.sqrt(fit.effective_fraction))
    total = np.r_[0.0, np.cumsum(power)]
    first = np.clip(np.searchsorted(bins, orders * fit.frequency) - count // 2, 0, power.size - count)
    level = (total[first + count] - total[first]) / count
    return np.asarray(np.sqrt(level))


def loop_metrics(
    loop: Loop,
    *,
    force_lag: float = 0.0,
    force_lag_sd: float = 0.0,
    run_scatter: float = 0.0,
    scatter_dof: float = math.inf,
    pads: Pads | None = None,
) -> list[Estimate]:
    """Return the numbers read from one loop, each `at` {"run": ...}, force set right by `force_lag`.

    `stiffness_secant` (F_max/x_max, half peak-to-peak of the fitted curves), `stiffness_storage` (N/m),
    `damping` (N s/m), `loss_factor`, with `pads` `shear_modulus_storage` and `shear_modulus_loss` (Pa),
    and `loop_area` (J), `amplitude` (m), `force_amplitude` (N).

    Parameters
    ----------
    force_lag, force_lag_sd
        How late the force is (s) and its standard error: a lag acts as damping -K' lag.
    run_scatter, scatter_dof
        Relative gain error of the force of one run (1 sigma) and its degrees of freedom; it widens the
        interval of everything that scales with the force.

    Notes
    -----
    sigma = A / (pi omega |X_1|^2) with A = pi sum h Im(F_h conj X_h), so K'' = sigma omega for a pure sine.
    """
    lag_turn = 1j * np.arange(1, N_F + 1) * loop.omega
    F = loop.F * np.exp(lag_turn * force_lag)
    dF = lag_turn * F  # per second of lag
    # A harmonic on the mains frequency may be all hum: it is as uncertain as it is large.
    sd_f = np.where(loop.kept, loop.sd_f, np.maximum(loop.sd_f, np.abs(loop.F) / math.sqrt(2)))
    X, X_1, F_1 = loop.X, loop.X[0], F[0]
    orders = np.arange(1, N_X + 1)

    x_max, x_slope = _half_range_with_slope(X)
    F_max, F_slope = _half_range_with_slope(F)
    storage = (F_1 / X_1).real
    loss = (F_1 / X_1).imag
    area = math.pi * float((orders * (F[:N_X] * np.conj(X)).imag).sum())
    damping = area / (math.pi * loop.omega * abs(X_1) ** 2)

    def error(slopes: tuple[np.ndarray, np.ndarray], scaled: float) -> tuple[float, float]:
        # A slope holds d/dRe + j d/dIm, so that d(value) = Re(conj(slope) d(coefficient)).
        slope_x, slope_f = slopes
        noise = float((np.abs(slope_x) ** 2 * loop.sd_x**2).sum() + (np.abs(slope_f) ** 2 * sd_f**2).sum())
        noise += float((np.conj(slope_f) * dF).real.sum() * force_lag_sd) ** 2
        scatter = (scaled * run_scatter) ** 2
        total = noise + scatter
        dof = scatter_dof * (total / scatter) ** 2 if scatter > 0 else math.inf
        return math.sqrt(total), dof

    none_x, none_f = np.zeros(N_X, dtype=complex), np.zeros(N_F, dtype=complex)
    first_x, first_f = none_x.copy(), none_f.copy()
    first_x[0], first_f[0] = 1.0, 1.0
    # d(F_1/X_1) = dF_1/X_1 - F_1/X_1^2 dX_1; the slope of Re(a dz) is conj(a), of Im(a dz) conj(-j a).
    a_f, a_x = 1 / X_1, -F_1 / X_1**2
    storage_slopes = (np.conj(a_x) * first_x, np.conj(a_f) * first_f)
    loss_slopes = (np.conj(-1j * a_x) * first_x, np.conj(-1j * a_f) * first_f)
    area_f = none_f.copy()
    area_f[:N_X] = math.pi * orders * 1j * X
    area_x = -1j * math.pi * orders * F[:N_X]
    per_area = 1 / (math.pi * loop.omega * abs(X_1) ** 2)
    damping_x = area_x * per_area - 2 * damping * X_1 / abs(X_1) ** 2 * first_x
    ratio = loss / storage
    ratio_slopes = (
        (loss_slopes[0] - ratio * storage_slopes[0]) / storage,
        (loss_slopes[1] - ratio * storage_slopes[1]) / storage,
    )
    secant = F_max / x_max
    rows = [
        ("stiffness_secant", secant, error((-secant / x_max * x_slope, F_slope / x_max), secant)),
        ("stiffness_storage", storage, error(storage_slopes, storage)),
        ("damping", damping, error((damping_x, area_f * per_area), damping)),
        ("loss_factor", ratio, error(ratio_slopes, 0.0)),
        ("loop_area", area, error((area_x, area_f), area)),
        ("amplitude", x_max, error((x_slope, none_f), 0.0)),
        ("force_amplitude", F_max, error((none_x, F_slope), F_max)),
    ]
    if pads is not None:
        g = pads.modulus_per_stiffness
        moduli = (("storage", storage, storage_slopes), ("loss", loss, loss_slopes))
        for name, value, (slope_x, slope_f) in moduli:
            rows.append((f"shear_modulus_{name}", value * g, error((g * slope_x, g * slope_f), value * g)))
    return [estimate(name, float(value), sd, dof=dof, at={"run": loop.run}) for name, value, (sd, dof) in rows]


def half_cycle_metrics(
    run: str, displacement: np.ndarray, force: np.ndarray, *, pads: Pads | None = None
) -> list[Estimate]:
    """Return what one load-unload ramp tells: it is no steady loop, so no damping and no model.

    `stiffness_secant` (N/m, from the start to the turn), `loss_work` (J) and `loss_ratio` (lost work
    over loading work), both over the displacements that the unloading covers again, and with `pads`
    `shear_modulus_secant` (Pa). Errors are those of the force noise; a gain error is not in them.

    Raises
    ------
    ValueError
        If one of the branches has fewer than 5 samples.
    """
    x = displacement - displacement[0]
    turn = int(np.argmax(np.abs(x)))
    if turn < 4 or x.size - turn < 5:
        raise ValueError("a ramp needs at least 5 samples on each branch")
    side = math.copysign(1.0, x[turn])
    x, F = side * x, side * force
    sigma = float(np.median(np.abs(np.diff(F, 2))) / 0.6745 / math.sqrt(6))
    start, sd_start = _force_at(x[: turn + 1], F[: turn + 1], 0.0, sigma)
    F = F - start
    force_top, sd_top = _force_at(x[: turn + 1], F[: turn + 1], float(x[turn]), sigma)
    sd_top = math.hypot(sd_top, sd_start)
    low = max(0.0, float(x[turn:].min()))
    grid = np.linspace(low, x[turn], 2001)
    loading, unloading = (_branch(x[part], F[part], grid) for part in (slice(0, turn + 1), slice(turn, None)))
    work = float(np.trapezoid(loading, grid))
    lost = work - float(np.trapezoid(unloading, grid))
    span = x[turn] - low
    sd_work = [sigma * span / math.sqrt(count) for count in (turn + 1, x.size - turn)]
    sd_lost = math.hypot(*sd_work)
    at = {"run": run}
    secant = estimate("stiffness_secant", force_top / x[turn], sd_top / x[turn], at=at)
    out = [
        secant,
        estimate("loss_work", lost, sd_lost, at=at),
        estimate("loss_ratio", lost / work, math.hypot(sd_lost, lost / work * sd_work[0]) / abs(work), at=at),
    ]
    if pads is not None:
        g = pads.modulus_per_stiffness
        out.append(estimate("shear_modulus_secant", force_top / x[turn] * g, sd_top / x[turn] * g, at=at))
    return out


def _force_at(x: np.ndarray, F: np.ndarray, at: float, sigma: float) -> tuple[float, float]:
    """Return the force of a branch at one of its ends, and its error, from a straight line nearby.

    Through the samples within 2 % of the stroke, at least four: one sample alone is noise.
    """
    near = np.argsort(np.abs(x - at), kind="stable")[: max(4, int((np.abs(x - at) < 0.02 * x.max()).sum()))]
    A = np.c_[np.ones(near.size), x[near] - at]
    inverse = np.linalg.pinv(A)
    return float(inverse[0] @ F[near]), sigma * float(np.linalg.norm(inverse[0]))


def _branch(x: np.ndarray, F: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return the force of one branch at displacements `grid`."""
    order = np.argsort(x, kind="stable")
    return np.asarray(np.interp(grid, x[order], F[order]))


def group_levels(values: Sequence[float | None], tolerance: float) -> tuple[list[int], list[float]]:
    """Group measured levels (current, preload) that lie within `tolerance` of their neighbours.

    Returns the label of each value and the level of each label (mean rounded to 0.01, exactly 0 when
    within the tolerance of 0), labels in the order of rising level; None counts as 0.

    Examples
    --------
    >>> group_levels([0.004, 2.001, None, 1.996, 6.0], 0.25)
    ([0, 1, 0, 1, 2], [0.0, 2.0, 6.0])
    """
    numbers = np.array([0.0 if v is None else v for v in values])
    order = np.argsort(numbers, kind="stable")
    labels = np.zeros(numbers.size, dtype=int)
    labels[order] = np.r_[0, np.cumsum(np.diff(numbers[order]) > tolerance)] if numbers.size else []
    levels = [round(float(numbers[labels == g].mean()), 2) for g in range(int(labels.max(initial=-1)) + 1)]
    return labels.tolist(), [0.0 if abs(level) <= tolerance else level for level in levels]
