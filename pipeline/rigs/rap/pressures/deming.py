"""Gain and offset of the device against the bench: a line with errors in both, through means of 5 s (rap.md, eq. 10).

Never on pulsating samples: what is left of the alignment would flatten the line. Limits of agreement are in `agreement`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.rap.pressures.agreement import Means, means_of
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pressures.levels import Level

# Means of fewer windows, or over a smaller share of their scatter, tell no line.
_FEWEST, _FEWEST_BLOCKS, _LEAST_RANGE = 8, 4, 20.0
_SEGMENT = 20.0
# Samples at rest that are enough to tell noise.
_AT_REST = 100
# Share of the bins of a segment that lie between the pump's lines for sure.
_QUIET = 0.15


@dataclass(frozen=True, eq=False)
class Deming:
    """``device = offset + gain bench`` of one tap.

    Attributes
    ----------
    gain, offset
        Estimates, 1 and Pa; their `reason` tells random part and type B apart.
    ratio
        Variance of the device's noise over that of the bench's (lambda), found in the data.
    noise
        Standard deviation of the noise of a sample of device and bench, Pa.
    means
        What the line was laid through.
    covariance
        Of gain and offset without type B, shape (2, 2).
    """

    gain: Estimate
    offset: Estimate
    ratio: float
    noise: tuple[float, float]
    means: Means
    covariance: np.ndarray

    def band(self, bench: np.ndarray) -> np.ndarray:
        """Return the standard error of the line at pressures `bench` (Pa), shape (n,)."""
        (gg, go), (_, oo) = self.covariance
        return np.asarray(np.sqrt(np.maximum(gg * bench**2 + 2.0 * go * bench + oo, 0.0)))


def deming(one: Aligned, levels: Sequence[Level], bench_gain_u: float | None = None) -> Deming:
    """Lay Deming's line through the means of 5 s of one tap.

    Parameters
    ----------
    one
        Device and bench side by side, equalised.
    levels
        Steady stretches: blocks do not cross their beginnings.
    bench_gain_u
        Relative standard uncertainty of the bench's gain (type B); None where not stated.
    """
    means = means_of(one, levels)
    noise = (_noise(one, one.device, levels), _noise(one, one.plain, levels))
    ratio = (noise[0] / noise[1]) ** 2 if noise[1] > 0 else 1e6
    at = {"channel": one.name}
    scatter = np.hypot(*noise) / np.sqrt(max(one.rate, 1.0) * 5.0)
    if (
        means.time.size < _FEWEST
        or means.blocks.count < _FEWEST_BLOCKS
        or float(np.ptp(means.bench)) < _LEAST_RANGE * scatter
    ):
        reason = "the pressure stays at about one level (or the record is short): gain and offset cannot be told apart; step the pump, and stop it"
        nothing = undetermined("gain", reason, at), undetermined("offset", reason, at)
        return Deming(*nothing, ratio, noise, means, np.full((2, 2), np.nan))
    x, y = means.bench, means.device
    shift = float(x.mean()), float(y.mean())
    u, v = x - shift[0], y - shift[1]
    whole = _line(np.array([u.size, u.sum(), v.sum(), u @ u, v @ v, u @ v]), ratio, shift)
    pulls = np.stack([u / (u @ u), 1.0 / u.size - shift[0] * u / (u @ u)])
    spread, dof = _spread(means, whole, pulls)
    type_b = whole[0] * (bench_gain_u or 0.0)
    random = np.sqrt(np.diag(spread))
    remark = (
        f"random part {random[0]:.2g}; gain of the bench (type B) {type_b:.2g}"
        if bench_gain_u
        else f"random part alone ({random[0]:.2g}): the gain of the bench is taken as exact, bench_gain_u not being stated"
    )
    return Deming(
        estimate(
            "gain", whole[0], float(np.hypot(random[0], type_b)), dof=dof, at=at, reason=remark, type_b=type_b or None
        ),
        estimate("offset", whole[1], float(random[1]), dof=dof, at=at),
        ratio,
        noise,
        means,
        spread,
    )


def _spread(means: Means, line: np.ndarray, pulls: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the covariance of gain and offset (2, 2) and its degrees of freedom; `pulls` of the means on both, (2, m).

    The means scatter alike with the pump on and at rest, and those few at rest pull most: their own scatter would tell too
    little, so it is told by all. Noise that hangs together counts by its effective number.
    """
    residual = means.device - line[1] - line[0] * means.bench
    number = min(effective_size(residual, 2), residual.size)
    dof = max(number - 2.0, 1.0)
    variance = float(residual @ residual) / max(residual.size - 2, 1) * residual.size / number
    return variance * pulls @ pulls.T, dof


def line_through(x: np.ndarray, y: np.ndarray, ratio: float) -> tuple[float, float]:
    """Return gain and offset of Deming's line (eq. 10) through points (n,); `ratio` = variance of y over that of x.

    Examples
    --------
    >>> x = np.array([0.0, 1.0, 2.0, 3.0])
    >>> [round(float(value), 12) for value in line_through(x, 2.0 * x + 1.0, 6.25)]
    [2.0, 1.0]
    """
    shift = float(x.mean()), float(y.mean())
    u, v = x - shift[0], y - shift[1]
    gain, offset = _line(np.array([x.size, 0.0, 0.0, u @ u, v @ v, u @ v]), ratio, shift)
    return float(gain), float(offset)


def _line(sums: np.ndarray, ratio: float, shift: tuple[float, float]) -> np.ndarray:
    n, x, y, xx, yy, xy = sums
    xx, yy, xy = xx - x * x / n, yy - y * y / n, xy - x * y / n
    apart = yy - ratio * xx
    # Two forms of one root: each loses digits where the other is exact.
    root = np.sqrt(apart * apart + 4.0 * ratio * xy * xy)
    gain = (apart + root) / (2.0 * xy) if apart > 0 else 2.0 * ratio * xy / (root - apart)
    return np.array([gain, shift[1] + y / n - gain * (shift[0] + x / n)])


def _noise(one: Aligned, values: np.ndarray, levels: Sequence[Level]) -> float:
    """Return the noise of a sample, Pa: where the pump stands if it does, under the pulsation otherwise."""
    for level in levels:
        inside = one.good & (one.time >= level.start) & (one.time <= level.end)
        if level.steady and not level.turning and inside.sum() >= _AT_REST:
            time = one.time[inside] - level.start
            return float(np.std(values[inside] - np.polyval(np.polyfit(time, values[inside], 1), time), ddof=2))
    return noise_of(values, one.good, one.rate)


def noise_of(values: np.ndarray, good: np.ndarray, rate: float) -> float:
    """Return the standard deviation of the white noise under a pulsating signal, from the floor of its spectrum.

    `values`, `good` have shape (n,); segments of 20 s with a gap are left out. Coloured parts beside the pump's lines count
    where they lie above 0.5 Hz.
    """
    size = round(_SEGMENT * rate)
    count = values.size // size if size > 8 else 0
    if not count:
        return float(np.std(values[good])) if good.any() else float("nan")
    pieces = values[: count * size].reshape(count, size)
    pieces = pieces[good[: count * size].reshape(count, size).all(axis=1)]
    if not pieces.size:
        return float(np.std(values[good])) if good.any() else float("nan")
    hann = np.hanning(size + 1)[:-1]
    power = np.abs(np.fft.rfft((pieces - pieces.mean(axis=1, keepdims=True)) * hann, axis=1)) ** 2 / float(hann @ hann)
    above = power[:, np.fft.rfftfreq(size, 1.0 / rate) > 0.5]
    if not above.shape[1]:
        return float(np.std(values[good]))
    # Segment by segment: the lines move with the speed. Most of the quietest bins hold noise alone.
    quiet = np.quantile(above, _QUIET, axis=1) / -np.log1p(-_QUIET)
    return float(np.sqrt(quiet.mean()))
