"""What the logs of the bearing rig share in coverage studies: gains that are off, lost rows, a clock that jitters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.coverage import dirt
from pipeline.recording import Recording
from pipeline.rigs.tpjb.probes import GAPS

PROBE_GAIN, CELL_GAIN = 0.01, 0.005
"""Relative standard uncertainty of the gains that the logs state: all probes alike, all load cells alike."""
_CELLS = ("force_u", "force_v", "force_static")
_JITTER, _LONGEST = 1e-5, 5


def as_logged(
    recordings: Sequence[Recording], seed: int, *, gains: bool = True, missing: float = 1e-3
) -> list[Recording]:
    """Return logs with 0.1 % of their rows lost in short stretches, stamps off by 10 us, and gains that are off.

    The gain of the probes is off by 1 % and that of the load cells by 0.5 % (one standard deviation), the same
    in all logs of the campaign; the logs state these uncertainties. Without `gains` they are right, and nothing is stated:
    that shows the intervals' type A part, which is small beside.
    """
    rng = np.random.default_rng((seed, 9))
    probes, cells = 1 + PROBE_GAIN * rng.standard_normal(), 1 + CELL_GAIN * rng.standard_normal()
    off = dict.fromkeys(GAPS, probes) | dict.fromkeys(_CELLS, cells)
    stream = next(iter(recordings[0].streams.values()))
    step = float(np.median(np.diff(stream.time)))
    spoilt = [dirt.scaled(r, off) for r in recordings] if gains else [_silent(r) for r in recordings]
    spoilt = dirt.dropouts(spoilt, rng, missing * stream.size / (0.5 * (_LONGEST + 1)), _LONGEST)
    return dirt.jitter(spoilt, rng, _JITTER / step)


def _silent(recording: Recording) -> Recording:
    told = {
        name: value for name, value in recording.conditions.items() if name not in ("sensor_gain_u", "force_gain_u")
    }
    return replace(recording, conditions=told)
