"""What the paper says of its road tests beside what these logs give (tire.md, 2 and 4); its figures are lost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.findings import Published
from pipeline.rigs.tire.road.run_numbers import RunNumbers

_SAMPLE_RATE = 12e3
# A slope of the dips over the force is seen from so many standard errors on.
_SEEN = 4.0


def published(runs: Sequence[RunNumbers]) -> list[Published]:
    """Return the claims that a drive can be held against."""
    return [*_rate(runs), *_speed(runs), *_dips(runs), *_events(runs)]


def _rate(runs: Sequence[RunNumbers]) -> list[Published]:
    rate = runs[0].device.rate
    rotation = np.concatenate([run.forces.speed[np.isfinite(run.forces.speed)] for run in runs])
    told = ""
    if rotation.size:
        most, least = (2.0 * math.pi * rate / float(np.percentile(rotation, q)) for q in (1.0, 99.0))
        told = f"{least:.0f} to {most:.0f} samples a revolution on this drive"
    return [
        Published(
            name="sampling rate", published=_SAMPLE_RATE, found=rate, unit="Hz", where="section 2",
            agrees=abs(rate / _SAMPLE_RATE - 1.0) < 1e-3, remark=told,
        )
    ]  # fmt: skip


def _speed(runs: Sequence[RunNumbers]) -> list[Published]:
    found = [run.comparison.speed_rms for run in runs if run.comparison is not None]
    found = [rms for rms in found if rms is not None and math.isfinite(rms)]
    if not found:
        return []
    return [
        Published(
            name="rolling speed from the time between peaks", published="V = Re Ω", found=max(found), unit="m/s",
            where="section 3", agrees=None,
            remark="root mean square of peripheral speed less speed of the car, slip of the driven wheel in it; the paper prints no number",
        )
    ]  # fmt: skip


def _dips(runs: Sequence[RunNumbers]) -> list[Published]:
    """Whether driving and braking make the two dips unequal, the way that the ring says."""
    rows = []
    for run in runs:
        slope = run.dip_slope
        if slope is None or run.reversed:
            continue
        value, error = slope
        seen = abs(value) > _SEEN * error
        rows.append(
            Published(
                name=f"dips under driving and braking ({run.run})", published="accelerating and braking change the dips",
                found=value, unit="ohm/N", where="section 3, Fig. 12",
                agrees=value > 0.0 if seen else None,
                remark=f"trailing less leading dip over Fx, standard error {error:.2g} ohm/N; driving deepens the leading dip"
                if seen
                else "the force hardly changes in this drive: not checkable",
            )
        )  # fmt: skip
    return rows


def _events(runs: Sequence[RunNumbers]) -> list[Published]:
    if not any(run.has_forces for run in runs):
        return []
    vertical = sum(event.kind == "vertical" for run in runs for event in run.events)
    longitudinal = sum(event.kind == "longitudinal" for run in runs for event in run.events)
    return [
        Published(
            name="events seen in the flex signal", published="steering corrections, accelerating, braking",
            found=f"{vertical} vertical, {longitudinal} longitudinal", unit="1", where="section 3, Figs 11 and 12",
            agrees=vertical + longitudinal > 0 or None,
            remark="one tire cannot tell a steering correction from a bump: both are vertical",
        )
    ]  # fmt: skip
