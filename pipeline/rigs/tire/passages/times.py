"""The moment of each passage to a fraction of a sample: least squares of [template, template', 1] (tire.md, 5.3).

Its standard error is that of the noise about the fit, coloured as it is. Lost samples do not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.passages.blocks import block_means
from pipeline.rigs.tire.passages.loops import WINDOW, passage_sums
from pipeline.rigs.tire.passages.order_tracking import monotone, monotone_slopes
from pipeline.rigs.tire.passages.template import FINE, Template

# Passages whose residuals tell the colour of the noise.
_SAMPLED = 48
# From so many revolutions behind a passage on, and up to so many before the next, only noise is left.
_FAR = 0.2
# Blocks of a revolution that tell the noise's spectrum.
_BLOCKS = 8192
_ROUGHER = 1.5
_FARTHEST = 0.2
# Share by which the load changes in a radian, over that from passage to passage.
_GROWING = 0.5
# Share by which a passage is wider over that by which it is higher: 0.1 at 1000 N, 0.25 at 3000 N, 0.5 at 6000 N.
_WIDER = 0.3


@dataclass(frozen=True, eq=False)
class PassageFit:
    """Fits of m passages of one chain.

    Attributes
    ----------
    places, errors
        Moment (samples) and its standard error for white noise, shape (m,).
    amplitude
        Height over the template's.
    noise
        Standard deviation of what is left, V.
    explained
        Share of the variance that the template explains.
    share
        Share of the template's information on time that the valid samples hold.
    by_width
        By what angle, rad, a passage that is wider by a share of all its angles is moved, over that share: nothing of an even
        one that is there as a whole.
    """

    places: np.ndarray
    errors: np.ndarray
    amplitude: np.ndarray
    noise: np.ndarray
    explained: np.ndarray
    share: np.ndarray
    by_width: np.ndarray


def fitted(flex: np.ndarray, places: np.ndarray, template: Template) -> PassageFit:
    """Return one pass of fits at the passages `places` (samples, shape (m,), m >= 2)."""
    knots = np.asarray(places, dtype=float)
    slopes = monotone_slopes(knots, np.arange(knots.size, dtype=float))
    s = passage_sums(flex, knots, slopes, template.values, template.slope)
    A = np.empty((knots.size, 3, 3))
    A[:, 0, 0], A[:, 0, 1], A[:, 0, 2] = s[:, 0], s[:, 1], s[:, 2]
    A[:, 1, 1], A[:, 1, 2], A[:, 2, 2] = s[:, 3], s[:, 4], s[:, 5]
    A[:, 1, 0], A[:, 2, 0], A[:, 2, 1] = A[:, 0, 1], A[:, 0, 2], A[:, 1, 2]
    # Values of one size, and full rank where samples lack.
    size = np.array([np.ptp(template.values), np.ptp(template.slope), 1.0])
    A = A / size[:, None] / size + 1e-9 * np.eye(3)
    inverse = np.linalg.inv(A)
    rhs = s[:, 6:9] / size
    x = np.einsum("kij,kj->ki", inverse, rhs)
    width = np.einsum("kj,kj->k", inverse[:, 1], s[:, 11:14] / size) / size[1]
    rss = np.maximum(s[:, 9] - np.einsum("ki,ki->k", x, rhs), 0.0)
    n = s[:, 5]
    total = s[:, 9] - s[:, 8] ** 2 / np.maximum(n, 1.0)
    variance = rss / np.maximum(n - 3.0, 1.0)
    a = x[:, 0] / size[0]
    safe = np.where(np.abs(a) > 1e-12, a, np.nan)
    shift = -x[:, 1] / size[1] / safe
    error = np.sqrt(variance * inverse[:, 1, 1]) / size[1] / np.abs(safe)
    per_radian = 1.0 / (2.0 * np.pi * slopes)
    full = _full_information(template, n=s[:, 10])
    share = size[1] ** 2 / inverse[:, 1, 1] / full
    moved = np.where(np.isfinite(shift), np.clip(shift, -_FARTHEST, _FARTHEST), 0.0)
    explained = 1.0 - np.divide(rss, total, out=np.ones_like(rss), where=total > 0.0)
    return PassageFit(
        knots + moved * per_radian,
        np.where(np.isfinite(error), error, np.inf) * per_radian,
        np.where(np.isfinite(a), a, 0.0),
        np.sqrt(variance),
        explained,
        share,
        np.abs(width),
    )


def between(places: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the places with those that are not `known` put where the known ones say, shape (m,)."""
    order = np.arange(places.size, dtype=float)
    if known.all() or known.sum() < 2:
        return places
    guess = monotone(order[known], places[known], order)
    return np.where(known, places, guess)


def standard_errors(flex: np.ndarray, places: np.ndarray, template: Template, fit: PassageFit) -> np.ndarray:
    """Return the standard errors of the moments by the noise as it is, samples, shape (m,).

    The spectrum of the noise is that of what the template leaves far from the patch, where a change of load or force
    does not reach: there it would be taken for noise. It weighs the spectrum of each estimator. Where nothing is
    recorded far from the patch, the errors are those of white noise.
    """
    slopes = monotone_slopes(places, np.arange(places.size, dtype=float))
    inner = np.arange(1, places.size - 1)
    chosen = inner[np.unique(np.linspace(0, inner.size - 1, min(_SAMPLED, inner.size)).round().astype(int))]
    longest = 1.0 / slopes[chosen].min()
    block = max(1, int(longest / _BLOCKS))
    size = 1 << int(np.ceil(np.log2(max(1.2 * longest / block, 16.0))))
    far = [_far_noise(flex, places, k, template, float(fit.amplitude[k]), block) for k in chosen.tolist()]
    weights = np.array([0.0 if left is None else float(np.sum(left.taper**2)) for left in far])
    if not weights.any():
        return fit.errors
    power = sum(np.abs(np.fft.rfft(left.taper * left.residual, size)) ** 2 for left in far if left is not None)
    spectrum = np.asarray(power) / weights.sum() * places.size / (places.size - 1.0)
    levels = np.array([0.0 if left is None else float(np.sum((left.taper * left.residual) ** 2)) for left in far])
    jumps = np.array([np.nan if left is None else left.jump for left in far])
    if levels.sum() == 0.0:
        return fit.errors
    twice = np.full(spectrum.size, 2.0)
    twice[0] = twice[-1] = 1.0
    factors = np.full(chosen.size, np.nan)
    rough = np.full(chosen.size, np.nan)
    for row, k in enumerate(chosen.tolist()):
        found = _estimator(flex, places, slopes, k, template, block)
        if found is not None:
            weight, white, rough[row] = found
            coloured = float((twice * spectrum * np.abs(np.fft.rfft(weight, size)) ** 2).sum()) / size
            factors[row] = np.sqrt(coloured * _nearby(levels, weights, row) / (levels.sum() / weights.sum()) / white)
    good = np.isfinite(factors)
    if not good.any():
        return fit.errors
    # What is rougher in the patch than far from it is no change of load: too few samples for so sharp a peak.
    rougher = float(np.nanmedian(rough[good])) / max(float(np.nanmedian(jumps)), 1e-30)
    widened = rougher if rougher > _ROUGHER else 1.0
    factor = np.interp(np.arange(places.size), chosen[good], factors[good]) * widened
    unit = np.divide(fit.errors, fit.noise, out=np.full(fit.errors.size, np.inf), where=fit.noise > 0.0)
    return np.asarray(unit * factor)


def load_errors(places: np.ndarray, template: Template, fit: PassageFit) -> np.ndarray:
    """Return the standard errors of the moments by changes of the load, samples, shape (m,).

    A heavier passage is not the same waveform, only higher: what is uneven in it (by hysteresis and lag) grows at another
    rate than what is even, and moves the fit. The share that is uneven, at right angles to a shift, tells by how much: on
    tires of 1000 to 6000 N, sensors of 30 to 95 mm and speeds up to 50 km/h the shift is 0.4 to 1.5 times that. And a load
    that grows while the sensor passes makes the trailing side higher. How fast is taken from how much passages in a row
    differ, as on a drum of twice the tire's size. Where part of a passage is lost, that it is also wider does not cancel.
    """
    angle = 2.0 * np.pi / FINE * np.arange(1 - FINE // 2, FINE // 2)  # That at -pi has no mirror image.
    inside = np.abs(angle) < 2.0 * np.pi * WINDOW
    values, slope = template.values[1:], template.slope[1:][inside]
    uneven = 0.5 * (values - values[::-1])[inside]
    uneven = uneven - slope * (uneven @ slope) / (slope @ slope)
    by_height = float(np.sqrt(uneven @ uneven / (slope @ slope)))
    columns = np.column_stack([slope, values[inside], np.ones(slope.size)])
    by_growth = abs(float(np.linalg.lstsq(columns, angle[inside] * values[inside], rcond=None)[0][0]))
    heavier = np.abs(fit.amplitude / np.median(fit.amplitude) - 1.0)
    differing = float(np.sqrt(0.5 * np.mean(np.diff(fit.amplitude) ** 2)) / np.median(fit.amplitude))
    wider = _WIDER * fit.by_width * np.maximum(heavier, differing)
    turning = 2.0 * np.pi * monotone_slopes(places, np.arange(places.size, dtype=float))
    return np.asarray(
        np.sqrt((by_height * heavier) ** 2 + (by_growth * _GROWING * differing) ** 2 + wider**2) / turning
    )


def _nearby(levels: np.ndarray, weights: np.ndarray, row: int) -> float:
    """Return the variance of the noise about a passage: median of five that are looked at."""
    near = slice(max(row - 2, 0), row + 3)
    there = weights[near] > 0.0
    if not there.any():
        return float(levels.sum() / weights.sum())
    return float(np.median(levels[near][there] / weights[near][there]))


@dataclass(frozen=True, eq=False)
class _Left:
    """What a fit leaves, V, with the weights of a taper; root mean square of its differences from sample to sample."""

    residual: np.ndarray
    taper: np.ndarray
    jump: float


def _far_noise(
    flex: np.ndarray, places: np.ndarray, k: int, template: Template, amplitude: float, block: int
) -> _Left | None:
    """Return what is left far behind passage k, in means of `block` samples."""
    period = places[k + 1] - places[k]
    begin, end = int(places[k] + _FAR * period), int(places[k + 1] - _FAR * period)
    means = block_means(flex[begin : min(end, flex.size)], block)
    valid = np.isfinite(means)
    if means.size < 8 or valid.sum() < 0.7 * means.size:
        return None
    left = means - amplitude * _at(template.values, begin + _middles(means.size, block), places, k)
    u = np.linspace(-1.0, 1.0, means.size)
    left = np.where(valid, left - np.polyval(np.polyfit(u[valid], left[valid], 1), u), 0.0)
    return _Left(left, np.where(valid, np.cos(0.5 * np.pi * u) ** 2, 0.0), _jump(left, valid))


def _estimator(
    flex: np.ndarray, places: np.ndarray, slopes: np.ndarray, k: int, template: Template, block: int
) -> tuple[np.ndarray, float, float] | None:
    """Return the weights of the shift of passage k by block, the sum of their squares by sample, and how rough the rest is."""
    reach = WINDOW / slopes[k]
    begin = max(int(places[k] - reach), 0)
    means = block_means(flex[begin : min(int(places[k] + reach) + 1, flex.size)], block)
    valid = np.isfinite(means)
    if valid.sum() < max(0.5 * means.size, 6):
        return None
    at = begin + _middles(means.size, block)
    T, dT = (_at(table, at, places, k) for table in (template.values, template.slope))
    columns = np.column_stack([T, dT, np.ones(at.size)]) * valid[:, None]
    columns /= np.abs(columns).max(axis=0)
    pseudo = np.linalg.pinv(columns)
    left = np.where(valid, means - columns @ (pseudo @ np.where(valid, means, 0.0)), 0.0)
    return pseudo[1], float(np.sum(pseudo[1] ** 2)) / block, _jump(left, valid)


def _middles(n: int, block: int) -> np.ndarray:
    return np.asarray(np.arange(n) * block + 0.5 * (block - 1))


def _jump(left: np.ndarray, valid: np.ndarray) -> float:
    both = valid[1:] & valid[:-1]
    return float(np.sqrt(np.mean(np.diff(left)[both] ** 2))) if both.any() else float("nan")


def _at(table: np.ndarray, places: np.ndarray, knots: np.ndarray, k: int) -> np.ndarray:
    """Return a table of the template at places (samples) that reach from passage k to its neighbours at most."""
    near = slice(max(k - 3, 0), k + 4)
    order = np.arange(knots.size, dtype=float)[near]
    angle = (monotone(knots[near], order, places) - k + 0.5) * FINE % FINE
    return np.asarray(np.interp(angle, np.arange(FINE + 1), np.append(table, table[0])))


def _full_information(template: Template, n: np.ndarray) -> np.ndarray:
    """Return the information on the angle that n samples of the whole window would hold, shape (m,)."""
    angle = np.abs(np.arange(FINE) - FINE // 2) / FINE
    inside = angle < WINDOW
    columns = np.column_stack([template.values[inside], template.slope[inside], np.ones(inside.sum())])
    size = np.ptp(columns[:, :2], axis=0)
    columns[:, :2] /= size
    inverse = np.linalg.inv(columns.T @ columns / inside.sum() + 1e-12 * np.eye(3))
    return np.asarray(n * size[1] ** 2 / inverse[1, 1])
