"""The dips of some revolutions of a drive, evenly spread over it: what driving and braking do to the waveform.

Every k-th whole revolution is kept, k doubles whenever too many are, so that memory stays the same however long the drive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.passages.revolutions import Revolutions
from pipeline.rigs.tire.ring.ring import grid
from pipeline.rigs.tire.road.library import WaveformLibrary
from pipeline.rigs.tire.road.revolution_fit import Forces

_MOST = 1024
# Orders that a dip is read from: the ring's, without the noise of higher ones; on so many angles.
_ORDERS, _ANGLES = 40, 1024
# Where the dips stand, rad from the peak.
_NEAREST, _FARTHEST = 0.12, 1.2
_LEAST_FILLED = 0.9
# Waveforms of so many forces make the model's line.
_FORCES = 9


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Dips of k revolutions, shape (k,) each, and the model's.

    Attributes
    ----------
    index
        Which of the drive's revolutions they are.
    leading, trailing
        Dips before and behind the peak, ohm from the mean of the revolution.
    model_force, model
        Asymmetry (ohm) of the tire at the drive's median load and rotation, by force (N), shape (n,); empty without a tire.
    """

    index: np.ndarray
    leading: np.ndarray
    trailing: np.ndarray
    model_force: np.ndarray
    model: np.ndarray

    @property
    def value(self) -> np.ndarray:
        """A = trailing - leading dip, ohm, shape (k,)."""
        return np.asarray(self.trailing - self.leading)


class AsymmetrySum:
    """Gathers revolutions, block by block."""

    def __init__(self, known: WaveformLibrary | None) -> None:
        self._known = known
        self._every, self._seen = 1, 0
        self._index: list[int] = []
        self._dips: list[tuple[float, float]] = []

    def add(self, block: Revolutions) -> None:
        """Take the next block."""
        m = block.times.size
        at = np.arange(self._seen, self._seen + m)
        self._seen += m
        filled = (block.count > 0).mean(axis=1) if m else np.zeros(0)
        kept = np.flatnonzero((at % self._every == 0) & block.whole & (filled >= _LEAST_FILLED))
        if kept.size:
            self._index += [int(i) for i in at[kept]]
            self._dips += dips(block.resistance[kept])
        while len(self._index) > _MOST:
            self._every *= 2
            stay = [place for place, i in enumerate(self._index) if i % self._every == 0]
            self._index = [self._index[place] for place in stay]
            self._dips = [self._dips[place] for place in stay]

    def close(self, forces: Forces) -> Asymmetry:
        """Return the dips, with the model's at the median state of the drive."""
        dip = np.array(self._dips).reshape(-1, 2)
        model_force, model = np.zeros(0), np.zeros(0)
        if self._known is not None and forces.fits.any():
            fits = forces.fits
            reach = max(200.0, 1.1 * float(np.percentile(np.abs(forces.force[fits]), 99.5)))
            model_force = np.linspace(-reach, reach, _FORCES)
            load = np.full(_FORCES, float(np.median(forces.load[fits])))
            speed = np.full(_FORCES, float(np.median(forces.speed[fits])))
            harmonics, *_ = self._known.harmonics(load, model_force, speed)
            of_model = np.array(_of_harmonics(harmonics))
            model = of_model[:, 1] - of_model[:, 0]
        return Asymmetry(np.array(self._index, dtype=int), dip[:, 0], dip[:, 1], model_force, model)


def dips(resistance: np.ndarray) -> list[tuple[float, float]]:
    """Return the leading and the trailing dip (ohm from the mean) of waveforms, shape (m, bins); empty bins are bridged."""
    theta = grid(resistance.shape[1])
    filled = np.array([_bridged(theta, row) for row in resistance])
    harmonics = np.fft.rfft(np.fft.ifftshift(filled, axes=1), axis=1) / filled.shape[1]
    return _of_harmonics(harmonics)


def _bridged(theta: np.ndarray, row: np.ndarray) -> np.ndarray:
    known = np.isfinite(row)
    if known.all():
        return row
    return np.asarray(np.interp(theta, theta[known], row[known], period=2.0 * math.pi))


def _of_harmonics(harmonics: np.ndarray) -> list[tuple[float, float]]:
    spectrum = np.zeros((harmonics.shape[0], _ANGLES // 2 + 1), dtype=complex)
    # The mean is the level; the first order is no bending of a ring.
    spectrum[:, 2 : _ORDERS + 1] = harmonics[:, 2 : _ORDERS + 1]
    shape = np.fft.fftshift(np.fft.irfft(spectrum, _ANGLES, axis=1) * _ANGLES, axes=1)
    theta = grid(_ANGLES)
    peak = theta[np.argmax(shape, axis=1)]
    found = []
    for row, centre in zip(shape, peak, strict=True):
        away = (theta - centre + math.pi) % (2.0 * math.pi) - math.pi
        before, behind = (row[(away * sign > _NEAREST) & (away * sign < _FARTHEST)].min() for sign in (-1.0, 1.0))
        found.append((float(before), float(behind)))
    return found
