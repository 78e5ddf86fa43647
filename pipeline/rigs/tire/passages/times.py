"""The moment of each passage to a fraction of a sample: least squares of [template, template', 1] (tire.md, 5.3).

Its standard error is that of the noise about the fit, coloured as it is. Lost samples do not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.passages.loops import WINDOW, passage_sums
from pipeline.rigs.tire.passages.order_tracking import monotone, monotone_slopes
from pipeline.rigs.tire.passages.template import FINE, Template

# Passages whose residuals tell the colour of the noise.
_SAMPLED = 48
_FARTHEST = 0.2


@dataclass(frozen=True, eq=False)
class PassageFit:
    """Fits of m passages of one chain.

    Attributes
    ----------
    places, errors
        Moment (samples) and its standard error for white noise, shape (m,).
    amplitude, level
        Height by the template's, V over V; level over the window's first sample, V.
    noise
        Standard deviation of what is left, V.
    explained
        Share of the variance that the template explains.
    share
        Share of the template's information on time that the valid samples hold.
    """

    places: np.ndarray
    errors: np.ndarray
    amplitude: np.ndarray
    noise: np.ndarray
    explained: np.ndarray
    share: np.ndarray


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
    )


def between(places: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the places with those that are not `known` put where the known ones say, shape (m,)."""
    order = np.arange(places.size, dtype=float)
    if known.all() or known.sum() < 2:
        return places
    guess = monotone(order[known], places[known], order)
    return np.where(known, places, guess)


def colour(flex: np.ndarray, places: np.ndarray, template: Template, amplitude: np.ndarray) -> np.ndarray:
    """Return by what factor the noise's colour widens the errors of the moments, shape (m,).

    The spectrum of what the fits leave, as against what they would leave of white noise, weighs the spectrum of each
    estimator. Passages in between are interpolated.
    """
    chosen = np.unique(np.linspace(0, places.size - 1, min(_SAMPLED, places.size)).round().astype(int))
    slopes = monotone_slopes(places, np.arange(places.size, dtype=float))
    lengths = 2.0 * WINDOW / slopes[chosen]
    size = 1 << int(np.ceil(np.log2(max(2.0 * lengths.max(), 16.0))))
    left = np.zeros(size // 2 + 1)
    white = np.zeros(size // 2 + 1)
    weights, scale = [], []
    for k in chosen:
        found = _residual(flex, places, slopes, int(k), template)
        if found is None:
            weights.append(np.zeros(size // 2 + 1))
            scale.append(0.0)
            continue
        residual, columns, weight, there = found
        left += np.abs(np.fft.rfft(residual, size)) ** 2
        Q = np.linalg.qr(columns)[0]
        white += there * 1.0 - (np.abs(np.fft.rfft(Q, size, axis=0)) ** 2).sum(axis=1)
        power = np.abs(np.fft.rfft(weight, size)) ** 2
        weights.append(power)
        scale.append(1.0)
    if not np.any(scale) or left.sum() == 0.0:
        return np.ones(places.size)
    spectrum = left / np.maximum(white, 1e-3 * white.max())
    level = left.sum() / white.sum()
    # A few neighbouring lines together, or chance in one of them would rule.
    spectrum = np.convolve(np.pad(spectrum, 2, mode="reflect"), np.full(5, 0.2), mode="valid") / level
    factors = np.array(
        [np.sqrt((spectrum * w).sum() / w.sum()) if on else np.nan for w, on in zip(weights, scale, strict=True)]
    )
    good = np.isfinite(factors)
    return np.asarray(np.maximum(np.interp(np.arange(places.size), chosen[good], factors[good]), 1.0))


def _residual(
    flex: np.ndarray, places: np.ndarray, slopes: np.ndarray, k: int, template: Template
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int] | None:
    """Return what the fit of passage k leaves, its columns, the weights of its moment, and how many samples it has."""
    reach = WINDOW / slopes[k]
    i = np.arange(max(int(places[k] - reach), 0), min(int(places[k] + reach) + 1, flex.size))
    angle = (monotone_phase(i, places, slopes, k) + 0.5) * FINE
    columns = np.column_stack(
        [
            np.interp(angle, np.arange(FINE), template.values, period=FINE),
            np.interp(angle, np.arange(FINE), template.slope, period=FINE),
            np.ones(i.size),
        ]
    )
    y = flex[i]
    valid = np.isfinite(y)
    if valid.sum() < 0.7 * i.size or valid.sum() < 12:
        return None
    columns = np.where(valid[:, None], columns / np.abs(columns).max(axis=0), 0.0)
    y = np.where(valid, y - y[valid].mean(), 0.0)
    pseudo = np.linalg.pinv(columns)
    return y - columns @ (pseudo @ y), columns, pseudo[1], int(valid.sum())


def monotone_phase(i: np.ndarray, knots: np.ndarray, slopes: np.ndarray, k: int) -> np.ndarray:
    """Return the phase round passage k, revolutions, at the samples `i`."""
    order = np.arange(knots.size, dtype=float)
    return monotone(knots, order, i.astype(float)) - k


def _full_information(template: Template, n: np.ndarray) -> np.ndarray:
    """Return the information on the angle that n samples of the whole window would hold, shape (m,)."""
    angle = np.abs(np.arange(FINE) - FINE // 2) / FINE
    inside = angle < WINDOW
    columns = np.column_stack([template.values[inside], template.slope[inside], np.ones(inside.sum())])
    size = np.ptp(columns[:, :2], axis=0)
    columns[:, :2] /= size
    inverse = np.linalg.inv(columns.T @ columns / inside.sum() + 1e-12 * np.eye(3))
    return np.asarray(n * size[1] ** 2 / inverse[1, 1])
