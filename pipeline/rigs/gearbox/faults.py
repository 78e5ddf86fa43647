"""Wrong signs, swapped sensors, wrong units of speed: what makes a run's numbers wrong before any is computed (gearbox.md, 8).

Errors here leave a run out; nothing is turned round silently. What the numbers themselves give away
is in `run_faults`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.record import COUNT, SPEED, TORQUES, Record
from pipeline.rigs.gearbox.stages.counts import Counts, counts_of
from pipeline.signals.periodogram import block_means

# Of the greatest torque of a run: less than that is no sign, and no excess of output over input.
_CLEAR = 0.1
# Both torques carry one load: means over this time, s, correlate by more than that.
_BLOCK, _FOLLOWS = 0.25, 0.3
# Of the top speed: what runs faster is near the nominal state.
_FAST = 0.8
_DECODINGS = (0.125, 0.25, 0.5, 2.0, 4.0, 8.0)
# Locked, the output torque is no thousandth of the input torque nor a hundred times it: then their units differ.
_UNLIKE = (0.005, 30.0)
_SCALES = {1e3: "a thousand", 1e6: "a million"}
_UNITS = {60.0 / (2.0 * math.pi): "rpm", 1.0 / (2.0 * math.pi): "Hz"}
# A factor between what was read and what was set is recognised within that share.
_NEAR = 0.08
# An uncompensated drive loses speed under load; more than that is told.
_MOST_SLIP = 0.1


@dataclass(frozen=True)
class FastStretch:
    """Where the output shaft runs near its top speed: its median speed (rad/s), median torques (N m), what was meant by them."""

    speed: float
    torque_in: float
    torque_out: float
    largest: float
    span: tuple[float, float]


def input_faults(record: Record, counts: Counts | None = None) -> list[QualityFinding]:
    """Return errors that make the channels of a run unusable as they are mapped.

    Parameters
    ----------
    record
        A run; clocks need not be aligned.
    counts
        Its output shaft, where it is known already.
    """
    dead = [name for name in TORQUES if not np.ptp(record.torque[name]) > 0]
    if dead:
        text = "does not move at all: the sensor is dead, not connected, or mapped to the wrong column"
        return [QualityFinding("error", f"{name} {text}", record.run, name) for name in dead]
    idle = _idle(record)
    if idle:
        text = (
            f"{idle} does not follow the load: it only shows noise while the other torque changes. The sensor is dead, not connected, or "
            "mapped to the wrong column"
        )
        return [QualityFinding("error", text, record.run, idle)]
    stretch = fast_stretch(record, counts or counts_of(record))
    if stretch is None:
        text = "the output shaft never turns: no stage can be told. Look whether the encoder is connected and mapped"
        return [QualityFinding("error", text, record.run, COUNT if record.has_counts else SPEED)]
    return [*_signs(record, stretch), *_units(record, stretch), *_swapped(record, stretch), *_speed(record, stretch)]


def _idle(record: Record) -> str:
    """Return the torque that has nothing to do with the other, empty where both follow one load."""
    size = max(round(record.torque.rate * _BLOCK), 1)
    if record.torque.time.size < 40 * size:
        return ""
    blocks = {name: block_means(record.torque.time, record.torque[name], size)[1] for name in TORQUES}
    if abs(float(np.corrcoef(blocks["torque_in"], blocks["torque_out"])[0, 1])) > _FOLLOWS:
        return ""
    # What moves with the load moves slowly: its means keep its spread, those of noise lose it.
    kept = {name: float(np.std(blocks[name]) / np.std(np.diff(record.torque[name]))) for name in TORQUES}
    return min(kept, key=lambda name: kept[name])


def fast_stretch(record: Record, counts: Counts) -> FastStretch | None:
    """Return the state near top speed, None where the shaft does not turn."""
    speed = counts.speed(max(counts.window, 0.5))
    if not counts.top > 0 or not np.any(speed > 0):
        return None
    fast = speed > _FAST * counts.top
    if fast.sum() < 10:
        return None
    times = counts.time[fast]
    near = np.interp(record.torque.time, counts.time, fast.astype(float)) > 0.5
    if near.sum() < 10:
        return None
    t_in, t_out = (record.torque[name] for name in TORQUES)
    largest = max(float(np.percentile(np.abs(t), 99.0)) for t in (t_in, t_out))
    span = (float(times[0]), float(times[-1]))
    return FastStretch(
        float(np.median(speed[fast])), float(np.median(t_in[near])), float(np.median(t_out[near])), largest, span
    )


def _signs(record: Record, stretch: FastStretch) -> list[QualityFinding]:
    """Return torques whose mean drives backwards while the shaft turns forwards."""
    found = []
    for name, value in zip(TORQUES, (stretch.torque_in, stretch.torque_out), strict=True):
        own = float(np.percentile(np.abs(record.torque[name]), 99.0))
        if value < -_CLEAR * own:
            text = (
                f"sign of {name} flipped; using -{name} is suggested: its median is {value:+.3g} N m while the shaft turns "
                "forwards. Turn it round in the recipe (factor -1) or at the amplifier; nothing is flipped silently"
            )
            found.append(QualityFinding("error", text, record.run, name, stretch.span))
    return found


def _units(record: Record, stretch: FastStretch) -> list[QualityFinding]:
    """Return torques whose ratio tells that one of them is in another unit than the other."""
    if min(stretch.torque_in, stretch.torque_out) <= 0:
        return []
    ratio = stretch.torque_out / stretch.torque_in
    if _UNLIKE[0] < ratio < _UNLIKE[1]:
        return []
    scale = min(_SCALES, key=lambda one: abs(abs(math.log10(ratio)) + 0.5 - math.log10(one)))
    small, large = ("torque_in", "torque_out") if ratio > 1.0 else ("torque_out", "torque_in")
    text = (
        f"torque_in is {stretch.torque_in:.3g} N m and torque_out {stretch.torque_out:.3g} N m at equal speed: one of them is in another "
        f"unit than declared, by about {_SCALES[scale]} ({small} too small, or {large} too large: N m against mN m?). Give the unit of "
        "both in the recipe"
    )
    return [QualityFinding("error", text, record.run, small, stretch.span)]


def _swapped(record: Record, stretch: FastStretch) -> list[QualityFinding]:
    excess = stretch.torque_out - stretch.torque_in
    if stretch.torque_out > _UNLIKE[1] * stretch.torque_in:
        return []
    if min(stretch.torque_in, stretch.torque_out) <= 0 or excess < 0.5 * _CLEAR * stretch.largest:
        return []
    text = (
        f"Output torque exceeds input torque at equal speed; channels swapped or sign wrong: {stretch.torque_out:.3g} N m out, "
        f"{stretch.torque_in:.3g} N m in at steady speed, a gain of power. Map the torques the other way round"
    )
    return [QualityFinding("error", text, record.run, "torque_out", stretch.span)]


def _speed(record: Record, stretch: FastStretch) -> list[QualityFinding]:
    """Return speeds that are off the nominal one by the factor of a wrong unit or decoding."""
    nominal, channel = record.speed_nominal, COUNT if record.has_counts else SPEED
    if nominal is None:
        return []
    ratio = stretch.speed / nominal
    told = f"the output shaft runs at {stretch.speed:.4g} rad/s in FOS, {ratio:.3g} times speed_nominal ({nominal:.4g} rad/s)"
    for factor, unit in _UNITS.items():
        if not record.has_counts and abs(ratio / factor - 1.0) < _NEAR:
            text = f"{told}: the speed is in {unit} and not in rad/s. Give the unit of {SPEED} in the recipe"
            return [QualityFinding("error", text, record.run, channel, stretch.span)]
        if abs(ratio * factor - 1.0) < _NEAR:
            text = f"{told}: speed_nominal is in {unit} and not in rad/s. Give it with its unit, as '120 rpm'"
            return [QualityFinding("error", text, record.run, channel, stretch.span)]
    for factor in _DECODINGS:
        if abs(ratio / factor - 1.0) < _NEAR:
            text = (
                f"{told}: encoder_ppr times encoder_decoding ({record.counts_per_turn:g} counts a turn) is wrong by the factor "
                f"{factor:g}; {record.counts_per_turn * factor:g} fits"
                if record.has_counts
                else f"{told}: a factor {factor:g} of encoder decoding"
            )
            return [QualityFinding("error", text, record.run, channel, stretch.span)]
    if abs(ratio - 1.0) > _MOST_SLIP:
        text = f"{told}: either the condition is wrong, or the encoder's resolution, or the drive slips that much"
        return [QualityFinding("warning", text, record.run, channel, stretch.span)]
    return []


def errors_of(findings: Sequence[QualityFinding]) -> list[str]:
    """Return the messages of the errors among the findings."""
    return [finding.message for finding in findings if finding.level == "error"]
