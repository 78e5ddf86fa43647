"""An estimate of the ultrafiltrate's volume against the scale: clock, error, rate (rap.md, 5.6 and section 8)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.bootstrap import blocks
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import effective_size, t_quantile
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.therapy.scale_record import Weighed, weighed, without_touches
from pipeline.rigs.rap.therapy.tank_filter import TankCourse

__all__ = ["ScaleLag", "VolumeError", "Weighed", "against_scale", "scale_lag", "weighed"]

SEARCH = 60.0
_BIN = 60.0
_BLOCK = 2400.0
_CLOCK_SURE = 5.0
# Readings that count around a start or stop, s.
_AROUND = 600.0
_RATE_OFF = 0.05


@dataclass(frozen=True)
class ScaleLag:
    """Scale's clock less the device's: `lag` (s; no value where nothing tells it), `value` to go on with, its `sd`."""

    lag: Estimate
    value: float
    sd: float
    problems: tuple[QualityFinding, ...]

    @property
    def determined(self) -> bool:
        """Whether the data tell it."""
        return self.lag.determined


@dataclass(frozen=True, eq=False)
class VolumeError:
    """Estimate less scale in means over a minute; arrays (n,), device's clock, m^3.

    Attributes
    ----------
    rms
        After the first echo (`from_time`, s).
    final, final_percent, largest, bias
        Over the last minutes (m^3; % of what was removed), largest size, mean.
    rate_scale, rate_estimate, rate_set
        Slopes while the pump runs, m^3/s; `rate_ratio` is weighed over set.
    """

    rms: Estimate
    final: Estimate
    final_percent: float
    largest: float
    bias: Estimate
    time: np.ndarray
    estimate: np.ndarray
    sd: np.ndarray
    scale: np.ndarray
    error: np.ndarray
    counted: np.ndarray
    from_time: float
    rate_scale: Estimate
    rate_estimate: Estimate
    rate_ratio: Estimate
    problems: tuple[QualityFinding, ...]


def scale_lag(scale: Weighed, course: TankCourse) -> ScaleLag:
    """Find how the scale's clock stands to the device's from starts and stops.

    A steady rise tells nothing: a later clock looks like a fuller tank. Without anything else the clocks are taken to
    agree, to +-30 s, and that is told.
    """
    from scipy.optimize import minimize_scalar

    span = (max(scale.time[0], course.time[0] - SEARCH), min(scale.time[-1], course.time[-1] + SEARCH))
    use = scale.good & (scale.time >= span[0]) & (scale.time <= span[1])
    if use.sum() < 60:
        raise InputError(
            "the scale and the device's level share less than a minute; look at the clocks of the two tables."
        )
    t, v = scale.time[use], scale.volume[use] * 1e6
    rate = _usual_rate(course)
    pieces = [
        (t[near], v[near]) for kink in _kinks(course, rate) if _both_sides(near := np.abs(t - kink) < _AROUND, t, kink)
    ]

    def residual(lag: float) -> np.ndarray:
        """Return what each piece leaves of the scale with an offset and a gain of its own."""
        left = []
        for moment, volume in pieces:
            X = np.stack(
                [np.ones(moment.size), np.interp(moment - lag, course.time, course.smoothed_volume * 1e6)], axis=1
            )
            c, *_ = np.linalg.lstsq(X, volume, rcond=None)
            left.append(volume - X @ c)
        return np.concatenate(left)

    if pieces:
        trial = np.linspace(-SEARCH, SEARCH, 61)
        values = [float(np.mean(residual(x) ** 2)) for x in trial]
        best = int(np.argmin(values))
        bounds = (trial[max(best - 1, 0)], trial[min(best + 1, trial.size - 1)])
        found = minimize_scalar(
            lambda x: float(np.mean(residual(x) ** 2)), bounds=bounds, method="bounded", options={"xatol": 0.01}
        )
        lag, least = float(found.x), float(found.fun)
        h = 5.0
        either = [float(np.mean(residual(lag + side) ** 2)) for side in (-h, h)]
        curvature = (sum(either) - 2.0 * least) / h**2
        n = effective_size(residual(lag), 3 * len(pieces))
        sd = math.sqrt(2.0 * least / (n * curvature)) if curvature > 0.0 else math.inf
        if sd < _CLOCK_SURE and abs(lag) < 0.95 * SEARCH:
            # Which second a row of the command stands for is not known better.
            sd = math.hypot(sd, 0.5)
            told = estimate("scale_lag", lag, sd, reason="from starts and stops, which both show")
            return ScaleLag(told, lag, sd, ())
    reason = (
        "the volume rises steadily while both are logged, and a later clock looks like a fuller tank; begin the log of the "
        "scale before the pump starts, or pause once"
    )
    text = f"the scale's clock cannot be told from the data; it is taken to agree with the device's, which to +-30 s is worth +-{30e6 * rate:.1f} mL."
    return ScaleLag(
        undetermined("scale_lag", reason),
        0.0,
        30.0 / math.sqrt(3.0),
        (QualityFinding("note", text, channel="uf_mass_scale"),),
    )


def _usual_rate(course: TankCourse) -> float:
    """Return how fast the tank usually fills, m^3/s."""
    rate = np.diff(course.smoothed_volume) / np.maximum(np.diff(course.time), 1e-9)
    on = rate[rate > 0.0]
    return float(np.median(on)) if on.size else 0.0


def _kinks(course: TankCourse, rate: float) -> list[float]:
    """Return when the filling starts or stops, s, away from emptyings."""
    steps = np.diff(course.smoothed_volume)
    now = steps / np.maximum(np.diff(course.time), 1e-9)
    on = now > 0.5 * rate
    turns = np.flatnonzero(on[1:] != on[:-1]) + 1
    falls = course.time[1:][steps < -20e-6]
    # An emptying takes its time, which the course does not follow.
    clear = [t for t in course.time[turns] if not np.any(np.abs(falls - t) < _AROUND)]
    return [float(t) for i, t in enumerate(clear) if i == 0 or t - clear[i - 1] > 30.0]


def _both_sides(near: np.ndarray, t: np.ndarray, kink: float) -> bool:
    """Tell whether readings stand on either side of a kink."""
    return bool((t[near] < kink - SEARCH).sum() >= 10 or (t[near] < kink).sum() >= 8) and (t[near] > kink).sum() >= 60


def against_scale(
    time: np.ndarray,
    volume: np.ndarray,
    sd: np.ndarray | None,
    scale: Weighed,
    lag: ScaleLag,
    *,
    first_echo: float | None,
    gain_u: float = 0.0,
    emptied: tuple[float, ...] = (),
    set_rate: float | None = None,
    what: str = "the volume by the level",
) -> VolumeError:
    """Compare an estimate of the volume with the scale.

    Parameters
    ----------
    time, volume, sd
        Estimate on the device's clock, shape (m,), m^3; `sd` None where it tells no error.
    first_echo
        Where the comparison begins, s; None: no level was ever seen.
    gain_u
        Relative standard uncertainty of the scale's gain (type B).
    emptied
        When the tank was emptied, s: jumps of the scale there are no touches.
    what
        What is compared, for messages.
    set_rate
        Rate as set while the pump runs, m^3/s, for the ratio of weighed to set.

    Raises
    ------
    InputError
        If there is no echo, or fewer than five minutes are common after the first one.
    """
    if first_echo is None:
        raise InputError("the level was never seen, so there is no estimate of the volume to hold against the scale.")
    problems: list[QualityFinding] = []
    scale, touched = without_touches(scale, tuple(t + lag.value for t in emptied), 120.0)
    problems += touched
    begin = max(first_echo, float(time[0]), float(scale.time[0] - lag.value))
    end = min(float(time[-1]), float(scale.time[-1] - lag.value))
    edges = begin + _BIN * np.arange(int(max(end - begin, 0.0) // _BIN) + 1)
    if edges.size < 6:
        raise InputError(
            f"estimate and scale share {max(end - begin, 0.0) / 60.0:.1f} min after the first echo; five are the least to compare them."
        )
    own = _means(time, volume, edges)
    other = _means(scale.time[scale.good] - lag.value, scale.volume[scale.good], edges)
    own_sd = _means(time, sd, edges) if sd is not None else np.full(edges.size - 1, np.nan)
    middle = 0.5 * (edges[1:] + edges[:-1])
    rise = float(np.nanmax(other) - np.nanmin(other))
    near = [np.abs(middle - e) < 120.0 for e in emptied]
    known = np.isfinite(own) & np.isfinite(other)
    counted = known & ~np.any(near, axis=0) if near else known
    error = own - other
    if counted.sum() < 5:
        raise InputError(
            "fewer than five minutes hold both an estimate and a weighing; look at the gaps of uf_mass_scale."
        )
    e = error[counted]
    clock = lag.sd * _median_rate(middle[counted], other[counted])
    common = math.hypot(clock, gain_u * rise)
    rms = _rms(e, common, scale)
    tail = e[-5:]
    final_sd = math.hypot(scale.noise / math.sqrt(_BIN * tail.size), common)
    final = estimate("uf_volume_error_final", float(tail.mean()), final_sd)
    bias = estimate("uf_volume_bias", float(e.mean()), math.hypot(_block_sd(e), common), dof=_dof(e.size))
    running = _running(middle, other, counted)
    rate_scale = _slope("uf_rate_scale", middle[running], other[running], gain_u)
    rate_own = _slope("uf_rate_estimate", middle[running], own[running], 0.0)
    ratio = undetermined("uf_rate_ratio", "no set-point, or no steady rise")
    if set_rate and rate_scale.value is not None and rate_scale.std_error is not None:
        ratio = estimate(
            "uf_rate_ratio", rate_scale.value / set_rate, rate_scale.std_error / set_rate, dof=rate_scale.dof
        )
        off = abs(float(ratio.value or 1.0) - 1.0)
        if off > _RATE_OFF and off > 2.0 * float(ratio.std_error or 0.0):
            text = f"UF pump gain {ratio.value:.3f}: the scale sees {100 * (float(ratio.value or 1.0) - 1.0):+.1f} % against the set rate. Calibrate the pump."
            problems.append(QualityFinding("warning", text, channel="uf_flow_set"))
    problems += _scale_doubts(middle[counted], e, own_sd[counted], bias, what)
    return VolumeError(
        rms=rms,
        final=final,
        final_percent=100.0 * float(final.value or 0.0) / rise if rise > 0.0 else math.nan,
        largest=float(np.abs(e).max()),
        bias=bias,
        time=middle,
        estimate=own,
        sd=own_sd,
        scale=other,
        error=error,
        counted=counted,
        from_time=begin,
        rate_scale=rate_scale,
        rate_estimate=rate_own,
        rate_ratio=ratio,
        problems=tuple(problems),
    )


def _means(time: np.ndarray, values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return means over the bins, NaN for empty ones."""
    known = np.isfinite(values)
    member = np.searchsorted(edges, time[known], side="right") - 1
    inside = (member >= 0) & (member < edges.size - 1)
    count = np.bincount(member[inside], minlength=edges.size - 1)
    total = np.bincount(member[inside], weights=values[known][inside], minlength=edges.size - 1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _dof(n: int) -> float:
    return max(n * _BIN / _BLOCK - 1.0, 1.0)


def _block_sd(e: np.ndarray) -> float:
    """Return the standard error of the mean of errors that hang together, by blocks of 40 min or a third of the run."""
    length = min(round(_BLOCK / _BIN), max(e.size // 3, 1))
    return float(np.std([e[rows].mean() for rows in blocks(e.size, length, 400)], ddof=1))


def _rms(e: np.ndarray, common: float, scale: Weighed) -> Estimate:
    """Return the root mean square with an interval from blocks."""
    value = math.sqrt(float(np.mean(e**2)))
    length = min(round(_BLOCK / _BIN), max(e.size // 3, 1))
    draws = np.array([np.mean(e[rows] ** 2) for rows in blocks(e.size, length, 400)])
    random = float(draws.std(ddof=1)) / (2.0 * max(value, 1e-12))
    dof = _dof(e.size)
    sd = math.hypot(random, common)
    half = math.hypot(t_quantile(dof) * random, t_quantile(math.inf) * common)
    remark = (
        f"means over {_BIN:.0f} s from the first echo on; the scale's own noise in them is "
        f"{1e6 * scale.noise / math.sqrt(_BIN):.2f} mL"
    )
    return Estimate("uf_volume_error_rms", value, sd, (max(value - half, 0.0), value + half), reason=remark, dof=dof)


def _median_rate(time: np.ndarray, volume: np.ndarray) -> float:
    return float(np.median(np.abs(np.diff(volume) / np.diff(time)))) if time.size > 1 else 0.0


def _running(time: np.ndarray, volume: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Tell which means lie on the longest rise without a pause or an emptying."""
    rate = np.diff(volume, append=np.nan) / _BIN
    usual = np.nanmedian(rate[counted]) if counted.any() else math.nan
    on = counted & (rate > 0.75 * usual) & (rate < 1.33 * usual)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    out = np.zeros(time.size, dtype=bool)
    if edges.size:
        longest = int(np.argmax(edges[1::2] - edges[::2]))
        out[edges[2 * longest] : edges[2 * longest + 1]] = True
    return out


def _slope(name: str, time: np.ndarray, volume: np.ndarray, gain_u: float) -> Estimate:
    """Return the slope of a straight line with an error that residuals which hang together widen."""
    if time.size < 10:
        return undetermined(name, f"{time.size} min of steady rise; ten are the least for a rate")
    from pipeline.estimation.uncertainty import widened

    x = (time - time.mean()) / np.ptp(time)
    X = np.stack([np.ones(x.size), x], axis=1)
    c, *_ = np.linalg.lstsq(X, volume, rcond=None)
    left = volume - X @ c
    variance = float(left @ left) / (x.size - 2)
    told = widened(np.linalg.inv(X.T @ X) * variance, left)
    slope = float(c[1]) / float(np.ptp(time))
    sd = math.hypot(float(told.std_error[1]) / float(np.ptp(time)), gain_u * slope)
    return estimate(name, slope, sd, dof=told.dof)


def _scale_doubts(time: np.ndarray, e: np.ndarray, sd: np.ndarray, bias: Estimate, what: str) -> list[QualityFinding]:
    """Tell a constant difference and a drift between estimate and scale."""
    out = []
    doubt = float(np.nanmedian(sd)) if np.isfinite(sd).any() else 2e-6
    value, error = float(bias.value or 0.0), float(bias.std_error or 0.0)
    if abs(value) > 3.0 * math.hypot(doubt, error) + 3e-6:
        text = (
            f"{what} stands {1e6 * value:+.1f} mL off the scale throughout. The level alone cannot tell an offset of the sensor "
            "(1 mm is 8.5 mL) or the tank's area from the volume: calibrate the geometry once with the scale, and check the tare."
        )
        out.append(QualityFinding("warning", text, channel="uf_level_distance"))
    drift = _slope("drift", time, e, 0.0)
    if drift.value is not None and drift.ci95 is not None and (drift.ci95[0] > 0.0 or drift.ci95[1] < 0.0):
        whole = drift.value * float(np.ptp(time))
        if abs(whole) > max(5e-6, 4.0 * doubt):
            text = (
                f"{what} and the scale drift apart by {1e6 * whole:+.1f} mL over the run: the scale drifts, the density or the tank's area "
                "is stated wrong, or fluid is lost between membrane and scale."
            )
            out.append(QualityFinding("warning", text, channel="uf_mass_scale", span=(float(time[0]), float(time[-1]))))
    return out
