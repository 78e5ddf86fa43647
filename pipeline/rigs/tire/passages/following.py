"""One stretch of a log after another becomes revolutions; the last turns of each are looked at again with the next."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from pipeline.rigs.tire.passages.chains import chains_of
from pipeline.rigs.tire.passages.device import Device
from pipeline.rigs.tire.passages.moments import Moments, moments_of
from pipeline.rigs.tire.passages.peaks import coarse, humps_of, pointing, without_spikes
from pipeline.rigs.tire.passages.pieces import Piece
from pipeline.rigs.tire.passages.resistance import in_upper_leg
from pipeline.rigs.tire.passages.revolutions import Revolutions, joined, none_of
from pipeline.rigs.tire.passages.tables import Mounting, tabulated
from pipeline.rigs.tire.passages.template import Template

# Longest stretch that is kept for the next piece, s; what is kept where there is no passage, s.
_KEPT, _TAIL = 120.0, 20.0
# The flex sensor that reads an end of its range for so many seconds is broken.
_OPEN = 1.0


class Follower:
    """Follows a log piece by piece: which way peaks point, the template and the last turns go from one to the next."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._sign = 0
        self._mounting: Mounting | None = None
        self._template: Template | None = None
        self._tail: Piece | None = None
        self._done = -np.inf

    def take(self, piece: Piece, *, last: bool) -> Revolutions:
        """Return the revolutions that are complete with this piece."""
        flex, spikes = without_spikes(piece.flex)
        stretch = self._with_tail(replace(piece, flex=flex))
        flex, rate, step = stretch.flex, stretch.rate, self._device.step
        means, size = coarse(flex, rate)
        if not self._sign:
            self._sign = pointing(means, size, rate, step)
        found = humps_of((self._sign or 1) * means, size, rate, step)
        chains: list[Moments] = []
        doubled = 0
        if self._sign:
            valid = np.concatenate([[0], np.cumsum(np.isfinite(flex))])
            candidates, doubled = chains_of(found.places, found.heights, valid)
            for chain in candidates:
                moments = moments_of(flex, chain, valid, self._template, self._sign)
                if moments is not None:
                    self._template = moments.template
                    chains.append(moments)
        if chains and self._mounting is None:
            self._mounting = self._mounted(stretch, chains[0])
        blocks = [self._new(stretch, moments, last=last and moments is chains[-1]) for moments in chains]
        self._keep(stretch, chains[-1].places if chains and not last else np.zeros(0))
        done = joined([block for block in blocks if len(block)] or [none_of(self._device)])
        if len(done):
            self._done = float(done.times[-1])

        def moment(place: float) -> float:
            return float(stretch.begins + place / rate)

        mounting = self._mounting or Mounting(0, False)
        return replace(
            done,
            stops=tuple((moment(a.places[-1]), moment(b.places[0])) for a, b in pairwise(chains)),
            still=tuple(
                (moment(a), moment(b))
                for a, b in found.empty
                if not any(entry.places[0] < b and a < entry.places[-1] for entry in chains)
            ),
            open=self._open(stretch),
            doubled=doubled,
            spikes=spikes,
            polarity=mounting.polarity,
            upper_leg=mounting.upper_leg,
            swing=found.swing,
        )

    def _mounted(self, stretch: Piece, moments: Moments) -> Mounting:
        """Return how the sensor sits, of peaks that point down either by the leg of the divider or by its bend."""
        if self._sign > 0:
            return Mounting(1, False)
        begin, end = (int(np.clip(place, 0, stretch.flex.size)) for place in moments.places[[0, -1]])
        waveform = float(np.nanmean(stretch.flex[begin:end])) + moments.template.values
        upper = in_upper_leg(waveform, self._device.supply_voltage, self._device.divider_resistance)
        return Mounting(1 if upper else -1, upper)

    def _new(self, stretch: Piece, moments: Moments, *, last: bool) -> Revolutions:
        """Return the revolutions of a chain that were not given yet and have a passage on either side.

        The one before the last waits for the next piece if the chain may go on there: its angle may still change.
        """
        assert self._mounting is not None
        places = moments.places
        times = stretch.begins + places / stretch.rate
        period = np.diff(places)
        new = np.flatnonzero(times > self._done + 0.5 * float(period.min()) / stretch.rate)
        first = max(int(new[0]), 1) if new.size else places.size
        over = last or places[-1] < stretch.flex.size - 3.0 * period[-1]
        final = places.size - (2 if over else 3)
        if first > final:
            return none_of(self._device)
        return tabulated(self._device, stretch, moments, first, final, self._mounting)

    def _open(self, stretch: Piece) -> tuple[tuple[float, float], ...]:
        """Return when the flex sensor reads an end of its range for longer than a passage can."""
        if stretch.clipped is None:
            return ()
        gone = np.concatenate([[False], stretch.clipped | np.isnan(stretch.flex), [False]])
        edges = np.flatnonzero(np.diff(gone.astype(np.int8)))
        return tuple(
            (stretch.begins + a / stretch.rate, stretch.begins + b / stretch.rate)
            for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
            if b - a > _OPEN * stretch.rate and stretch.clipped[a:b].mean() > 0.5
        )

    def _with_tail(self, piece: Piece) -> Piece:
        """Return the piece behind what was kept, unless a silence lies between."""
        tail = self._tail
        if tail is None or tail.first + tail.flex.size != piece.first:
            return piece
        parts = (tail, piece)

        def both(masks: tuple[np.ndarray | None, np.ndarray | None]) -> np.ndarray | None:
            if masks[0] is None and masks[1] is None:
                return None
            return np.concatenate([
                np.zeros(part.flex.size, dtype=bool) if mask is None else mask
                for mask, part in zip(masks, parts, strict=True)
            ])  # fmt: skip

        return Piece(
            tail.first,
            tail.begins,
            piece.rate,
            np.concatenate([tail.flex, piece.flex]),
            None if tail.film is None or piece.film is None else np.concatenate([tail.film, piece.film]),
            both((tail.clipped, piece.clipped)),
            both((tail.film_clipped, piece.film_clipped)),
        )

    def _keep(self, stretch: Piece, places: np.ndarray) -> None:
        """Keep the end of a stretch: the last turns of the chain that may go on, or a little."""
        begin = stretch.flex.size - int(_TAIL * stretch.rate)
        if places.size > 3:
            begin = int(places[-4] - 0.6 * (places[-3] - places[-4]))
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
