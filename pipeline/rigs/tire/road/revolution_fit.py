"""Load and longitudinal force of every revolution: Gauss-Newton against the library under the drive's own noise (5.11).

The fit is made in the divider's voltage, where the noise is additive, on 256 angles; bins without samples carry no
weight. The noise's spectrum is learnt from what the fits leave over, so standard errors hold under coloured noise.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from pipeline.rigs.tire.ring.sensor import divider_voltage, voltage_slope
from pipeline.rigs.tire.road.library import WaveformLibrary
from pipeline.rigs.tire.road.noise_spectrum import NoiseSpectrum

ANGLES = 256
# Why a revolution is not taken: Forces.reason is the place in here.
REASONS = (
    "",
    "too few samples where the load shows",
    "does not settle",
    "shape is not that of the ring",
    "load at the end of the library",
)
_GATHERED = 512
_LEARNT_FROM = 256
_COARSE_PASSES = 10
_LEARNING = 3
_LEAST_SHARE = 0.6
_LEAST_FILLING = 0.4
_FARTHEST_SHIFT = 0.15
_NEIGHBOURS = 31
_WORST_MISFIT = 2.0
_LEAST_SURE = 4.0


class PassageBlock(Protocol):
    """What is used of some revolutions (`passages.revolutions.Revolutions`)."""

    times: np.ndarray
    time_se: np.ndarray
    speed: np.ndarray
    speed_se: np.ndarray
    resistance: np.ndarray
    film: np.ndarray | None
    count: np.ndarray
    whole: np.ndarray


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
        Angle (rad) of the contact's centre after the passage's time.
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


def joined(parts: list[Forces]) -> Forces:
    """Return the revolutions of several parts in one."""
    return Forces(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Forces)})


class RevolutionFit:
    """Fits revolutions as they come: `add` blocks of any size, `close` at the end; both return what is ready.

    Attributes
    ----------
    noise
        What is known of the drive's noise so far.
    residual
        Mean of what the fits leave over by angle (V) over that of the signal: the part no noise explains.
    """

    def __init__(self, known: WaveformLibrary) -> None:
        self.known = known
        self.noise = NoiseSpectrum()
        self._waiting: list[_Passages] = []
        self._left_over = np.zeros(ANGLES)
        self._signal = np.zeros(ANGLES)
        self._seen = np.zeros(ANGLES)

    def add(self, block: PassageBlock) -> Forces | None:
        """Take revolutions; return the fits of those that wait once enough have gathered."""
        if block.times.size:
            self._waiting.append(_passages(block, self.known))
        return self._ready() if sum(part.time.size for part in self._waiting) >= _GATHERED else None

    def close(self) -> Forces | None:
        """Return the fits of the revolutions that still wait."""
        return self._ready() if self._waiting else None

    @property
    def residual(self) -> tuple[float, float]:
        """What is left over of the mean waveform after the fits, rms over that of the signal, and its standard error.

        A share well above its error is a shape that the ring does not have: the forces err by about that share.
        """
        seen = np.maximum(self._seen, 1.0)
        mean, signal = self._left_over / seen, self._signal / seen
        scale = float(np.sqrt(np.mean((signal - signal.mean()) ** 2)))
        noise = float(np.sqrt(np.trapezoid(self.noise.values, self.noise.frequency))) if self.noise.known else np.nan
        return float(np.sqrt(np.mean(mean**2))) / scale, noise / np.sqrt(seen.mean()) / scale

    def _ready(self) -> Forces:
        data = _together(self._waiting)
        self._waiting = []
        state = _coarse_fit(data, self.known)
        if not self.noise.known:
            for _ in range(_LEARNING):
                found = self._step(data, state)
                state = found.state
                self.noise = self._learnt(data, found, NoiseSpectrum(self.noise.memory))
        found = self._step(data, state)
        self.noise = self._learnt(data, found, self.noise)
        self._remember(data, found)
        return self._told(data, found)

    def _step(self, data: _Passages, state: _State) -> _Fit:
        return _step(data, state, self.known, self._weights(data), self._variances(data))

    def _weights(self, data: _Passages) -> np.ndarray:
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

    def _variances(self, data: _Passages) -> np.ndarray:
        """Return the noise's variance by half orders 0, 1/2, 1.., V^2 a sample, shape (m, ANGLES + 1)."""
        orders = np.maximum(0.5 * np.arange(ANGLES + 1), 0.5)
        if not self.noise.known:
            return np.full((data.time.size, orders.size), data.noise_guess**2)
        return self.noise.density(orders * data.speed[:, None] / (2.0 * np.pi)) * _to_variance(data.speed)

    def _learnt(self, data: _Passages, found: _Fit, noise: NoiseSpectrum) -> NoiseSpectrum:
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
        S = self._variances(data)[rows][:, 2 * orders]
        kept = np.clip(1.0 - fitted / S, 0.1, 1.0)
        noise.add(orders * data.speed[rows, None] / (2.0 * np.pi), power / _to_variance(data.speed[rows]), kept)
        return noise

    def _remember(self, data: _Passages, found: _Fit) -> None:
        good = data.usable[:, None] & ~data.missing & found.settled[:, None]
        self._left_over += np.where(good, found.residual, 0.0).sum(axis=0)
        self._signal += np.where(good, data.voltage, 0.0).sum(axis=0)
        self._seen += good.sum(axis=0)

    def _told(self, data: _Passages, found: _Fit) -> Forces:
        tire, state = self.known.tire, found.state
        scale = _running_median(np.where(data.usable, found.chi2, np.nan), _NEIGHBOURS)
        misfit = found.chi2 / scale
        sd = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2) * np.maximum(scale, 0.1)[:, None])
        sd[:, 0] = np.hypot(sd[:, 0], _INTERPOLATION * state.load)
        reason = np.zeros(data.time.size, dtype=np.uint8)
        usual = np.median(state.shift[data.usable]) if data.usable.any() else 0.0
        reason[(state.load >= 0.999 * self.known.top) | (state.load <= _LEAST_LOAD)] = 4
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
            speed=data.speed,
            speed_se=data.speed_se,
            load=seen(state.load),
            load_se=seen(sd[:, 0]),
            force=seen(state.force),
            force_se=seen(sd[:, 1]),
            correlation=seen(found.covariance[:, 0, 1] * scale / (sd[:, 0] * sd[:, 1])),
            shift=seen(state.shift),
            resistance=seen(state.resistance),
            resistance_se=seen(sd[:, 3]),
            gain_ratio=seen(_gain_ratio(data, state, self.known)),
            misfit=seen(misfit),
            share=1.0 - data.missing.mean(axis=1),
            fits=reason == 0,
            reason=reason,
            extrapolated=(state.load < tire.least_load) | (state.load > tire.most_load),
        )


_LEAST_LOAD = 20.0
_FARTHEST = 0.6
# Error of bins and library, relative: what bench runs without road noise show.
_INTERPOLATION = 4e-4
_UNKNOWNS = 8
_LOAD_NODES, _SPEED_NODES = 60, 9
# Load and force always may bend a little, N/s.
_LEAST_BEND = 1.0
# The angle between two passages is never better known, relative.
_LEAST_STRETCH = 2e-5


@dataclass(frozen=True, eq=False)
class _Passages:
    """Revolutions on `ANGLES` angles, in V; `fine` and `weight` are those of the bins they are merged from."""

    time: np.ndarray
    time_se: np.ndarray
    speed: np.ndarray
    speed_se: np.ndarray
    voltage: np.ndarray
    weight: np.ndarray
    missing: np.ndarray
    film: np.ndarray | None
    usable: np.ndarray
    noise_guess: float

    def part(self, rows: np.ndarray) -> _Passages:
        """Return some of the revolutions."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return _Passages(**{name: v[rows] if isinstance(v, np.ndarray) else v for name, v in found.items()})


@dataclass(frozen=True, eq=False)
class _State:
    """Unknowns of each revolution, shape (m,) each."""

    load: np.ndarray
    force: np.ndarray
    shift: np.ndarray
    resistance: np.ndarray

    def part(self, rows: np.ndarray) -> _State:
        return _State(*(getattr(self, f.name)[rows] for f in fields(self)))

    def with_rows(self, rows: np.ndarray, other: _State) -> _State:
        """Return the state with some revolutions out of another."""
        found = [getattr(self, f.name).copy() for f in fields(self)]
        for values, f in zip(found, fields(self), strict=True):
            values[rows] = getattr(other, f.name)
        return _State(*found)

    def moved(self, step: np.ndarray, top: float) -> _State:
        """Return the state after a step (m, 4), shortened where it goes too far at once."""
        far = np.maximum(np.abs(step[:, 0]) / np.maximum(0.5 * self.load, 300.0), np.abs(step[:, 2]) / 0.05)
        step = step / np.maximum(far, 1.0)[:, None]
        return _State(
            np.clip(self.load + step[:, 0], _LEAST_LOAD, top),
            np.clip(self.force + step[:, 1], -top, top),
            np.clip(self.shift + step[:, 2], -_FARTHEST, _FARTHEST),
            np.maximum(self.resistance + step[:, 3], 1.0),
        )


@dataclass(frozen=True, eq=False)
class _Fit:
    """One pass.

    The state after it, covariance (m, 8, 8), whether the step was one that a linear model bears, chi2 over degrees of freedom (m,),
    residual (V, (m, ANGLES), 0 where missing), the spectra of the columns with the missing filled, and what is left
    over likewise (V).
    """

    state: _State
    covariance: np.ndarray
    settled: np.ndarray
    chi2: np.ndarray
    residual: np.ndarray
    spectra: np.ndarray
    left: np.ndarray


def _to_variance(speed: np.ndarray) -> np.ndarray:
    """Return what turns a one-sided density (V^2/Hz) into the variance of one of `ANGLES` samples of a turn, (m, 1)."""
    return np.asarray(ANGLES * speed[:, None] / (4.0 * np.pi))


def _passages(block: PassageBlock, known: WaveformLibrary) -> _Passages:
    sensor = known.tire.sensor
    count = np.asarray(block.count, dtype=float)
    rows, bins = count.shape
    seen = np.isfinite(block.resistance) & (count > 0.0)
    weight = np.where(seen, count, 0.0).reshape(rows, ANGLES, bins // ANGLES)
    R2 = np.where(seen, block.resistance, 0.0)
    V = divider_voltage(R2, sensor.VIN, sensor.R1).reshape(weight.shape)
    total = weight.sum(axis=2)
    usual = np.median(total, axis=1, keepdims=True)
    missing = total < np.maximum(_LEAST_FILLING * usual, 1e-9)
    weight = weight / np.where(total > 0.0, total, 1.0)[:, :, None]
    voltage = (V * weight).sum(axis=2)
    film = None
    if block.film is not None and known.tire.film is not None:
        found = np.where(np.isfinite(block.film), block.film, 0.0).reshape(weight.shape)
        film = (found * weight).sum(axis=2)
    usable = block.whole & (missing.mean(axis=1) < 1.0 - _LEAST_SHARE) & np.isfinite(block.speed) & (block.speed > 0.0)
    speed = np.where(usable, block.speed, 1.0)
    between = np.diff(voltage[usable], axis=1)
    guess = max(1e-9, float(np.median(np.abs(between))) / 0.954) if between.size else 1.0
    return _Passages(block.times, block.time_se, speed, block.speed_se, voltage, weight, missing, film, usable, guess)


def _together(parts: list[_Passages]) -> _Passages:
    def stacked(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])

    names = ("time", "time_se", "speed", "speed_se", "voltage", "weight", "missing", "usable")
    film = None if any(part.film is None for part in parts) else stacked("film")
    guess = float(np.median([part.noise_guess for part in parts]))
    return _Passages(**{name: stacked(name) for name in names}, film=film, noise_guess=guess)


def _start(data: _Passages, known: WaveformLibrary) -> _State:
    """Read the load off the peak above the level beside it; the contact's centre runs ahead of the peak by the lag."""
    sensor = known.tire.sensor
    theta = _angles()
    level = np.where(data.missing | (np.abs(theta) < 1.0), np.nan, data.voltage)
    near = np.where(data.missing | (np.abs(theta) > 0.1), np.nan, data.voltage)
    V0 = _filled_median(level)
    top = np.maximum(_filled_max(near), V0)
    R0, peak = (np.clip(V, 1e-3, 0.999 * sensor.VIN) for V in (V0, top))
    R0, peak = (sensor.R1 * V / (sensor.VIN - V) for V in (R0, peak))
    loads, peaks = known.peaks
    rising = np.maximum.accumulate(peaks) + 1e-6 * np.arange(peaks.size)
    load = np.clip(np.interp(peak - R0, rising, loads), 5 * _LEAST_LOAD, 0.95 * known.top)
    return _State(load, np.zeros_like(load), data.speed * sensor.lag, R0)


def _filled_median(values: np.ndarray) -> np.ndarray:
    empty = ~np.isfinite(values).any(axis=1)
    values = np.where(empty[:, None], 0.0, values)
    found = np.nanmedian(values, axis=1)
    return np.asarray(np.where(empty, np.median(found), found))


def _filled_max(values: np.ndarray) -> np.ndarray:
    empty = ~np.isfinite(values).any(axis=1)
    found = np.nanmax(np.where(empty[:, None], -1e9, values), axis=1)
    usual = np.median(found[~empty]) if (~empty).any() else 0.0
    return np.asarray(np.where(empty, usual, found))


def _angles() -> np.ndarray:
    """Return the centres of the merged bins, rad, shape (ANGLES,); bin i of N stands at -pi + 2 pi i/N."""
    step = 2.0 * np.pi / ANGLES
    return np.asarray(-np.pi + step * np.arange(ANGLES) + 0.5 * step)


def _on_bins(harmonics: np.ndarray, bins: int, offset: float) -> np.ndarray:
    """Return a one-sided series on `bins` angles from -pi + offset, shape (m, bins), as means over one bin each."""
    n = np.arange(harmonics.shape[1])
    turned = harmonics * (np.exp(1j * n * (offset - np.pi)) * np.sinc(n / bins))
    if harmonics.shape[1] > bins // 2:
        turned = turned[:, : bins // 2]
    return np.asarray(np.fft.irfft(turned, bins, axis=1) * bins)


def _coarse_fit(data: _Passages, known: WaveformLibrary) -> _State:
    """Fit by plain least squares until the next step under the noise is a small one; few revolutions need many passes."""
    state = _start(data, known)
    rows = np.arange(data.time.size)
    for _ in range(_COARSE_PASSES):
        before = state.part(rows)
        after = _coarse_step(data.part(rows), before, known)
        state = state.with_rows(rows, after)
        moved = (
            np.abs(after.load - before.load) / (0.02 * before.load + 20.0) + np.abs(after.shift - before.shift) / 5e-3
        )
        rows = rows[moved > 1.0]
        if rows.size == 0:
            break
    return state


def _coarse_step(data: _Passages, state: _State, known: WaveformLibrary) -> _State:
    """Make one Gauss-Newton step by plain least squares over the angles that hold samples."""
    sensor = known.tire.sensor
    coarse = _shapes(data, state, known)
    R2 = np.maximum(coarse[0] + state.resistance[:, None], 0.0)
    g = np.where(data.missing, 0.0, voltage_slope(R2, sensor.VIN, sensor.R1))
    J = np.stack([g * coarse[1], g * coarse[2], g * coarse[3], g], axis=1)
    residual = data.voltage - divider_voltage(R2, sensor.VIN, sensor.R1)
    _, step = _solved(np.matmul(J, J.swapaxes(1, 2)), np.matmul(J, residual[:, :, None])[:, :, 0])
    return state.moved(step, known.top)


def _shapes(data: _Passages, state: _State, known: WaveformLibrary) -> list[np.ndarray]:
    """Return R2 - R0 and its derivatives by Fz, Fx and shift on `ANGLES` angles, ohm, shape (m, ANGLES) each."""
    H, slope, pushed = known.harmonics(state.load, state.force, data.speed)
    n = known.orders
    turned = np.exp(1j * n * state.shift[:, None])
    half = np.pi / ANGLES - np.pi / (ANGLES * data.weight.shape[2])
    return [_on_bins(turned * column, ANGLES, half) for column in (H, slope, pushed, 1j * n * H)]


def _step(data: _Passages, state: _State, known: WaveformLibrary, weights: np.ndarray, variances: np.ndarray) -> _Fit:
    """Make one Gauss-Newton step under the noise.

    Fz and Fx change within the turn as the passages beside it tell. How far that, the rotation and its change may be
    off are four more unknowns with a prior, so that the begin of a manoeuvre widens the errors of the turns around it.
    """
    sensor = known.tire.sensor
    fine = data.weight.shape[2] * ANGLES
    coarse = _shapes(data, state, known)
    H = known.harmonics(state.load, state.force, data.speed)[0] * np.exp(1j * known.orders * state.shift[:, None])
    R2 = _on_bins(H, fine, 0.0) + state.resistance[:, None]
    V = divider_voltage(np.maximum(R2, 0.0), sensor.VIN, sensor.R1).reshape(data.weight.shape)
    g = voltage_slope(coarse[0] + state.resistance[:, None], sensor.VIN, sensor.R1)
    later = (_angles() + state.shift[:, None]) / data.speed[:, None] - sensor.lag
    rates, spread = _changes(data, state)
    columns = np.empty((data.time.size, _UNKNOWNS + 1, ANGLES))
    for i, shape in enumerate((coarse[1], coarse[2], coarse[3], 1.0)):
        columns[:, i] = g * shape
    columns[:, 4:6] = columns[:, :2] * later[:, None, :]
    theta = later * data.speed[:, None]
    columns[:, 6], columns[:, 7] = columns[:, 2] * theta, columns[:, 2] * theta**2
    columns[:, 8] = data.voltage - (V * data.weight).sum(axis=2) - (rates[:, :, None] * columns[:, 4:6]).sum(axis=1)
    columns[np.broadcast_to(data.missing[:, None, :], columns.shape)] = 0.0
    residual = columns[:, -1].copy()
    spectra = _whole(columns, data.missing, weights)
    J, r = spectra[:, :-1], spectra[:, -1]
    # Orders beside the mean and the last stand for two: n and -n.
    double = np.full(ANGLES // 2 + 1, 2.0)
    double[[0, -1]] = 1.0
    weighted = J.conj() * (weights * double)[:, None, :]
    A = np.matmul(weighted, J.swapaxes(1, 2)).real / ANGLES
    b = np.matmul(weighted, r[:, :, None])[:, :, 0].real / ANGLES
    prior = np.zeros((data.time.size, _UNKNOWNS))
    prior[:, 4:] = 1.0 / spread**2
    A[:, range(_UNKNOWNS), range(_UNKNOWNS)] += prior
    inverse, step = _solved(A, b)
    squares = (np.abs(r) ** 2 * weights * double).sum(axis=1) / ANGLES - (step * b).sum(axis=1)
    freedom = np.maximum((~data.missing).sum(axis=1) - 6.0, 1.0)
    # The unknowns are gains @ voltage; under noise of any spectrum their covariance is gains C gains'.
    gains = np.matmul(inverse, np.fft.irfft(weights[:, None, :] * J, ANGLES, axis=2))
    covariance = _under_noise(gains, variances) + np.matmul(inverse * prior[:, None, :], inverse.swapaxes(1, 2))
    settled = (
        (np.abs(step[:, 0]) < 0.1 * state.load + 50.0) & (np.abs(step[:, 2]) < 0.02) & np.isfinite(step).all(axis=1)
    )
    left = np.fft.irfft(r - np.matmul(step[:, None, :], J)[:, 0], ANGLES, axis=1)
    after = state.moved(step[:, :4], known.top)
    return _Fit(after, covariance, settled, squares / freedom, residual, J, left)


def _under_noise(gains: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """Return the covariance of `gains` (m, p, ANGLES) times a noise of `variances` by half orders, shape (m, p, p)."""
    spectra = np.fft.rfft(gains, 2 * ANGLES, axis=2)
    double = np.full(ANGLES + 1, 2.0)
    double[[0, -1]] = 1.0
    weighted = spectra.conj() * (variances * double)[:, None, :]
    return np.asarray(np.matmul(weighted, spectra.swapaxes(1, 2)).real / (2 * ANGLES))


def _whole(columns: np.ndarray, missing: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the spectra of the columns, shape (m, p, orders), with the missing bins filled so that they carry no weight."""
    spectra = np.fft.rfft(columns, axis=2)
    gapped = np.flatnonzero(missing.any(axis=1) & (missing.mean(axis=1) < 1.0 - _LEAST_SHARE))
    if gapped.size:
        from pipeline.rigs.tire.road.missing_bins import fill

        kernel = np.fft.irfft(weights[gapped], ANGLES, axis=1)
        part = columns[gapped]
        fill(kernel, np.fft.irfft(spectra[gapped] * weights[gapped, None, :], ANGLES, axis=2), missing[gapped], part)
        spectra[gapped] = np.fft.rfft(part, axis=2)
    return spectra


def _solved(A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the inverse of each A, shape (m, p, p), and the steps; NaN where A tells nothing."""
    size = np.sqrt(np.diagonal(A, axis1=1, axis2=2))
    dead = ~(size > 0.0).all(axis=1) | ~np.isfinite(A).all(axis=(1, 2))
    size = np.where(dead[:, None], 1.0, size)
    count = A.shape[1]
    even = np.where(dead[:, None, None], np.eye(count), A / (size[:, :, None] * size[:, None, :]))
    even = even + 1e-12 * np.eye(count)
    inverse = np.linalg.inv(even) / (size[:, :, None] * size[:, None, :])
    inverse[dead] = np.nan
    step = np.matmul(inverse, b[:, :, None])[:, :, 0]
    return inverse, np.where(dead[:, None], 0.0, step)


def _changes(data: _Passages, state: _State) -> tuple[np.ndarray, np.ndarray]:
    """Return how Fz and Fx change at each revolution, N/s, shape (m, 2), from those beside it; 0 beside a gap.

    And how far off may be these rates (N/s), the rotation (relative) and its change (rad of phase per rad^2): by the
    bend of the course around, shape (m, 4).
    """
    apart = np.diff(data.time)
    near = data.usable[1:] & data.usable[:-1] & (apart > 0.0) & (apart * data.speed[1:] < 3.0 * np.pi)
    both = np.concatenate([[False], near]) & np.concatenate([near, [False]])
    rates = np.zeros((data.time.size, 3))
    bends = np.zeros((data.time.size, 3))
    for i, values in enumerate((state.load, state.force, data.speed)):
        slope = np.where(near, np.diff(values) / np.where(near, apart, 1.0), 0.0)
        before, after = np.concatenate([[0.0], slope]), np.concatenate([slope, [0.0]])
        rates[:, i] = np.where(both, 0.5 * (before + after), before + after)
        bend = np.where(both, np.abs(after - before), np.abs(rates[:, i]))
        bends[:, i] = np.maximum(bend, np.maximum(np.append(bend[1:], 0.0), np.append(0.0, bend[:-1])))
    spread = np.empty((data.time.size, 4))
    spread[:, :2] = 0.5 * bends[:, :2] + _LEAST_BEND
    turn = 2.0 * np.pi / data.speed
    spread[:, 2] = 0.5 * bends[:, 2] * turn / data.speed + _LEAST_STRETCH
    spread[:, 3] = spread[:, 2] / (2.0 * np.pi)
    return rates[:, :2], spread


def _running_median(values: np.ndarray, width: int) -> np.ndarray:
    """Return the median of the finite values within half a width on either side, shape (m,); 1 where there is none."""
    half = width // 2
    padded = np.pad(values, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    some = np.isfinite(windows).any(axis=1)
    found = np.ones(values.size)
    found[some] = np.nanmedian(windows[some], axis=1)
    return found


def _gain_ratio(data: _Passages, state: _State, known: WaveformLibrary) -> np.ndarray:
    """Return the flex sensor's gain by the film's load, shape (m,).

    The film's waveform over the one that Fz and Fx of the flex sensor predict for it tells the film's own load; the gain
    is what the flex sensor shows over what it ought to show there.
    """
    if data.film is None:
        return np.full(data.time.size, np.nan)
    fine = data.weight.shape[2] * ANGLES
    H = known.harmonics(state.load, state.force, data.speed)[0] * known.film_factor(data.speed)
    expected = _on_bins(H * np.exp(1j * known.orders * state.shift[:, None]), ANGLES, np.pi / ANGLES - np.pi / fine)
    seen = (~data.missing).astype(float)
    n = np.maximum(seen.sum(axis=1, keepdims=True), 1.0)
    expected = seen * (expected - (seen * expected).sum(axis=1, keepdims=True) / n)
    with np.errstate(divide="ignore", invalid="ignore"):
        amplitude = (expected * data.film).sum(axis=1) / (expected**2).sum(axis=1)
    ratio = np.full(data.time.size, np.nan)
    told = data.usable & np.isfinite(amplitude) & (amplitude > 0.0)
    if not told.any():
        return ratio
    loads = np.geomspace(_LEAST_LOAD, known.top, _LOAD_NODES)
    speeds = np.geomspace(data.speed[told].min(), data.speed[told].max() * (1.0 + 1e-9), _SPEED_NODES)
    nearest = np.argmin(np.abs(np.log(data.speed[:, None] / speeds)), axis=1)
    for i, speed in enumerate(speeds):
        rows = np.flatnonzero(told & (nearest == i))
        turned = np.full(loads.size, speed)
        flex = known.harmonics(loads, np.zeros(loads.size), turned)[0][:, 1:]
        film = np.log(np.linalg.norm(flex * known.film_factor(turned)[:, 1:], axis=1))
        flex_size, x = np.log(np.linalg.norm(flex, axis=1)), np.log(loads)
        by_flex = np.log(state.load[rows])
        by_film = np.interp(np.interp(by_flex, x, film) + np.log(amplitude[rows]), np.maximum.accumulate(film), x)
        ratio[rows] = np.exp(np.interp(by_flex, x, flex_size) - np.interp(by_film, x, flex_size))
    return ratio
