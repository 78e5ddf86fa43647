"""Device and bench side by side: the bench read at the device's samples, through the device's sensor (rap.md, 5.2).

The clock and the poles come from `alignment`. Gains and offsets stay as they are: they are what agreement is about.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.signals.resampling import stretches, to_uniform

# The grid on which the bench is filtered is so many times finer than its samples; both ends are extended, s.
_FINER, _EXTENDED = 4, 5.0
# Samples that near to an end or a gap are not compared, s.
_MARGIN = 0.5
# Between two samples of the bench that many steps apart one is missing.
_KNOWN = 1.6
# A stretch of fewer samples is left out.
_FEWEST = 40


@dataclass(frozen=True, eq=False)
class Aligned:
    """One tap on the bench's clock, at the device's samples; shape (n,) each.

    Attributes
    ----------
    name
        Tap.
    time
        s, increasing.
    device
        As read, Pa.
    bench
        Read at the same moments, as the device's sensor would (pole of the bench taken out, that of the device put in), Pa.
    plain
        Read at the same moments as it is, Pa.
    good
        Where both are known.
    pole, pole_sd
        Pole of the device's sensor that the bench was read through and its standard error, s.
    """

    name: str
    time: np.ndarray
    device: np.ndarray
    bench: np.ndarray
    plain: np.ndarray
    good: np.ndarray
    pole: float = 0.0
    pole_sd: float = 0.0

    @property
    def rate(self) -> float:
        """Samples a second, Hz."""
        return float(1.0 / np.median(np.diff(self.time)))


def aligned(pair: Pair, alignment: Alignment) -> Aligned:
    """Return both channels of a pair at the device's samples.

    Between its samples the bench is read by its Fourier series: straight lines would take 2 to 8 % off the pulsation.
    """
    time = alignment.device_on_bench(pair.device.time)
    tau_d = alignment.pole_by_name.get(pair.name) or _usual(alignment)
    equal, plain = _at(pair, alignment, time, (tau_d, alignment.bench_pole))
    known = np.isfinite(equal) & np.isfinite(plain)
    spread = [
        p.std_error for p in alignment.poles if p.std_error is not None and p.at.get("channel", pair.name) == pair.name
    ]
    good = known & _inside(time, pair.device.time)
    return Aligned(pair.name, time, pair.device.values, equal, plain, good, tau_d, spread[0] if spread else 0.0)


def _usual(alignment: Alignment) -> float:
    """Return the median pole of the device's sensors, that of the bench where none is known (then nothing is equalised)."""
    poles = list(alignment.pole_by_name.values())
    return float(np.median(poles)) if poles else alignment.bench_pole


def _inside(time: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Tell which samples lie off gaps of the device's own record."""
    good = np.ones(time.size, dtype=bool)
    for part in stretches(stamps, stamps):
        good[part] = (time[part] > time[part[0]] + _MARGIN) & (time[part] < time[part[-1]] - _MARGIN)
    return good


def _at(
    pair: Pair, alignment: Alignment, time: np.ndarray, poles: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bench at `time`, through the device's sensor and as it is; NaN beyond its stretches."""
    from scipy.interpolate import make_interp_spline

    stamps = alignment.bench_time(pair.bench.time)
    equal, plain = np.full(time.size, np.nan), np.full(time.size, np.nan)
    for part in stretches(stamps, pair.bench.values):
        if part.size < _FEWEST:
            continue
        even = to_uniform(stamps[part], pair.bench.values[part])
        grid, (through, same) = _finer(even.grid[0], 1.0 / even.rate, even.values, poles)
        inside = (time > grid[0] + _MARGIN) & (time < even.grid[-1] - _MARGIN)
        # A lone lost sample is bridged for the filter alone: between its neighbours the bench is not known.
        at = np.clip(np.searchsorted(stamps[part], time), 1, part.size - 1)
        inside &= np.diff(stamps[part])[at - 1] < _KNOWN / even.rate
        for out, values in ((equal, through), (plain, same)):
            out[inside] = make_interp_spline(grid, values, k=3)(time[inside])
    return equal, plain


def _finer(
    start: float, step: float, values: np.ndarray, poles: tuple[float, float]
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return a finer grid and the samples on it, filtered by (1 + s tau_b)/(1 + s tau_d) and as they are."""
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    tau_d, tau_b = poles
    size = min(round(_EXTENDED / step), values.size - 1)
    # Turned about both end samples: level and slope go on.
    before = 2.0 * values[0] - values[size:0:-1]
    behind = 2.0 * values[-1] - values[-2 : -size - 2 : -1]
    # The series is periodic: beyond the extension a straight way leads from its end back to its start.
    total = next_fast_len(values.size + 3 * size)
    missing = total - values.size - 2 * size
    way = np.linspace(behind[-1], before[0], missing + 2)[1:-1]
    spectrum = rfft(np.concatenate([before, values, behind, way]))
    omega = 2.0 * np.pi * rfftfreq(total, step)
    through = spectrum * (1.0 + 1j * omega * tau_b) / (1.0 + 1j * omega * tau_d)
    grid = start + step / _FINER * np.arange(_FINER * (values.size - 1) + 1)
    fine = []
    for one in (through, spectrum):
        padded = np.zeros(_FINER * total // 2 + 1, dtype=complex)
        padded[: one.size] = one
        if total % 2 == 0:
            padded[one.size - 1] *= 0.5
        fine.append(_FINER * irfft(padded, _FINER * total)[_FINER * size : _FINER * size + grid.size])
    return grid, (fine[0], fine[1])
