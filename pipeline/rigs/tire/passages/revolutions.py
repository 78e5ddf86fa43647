"""The revolutions of a log: moments, speeds and R2 by angle, stretch by stretch in bounded memory (tire.md, 5.2-5.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.rigs.tire.passages.device import Device

BINS = 1024
"""Bins of angle of a revolution: even angles from -pi, `ring.grid(BINS)`; 0 is the peak."""


@dataclass(frozen=True, eq=False)
class Revolutions:
    """m revolutions, each half a turn before and behind a passage, in order of time. SI.

    Attributes
    ----------
    times, time_se
        Moment of the passage and its standard error, s, shape (m,). All carry the same unknown offset of the angle.
    speed, speed_se
        Mean angular speed from the passage before to the one behind, rad/s, shape (m,).
    resistance
        R2 by angle, ohm, shape (m, BINS), NaN where no sample is. Peaks point up: that of a sensor bent the other way
        (polarity -1) is mirrored about its level.
    film
        Volts of the PVDF film by angle, shape (m, BINS), NaN where it was clipped in the revolution; None without one.
    count
        Valid samples of the flex sensor, shape (m, BINS).
    repaired
        Whether the passage was lost and its moment put between its neighbours, shape (m,).
    whole
        Whether the revolution is fit for use: passage there, not clipped, samples enough about it, shape (m,).
    level, amplitude, noise
        R0 (mean of the revolution), height of the peak over it, standard deviation of one sample of R2, ohm, shape (m,).
    film_amplitude
        Peak to peak of the film, V, shape (m,); None without one.
    clipped, film_clipped
        Share of the revolution's samples at an end of the scale, shape (m,).
    share, patch
        Share of the samples that are there: of the revolution, of its part about the patch, shape (m,).
    skewness, film_skewness, first_harmonic
        Of the mean waveform of the stretch that the revolution is in: skewness over the angle of flex and film (NaN
        without one), amplitude of the first harmonic of R2 over its peak, shape (m,).
    hum
        Amplitude of the mains' line in the flex voltage of that stretch, V, 0 where none stands out, shape (m,).
    stops
        From when to when (s) no speed can be told although there are samples: the wheel stood or nearly so.
    still
        From when to when (s) nothing like a passage is in the samples.
    open
        From when to when (s) the flex sensor reads an end of its range: broken ink, broken wire, short circuit.
    swing
        Largest swing of the flex voltage where there is no revolution at all, V; NaN otherwise.
    doubled
        Candidates that were dropped as doubles.
    spikes
        Single samples that were left out because they stand out by more than the signal swings.
    polarity, upper_leg
        +1, -1, or 0 where there was no passage yet; whether the sensor is in the divider's upper leg.
    """

    times: np.ndarray
    time_se: np.ndarray
    speed: np.ndarray
    speed_se: np.ndarray
    resistance: np.ndarray
    film: np.ndarray | None
    count: np.ndarray
    repaired: np.ndarray
    whole: np.ndarray
    level: np.ndarray
    amplitude: np.ndarray
    noise: np.ndarray
    film_amplitude: np.ndarray | None
    clipped: np.ndarray
    film_clipped: np.ndarray
    share: np.ndarray
    patch: np.ndarray
    skewness: np.ndarray
    film_skewness: np.ndarray
    first_harmonic: np.ndarray
    hum: np.ndarray
    stops: tuple[tuple[float, float], ...] = ()
    still: tuple[tuple[float, float], ...] = ()
    open: tuple[tuple[float, float], ...] = ()
    swing: float = float("nan")
    doubled: int = 0
    spikes: int = 0
    polarity: int = 0
    upper_leg: bool = False

    def __len__(self) -> int:
        return int(self.times.size)

    def __getitem__(self, chosen: np.ndarray | slice) -> Revolutions:
        """Return the revolutions that a mask, indices or a slice choose."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        arrays: dict[str, Any] = {name: v[chosen] for name, v in values.items() if isinstance(v, np.ndarray)}
        return replace(self, **arrays)

    def without_tables(self) -> Revolutions:
        """Return the same without what is told by angle: `resistance`, `film` and `count` have no bins."""
        none = np.zeros((len(self), 0))
        return replace(self, resistance=none, film=None, count=none.astype(np.int64))


def joined(blocks: Iterable[Revolutions]) -> Revolutions:
    """Return blocks as one; for runs that fit into memory. ValueError where there is none."""
    parts = list(blocks)
    if not parts:
        raise ValueError("no block of revolutions")
    if len(parts) == 1:
        return parts[0]
    together: dict[str, Any] = {}
    for f in fields(Revolutions):
        values = [getattr(part, f.name) for part in parts]
        if isinstance(values[0], np.ndarray):
            together[f.name] = np.concatenate(values)
        elif isinstance(values[0], tuple):
            together[f.name] = _merged([span for value in values for span in value])
    swings = [part.swing for part in parts if np.isfinite(part.swing)]
    return replace(
        parts[-1],
        **together,
        doubled=sum(part.doubled for part in parts),
        spikes=sum(part.spikes for part in parts),
        swing=max(swings, default=float("nan")),
    )


def _merged(spans: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Return the spans in order, those that overlap as one: neighbouring stretches share their ends."""
    merged: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if merged and begin <= merged[-1][1] + 1e-9:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((begin, end))
    return tuple(merged)


def revolutions_of(device: Device) -> Iterator[Revolutions]:
    """Yield the revolutions of a log in blocks of about a minute; at least one block, which may hold none.

    What was learnt in one stretch (template, which way peaks point) is used in the next.
    """
    from pipeline.rigs.tire.passages.following import Follower

    follower = Follower(device)
    any_piece = False
    pieces = iter(device.pieces())
    piece = next(pieces, None)
    while piece is not None:
        following = next(pieces, None)
        yield follower.take(piece, last=following is None)
        any_piece = True
        piece = following
    if not any_piece:
        yield none_of(device)


def none_of(device: Device) -> Revolutions:
    """Return a block without revolutions."""
    nothing = np.zeros(0)
    table = np.zeros((0, BINS))
    film = device.has_film
    return Revolutions(
        times=nothing,
        time_se=nothing,
        speed=nothing,
        speed_se=nothing,
        resistance=table,
        film=table if film else None,
        count=np.zeros((0, BINS), dtype=np.int64),
        repaired=np.zeros(0, dtype=bool),
        whole=np.zeros(0, dtype=bool),
        level=nothing,
        amplitude=nothing,
        noise=nothing,
        film_amplitude=nothing if film else None,
        clipped=nothing,
        film_clipped=nothing,
        share=nothing,
        patch=nothing,
        skewness=nothing,
        film_skewness=nothing,
        first_harmonic=nothing,
        hum=nothing,
    )
