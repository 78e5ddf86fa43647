"""Load and longitudinal force of every revolution: Gauss-Newton against the library under the drive's own noise (5.11).

The fit is made in the divider's voltage, where the noise is additive, on 256 angles; bins without samples carry no
weight. The noise's spectrum is learnt from what the fits leave over, so standard errors hold under coloured noise.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from pipeline.rigs.tire.road.gain_ratio import gain_ratio
from pipeline.rigs.tire.road.gauss_newton import LEAST_LOAD, State, Step, coarse_fit, noise_step
from pipeline.rigs.tire.road.library import WaveformLibrary
from pipeline.rigs.tire.road.noise_spectrum import NoiseSpectrum
from pipeline.rigs.tire.road.passage_voltage import (
    ANGLES,
    PassageBlock,
    Passages,
    angles,
    passages_of,
    to_variance,
    together,
)
from pipeline.rigs.tire.road.shape_error import ShapeError

# Why a revolution is not taken: Forces.reason is the place in here.
REASONS = (
    "",
    "too few samples where the load shows",
    "does not settle",
    "shape is not that of the ring",
    "load at the end of the library",
    "out of step with its neighbours: a passage beside it is not seen",
    "the sensor's gain is not the bench's",
)
OUT_OF_STEP, OTHER_GAIN = 5, 6
_GATHERED = 512
_LEARNT_FROM = 256
_LEARNING = 3
# Error of bins and library, relative: what bench runs without road noise show.
_INTERPOLATION = 4e-4
# Power that a Hann taper takes from half orders away, |sinc(x)/(1 - x^2)|^2 over its sum.
_TAPERED = {
    0: 0.3335,
    **dict.fromkeys((-1, 1), 0.2403),
    **dict.fromkeys((-2, 2), 0.0834),
    **dict.fromkeys((-3, 3), 0.0096),
}
_FARTHEST_SHIFT = 0.15
_NEIGHBOURS = 31
_WORST_MISFIT = 2.0
_LEAST_SURE = 4.0
# Two turns between the passages beside one, to so much (rad).
_NEXT_TURNS = 0.5


@dataclass(frozen=True, eq=False)
class Forces:
    """What revolutions tell, shape (m,) each.

    Attributes
    ----------
    time, time_se, speed, speed_se
        Passage (s) and rotation (rad/s), as they came in.
    load, load_se, force, force_se, correlation
        Fz and Fx at the passage, N; standard errors under the drive's noise, and the correlation of the two errors.
    shift
        Angle (rad) by which the contact's centre lies before the passage: the waveform moves under the longitudinal force.
    resistance, resistance_se
        R0, ohm.
    gain_ratio
        Gain of the flex sensor over the film's, 1 as on the bench: falls as the flex sensor comes loose; NaN without film.
    misfit
        Sum of squares over its degrees of freedom, 1 where only the drive's noise is left.
    share
        Share of the angles that hold samples.
    fits, reason
        Whether the numbers may be used, and if not the place of the reason in `REASONS`.
    extrapolated
        Whether the load is outside of what the bench calibrated.
    """

    time: np.ndarray
    time_se: np.ndarray
    speed: np.ndarray
    speed_se: np.ndarray
    load: np.ndarray
    load_se: np.ndarray
    force: np.ndarray
    force_se: np.ndarray
    correlation: np.ndarray
    shift: np.ndarray
    resistance: np.ndarray
    resistance_se: np.ndarray
    gain_ratio: np.ndarray
    misfit: np.ndarray
    share: np.ndarray
    fits: np.ndarray
    reason: np.ndarray
    extrapolated: np.ndarray

    def __len__(self) -> int:
        return int(self.time.size)


def between_centres(forces: Forces) -> Forces:
    """Return the revolutions with their rotation from the contact's centre before to the one behind, not between passages.

    Passages lie where the waveform peaks, which moves with the longitudinal force: while that changes, they are not a turn
    apart. Where a neighbour has no fit, or is not the next turn, the rotation stays that between passages.
    """
    behind, before = slice(2, None), slice(None, -2)
    shift = np.where(forces.fits, forces.shift, np.nan)
    moved = np.zeros(len(forces))
    moved[1:-1] = shift[behind] - shift[before]
    turned = np.full(len(forces), np.nan)
    turned[1:-1] = forces.speed[1:-1] * (forces.time[behind] - forces.time[before])
    next_turns = np.isfinite(moved) & (np.abs(turned - 4.0 * np.pi) < _NEXT_TURNS)
    return replace(forces, speed=forces.speed * np.where(next_turns, 1.0 + moved / (4.0 * np.pi), 1.0))


def joined(parts: list[Forces]) -> Forces:
    """Return the revolutions of several parts in one; ValueError where there is no part."""
    return Forces(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Forces)})


class RevolutionFit:
    """Fits revolutions as they come: `add` blocks of any size, `close` at the end; both return what is ready.

    Attributes
    ----------
    noise
        What is known of the drive's noise so far.
    shape_error
        Mean of what the fits leave over by angle: the part no noise explains.
    """

    def __init__(self, known: WaveformLibrary) -> None:
        self.known = known
        self.noise = NoiseSpectrum()
        self._waiting: list[Passages] = []
        self._left_over = np.zeros(ANGLES)
        self._signal = np.zeros(ANGLES)
        self._seen = np.zeros(ANGLES)

    def add(self, block: PassageBlock) -> Forces | None:
        """Take revolutions; return the fits of those that wait once enough have gathered."""
        if block.times.size:
            self._waiting.append(passages_of(block, self.known))
        return self._ready() if sum(part.time.size for part in self._waiting) >= _GATHERED else None

    def close(self) -> Forces | None:
        """Return the fits of the revolutions that still wait."""
        return self._ready() if self._waiting else None

    @property
    def shape_error(self) -> ShapeError | None:
        """What is left over of the mean waveform after the fits; None where no revolution was fitted."""
        seen = np.maximum(self._seen, 1.0)
        left, signal = self._left_over / seen, self._signal / seen
        signal = signal - signal.mean()
        scale = float(np.sqrt(np.mean(signal**2)))
        if not scale > 0.0 or not self.noise.known:
            return None
        noise = float(np.sqrt(np.trapezoid(self.noise.values, self.noise.frequency))) / np.sqrt(seen)
        share = float(np.sqrt(np.mean(left**2))) / scale
        return ShapeError(angles(), left, noise, signal, share, float(np.sqrt(np.mean(noise**2))) / scale)

    def _ready(self) -> Forces:
        data = together(self._waiting)
        self._waiting = []
        state = coarse_fit(data, self.known)
        if not self.noise.known:
            for _ in range(_LEARNING):
                found = self._stepped(data, state)
                state = found.state
                self.noise = self._learnt(data, found, NoiseSpectrum(self.noise.memory))
        found = self._stepped(data, state)
        self.noise = self._learnt(data, found, self.noise)
        self._remember(data, found)
        return self._told(data, found)

    def _stepped(self, data: Passages, state: State) -> Step:
        return noise_step(data, state, self.known, self._weights(data), self._variances(data))

    def _weights(self, data: Passages) -> np.ndarray:
        """Return one over the variance of each order of each revolution, shape (m, ANGLES/2 + 1), per V^2.

        Order 1 has none: bending shows no curvature there, eccentricity does. The mean weighs as order 2.
        """
        S = self._variances(data)
        # What a turn's periodogram shows of it: the turn is a window, and the noise beside an order leaks into it.
        lags = np.arange(2 * ANGLES)
        cut = np.clip(1.0 - np.minimum(lags, 2 * ANGLES - lags) / ANGLES, 0.0, 1.0)
        seen = np.fft.rfft(np.fft.irfft(S, 2 * ANGLES, axis=1) * cut, axis=1).real[:, ::2]
        weights = np.asarray(1.0 / seen)
        weights[:, 0] = weights[:, 2]
        weights[:, 1] = 0.0
        return weights

    def _variances(self, data: Passages) -> np.ndarray:
        """Return the noise's variance by half orders 0, 1/2, 1.., V^2 a sample, shape (m, ANGLES + 1)."""
        orders = np.maximum(0.5 * np.arange(ANGLES + 1), 0.5)
        if not self.noise.known:
            return np.full((data.time.size, orders.size), data.noise_guess**2)
        return np.asarray(self.noise.density(orders * data.speed[:, None] / (2.0 * np.pi)) * to_variance(data.speed))

    def _learnt(self, data: Passages, found: Step, noise: NoiseSpectrum) -> NoiseSpectrum:
        """Return `noise` with what the fits of the revolutions with few gaps leave over."""
        gaps = data.missing.sum(axis=1)
        fitting = data.usable & np.isfinite(found.chi2) & found.settled
        fitting &= found.chi2 < 3.0 * np.median(found.chi2[fitting]) if fitting.any() else fitting
        for most in (0.1, 0.25):
            rows = np.flatnonzero(fitting & (gaps <= most * ANGLES))
            if rows.size >= 64:
                break
        if rows.size < 8:
            return noise
        rows = rows[:: 1 + rows.size // _LEARNT_FROM]
        orders = np.arange(3, ANGLES // 2)
        # A taper keeps strong orders out of weak ones.
        taper = np.hanning(ANGLES + 1)[:-1]
        taper = taper / np.sqrt(np.mean(taper**2))
        columns, residual = np.fft.irfft(found.spectra[rows], ANGLES, axis=2), found.left[rows]
        bent = np.fft.rfft(columns * taper, axis=2)[:, :, orders]
        power = np.abs(np.fft.rfft(residual * taper, axis=1)[:, orders]) ** 2 / ANGLES
        fitted = np.einsum("jan,jab,jbn->jn", bent.conj(), found.covariance[rows], bent, optimize=True).real / ANGLES
        half = self._variances(data)[rows]
        S = half[:, 2 * orders]
        kept = np.clip(1.0 - fitted / S, 0.1, 1.0)
        # What the taper smears into an order from those beside it, by the spectrum as far as it is known.
        smeared = sum(share * half[:, np.clip(2 * orders + k, 1, 2 * ANGLES // 2)] for k, share in _TAPERED.items())
        power = power * np.clip(S / smeared, 0.1, 1.5)
        noise.add(orders * data.speed[rows, None] / (2.0 * np.pi), power / to_variance(data.speed[rows]), kept)
        return noise

    def _remember(self, data: Passages, found: Step) -> None:
        good = data.usable[:, None] & ~data.missing & found.settled[:, None]
        self._left_over += np.where(good, found.residual, 0.0).sum(axis=0)
        self._signal += np.where(good, data.voltage, 0.0).sum(axis=0)
        self._seen += good.sum(axis=0)

    def _told(self, data: Passages, found: Step) -> Forces:
        tire, state = self.known.tire, found.state
        scale = _running_median(np.where(data.usable, found.chi2, np.nan), _NEIGHBOURS)
        misfit = found.chi2 / scale
        sd = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2) * np.maximum(scale, 0.1)[:, None])
        sd[:, 0] = np.hypot(sd[:, 0], _INTERPOLATION * state.load)
        reason = np.zeros(data.time.size, dtype=np.uint8)
        usual = np.median(state.shift[data.usable]) if data.usable.any() else 0.0
        reason[(state.load >= 0.999 * self.known.top) | (state.load <= LEAST_LOAD)] = 4
        reason[(misfit > _WORST_MISFIT) | (np.abs(state.shift - usual) > _FARTHEST_SHIFT)] = 3
        reason[~found.settled] = 2
        unsure = sd[:, :2] / np.stack(
            [_running_median(np.where(data.usable, sd[:, i], np.nan), _NEIGHBOURS) for i in (0, 1)], 1
        )
        reason[~data.usable | (unsure > _LEAST_SURE).any(axis=1)] = 1
        untold = (reason == 1) | (reason == 2)

        def seen(values: np.ndarray) -> np.ndarray:
            return np.where(untold, np.nan, values)

        return Forces(
            time=data.time,
            time_se=data.time_se,
            speed=data.told_speed,
            speed_se=data.speed_se,
            load=seen(state.load),
            load_se=seen(sd[:, 0]),
            force=seen(state.force),
            force_se=seen(sd[:, 1]),
            correlation=seen(found.covariance[:, 0, 1] * scale / (sd[:, 0] * sd[:, 1])),
            shift=seen(state.shift),
            resistance=seen(state.resistance),
            resistance_se=seen(sd[:, 3]),
            gain_ratio=seen(gain_ratio(data, state, self.known)),
            misfit=seen(misfit),
            share=1.0 - data.missing.mean(axis=1),
            fits=reason == 0,
            reason=reason,
            extrapolated=(state.load < tire.least_load) | (state.load > tire.most_load),
        )


def _running_median(values: np.ndarray, width: int) -> np.ndarray:
    """Return the median of the finite values within half a width on either side, shape (m,); 1 where there is none."""
    half = width // 2
    padded = np.pad(values, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    some = np.isfinite(windows).any(axis=1)
    found = np.ones(values.size)
    found[some] = np.nanmedian(windows[some], axis=1)
    return found
