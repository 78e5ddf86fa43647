"""What reaches the synthetic transmitter: resistance and film behind their lags, noise, codes of the converter."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.ring.pvdf import liner_strain
from pipeline.rigs.tire.ring.sensor import divider_voltage
from pipeline.rigs.tire.synthetic.library import library
from pipeline.rigs.tire.synthetic.motion import Motion
from pipeline.rigs.tire.synthetic.truth import RoadTruth, TireTruth, ring_of

_LEAST_RESISTANCE = 10.0
_ROAD_BAND = (30.0, 400.0)


def lagged(values: np.ndarray, rate: float, lag: float) -> np.ndarray:
    """Return a first-order lag of evenly sampled values, shape (n,), at rest before the first (bilinear)."""
    if lag == 0.0:
        return values
    from scipy.signal import lfilter

    a = 2.0 * lag * rate
    b = np.array([1.0, 1.0]) / (1.0 + a)
    pole = (1.0 - a) / (1.0 + a)
    filtered, _ = lfilter(b, [1.0, pole], values, zi=[(b[1] - pole) * values[0]])
    return np.asarray(filtered)


def high_passed(values: np.ndarray, rate: float, time_constant: float) -> np.ndarray:
    """Return what a first-order high-pass leaves of evenly sampled values, shape (n,): they less their lag."""
    return np.asarray(values - lagged(values, rate, time_constant))


def flex_voltage(truth: TireTruth, motion: Motion, rng: np.random.Generator) -> np.ndarray:
    """Return the voltage at the divider, V, shape (n,)."""
    k = lagged(_felt(truth, motion, truth.flex_length, 0.0), truth.rate, truth.flex_lag)
    if truth.creep:
        k = (1.0 - truth.creep) * k + truth.creep * lagged(k, truth.rate, truth.creep_time)
    share = motion.time / motion.time[-1]
    c = truth.polarity * truth.c * (1.0 + truth.gain_drift * share)
    c = c * np.where(motion.time >= truth.debond_time, truth.debond_share, 1.0)
    R2 = truth.R0 * (1.0 + truth.resistance_drift * share) + c * k + truth.once_per_rev * np.cos(motion.angle)
    R2 = np.maximum(R2, _LEAST_RESISTANCE)
    supply = truth.supply_voltage * (1.0 - truth.supply_sag * share)
    V = supply * divider_voltage(R2, 1.0, truth.divider_resistance)
    V = np.where(motion.time >= truth.broken_time, supply, V)
    if truth.divider_flipped:
        V = supply - V
    V = V + truth.mains * np.sin(2.0 * np.pi * 50.0 * motion.time)
    return np.asarray(V + _noise(truth, truth.flex_noise, V.size, rng))


def film_voltage(truth: TireTruth, motion: Motion, rng: np.random.Generator) -> np.ndarray:
    """Return the voltage of the film's readout, V, shape (n,)."""
    strain = liner_strain(_felt(truth, motion, truth.film_length, truth.film_offset_angle), truth.h)
    V = truth.film_mid + truth.film_gain * high_passed(strain, truth.rate, truth.film_time_constant)
    return np.asarray(V + _noise(truth, truth.film_noise, V.size, rng))


def codes(truth: TireTruth, voltage: np.ndarray) -> np.ndarray:
    """Return the converter's codes, shape (n,): rounded and clipped."""
    full = 2**truth.adc_bits
    return np.asarray(np.clip(np.round(voltage / truth.adc_reference * full), 0, full - 1))


def _felt(truth: TireTruth, motion: Motion, length: float, ahead: float) -> np.ndarray:
    """Return the curvature averaged over a sensor that runs `ahead` (rad) of the flex sensor, 1/m, shape (n,)."""
    sign = truth.force_sign if isinstance(truth, RoadTruth) else 1
    known = library(ring_of(truth), truth.kt, truth.Ro, length, float(motion.Fz.max()))
    return known.curvature(motion.angle + ahead, motion.Fz, sign * motion.Fx)


def _noise(truth: TireTruth, white: float, n: int, rng: np.random.Generator) -> np.ndarray:
    noise = white * rng.standard_normal(n)
    if truth.road_noise:
        from scipy.signal import butter, sosfilt

        low, high = _ROAD_BAND
        band = butter(2, (low, min(high, 0.45 * truth.rate)), "bandpass", fs=truth.rate, output="sos")
        rough = sosfilt(band, rng.standard_normal(n))
        noise = noise + truth.road_noise * rough / np.std(rough)
    return np.asarray(truth.noise * noise)
