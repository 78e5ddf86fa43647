"""How fast the shafts really turn, seen without the encoder: by the torque's ripple in FOS and by the mesh lines in SOS.

A counter with another resolution than stated, or a speed in another unit, is off by one factor everywhere; these
two are not. Says by what factor, or nothing where they cannot tell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span, within
from pipeline.rigs.gearbox.record import Record, Signal
from pipeline.rigs.gearbox.vibration.mesh import input_speed
from pipeline.rigs.gearbox.vibration.sos_speed import line_orders, teeth_in

# Mistakes that are made: resolution and decoding by powers of two, rpm or Hz for rad/s.
FACTORS = (1.0, 0.125, 0.25, 0.5, 2.0, 4.0, 8.0, math.pi / 30.0, 30.0 / math.pi, 2.0 * math.pi, 0.5 / math.pi)
# Power of a line over the noise beside it that chance does not reach among some thousand places.
_LINE = 25.0
# The noise beside a line is a median over so many of its widths to either side: two lines and their flanks are less than half.
_BESIDE = 6.0
# Orders of the counted shaft within which its true order 1 is sought.
_SOUGHT = (0.07, 20.0)
# Lines nearer than this many widths of a line are one.
_SAME = 1.4
# Of a comb at an odd speed every line must stand so far out of the noise, and there must be some: half the lines of a
# true comb lie on that of twice its speed.
_EACH, _LINES = 10.0, 3
# End of a stage without a settled part that is left out, s.
_GUARD = 0.3


@dataclass(frozen=True)
class TrueSpeed:
    """Speed of a shaft over what the encoder says, and what shows it in words."""

    factor: float
    shown_by: str


def by_ripple(run: AlignedRun, steady: list[Span]) -> TrueSpeed | None:
    """Return the true speed of the locked shaft over the counted one, from the torques' ripple.

    Parameters
    ----------
    run
        With its speed as the encoder tells it.
    steady
        Settled parts of FOS, s; the stage itself serves where none settled.

    Returns
    -------
    1 where a line stands at the counted speed, None where nothing can be told.

    Notes
    -----
    A shaft's ripple has order 1, and 2 with it; nothing turns slower than the locked box does. The lowest line of the
    torques' spectra is order 1 where another stands at twice its frequency.
    """
    if not run.speed_nominal > 0:
        return None
    spans = steady or [(start + _GUARD, end - _GUARD) for name, (start, end) in run.stages.items() if name == "fos"]
    time, *torques = run.slow
    parts = [part for span in spans if (part := within(time, span)).stop - part.start >= 100]
    if not parts:
        return None
    counted = run.speed_nominal / (2.0 * math.pi)
    step = float(np.median(np.diff(time)))
    length = 8 * max(part.stop - part.start for part in parts)
    frequency = np.fft.rfftfreq(length, step)
    width = 1.0 / (step * min(part.stop - part.start for part in parts))
    spectra = [_over_floor(time[part], values[part], length, 1.0 / width) for values in torques for part in parts]
    limits = (_SOUGHT[0] * counted, _SOUGHT[1] * counted)
    lines = _lines(frequency, np.mean(spectra, axis=0), width, limits, _LINE / math.sqrt(len(spectra)))

    def stands(at: float) -> bool:
        return any(abs(line - at) < _SAME * width for line in lines)

    lowest = min(lines, default=0.0)
    # A line at the counted speed may be order 2 of a shaft that turns half as fast.
    if stands(counted) and not abs(lowest - 0.5 * counted) < _SAME * width:
        return TrueSpeed(1.0, "the torques ripple once a turn")
    if lowest < 2.5 * width or not stands(2.0 * lowest):
        return None
    return TrueSpeed(lowest / counted, f"the torques ripple at {lowest:.3g} Hz and twice that while locked")


def _over_floor(time: np.ndarray, torque: np.ndarray, length: int, duration: float) -> np.ndarray:
    """Return the power spectrum over the noise beside each frequency, shape (length // 2 + 1,)."""
    from scipy.ndimage import median_filter

    trend = np.polynomial.Polynomial.fit(time, torque, 1)
    power = np.abs(np.fft.rfft((torque - trend(time)) * np.hanning(time.size), length)) ** 2
    step = (time[-1] - time[0]) / (time.size - 1)
    beside = 2 * round(_BESIDE * length * step / duration) + 1
    floor = median_filter(power, beside, mode="nearest") / math.log(2.0)
    return np.asarray(power / np.maximum(floor, 1e-300))


def _lines(frequency: np.ndarray, contrast: np.ndarray, width: float, limits: Span, least: float) -> list[float]:
    """Return the frequencies (Hz) of the lines that stand out of the noise by `least`."""
    own = max(int(2.0 * width / float(frequency[1])), 2)
    inner = contrast[1:-1]
    tops = 1 + np.flatnonzero((inner >= contrast[:-2]) & (inner > contrast[2:]) & (inner > least))
    tops = tops[(frequency[tops] > limits[0]) & (frequency[tops] < limits[1])]
    return [float(frequency[i]) for i in tops if contrast[i] >= contrast[max(i - own, 0) : i + own + 1].max()]


def by_mesh(record: Record, run: AlignedRun) -> TrueSpeed | None:
    """Return the true input speed in SOS over the counted one of FOS, from the mesh lines.

    Notes
    -----
    Sought at the counted speed and at the factors that mistakes have; the greatest contrast is the true one. None
    where no comb stands out, or one at another speed lacks a line.
    """
    if record.vibration is None or "sos" not in run.stages or not run.speed_nominal > 0:
        return None
    log, span, orders = record.vibration, run.stages["sos"], line_orders(teeth_in(record))
    found = [
        (one.contrast, one.speed, one.orders)
        for factor in FACTORS
        if (one := input_speed(log.time, log.values, span, factor * run.speed_nominal, orders)) is not None
    ]
    if not found:
        return None
    contrast, speed, seen = max(found)
    factor = speed / run.speed_nominal
    if mistake(factor) != 1.0 and (len(seen) < _LINES or not _all_stand(log.part(*span), speed, seen)):
        return None
    text = f"{len(seen)} mesh lines in SOS, {contrast:.0f} times their noise, tell {speed:.4g} rad/s of input speed"
    return TrueSpeed(factor, text)


def _all_stand(log: Signal, speed: float, orders: Sequence[float]) -> bool:
    """Tell whether each line of a comb stands out of the noise in some channel."""
    window = np.hanning(log.time.size)
    seen = np.zeros(len(orders), dtype=bool)
    for values in log.values.values():
        power = np.abs(np.fft.rfft((values - values.mean()) * window)) ** 2
        bins = np.array(orders) * speed / (2.0 * math.pi) * log.time.size / log.rate
        for i, at in enumerate(np.rint(bins).astype(int)):
            beside = power[max(at - 60, 1) : at + 60]
            near = power[max(at - 2, 1) : at + 3]
            seen[i] |= bool(near.size and near.max() > _EACH * float(np.median(beside)) / math.log(2.0))
    return bool(seen.all())


def mistake(factor: float) -> float | None:
    """Return the factor of a known mistake that explains `factor`, None where none does; a drive droops by up to 15 %.

    Examples
    --------
    >>> mistake(0.122), mistake(0.78), mistake(0.99)
    (0.125, None, 1.0)
    """
    return next((one for one in FACTORS if 0.85 <= factor / one <= 1.05), None)


def true_speed(record: Record, run: AlignedRun, steady: list[Span]) -> TrueSpeed | None:
    """Return the true speed over the counted one where ripple or mesh lines show another, None where they do not.

    Notes
    -----
    The mesh lines are sought only where the ripple does not bear the counter out: they cost more. They carry more
    weight, and the ripple must not contradict them.
    """
    ripple = by_ripple(run, steady)
    if ripple is not None and ripple.factor == 1.0:
        return None
    mesh = by_mesh(record, run)
    if mesh is None:
        return ripple
    known = mistake(mesh.factor)
    if known == 1.0:
        return None
    if ripple is None:
        return mesh if known is not None else None
    if not 0.65 < mesh.factor / ripple.factor < 1.1:
        return None
    return TrueSpeed(ripple.factor if known is None else known, f"{ripple.shown_by}, and {mesh.shown_by}")
