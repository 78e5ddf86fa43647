"""An estimate of the ultrafiltrate's volume against the scale: error, drift, rate (rap.md, 5.6 and section 8)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.bootstrap import blocks
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import t_quantile
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.therapy.scale_clock import ScaleLag
from pipeline.rigs.rap.therapy.scale_record import Weighed, without_touches

_BIN = 60.0
_BLOCK = 2400.0
_RATE_OFF = 0.05
_DEVICE_ALONE = (
    "Where the level agrees with the scale, it is the device's own estimate that is off: look at its calibration."
)
# Minutes that are taken together for the scatter of squares.
_STRETCH = 10
# Even quantiles of a normal distribution, to carry an error through what is not linear in it.
_NORMAL = np.array(
    [-1.834, -1.28, -0.954, -0.706, -0.491, -0.297, -0.113, 0.113, 0.297, 0.491, 0.706, 0.954, 1.28, 1.834]
)
# Rates of level and scale nearer than that are the same.
_RATE_SAME = 0.01


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

    @property
    def pump_is_off(self) -> bool:
        """Whether the estimate gains as the scale does, so that a rate off the set one is the pump's doing."""
        own, weighed, ratio = (one.value for one in (self.rate_estimate, self.rate_scale, self.rate_ratio))
        if own is None or weighed is None or ratio is None:
            return True
        return abs(own / weighed - 1.0) < max(_RATE_SAME, 0.3 * abs(ratio - 1.0))


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
    rms = _rms(e, common, gain_u * rise, scale)
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
    problems += _scale_doubts(middle[counted], e, own_sd[counted], bias, what, float(rate_scale.value or 0.0))
    made = VolumeError(
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
    return replace(made, problems=(*_rate_doubts(made, set_rate, what), *problems))


def _rate_doubts(found: VolumeError, set_rate: float | None, what: str) -> list[QualityFinding]:
    """Tell a weighed rate that is not the set one, and whether the pump can be blamed."""
    ratio = found.rate_ratio
    off = float(ratio.value or 1.0) - 1.0
    if not set_rate or abs(off) <= max(_RATE_OFF, 2.0 * float(ratio.std_error or 0.0)):
        return []
    text = f"UF pump gain {1.0 + off:.3f}: the scale sees {100 * off:+.1f} % against the set rate. Calibrate the pump."
    if not found.pump_is_off:
        own = float(found.rate_estimate.value or 0.0) / set_rate - 1.0
        text = (
            f"the scale gains {100 * off:+.1f} % against the set rate and {what} {100 * own:+.1f} %: one of them is wrong. Look at the "
            "scale (drift, touched), fluid_density and the tank's floor before the pump."
        )
    return [QualityFinding("warning", text, channel="uf_flow_set")]


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


def _rms(e: np.ndarray, common: float, gain: float, scale: Weighed) -> Estimate:
    """Return the root mean square of the errors e (n,).

    `common` (m^3) is what all may be off alike by clock and scale: it moves the mean, and the root mean square as that counts
    in it. `gain` is the scale's part of it (type B).
    """
    value = math.sqrt(float(np.mean(e**2)))
    # Differences of neighbouring stretches: what settles slowly behind the first echo does so in every run.
    count = max(e.size // _STRETCH, 2)
    squares = np.array([part.mean() for part in np.array_split(e**2, count)])
    variance = float(np.mean(np.diff(squares) ** 2)) / 2.0
    random = math.sqrt(variance / count) / (2.0 * max(value, 1e-12))
    # A variance from successive differences has two thirds of the usual degrees of freedom (von Neumann 1941).
    dof = max(2.0 * (count - 1.0) / 3.0, 1.0)
    mean, spread = float(e.mean()), float(e.var())
    shifted = np.sqrt(spread + (mean + common * _NORMAL) ** 2)
    moved = float(shifted.std())
    low, high = (
        math.sqrt(spread + max(abs(mean) - 1.96 * common, 0.0) ** 2),
        math.sqrt(spread + (abs(mean) + 1.96 * common) ** 2),
    )
    half = t_quantile(dof) * random
    interval = (max(value - math.hypot(half, value - low), 0.0), value + math.hypot(half, high - value))
    remark = (
        f"means over {_BIN:.0f} s from the first echo on; the scale's own noise in them is "
        f"{1e6 * scale.noise / math.sqrt(_BIN):.2f} mL"
    )
    sd, of_gain = math.hypot(random, moved), moved * gain / common if common > 0.0 else 0.0
    return Estimate("uf_volume_error_rms", value, sd, interval, reason=remark, dof=dof, type_b=of_gain or None)


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


def _scale_doubts(
    time: np.ndarray, e: np.ndarray, sd: np.ndarray, bias: Estimate, what: str, rate: float
) -> list[QualityFinding]:
    """Tell a constant difference and a drift between estimate and scale."""
    out = []
    by_level = bool(np.isfinite(sd).any())
    doubt = float(np.nanmedian(sd)) if by_level else 2e-6
    value, error = float(bias.value or 0.0), float(bias.std_error or 0.0)
    drift = _slope("drift", time, e, 0.0)
    whole = float(drift.value or 0.0) * float(np.ptp(time))
    drifts = drift.ci95 is not None and (drift.ci95[0] > 0.0 or drift.ci95[1] < 0.0)
    drifts &= abs(whole) > max(5e-6, 4.0 * doubt)
    if abs(value) > 3.0 * math.hypot(doubt, error) + 3e-6 and not (drifts and abs(whole) > abs(value)):
        clocks = f" A scale whose clock stands {abs(value) / rate:.0f} s apart looks alike." if rate > 0.0 else ""
        text = f"{what} stands {1e6 * value:+.1f} mL off the scale throughout. " + (
            "The level alone cannot tell an offset of the sensor (1 mm is 8.5 mL) or the tank's area from the volume: calibrate the "
            "geometry once with the scale, and check the tare." + clocks
            if by_level
            else _DEVICE_ALONE
        )
        out.append(QualityFinding("warning", text, channel="uf_level_distance"))
    if drifts:
        text = f"{what} and the scale drift apart by {1e6 * whole:+.1f} mL over the run" + (
            ": the scale drifts, the density or the tank's area is stated wrong, or fluid is lost between membrane and scale."
            if by_level
            else f". {_DEVICE_ALONE}"
        )
        out.append(QualityFinding("warning", text, channel="uf_mass_scale", span=(float(time[0]), float(time[-1]))))
    return out
