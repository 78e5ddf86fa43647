"""Vibration by stage, by shaft order and around events (fact sheet 5.7). Speeds from mesh lines are in `mesh`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.gearbox.aligned_run import Span, within
from pipeline.signals.spectra import welch

# Gravity and drift of the sensors lie below, Hz.
HIGH_PASS = 2.0
# The error of a level comes from blocks at least so long (s, samples), at least and at most so many.
_BLOCK, _SAMPLES = 0.02, 25
_FEWEST, _MOST = 6, 60
# Shaft orders of a spectrum are told apart to this much.
_ORDER_STEP = 0.1


@dataclass(frozen=True)
class StageVibration:
    """Vibration of one channel in one stage, above 2 Hz.

    `rms` m/s^2 and its standard error with `dof` (NaN where the stage is too short to tell one, or the channel is
    dead); `crest` largest over rms; `kurtosis` 3 for Gaussian noise, 1.5 for a sine.
    """

    rms: float
    rms_error: float
    dof: float
    crest: float
    kurtosis: float


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Amplitude spectrum over shaft orders: `order` (1), `amplitude` (m/s^2 peak of a sine), shape (n,).

    `floor` is the median amplitude beside each order, shape (n,): what noise alone shows there.
    """

    order: np.ndarray
    amplitude: np.ndarray
    floor: np.ndarray


@dataclass(frozen=True)
class OrderLevel:
    """One line: its order, amplitude (m/s^2 peak), noise floor there, and whether it stands out."""

    order: float
    amplitude: float
    floor: float

    @property
    def stands_out(self) -> bool:
        """Tell whether it exceeds the floor four times: noise does so about once in a hundred thousand."""
        return self.amplitude > 4 * self.floor


def high_passed(time: np.ndarray, values: np.ndarray, cutoff: float = HIGH_PASS) -> np.ndarray:
    """Return the samples without what lies below `cutoff` Hz, zero phase, shape (n,)."""
    from scipy.signal import butter, sosfiltfilt

    rate = (time.size - 1) / float(time[-1] - time[0])
    if time.size < 32 or cutoff > 0.4 * rate:
        return np.asarray(values - values.mean())
    sections = butter(2, cutoff, "highpass", fs=rate, output="sos")
    # Mirrored over a period of the cutoff: turned about a noisy last sample the log would step by its noise.
    length = min(round(rate / cutoff), time.size - 1)
    return np.asarray(sosfiltfilt(sections, values - values.mean(), padtype="even", padlen=length))


def stage_vibration(time: np.ndarray, values: np.ndarray, span: Span, guard: float = 0.1) -> StageVibration | None:
    """Measure one channel over one stage.

    Parameters
    ----------
    time, values
        s and m/s^2, shape (n,): the whole run, high-passed (`high_passed`).
    span
        The stage, s; `guard` is left out at both ends of stages long enough.

    Returns
    -------
    None below 32 samples.
    """
    edge = guard if span[1] - span[0] > 4 * guard else 0.0
    x = values[within(time, (span[0] + edge, span[1] - edge))]
    if x.size < 32:
        return None
    square = x**2
    power = float(square.mean())
    if not power > 0:
        return StageVibration(0.0, math.nan, math.nan, math.nan, math.nan)
    rms = math.sqrt(power)
    rate = (x.size - 1) / (span[1] - span[0] - 2 * edge)
    error, dof = _error_of_mean(square, max(round(_BLOCK * rate), _SAMPLES))
    return StageVibration(
        rms, error / (2 * rms), dof, float(np.abs(x).max()) / rms, float((square**2).mean()) / power**2
    )


def _error_of_mean(square: np.ndarray, size: int) -> tuple[float, float]:
    """Return the standard error of a mean square and its degrees of freedom; NaN below six blocks of `size`.

    From second differences of block means: how the level rises or falls within the stage is the stage's own and
    no error. For white block means they have (n - 2)/1.94 degrees of freedom.
    """
    n = min(square.size // size, _MOST)
    if n < _FEWEST:
        return math.nan, math.nan
    means = np.array([float(part.mean()) for part in np.array_split(square, n)])
    bends = np.diff(means, 2)
    return math.sqrt(float(np.mean(bends**2)) / 6.0 / n), (n - 2) / 1.94


def order_spectrum(
    time: np.ndarray, values: np.ndarray, span: Span, angle: np.ndarray, highest: float = 300.0
) -> OrderSpectrum | None:
    """Resample a stage on the angle of a shaft and return its amplitude spectrum over orders.

    Parameters
    ----------
    time, values
        s and m/s^2, shape (n,).
    span
        Stage of steady speed, s.
    angle
        Angle of the shaft at `time`, rad, shape (n,): the encoder's while locked, speed times time in SOS.
    highest
        Largest order; the sampling rate may allow less.

    Returns
    -------
    None where the shaft makes fewer than four turns.
    """
    part = within(time, span)
    turns = (angle[part] - angle[part][0]) / (2 * math.pi) if part.stop > part.start else np.zeros(0)
    if turns.size < 64 or turns[-1] < 4:
        return None
    turns = np.maximum.accumulate(turns)
    forward = np.r_[True, np.diff(turns) > 0]
    per_turn = (turns.size - 1) / turns[-1]
    grid = np.arange(0, turns[-1], 1 / per_turn)
    resampled = _cubic(turns[forward], values[part][forward], grid)
    segment = min(round(per_turn / _ORDER_STEP), grid.size)
    try:
        spectra = welch(resampled, resampled, per_turn, segment)
    except InputError:
        return None
    # The Hann window spreads a line over 1.5 bins: from density to the amplitude of a sine.
    amplitude = np.sqrt(2 * spectra.pxx * 1.5 * per_turn / segment)
    kept = spectra.frequency <= min(highest, 0.45 * per_turn)
    floor = _floor(amplitude, max(round(5.0 * segment / per_turn), 8))
    return OrderSpectrum(spectra.frequency[kept], amplitude[kept], floor[kept])


def order_levels(
    spectrum: OrderSpectrum, orders: Sequence[float], sidebands: Mapping[float, float] | None = None
) -> list[OrderLevel]:
    """Read the amplitudes at the given orders.

    Parameters
    ----------
    spectrum
        From `order_spectrum`.
    orders
        Those beyond the spectrum are left out.
    sidebands
        Order -> spacing: its first two sidebands on either side are read too (carrier passing: 140 -> 2).
    """
    wanted = list(orders)
    for centre, spacing in (sidebands or {}).items():
        wanted += [centre + k * spacing for k in (-2, -1, 1, 2)]
    step = float(spectrum.order[1] - spectrum.order[0])
    found = []
    for order in sorted(set(wanted)):
        if not 0 < order <= spectrum.order[-1] - 2 * step:
            continue
        at = round(order / step)
        near = slice(max(at - 1, 0), at + 2)
        best = near.start + int(np.argmax(spectrum.amplitude[near]))
        found.append(OrderLevel(order, float(spectrum.amplitude[best]), float(spectrum.floor[best])))
    return found


def transient(time: np.ndarray, values: np.ndarray, event: float, before: Span, width: float = 0.2) -> float:
    """Return how much energy an event adds: mean square within `width` s of it over that of the stage before.

    Parameters
    ----------
    time, values
        s and m/s^2, shape (n,), high-passed.
    event
        s.
    before
        A quiet stage to compare with, s.
    """
    at = values[within(time, (event - 0.5 * width, event + 0.5 * width))]
    calm = values[within(time, before)]
    if at.size < 8 or calm.size < 32 or not np.any(calm):
        return math.nan
    return float(np.mean(at**2) / np.mean(calm**2))


def aliased_lines(
    time: np.ndarray, values: np.ndarray, span: Span, speed: float, orders: Sequence[float]
) -> list[tuple[float, float]]:
    """Find mesh lines folded back at the sampling rate: (order, frequency in Hz where it shows).

    A line at fs - f_m where f_m itself lies above fs/2 means that no filter stood before the converter.
    """
    part = within(time, span)
    if part.stop - part.start < 1024 or not speed > 0:
        return []
    t, x = time[part], values[part] - values[part].mean()
    rate = (t.size - 1) / float(t[-1] - t[0])
    power = np.abs(np.fft.rfft(x * np.hanning(x.size))) ** 2
    spacing = rate / x.size
    found = []
    for order in orders:
        line = order * speed / (2 * math.pi)
        folded = abs(line - rate * round(line / rate))
        own_orders = [k * speed / (2 * math.pi) for k in orders if k * speed / (2 * math.pi) < 0.5 * rate]
        width = 4 * spacing
        if line < 0.5 * rate or folded < 10 * spacing or any(abs(folded - f) < 2 * width for f in own_orders):
            continue
        at = round(folded / spacing)
        beside = np.r_[power[max(at - 100, 0) : at - 8], power[at + 9 : at + 100]]
        if beside.size > 20 and power[at - 4 : at + 5].max() > 50 * np.median(beside):
            found.append((order, float(folded)))
    return found


def _cubic(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(x, y, k=3)(at))


def _floor(amplitude: np.ndarray, width: int) -> np.ndarray:
    """Return the running median by blocks of `width` bins, interpolated, shape as given."""
    count = max(amplitude.size // width, 1)
    parts = np.array_split(np.arange(amplitude.size), count)
    centres = [float(part.mean()) for part in parts]
    return np.interp(np.arange(amplitude.size), centres, [float(np.median(amplitude[part])) for part in parts])
