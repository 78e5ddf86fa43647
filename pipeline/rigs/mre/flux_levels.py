"""Flux density at the coil current of each run, where both were logged: the table `flux_levels`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.recording import Recording


def flux_levels(recordings: Sequence[Recording]) -> pd.DataFrame:
    """Return run, current (A) and flux_density (T), medians of runs at one current; empty where none logs both.

    The set current stands in where none was measured.
    """
    rows = []
    for recording in recordings:
        if "flux_density" not in recording:
            continue
        label = recording.conditions.get("coil_current")
        current = (
            _median(recording, "current")
            if "current" in recording
            else float(label)
            if isinstance(label, float | int)
            else None
        )
        density = _median(recording, "flux_density")
        if current is not None and density is not None:
            rows.append({"run": recording.run, "current": current, "flux_density": density})
    return pd.DataFrame(rows, columns=["run", "current", "flux_density"])


def _median(recording: Recording, channel: str) -> float | None:
    values = recording.values(channel)
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None
