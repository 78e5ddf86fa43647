"""What the logs of the bearing rig share in coverage studies: gains that are off, lost rows, a clock that jitters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.coverage import dirt
from pipeline.recording import Recording
from pipeline.rigs.tpjb.probes import GAPS

PROBE_GAIN, CELL_GAIN = 0.01, 0.005
"""Relative standard uncertainty of the gains that the logs state: all probes alike, all load cells alike."""
_CELLS = ("force_u", "force_v", "force_static")
_JITTER = 1e-5


def as_logged(recordings: Sequence[Recording], seed: int, missing: float = 1e-3, longest: int = 5) -> list[Recording]:
    """Return logs with 0.1 % of their rows lost in short stretches, stamps off by 10 us, and gains that are off.

    The gain of the probes is off by 1 % and that of the load cells by 0.5 % (one standard deviation), the same
    in all logs of the campaign.
    """
    rng = np.random.default_rng((seed, 9))
    probes, cells = 1 + PROBE_GAIN * rng.standard_normal(), 1 + CELL_GAIN * rng.standard_normal()
    off = dict.fromkeys(GAPS, probes) | dict.fromkeys(_CELLS, cells)
    stream = next(iter(recordings[0].streams.values()))
    step = float(np.median(np.diff(stream.time)))
    spoilt = [dirt.scaled(recording, off) for recording in recordings]
    spoilt = dirt.dropouts(spoilt, rng, missing * stream.size / (0.5 * (longest + 1)), longest)
    return dirt.jitter(spoilt, rng, _JITTER / step)
