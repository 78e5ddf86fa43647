"""Is the sign of the ultrafiltrate pressure turned? Where the blood side's pressure wavers, that behind the membrane follows (rap.md, eq. 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.rigs.rap.pressures.spans import Span, within
from pipeline.rigs.rap.tables import Signal

# Means of five seconds, less those of two minutes about them: what the pump's speed wavers, without membrane, level and zero.
_MEAN, _ABOUT = 5.0, 25
_FEWEST = 60
# So many standard deviations of chance below nil the two run against each other.
_AGAINST = -4.5
TURNED = (
    "pressure_uf_rap falls whenever the blood side's pressures rise (correlation {:.2f} of means of 5 s), where it must follow them through the "
    "membrane: its sign is turned. No membrane is told from it; write 'sign: -1' in the recipe."
)


def turned(prefilter: Signal, back: Signal, uf: Signal, running: Sequence[Span]) -> str:
    """Return why the sign is turned, '' where it is not or too little is logged; `running` is when the pumps run, s."""
    blood = 0.5 * (prefilter.values + np.interp(prefilter.time, back.time, back.values))
    at = np.interp(prefilter.time, uf.time, uf.values)
    number = np.floor((prefilter.time - prefilter.time[0]) / _MEAN).astype(int)
    count = np.bincount(number)
    middle = prefilter.time[0] + (np.arange(count.size) + 0.5) * _MEAN
    ours, theirs = (_wavering(values, number, count) for values in (blood, at))
    # Away from starts and stops, which move all pressures at once.
    inside = within(middle, [(start + 60.0, end - 60.0) for start, end in running])
    inside &= count > 0.5 * _MEAN * prefilter.rate
    if inside.sum() < _FEWEST:
        return ""
    # A clamp or a clot is no wavering.
    inside &= np.abs(ours) < 5.0 * 1.4826 * float(np.median(np.abs(ours[inside])))
    correlation = float(np.corrcoef(ours[inside], theirs[inside])[0, 1])
    return TURNED.format(correlation) if correlation * float(np.sqrt(inside.sum())) < _AGAINST else ""


def _wavering(values: np.ndarray, number: np.ndarray, count: np.ndarray) -> np.ndarray:
    mean = np.bincount(number, values) / np.maximum(count, 1)
    return np.asarray(mean - np.convolve(mean, np.full(_ABOUT, 1.0 / _ABOUT), mode="same"))
