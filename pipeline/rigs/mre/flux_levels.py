"""Flux density at the coil current of each run, where both were logged: the table `flux_levels`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.recording import Recording


class FluxLevel(NamedTuple):
    """Medians of a run: coil current (A) and flux density (T)."""

    run: str
    current: float
    flux_density: float


def flux_level(recording: Recording) -> FluxLevel | None:
    """Return the level of a run, None where one of both is not known. The set current stands in where none was measured."""
    if "flux_density" not in recording:
        return None
    label = recording.conditions.get("coil_current")
    current = (
        _median(recording, "current")
        if "current" in recording
        else float(label)
        if isinstance(label, float | int)
        else None
    )
    density = _median(recording, "flux_density")
    return FluxLevel(recording.run, current, density) if current is not None and density is not None else None


def flux_levels(recordings: Iterable[Recording]) -> pd.DataFrame:
    """Return run, current (A) and flux_density (T), medians of runs at one current; empty where none logs both."""
    return flux_table(flux_level(recording) for recording in recordings)


def flux_table(levels: Iterable[FluxLevel | None]) -> pd.DataFrame:
    """Return the levels that are known as a table."""
    return pd.DataFrame([level for level in levels if level is not None], columns=list(FluxLevel._fields))


def _median(recording: Recording, channel: str) -> float | None:
    values = recording.values(channel)
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None
