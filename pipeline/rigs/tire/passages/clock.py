"""What the columns of a log tell of its clock: samples per second, samples of a packet, bits of its counter (tire.md, 5.1)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Stream

# The log's own times are believed against the stated rate from this relative difference on.
_RATE_DIFFERS = 2e-3
# Steps of time within this share of the usual are even; where they are not, so much may be missing of the stated rate.
_EVEN, _MOST_MISSING = 0.3, 2.0
SMALL_COUNTER = 4
# A number that falls by so much began again; the rate is not told across so many seconds.
_BEGUN_AGAIN, _SILENCE = 1000.0, 0.1
# Of a transmitter that states neither: samples in one packet, bits of its counter.
FRAMES, _BITS = 10, 16


def counts(values: np.ndarray | None) -> bool:
    """Tell whether a channel counts at all."""
    return values is not None and bool(np.all(np.isfinite(values))) and values.size > 1 and float(np.ptp(values)) > 0.0


def sample_rate(
    stream: Stream,
    time: np.ndarray,
    number: np.ndarray | None,
    told: float | None,
    remarks: list[str],
) -> float:
    """Return the rate of the device's samples, Hz: as told, unless the log's times say something else.

    Parameters
    ----------
    number
        What counts the samples, shape (n,) as `time`; None where nothing does.
    remarks
        Takes what was found odd.

    Raises
    ------
    InputError
        Where the times tell no rate.
    """
    seen = _seen(time)
    if number is not None and time.size > 1:
        ahead, passed = np.diff(number), np.diff(time)
        steady = (ahead > -_BEGUN_AGAIN) & (passed < _SILENCE)
        lasting = float(passed[steady].sum())
        seen = float(ahead[steady].sum()) / lasting if lasting > 0.0 else seen
    elif uneven(time):
        remarks.append(
            "the log's times are uneven from sample to sample: moments and speeds are as uncertain as they are"
        )
        if told is not None and told / _MOST_MISSING < seen < told * (1.0 + _RATE_DIFFERS):
            return told
    if not (math.isfinite(seen) and seen > 0.0):
        raise InputError(f"stream '{stream.name}': its times tell no sample rate. Check the column of the time.")
    if told is not None and abs(seen / told - 1.0) < _RATE_DIFFERS:
        return told
    if told is not None:
        remarks.append(
            f"sample_rate is stated as {told:g} Hz but the log's times tell {seen:.6g} Hz: the latter is used"
        )
    neat = float(f"{seen:.3g}")
    return neat if abs(seen / neat - 1.0) < 0.5 * _RATE_DIFFERS else seen


def uneven(time: np.ndarray) -> bool:
    """Tell whether times jitter from sample to sample, or are stamps of packets."""
    steps = np.diff(time)
    step = float(np.median(steps)) if steps.size else 0.0
    return bool(steps.size and np.mean(np.abs(steps - step) < _EVEN * step) < 0.5)


def _seen(time: np.ndarray) -> float:
    """Return the samples per second that times alone show, Hz; of uneven ones that of the part with least missing."""
    if time.size < 2:
        return 0.0
    if not uneven(time):
        return 1.0 / float(np.median(np.diff(time)))
    parts = [part for part in np.array_split(time, 10) if part.size > 1 and part[-1] > part[0]]
    return max(((part.size - 1) / float(part[-1] - part[0]) for part in parts), default=0.0)


def frames_of(counter: np.ndarray, told: float | None, remarks: list[str]) -> int:
    """Return the samples of one packet, by how often its number is repeated."""
    edges = np.flatnonzero(np.diff(counter) != 0.0)
    stated = int(FRAMES if told is None else told)
    if edges.size < 20:
        return stated
    length, times = np.unique(np.diff(edges), return_counts=True)
    usual = int(length[np.argmax(times)])
    if usual == stated or times.max() < 0.6 * times.sum():
        return stated
    if told is not None:
        remarks.append(
            f"frames_per_packet is {stated} but the log has {usual} samples under each packet_counter: {usual} is used"
        )
    return usual


def bits_of(counter: np.ndarray, told: float | None, remarks: list[str]) -> int:
    """Return the bits of the counter: as told, unless it is seen to wrap earlier or to run higher."""
    stated = int(_BITS if told is None else told)
    highest = float(counter.max())
    needed = max(1, math.ceil(math.log2(highest + 1.0)))
    wraps = int(np.count_nonzero(np.diff(counter) < -0.5 * highest))
    if needed > stated or (wraps >= 3 and needed < stated):
        if needed > SMALL_COUNTER and told is not None:
            remarks.append(
                f"packet_counter is stated to have {stated} bits but runs to {highest:g}: {needed} bits are used"
            )
        return needed
    return stated
