"""A chain of passages with its moments becomes revolutions: R2 and film by angle, level, height (tire.md, 5.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.passages.device import Device
from pipeline.rigs.tire.passages.hum import mains_hum
from pipeline.rigs.tire.passages.loops import in_bins
from pipeline.rigs.tire.passages.moments import Moments, mean_by_angle
from pipeline.rigs.tire.passages.order_tracking import monotone_slopes
from pipeline.rigs.tire.passages.pieces import Piece
from pipeline.rigs.tire.passages.resistance import from_volts
from pipeline.rigs.tire.passages.revolutions import BINS, Revolutions
from pipeline.rigs.tire.passages.template import FINE, Template, from_bins, from_values, mean_of
from pipeline.rigs.tire.ring.sensor import voltage_slope

# A revolution is whole with this share of its samples within so many revolutions of the passage.
_WHOLE, _PATCH = 0.6, 0.12


@dataclass(frozen=True)
class Mounting:
    """How the sensor sits: +1 where flattening raises R2, and whether it is in the divider's upper leg."""

    polarity: int
    upper_leg: bool

    @property
    def sign(self) -> int:
        """+1 where peaks of the voltage point up."""
        return -self.polarity if self.upper_leg else self.polarity


def tabulated(
    device: Device, stretch: Piece, moments: Moments, first: int, final: int, mounting: Mounting
) -> Revolutions:
    """Return the revolutions round the passages `first` to `final` of a chain, each of which has one on either side."""
    places, rate, m = moments.places, stretch.rate, final - first + 1
    slopes = monotone_slopes(places, np.arange(places.size, dtype=float))
    VIN, R1, flipped = device.supply_voltage, device.divider_resistance, mounting.upper_leg
    own, around = slice(first, final + 1), (slice(first + 1, final + 2), slice(first - 1, final))
    resistance, volts = np.zeros((m, BINS)), np.zeros((m, BINS if stretch.film is not None else 0))
    count, film_count = np.zeros((m, BINS), dtype=np.int64), np.zeros((m, volts.shape[1]), dtype=np.int64)
    film, film_template = _film_template(stretch, moments)
    in_bins(
        stretch.flex,
        film,
        places,
        slopes,
        first,
        _resistance_template(stretch, moments, VIN, R1, flipped).values,
        film_template.values,
        moments.fit.amplitude[own],
        VIN,
        R1,
        flipped,
        resistance,
        volts,
        count,
        film_count,
    )
    mean = from_bins(mean_of(resistance, count))
    level, amplitude = _against(resistance, count, mean, mounting.polarity)
    if mounting.polarity < 0:
        resistance = 2.0 * level[:, None] - resistance
    clipped, film_clipped = (_share_clipped(c, places, first, final) for c in (stretch.clipped, stretch.film_clipped))
    volts[film_clipped > 0.0] = np.nan
    film_amplitude = None
    if stretch.film is not None:
        size = float(np.ptp(film_template.values))
        film_amplitude = size * _against(volts, film_count, film_template, 1)[1] / max(film_template.height, 1e-12)
    times = stretch.begins + places / rate
    across = times[around[0]] - times[around[1]]
    turns = 0.5 * rate * across
    near = np.abs(np.arange(BINS) - BINS // 2) < _PATCH * BINS
    patch = count[:, near].sum(axis=1) / np.maximum(near.mean() * turns, 1.0)
    errors = moments.errors / rate
    speed = 4.0 * np.pi / across
    repaired = moments.repaired[own]
    ones = np.ones(m)
    return Revolutions(
        times=times[own],
        time_se=errors[own],
        speed=speed,
        speed_se=speed * np.hypot(errors[around[0]], errors[around[1]]) / across,
        resistance=resistance,
        film=volts if stretch.film is not None else None,
        count=count,
        repaired=repaired,
        whole=(patch > _WHOLE) & ~repaired & (clipped == 0.0) & np.isfinite(level),
        level=level,
        amplitude=amplitude,
        noise=moments.fit.noise[own] / voltage_slope(level, VIN, R1),
        film_amplitude=film_amplitude,
        clipped=clipped,
        film_clipped=film_clipped,
        share=np.minimum(count.sum(axis=1) / np.maximum(turns, 1.0), 1.0),
        patch=np.minimum(patch, 1.0),
        skewness=mounting.sign * moments.template.skewness * ones,
        film_skewness=(film_template.skewness if stretch.film is not None else np.nan) * ones,
        first_harmonic=2.0 * abs(mean.harmonics[1]) / max(float((mounting.polarity * mean.values).max()), 1e-12) * ones,
        hum=mains_hum(stretch, moments) * ones,
    )


def _resistance_template(stretch: Piece, moments: Moments, VIN: float, R1: float, flipped: bool) -> Template:
    """Return the mean R2 by angle less its mean, ohm, from that of the voltage."""
    begin, end = (int(np.clip(place, 0, stretch.flex.size)) for place in moments.places[[0, -1]])
    level = float(np.nanmean(stretch.flex[begin:end]))
    R2 = from_volts(level + moments.template.values, VIN, R1, flipped)
    return from_values(np.where(np.isfinite(R2), R2, np.nanmean(R2)))


def _film_template(stretch: Piece, moments: Moments) -> tuple[np.ndarray, Template]:
    """Return the film's volts, none where there is no film, and their mean by angle less its mean."""
    if stretch.film is not None:
        means = mean_by_angle(stretch.film, moments.places)
        if np.isfinite(means).any():
            return stretch.film, from_bins(means, moments.template.harmonics.size - 1)
    return np.zeros(0) if stretch.film is None else stretch.film, from_values(np.zeros(FINE))


def _against(values: np.ndarray, count: np.ndarray, template: Template, polarity: int) -> tuple[np.ndarray, np.ndarray]:
    """Return level and height over it of each revolution: least squares of [template, 1] on the bins that are there."""
    T = template.values[:: template.values.size // values.shape[1]]
    there = (count > 0) & np.isfinite(values)
    weight = there.astype(float)
    known = np.where(there, values, 0.0)
    s0, s1, s2 = weight.sum(axis=1), weight @ T, weight @ (T * T)
    y0, y1 = known.sum(axis=1), known @ T
    det = s0 * s2 - s1 * s1
    safe = np.where(det > 1e-6 * s0 * s2, det, np.nan)
    height = template.height if polarity > 0 else -float(template.values.min())
    return np.asarray((s2 * y0 - s1 * y1) / safe), np.asarray((s0 * y1 - s1 * y0) / safe * height)


def _share_clipped(clipped: np.ndarray | None, places: np.ndarray, first: int, final: int) -> np.ndarray:
    """Return the share of clipped samples in each revolution."""
    if clipped is None:
        return np.zeros(final - first + 1)
    total = np.concatenate([[0], np.cumsum(clipped)])
    edges = np.clip(np.round(0.5 * (places[:-1] + places[1:])).astype(int), 0, clipped.size)[first - 1 : final + 1]
    return np.asarray(np.diff(total[edges]) / np.maximum(np.diff(edges), 1))
