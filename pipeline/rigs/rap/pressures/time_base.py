"""Is the time in the unit that it is said to be in? A pump that turns a hundred times a second is none of this device (rap.md, 3.5)."""

from __future__ import annotations

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.record import WORDS, Record, Source
from pipeline.rigs.rap.pulsation.passages import BAND
from pipeline.rigs.rap.tables import Signal

# Seconds in one of each: what a stamp may have been before somebody called it a second.
TIME_UNITS = {"min": 60.0, "h": 3600.0, "ms": 1e-3, "us": 1e-6}
_PULSATING = ("prefilter", "return", "access")
# Only rates beyond these are doubted, Hz.
_FAST, _SLOW = 100.0, 0.2
_SEGMENT, _SEGMENTS = 1024, 3
# The line, a wandering speed's that share wide to either side, holds that share of the power about a straight course.
_ABOUT, _SHARE = 0.1, 0.3


def time_faults(record: Record) -> list[QualityFinding]:
    """Return an error where pressures pulsate as a pump does whose time is in another unit; one for all readers alike."""
    each = {reader: _of(source) for reader, source in record.sources.items()}
    found = {reader: one for reader, one in each.items() if one is not None}
    if not found:
        return []
    first, *others = found
    one, line, unit = found[first]
    seconds, alike = TIME_UNITS[unit], [WORDS[reader] for reader in others]
    text = (
        f"time in {unit}, labelled s? By its stamps {one.name} is sampled at {one.rate:.4g} Hz and pulsates at {line:.3g} Hz, where a roller pump passes "
        f"{BAND[0]:g} to {BAND[1]:g} times a second; in {unit} these are {one.rate / seconds:.3g} and {line / seconds:.3g} Hz"
        f"{', and alike ' + ' and '.join(alike) + ' readings' if alike else ''}. Give the unit of the time in the recipe"
    )
    return [QualityFinding("error", text, record.run, one.name)]


def _of(source: Source) -> tuple[Signal, float, str] | None:
    """Return the pressure that tells another unit of time, its line (Hz by the stamps), and the unit."""
    for one in (source.taps[tap] for tap in _PULSATING if tap in source.taps):
        if _SLOW < one.rate < _FAST or one.values.size < _SEGMENTS * _SEGMENT:
            continue
        line = _line(one)
        for unit, seconds in TIME_UNITS.items():
            if line is not None and BAND[0] <= line / seconds <= BAND[1]:
                return one, line, unit
    return None


def _line(one: Signal) -> float | None:
    """Return the frequency (Hz by the stamps) of the line that most of the motion is made of; None where there is none."""
    count = one.values.size // _SEGMENT
    pieces = one.values[: count * _SEGMENT].reshape(count, _SEGMENT)
    ramp = np.arange(_SEGMENT) - 0.5 * (_SEGMENT - 1)
    pieces = pieces - pieces.mean(axis=1, keepdims=True)
    pieces = pieces - (pieces @ ramp / (ramp @ ramp))[:, None] * ramp
    power = np.abs(np.fft.rfft(pieces * np.hanning(_SEGMENT), axis=1)) ** 2
    strongest = power[:, 1:].argmax(axis=1) + 1
    about = np.abs(np.arange(power.shape[1]) - strongest[:, None]) <= np.maximum(_ABOUT * strongest[:, None], 1.0)
    share = (power * about).sum(axis=1) / np.maximum(power[:, 1:].sum(axis=1), 1e-300)
    return float(np.median(strongest)) * one.rate / _SEGMENT if float(np.median(share)) > _SHARE else None
