"""Where a run was held: its conditions, and what the channels beside displacement and force say of them.

Small numbers, taken once while the run is read, so that what concerns the whole campaign needs no samples again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.recording import Condition, Recording

if TYPE_CHECKING:
    from pipeline.rigs.mre.flux_levels import FluxLevel


@dataclass(frozen=True)
class Held:
    """What a run was held at.

    Attributes
    ----------
    run, conditions
        As the recording has them.
    ranges
        2 % and 98 % quantiles of coil current (A) and voltage (V), where logged; zeros where no sample has a value.
    means
        Of axial load (N) and flux density (T), where logged; NaN where no sample has a value.
    flux
        Current and flux density of the run, where both are known.
    """

    run: str
    conditions: Mapping[str, Condition]
    ranges: Mapping[str, tuple[float, float]]
    means: Mapping[str, float]
    flux: FluxLevel | None


def held_of(recording: Recording) -> Held:
    """Return where a run was held."""
    from pipeline.rigs.mre.flux_levels import flux_level

    ranges, means = {}, {}
    for channel in ("current", "voltage"):
        if channel in recording:
            values = _known(recording, channel)
            low, high = np.quantile(values, [0.02, 0.98]) if values.size else (0.0, 0.0)
            ranges[channel] = (float(low), float(high))
    for channel in ("force_axial", "flux_density"):
        if channel in recording:
            values = _known(recording, channel)
            means[channel] = float(values.mean()) if values.size else float("nan")
    return Held(recording.run, dict(recording.conditions), ranges, means, flux_level(recording))


def _known(recording: Recording, channel: str) -> np.ndarray:
    values = recording.values(channel)
    return np.asarray(values[np.isfinite(values)])
