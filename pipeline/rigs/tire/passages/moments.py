"""The moments of a chain of passages, and the waveform that they are fitted with, which they make (tire.md, 5.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.tire.passages.chains import Chain, chains_of
from pipeline.rigs.tire.passages.loops import sums_by_angle
from pipeline.rigs.tire.passages.order_tracking import monotone_slopes
from pipeline.rigs.tire.passages.revolutions import BINS
from pipeline.rigs.tire.passages.template import ORDERS, Template, from_bins, mean_of
from pipeline.rigs.tire.passages.times import PassageFit, between, fitted, load_errors, standard_errors

# A candidate of which the template explains less, or that is lower than this share of the usual, is no passage.
_EXPLAINED, _LEAST = 0.5, 0.15
# A moment is taken from its neighbours where less of the template's information is there.
_INFORMATION = 0.1
_FIRST_PASSES, _PASSES = 5, 1
# A chain of so many passages makes its own template, of so many revolutions at most.
_ENOUGH, _MOST = 8, 120
# Orders of the template per sample of a revolution: more of them would follow each revolution's own few samples.
_PER_ORDER, _FEWEST_ORDERS = 0.7, 24.0


@dataclass(frozen=True, eq=False)
class Moments:
    """A chain with its moments.

    Attributes
    ----------
    places, errors
        Samples from the beginning of the stretch, shape (m,).
    repaired
        Whether a moment is taken from its neighbours, shape (m,).
    fit, template
        The last fits, and what was fitted, V.
    """

    places: np.ndarray
    errors: np.ndarray
    repaired: np.ndarray
    fit: PassageFit
    template: Template


def moments_of(flex: np.ndarray, chain: Chain, valid: np.ndarray, known: Template | None, sign: int) -> Moments | None:
    """Return the moments of a chain, without candidates that are no passages; None where too few are left.

    Parameters
    ----------
    flex
        V, shape (n,), NaN where lost.
    valid
        How many of them are valid up to each, shape (n + 1,).
    known
        The template of the stretch before, so that the angle keeps its zero; None at the beginning.
    sign
        +1 where peaks point up.
    """
    places, template = chain.places, known
    if template is None:
        template = _template(flex, places)
        template = template.turned(template.top if sign > 0 else _lowest(template))
    for turn in range(_FIRST_PASSES if known is None else _PASSES):
        fit = fitted(flex, places, template)
        if turn == 0:
            real = _real(fit, chain)
            if not real.all():
                shorter = _without(places[real], np.abs(fit.amplitude[real]), valid)
                return None if shorter is None else moments_of(flex, shorter, valid, known, sign)
        there = (fit.share > _INFORMATION) & ~chain.repaired
        if there.sum() < 3:
            return None
        places = between(np.where(there, fit.places, places), there)
        if known is None or places.size >= _ENOUGH:
            template = _template(flex, places)
    fit = fitted(flex, places, template)
    places = between(np.where(there, fit.places, places), there)
    noise, load = standard_errors(flex, places, template, fit), load_errors(places, template, fit)
    errors = np.where(there, np.hypot(noise, load), _error_between(places, there))
    return Moments(places, errors, ~there, fit, template)


def mean_by_angle(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the mean of samples by bins of angle over up to 120 revolutions, evenly spread, shape (BINS,).

    Parameters
    ----------
    values
        Samples of a stretch, shape (n,), NaN where lost; empty bins are NaN.
    places
        Passages of a chain, in samples, shape (m,).
    """
    slopes = monotone_slopes(places, np.arange(places.size, dtype=float))
    chosen = np.unique(np.linspace(0, places.size - 1, min(places.size, _MOST)).round().astype(np.int64))
    total, count = np.zeros((chosen.size, BINS)), np.zeros((chosen.size, BINS), dtype=np.int64)
    sums_by_angle(values, places, slopes, chosen, total, count)
    return mean_of(total / np.maximum(count, 1), count)


def _real(fit: PassageFit, chain: Chain) -> np.ndarray:
    """Return which candidates look like a passage, or cannot be judged."""
    judged = fit.share > _INFORMATION
    usual = float(np.median(fit.amplitude[judged])) if judged.any() else 1.0
    good = (fit.explained > _EXPLAINED) & (fit.amplitude > _LEAST * usual)
    return np.asarray(good | chain.repaired | ~judged)


def _without(places: np.ndarray, heights: np.ndarray, valid: np.ndarray) -> Chain | None:
    """Return the longest chain of the candidates that are left."""
    chains, _ = chains_of(places, heights, valid)
    return max(chains, key=lambda chain: chain.places.size, default=None)


def _template(flex: np.ndarray, places: np.ndarray) -> Template:
    """Return the mean voltage of the chain by angle."""
    per_turn = float(np.median(np.diff(places)))
    return from_bins(mean_by_angle(flex, places), int(np.clip(_PER_ORDER * per_turn, _FEWEST_ORDERS, ORDERS)))


def _lowest(template: Template) -> float:
    return replace(template, values=-template.values).top


def _error_between(places: np.ndarray, known: np.ndarray) -> float:
    """Return how far a known moment is from where its neighbours put it, samples, as a standard error."""
    at = np.flatnonzero(known)
    before, inner, behind = at[:-2], at[1:-1], at[2:]
    even = behind - inner == inner - before
    off = (places[inner] - 0.5 * (places[before] + places[behind]))[even]
    return float(np.sqrt(np.mean(off**2))) if off.size else float(np.diff(places).mean())
