"""The synthetic MRE shear rig of mre.md section 6: logs with known truth, as the sensors would give them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.recording import Recording


def synthesize_shear(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the 12 runs of T5 and the 4 of T6; `truth` overrides any field of `ShearTruth`."""
    raise NotImplementedError
