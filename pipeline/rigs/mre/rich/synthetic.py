"""The synthetic rig's rich records: one a current, as `mre.synthetic` makes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pipeline.recording import Recording
from pipeline.rigs.mre.synthetic import shear_truth, synthesize_rich

_DURATION = 60.0
# What the pads are made of: for the chapter on micromechanics.
_COMPOUND = {"powder_fraction": 0.25, "matrix_shear_modulus": 0.3e6, "poisson_ratio": 0.2}


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return one record a current: `currents` (0 and 6 A), `duration` (60 s) and any field of `ShearTruth` may be set."""
    own = {"currents": [0.0, 6.0], "duration": _DURATION, **truth}
    known = shear_truth(own)
    logs = [
        synthesize_rich(own, seed + i, current=float(current), duration=known.duration)
        for i, current in enumerate(known.currents)
    ]
    return [replace(log, conditions={**log.conditions, **_COMPOUND}) for log in logs]
