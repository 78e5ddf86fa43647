"""Logs that do not state how well the sensors are calibrated: what is told of them is type A alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pipeline.recording import Recording


def unstated(recordings: Iterable[Recording]) -> list[Recording]:
    """Return logs without `sensor_gain_u` and `force_gain_u`, so that errors are held against noise, not against 1 %."""
    return [
        replace(r, conditions={k: v for k, v in r.conditions.items() if k not in ("sensor_gain_u", "force_gain_u")})
        for r in recordings
    ]
