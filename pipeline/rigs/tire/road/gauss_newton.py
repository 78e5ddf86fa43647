"""Gauss-Newton steps on many revolutions at once: plain least squares to come near, then under the drive's noise (5.11).

What the noise is comes in; which revolutions may be used is judged elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pipeline.rigs.tire.ring.sensor import divider_voltage, voltage_slope
from pipeline.rigs.tire.road.library import WaveformLibrary
from pipeline.rigs.tire.road.passage_voltage import ANGLES, LEAST_SHARE, Passages, angles, on_bins

LEAST_LOAD = 20.0
_COARSE_PASSES = 10
_FARTHEST = 0.6
_UNKNOWNS = 8
# Share of the bend around by which the rates of load and force within a turn may be off: half of it is noise.
_BENT = 0.25
# Load and force always may bend a little, N/s.
_LEAST_BEND = 1.0
# The angle between two passages is never better known, relative.
_LEAST_STRETCH = 2e-5


@dataclass(frozen=True, eq=False)
class State:
    """Unknowns of each revolution, shape (m,) each."""

    load: np.ndarray
    force: np.ndarray
    shift: np.ndarray
    resistance: np.ndarray

    def part(self, rows: np.ndarray) -> State:
        """Return some of the revolutions."""
        return State(*(getattr(self, f.name)[rows] for f in fields(self)))

    def with_rows(self, rows: np.ndarray, other: State) -> State:
        """Return the state with some revolutions out of another."""
        found = [getattr(self, f.name).copy() for f in fields(self)]
        for values, f in zip(found, fields(self), strict=True):
            values[rows] = getattr(other, f.name)
        return State(*found)

    def moved(self, step: np.ndarray, top: float) -> State:
        """Return the state after a step (m, 4), shortened where it goes too far at once."""
        far = np.maximum(np.abs(step[:, 0]) / np.maximum(0.5 * self.load, 300.0), np.abs(step[:, 2]) / 0.05)
        step = step / np.maximum(far, 1.0)[:, None]
        return State(
            np.clip(self.load + step[:, 0], LEAST_LOAD, top),
            np.clip(self.force + step[:, 1], -top, top),
            np.clip(self.shift + step[:, 2], -_FARTHEST, _FARTHEST),
            np.maximum(self.resistance + step[:, 3], 1.0),
        )


@dataclass(frozen=True, eq=False)
class Step:
    """One pass.

    The state after it, covariance (m, 8, 8), whether the step was one that a linear model bears, chi2 over degrees of freedom (m,),
    residual (V, (m, ANGLES), 0 where missing), the spectra of the columns with the missing filled, and what is left
    over likewise (V).
    """

    state: State
    covariance: np.ndarray
    settled: np.ndarray
    chi2: np.ndarray
    residual: np.ndarray
    spectra: np.ndarray
    left: np.ndarray


def start_values(data: Passages, known: WaveformLibrary) -> State:
    """Read the load off the peak above the level beside it; the contact's centre runs ahead of the peak by the lag."""
    sensor = known.tire.sensor
    theta = angles()
    level = np.where(data.missing | (np.abs(theta) < 1.0), np.nan, data.voltage)
    near = np.where(data.missing | (np.abs(theta) > 0.1), np.nan, data.voltage)
    V0 = _filled_median(level)
    top = np.maximum(_filled_max(near), V0)
    R0, peak = (np.clip(V, 1e-3, 0.999 * sensor.VIN) for V in (V0, top))
    R0, peak = (sensor.R1 * V / (sensor.VIN - V) for V in (R0, peak))
    loads, peaks = known.peaks
    rising = np.maximum.accumulate(peaks) + 1e-6 * np.arange(peaks.size)
    load = np.clip(np.interp(peak - R0, rising, loads), 5 * LEAST_LOAD, 0.95 * known.top)
    return State(load, np.zeros_like(load), data.speed * sensor.lag, R0)


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


def coarse_fit(data: Passages, known: WaveformLibrary) -> State:
    """Fit by plain least squares until the next step under the noise is a small one; few revolutions need many passes."""
    state = start_values(data, known)
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


def _coarse_step(data: Passages, state: State, known: WaveformLibrary) -> State:
    """Make one Gauss-Newton step by plain least squares over the angles that hold samples."""
    sensor = known.tire.sensor
    coarse = shapes(data, state, known)
    R2 = np.maximum(coarse[0] + state.resistance[:, None], 0.0)
    g = np.where(data.missing, 0.0, voltage_slope(R2, sensor.VIN, sensor.R1))
    J = np.stack([g * coarse[1], g * coarse[2], g * coarse[3], g], axis=1)
    residual = data.voltage - divider_voltage(R2, sensor.VIN, sensor.R1)
    _, step = _solved(np.matmul(J, J.swapaxes(1, 2)), np.matmul(J, residual[:, :, None])[:, :, 0])
    return state.moved(step, known.top)


def shapes(data: Passages, state: State, known: WaveformLibrary) -> list[np.ndarray]:
    """Return R2 - R0 and its derivatives by Fz, Fx and shift on `ANGLES` angles, ohm, shape (m, ANGLES) each."""
    H, slope, pushed = known.harmonics(state.load, state.force, data.speed)
    n = known.orders
    turned = np.exp(1j * n * state.shift[:, None])
    half = np.pi / ANGLES - np.pi / (ANGLES * data.weight.shape[2])
    return [on_bins(turned * column, ANGLES, half) for column in (H, slope, pushed, 1j * n * H)]


def noise_step(
    data: Passages, state: State, known: WaveformLibrary, weights: np.ndarray, variances: np.ndarray
) -> Step:
    """Make one Gauss-Newton step under the noise.

    Fz and Fx change within the turn as the passages beside it tell. How far that, the rotation and its change may be
    off are four more unknowns with a prior, so that the begin of a manoeuvre widens the errors of the turns around it.
    """
    sensor = known.tire.sensor
    fine = data.weight.shape[2] * ANGLES
    coarse = shapes(data, state, known)
    H = known.harmonics(state.load, state.force, data.speed)[0] * np.exp(1j * known.orders * state.shift[:, None])
    R2 = on_bins(H, fine, 0.0) + state.resistance[:, None]
    V = divider_voltage(np.maximum(R2, 0.0), sensor.VIN, sensor.R1).reshape(data.weight.shape)
    g = voltage_slope(coarse[0] + state.resistance[:, None], sensor.VIN, sensor.R1)
    later = (angles() + state.shift[:, None]) / data.speed[:, None] - sensor.lag
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
    return Step(after, covariance, settled, squares / freedom, residual, J, left)


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
    gapped = np.flatnonzero(missing.any(axis=1) & (missing.mean(axis=1) < 1.0 - LEAST_SHARE))
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


def _changes(data: Passages, state: State) -> tuple[np.ndarray, np.ndarray]:
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
    spread[:, :2] = _BENT * bends[:, :2] + _LEAST_BEND
    turn = 2.0 * np.pi / data.speed
    spread[:, 2] = 0.5 * bends[:, 2] * turn / data.speed + _LEAST_STRETCH
    spread[:, 3] = spread[:, 2] / (2.0 * np.pi)
    return rates[:, :2], spread
