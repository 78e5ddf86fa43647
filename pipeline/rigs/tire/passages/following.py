"""One stretch of a log after another becomes revolutions; the last turns of each are looked at again with the next."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.tire.passages.chains import Chain, chains_of
from pipeline.rigs.tire.passages.device import Device, Piece
from pipeline.rigs.tire.passages.loops import block_means, in_bins
from pipeline.rigs.tire.passages.order_tracking import monotone_slopes
from pipeline.rigs.tire.passages.peaks import coarse, humps_of, pointing
from pipeline.rigs.tire.passages.resistance import in_upper_leg
from pipeline.rigs.tire.passages.revolutions import BINS, Revolutions, joined, none_of
from pipeline.rigs.tire.passages.template import FINE, ORDERS, Template, bridged, from_bins
from pipeline.rigs.tire.passages.times import PassageFit, between, fitted, standard_errors

# Longest stretch that is kept for the next piece, s; turns that are kept; what is kept where there is no passage, s.
_KEPT, _TURNS, _TAIL = 120.0, 3.6, 20.0
# A candidate of which the template explains less, or that is lower than this share of the usual, is no passage.
_EXPLAINED, _LEAST = 0.5, 0.15
# A moment is taken from its neighbours where less of the template's information is there.
_INFORMATION = 0.1
# A revolution is whole with this share of its samples about the patch.
_WHOLE, _PATCH = 0.6, 0.12
_FIRST_PASSES = 5
_ENOUGH = 8
# Orders of the template per sample of a revolution: more of them would follow each revolution's own few samples.
_PER_ORDER, _FEWEST_ORDERS = 0.7, 24.0
# The flex sensor that reads an end of its range for so many seconds is broken.
_OPEN = 1.0
# What the mains do is looked for in so many seconds.
_HUM = 20.0


@dataclass(frozen=True, eq=False)
class _Refined:
    """A chain with its moments: samples and standard errors."""

    chain: Chain
    places: np.ndarray
    errors: np.ndarray
    fit: PassageFit


class Follower:
    """Follows a log piece by piece."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._sign = 0
        self._upper_leg = False
        self._template: Template | None = None
        self._tail: Piece | None = None
        self._done = -np.inf

    def take(self, piece: Piece, *, last: bool) -> Revolutions:
        """Return the revolutions that are complete with this piece."""
        stretch = self._with_tail(piece)
        flex, rate, step = stretch.flex, stretch.rate, self._device.step
        means, size = coarse(flex, rate, step)
        if not self._sign:
            self._sign = pointing(means, size, rate, step)
        if not self._sign:
            self._keep(stretch, flex.size - int(_TAIL * rate))
            quantiles = np.nanquantile(means, [0.005, 0.995]) if np.isfinite(means).any() else [np.nan, np.nan]
            span = (stretch.begins, stretch.begins + flex.size / rate)
            swing = float(quantiles[1] - quantiles[0])
            return replace(none_of(self._device), still=(span,), open=self._open(stretch), swing=swing)
        found = humps_of(self._sign * means, size, rate, step)
        opened = self._open(stretch)
        valid = np.concatenate([[0], np.cumsum(np.isfinite(flex))])
        chains, doubled = chains_of(found.places, found.heights, valid)
        refined = [self._refined(flex, chain, valid) for chain in chains]
        good = [entry for entry in refined if entry is not None]
        blocks = [self._binned(stretch, entry, last=last and entry is good[-1]) for entry in good]
        blocks = [block for block in blocks if len(block)]
        places = good[-1].places if good else np.zeros(0)
        if places.size > 3 and not last:
            self._keep(stretch, int(places[-4] - 0.6 * (places[-3] - places[-4])))
        else:
            self._keep(stretch, flex.size - int(_TAIL * rate))
        still = tuple(
            (stretch.begins + a / rate, stretch.begins + b / rate)
            for a, b in found.empty
            if not any(entry.places[0] < b and a < entry.places[-1] for entry in good)
        )
        stops = tuple(
            (stretch.begins + before.places[-1] / rate, stretch.begins + behind.places[0] / rate)
            for before, behind in zip(good[:-1], good[1:], strict=True)
        )
        done = joined(blocks) if blocks else none_of(self._device)
        if len(done):
            self._done = float(done.times[-1])
        return replace(
            done,
            stops=stops,
            still=still,
            open=opened,
            doubled=doubled,
            polarity=self._polarity(),
            upper_leg=self._upper_leg,
            swing=found.swing,
        )

    def _open(self, stretch: Piece) -> tuple[tuple[float, float], ...]:
        """Return when the flex sensor reads an end of its range for longer than a passage can."""
        if stretch.clipped is None:
            return ()
        edges = np.flatnonzero(np.diff(np.concatenate([[False], stretch.clipped | np.isnan(stretch.flex), [False]]).astype(np.int8)))
        return tuple(
            (stretch.begins + a / stretch.rate, stretch.begins + b / stretch.rate)
            for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
            if b - a > _OPEN * stretch.rate and stretch.clipped[a:b].mean() > 0.5
        )

    def _polarity(self) -> int:
        return -self._sign if self._upper_leg else self._sign

    def _with_tail(self, piece: Piece) -> Piece:
        """Return the piece behind what was kept, unless a silence lies between."""
        tail = self._tail
        if tail is None or tail.first + tail.flex.size != piece.first:
            return piece

        def both(a: np.ndarray | None, b: np.ndarray | None) -> np.ndarray | None:
            if a is None and b is None:
                return None
            nothing = [np.zeros(p.flex.size, dtype=bool) for p in (tail, piece)]
            return np.concatenate([nothing[0] if a is None else a, nothing[1] if b is None else b])

        return Piece(
            tail.first,
            tail.begins,
            piece.rate,
            np.concatenate([tail.flex, piece.flex]),
            both(tail.film, piece.film),
            both(tail.clipped, piece.clipped),
            both(tail.film_clipped, piece.film_clipped),
        )

    def _keep(self, stretch: Piece, begin: int) -> None:
        begin = max(begin, stretch.flex.size - int(_KEPT * stretch.rate), 0)

        def rest(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else values[begin:].copy()

        self._tail = Piece(
            stretch.first + begin,
            stretch.begins + begin / stretch.rate,
            stretch.rate,
            stretch.flex[begin:].copy(),
            rest(stretch.film),
            rest(stretch.clipped),
            rest(stretch.film_clipped),
        )

    def _refined(self, flex: np.ndarray, chain: Chain, valid: np.ndarray) -> _Refined | None:
        """Return the moments of a chain, without candidates that are none."""
        template, new = self._template, self._template is None
        places = chain.places
        if template is None:
            template = self._built(flex, places)
            template = template.turned(template.top) if self._sign > 0 else template.turned(_bottom(template))
        for turn in range(_FIRST_PASSES if new else 2):
            fit = fitted(flex, places, template)
            real = self._real(fit, chain)
            if turn == 0 and not real.all():
                kept = real | chain.repaired
                again, _ = chains_of(places[real], np.abs(fit.amplitude[real]), valid)
                if not again:
                    return None
                del kept
                longest = max(again, key=lambda c: c.places.size)
                if longest.places.size == places.size and np.array_equal(longest.places, places):
                    return None
                return self._refined(flex, longest, valid)
            known = (fit.share > _INFORMATION) & ~chain.repaired
            if known.sum() < 3:
                return None
            places = between(np.where(known, fit.places, places), known)
            if new:
                template = self._built(flex, places)
        if places.size >= _ENOUGH and not new:
            template = self._built(flex, places)
            fit = fitted(flex, places, template)
            places = between(np.where(known, fit.places, places), known)
        self._template = template
        fit = fitted(flex, places, template)
        errors = np.where(known, standard_errors(flex, places, template, fit), _guess_error(places, known))
        return _Refined(replace(chain, repaired=~known), places, errors, fit)

    def _real(self, fit: PassageFit, chain: Chain) -> np.ndarray:
        usual = float(np.median(fit.amplitude[fit.share > _INFORMATION])) if np.any(fit.share > _INFORMATION) else 1.0
        good = (fit.explained > _EXPLAINED) & (fit.amplitude > _LEAST * usual)
        return np.asarray(good | chain.repaired | (fit.share <= _INFORMATION))

    def _built(self, flex: np.ndarray, places: np.ndarray) -> Template:
        """Return the mean voltage of the chain by angle."""
        slopes = monotone_slopes(places, np.arange(places.size, dtype=float))
        means, counts = _tables(places.size)
        nothing = np.zeros(1)
        in_bins(flex, places, slopes, 0, places.size - 1, nothing, nothing, 0.0, 0.0, False, BINS, means, counts)
        per_turn = float(np.median(np.diff(places)))
        return from_bins(_mean_of(means, counts), int(np.clip(_PER_ORDER * per_turn, _FEWEST_ORDERS, ORDERS)))

    def _binned(self, stretch: Piece, entry: _Refined, *, last: bool) -> Revolutions:
        """Return the revolutions of a chain that are new and have a passage on either side."""
        places, rate, device = entry.places, stretch.rate, self._device
        times = stretch.begins + places / rate
        period = np.diff(times)
        new = np.flatnonzero(times > self._done + 0.5 * float(period.min()))
        first = max(int(new[0]), 1) if new.size else places.size
        final = places.size - (2 if last or places[-1] < stretch.flex.size - 3.0 * rate * period[-1] else 3)
        if first > final:
            return none_of(device)
        slopes = monotone_slopes(places, np.arange(places.size, dtype=float))
        m = final - first + 1
        count = np.zeros((m, BINS), dtype=np.int64)
        resistance = np.zeros((m, BINS))
        if self._sign < 0 and not self._upper_leg and self._done == -np.inf:
            self._upper_leg = self._in_upper_leg(stretch.flex, places, slopes)
        VIN, R1 = device.supply_voltage, device.divider_resistance
        law = (VIN, R1, self._upper_leg)
        nothing = np.zeros(1)
        among = (first, final)
        in_bins(stretch.flex, places, slopes, *among, nothing, nothing, *law, BINS, resistance, count)
        template = from_bins(_mean_of(resistance, count))
        relative = entry.fit.amplitude[first : final + 1]
        in_bins(stretch.flex, places, slopes, *among, relative, template.values, *law, BINS, resistance, count)
        polarity = self._polarity()
        level, amplitude = _against(resistance, count, template, polarity)
        if polarity < 0:
            resistance = 2.0 * level[:, None] - resistance
        film, film_amplitude, film_skewness = self._film(stretch, places, slopes, first, final)
        clipped = _share_clipped(stretch.clipped, places, first, final)
        film_clipped = _share_clipped(stretch.film_clipped, places, first, final)
        if film is not None:
            film[film_clipped > 0.0] = np.nan
        middle = to_slope(level, VIN, R1)
        about = np.abs(np.arange(BINS) - BINS // 2) < _PATCH * BINS
        turns = 0.5 * (places[first + 1 : final + 2] - places[first - 1 : final])
        ones = np.ones(m)
        mean = polarity * template.values
        repaired = entry.chain.repaired[first : final + 1]
        across = times[first + 1 : final + 2] - times[first - 1 : final]
        speed = 4.0 * np.pi / across
        errors = entry.errors / rate
        patch = count[:, about].sum(axis=1) / np.maximum(about.mean() * turns, 1.0)
        both = np.hypot(errors[first + 1 : final + 2], errors[first - 1 : final])
        return Revolutions(
            times=times[first : final + 1],
            time_se=errors[first : final + 1],
            speed=speed,
            speed_se=speed * both / across,
            resistance=resistance,
            film=film,
            count=count,
            repaired=repaired,
            whole=(patch > _WHOLE) & ~repaired & (clipped == 0.0),
            level=level,
            amplitude=amplitude,
            noise=entry.fit.noise[first : final + 1] / middle,
            film_amplitude=film_amplitude,
            clipped=clipped,
            film_clipped=film_clipped,
            share=np.minimum(count.sum(axis=1) / np.maximum(turns, 1.0), 1.0),
            patch=np.minimum(patch, 1.0),
            skewness=self._sign * _skewness(self._volts().values) * ones,
            film_skewness=film_skewness * ones,
            first_harmonic=2.0 * abs(template.harmonics[1]) / mean.max() * ones,
            hum=mains(stretch, entry, self._volts()) * ones,
        )

    def _in_upper_leg(self, flex: np.ndarray, places: np.ndarray, slopes: np.ndarray) -> bool:
        means, counts = _tables(places.size)
        nothing = np.zeros(1)
        in_bins(flex, places, slopes, 0, places.size - 1, nothing, nothing, 0.0, 0.0, False, BINS, means, counts)
        return in_upper_leg(
            bridged(_mean_of(means, counts)), self._device.supply_voltage, self._device.divider_resistance
        )

    def _volts(self) -> Template:
        """Return the template of the voltage."""
        assert self._template is not None
        return self._template

    def _film(
        self, stretch: Piece, places: np.ndarray, slopes: np.ndarray, first: int, final: int
    ) -> tuple[np.ndarray | None, np.ndarray | None, float]:
        """Return the film by angle, its peak to peak (V), and the skewness of its mean."""
        if stretch.film is None:
            return None, None, np.nan
        m = final - first + 1
        film, count = _tables(m)
        nothing = np.zeros(1)
        in_bins(stretch.film, places, slopes, first, final, nothing, nothing, 0.0, 0.0, False, BINS, film, count)
        if not np.isfinite(film).any():
            return film, np.full(m, np.nan), np.nan
        template = from_bins(_mean_of(film, count))
        in_bins(
            stretch.film, places, slopes, first, final, np.ones(m), template.values, 0.0, 0.0, False, BINS, film, count
        )
        _, amplitude = _against(film, count, template, 1)
        return film, amplitude / template.height * float(np.ptp(template.values)), _skewness(template.values)


def _skewness(values: np.ndarray) -> float:
    """Return the third moment over the cube of the standard deviation, of values whose mean is zero."""
    return float(np.mean(values**3) / np.mean(values**2) ** 1.5)


def mains(stretch: Piece, entry: _Refined, template: Template) -> float:
    """Return the amplitude of a line at 50 or 60 Hz in what the template leaves of the flex voltage, V; 0 without one.

    The line must also be far higher than what is left at multiples of the speed of rotation near it.
    """
    places = entry.places
    begin = max(int(places[0]), 0)
    end = min(int(places[-1]), begin + int(_HUM * stretch.rate), stretch.flex.size)
    i = np.arange(begin, end)
    phase = np.interp(i, places, np.arange(places.size, dtype=float))
    level = np.interp(i, places, entry.fit.amplitude)
    table = np.interp(((phase + 0.5) % 1.0) * FINE, np.arange(FINE + 1), np.append(template.values, template.values[0]))
    left = stretch.flex[begin:end] - level * table
    size = max(1, int(stretch.rate / 500.0))
    blocks = block_means(left, size)
    valid = np.isfinite(blocks)
    if valid.sum() < 0.5 * blocks.size or blocks.size < 500:
        return 0.0
    blocks = np.where(valid, blocks - blocks[valid].mean(), 0.0) * np.hanning(blocks.size)
    lines = 2.0 * np.abs(np.fft.rfft(blocks)) / np.hanning(blocks.size)[valid].sum()
    frequency = np.fft.rfftfreq(blocks.size, size / stretch.rate)
    highest = 0.0
    for hum in (50.0, 60.0):
        near, beside = np.abs(frequency - hum) < 0.3, np.abs(np.abs(frequency - hum) - 4.5) < 3.5
        line = float(lines[near].max(initial=0.0))
        if beside.any() and line > 3.0 * float(lines[beside].max()):
            highest = max(highest, line)
    return highest


def to_slope(R2: np.ndarray, VIN: float, R1: float) -> np.ndarray:
    """Return |dV/dR2|, V/ohm."""
    return np.asarray(VIN * R1 / (R1 + R2) ** 2)


def _tables(m: int) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((m, BINS)), np.zeros((m, BINS), dtype=np.int64)


def _mean_of(values: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the mean of each bin over revolutions, levels that differ taken out first; NaN where empty."""
    weight = count.sum(axis=0)
    known = np.where(count > 0, values, 0.0)

    def mean(of: np.ndarray) -> np.ndarray:
        return np.divide((of * count).sum(axis=0), weight, out=np.full(weight.size, np.nan), where=weight > 0)

    first = mean(known)
    off = np.where(count > 0, values - first, 0.0)
    level = (off * count).sum(axis=1) / np.maximum(count.sum(axis=1), 1)
    return mean(np.where(count > 0, values - level[:, None], 0.0))


def _against(values: np.ndarray, count: np.ndarray, template: Template, polarity: int) -> tuple[np.ndarray, np.ndarray]:
    """Return level and height over it of each revolution: least squares of [template, 1] on the bins that are there."""
    n = template.values.size // values.shape[1]
    T = template.values[::n]
    weight = (count > 0).astype(float)
    known = np.where(count > 0, values, 0.0)
    s0, s1, s2 = weight.sum(axis=1), weight @ T, weight @ (T * T)
    y0, y1 = known.sum(axis=1), known @ T
    det = s0 * s2 - s1 * s1
    safe = np.where(det > 1e-9 * s0 * s2, det, np.nan)
    a = (s0 * y1 - s1 * y0) / safe
    level = (s2 * y0 - s1 * y1) / safe
    height = template.height if polarity > 0 else -float(template.values.min())
    return level, a * height


def _bottom(template: Template) -> float:
    turned = replace(template, values=-template.values)
    return turned.top


def _share_clipped(clipped: np.ndarray | None, places: np.ndarray, first: int, final: int) -> np.ndarray:
    """Return the share of clipped samples in each revolution."""
    m = final - first + 1
    if clipped is None:
        return np.zeros(m)
    total = np.concatenate([[0], np.cumsum(clipped)])
    edges = np.clip(np.round(0.5 * (places[:-1] + places[1:])).astype(int), 0, clipped.size)
    edges = edges[first - 1 : final + 1]
    return np.asarray(np.diff(total[edges]) / np.maximum(np.diff(edges), 1))


def _guess_error(places: np.ndarray, known: np.ndarray) -> float:
    """Return how far a known moment is from where its neighbours put it, samples, as a standard error."""
    at = np.flatnonzero(known)
    if at.size < 4:
        return float(np.diff(places).mean())
    order = np.arange(places.size, dtype=float)
    inner = at[1:-1]
    guess = 0.5 * (places[at[:-2]] + places[at[2:]])
    even = order[at[2:]] - order[inner] == order[inner] - order[at[:-2]]
    off = (places[inner] - guess)[even]
    return float(np.sqrt(np.mean(off**2))) if off.size else float(np.diff(places).mean())
