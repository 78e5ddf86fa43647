"""What the models leave over, as numbers: pulsation, drift, curvature, resistances that move (rap.md, 5.8).

Each with its error and the limit from which it matters. What it means is said by the faults.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pressures.deming import Deming
from pipeline.rigs.rap.pressures.hydraulics_fit import Hydraulics
from pipeline.rigs.rap.pressures.meter_place import last_coefficient, metered_share
from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.passages import Passages

# Limits: share of the stroke's amplitude, mmHg in an hour as Pa, relative differences.
_LINE, _DRIFT, _GAIN, _BEND, _RESISTANCE = 0.03, 133.322, 0.01, 0.01, 0.05
# Over a whole run a drift below that is none, Pa.
_LEAST_DRIFT = 30.0
# A number counts from so many standard errors on.
_SURE = 4.0
_FEWEST = 8
# Ultrafiltration is on above that, m^3/s, and a transmembrane pressure tells it above that, Pa.
_UF_ON, _LEAST_TMP = 1e-9, 300.0
_HOUR = 3600.0


@dataclass(frozen=True)
class Misfit:
    """One check: `value` with `std_error` in `unit`; `exceeds` where it is sure and above `limit` in size.

    `name` is residual_line, drift, pulsation_gain, curvature, resistance_trend, resistance_over_flow or meter_step; `channel`
    the tap or the resistance, None for the meter.
    """

    name: str
    channel: str | None
    value: float
    std_error: float
    unit: str
    limit: float

    @property
    def exceeds(self) -> bool:
        """Tell whether it is there beyond chance and large enough to matter."""
        return abs(self.value) > self.limit and abs(self.value) > _SURE * self.std_error


def misfits_of_tap(one: Aligned, line: Deming, alignment: Alignment, passages: Passages) -> list[Misfit]:
    """Return the checks of one tap, those that its data allow.

    Parameters
    ----------
    one
        Device and bench side by side.
    line
        Gain and offset found.
    alignment
        For the gain at the pump's lines.
    passages
        Frequency of the strokes in windows on the bench's clock.
    """
    if line.gain.value is None or line.offset.value is None:
        return []
    residual = np.where(one.good, one.device - line.offset.value - line.gain.value * one.bench, np.nan)
    found = _residual_line(one, residual, passages)
    x, y, time = line.means.bench, line.means.device, line.means.time
    left = y - line.offset.value - line.gain.value * x
    blocks = line.means.blocks
    if x.size >= _FEWEST and blocks.count >= 4:
        slope, sd = last_coefficient(
            np.stack([np.ones_like(x), x, (time - time.mean()) / _HOUR], axis=-1), left, blocks.of
        )
        least = _LEAST_DRIFT / max(float(np.ptp(time)) / _HOUR, 1e-9)
        found.append(Misfit("drift", one.name, slope, sd, "Pa/h", max(_DRIFT, least)))
        half = 0.5 * float(np.ptp(x))
        bend, sd = last_coefficient(
            np.stack([np.ones_like(x), x, ((x - x.min()) / half - 1.0) ** 2], axis=-1), left, blocks.of
        )
        found.append(Misfit("curvature", one.name, bend / half, sd / half, "1", _BEND))
    for gain in alignment.gains:
        if gain.at.get("channel") == one.name and gain.value is not None and gain.std_error is not None:
            apart = gain.value / line.gain.value - 1.0
            sd = math.hypot(gain.std_error / gain.value, math.sqrt(line.covariance[0, 0]) / line.gain.value)
            found.append(Misfit("pulsation_gain", one.name, apart, sd, "1", _GAIN))
    return found


def misfits_of_circuit(found: Hydraulics) -> list[Misfit]:
    """Return whether resistances move in time or with the flow, and whether the meter steps with the ultrafiltration."""
    means, flow, uf = found.means, found.flow, found.uf_flow
    told = []
    mean = means.mean
    p = {tap: mean[tap] - found.zero.get(tap, 0.0) for tap in ("access", "prefilter", "return") if tap in mean}
    cases = {
        "r_access": (("access",), -1.0, flow),
        "r_filter": (("prefilter", "return"), 1.0, flow - 0.5 * uf),
        "r_return": (("return",), 1.0, flow - uf),
    }
    for name, (taps, sign, q) in cases.items():
        if not set(taps) <= set(p):
            continue
        drop = sign * (p[taps[0]] - (p[taps[1]] if len(taps) > 1 else 0.0))
        used = means.turning & np.isfinite(drop) & np.isfinite(q) & (np.abs(q) > 1e-8)
        if used.sum() < _FEWEST:
            continue
        r = drop[used] / q[used]
        r = r / r.mean() - 1.0
        time = means.windows.centre[used]
        level = q[used] / q[used].mean() - 1.0
        groups = np.unique(means.level[used], return_inverse=True)[1] * 1000 + np.arange(r.size) // 2
        groups = np.unique(groups, return_inverse=True)[1]
        several = float(np.ptp(level)) > 0.15
        base = [np.ones_like(r)] + ([level] if several else [])
        span = max(float(np.ptp(time)), 1.0)
        # Resistances as logged step with the set-points in time: the trend is that beside the flow's.
        slope, sd = last_coefficient(np.stack([*base, (time - time.mean()) / span], axis=-1), r, groups)
        told.append(Misfit("resistance_trend", name, slope, sd, "1", _RESISTANCE))
        if several:
            slope, sd = last_coefficient(np.stack([np.ones_like(r), level], axis=-1), r, groups)
            told.append(
                Misfit(
                    "resistance_over_flow",
                    name,
                    slope * float(np.ptp(level)),
                    sd * float(np.ptp(level)),
                    "1",
                    _RESISTANCE,
                )
            )
    membrane = _membrane_trend(found)
    told += [membrane] if membrane is not None else []
    step = _meter_step(found)
    return told + ([step] if step is not None else [])


def _membrane_trend(found: Hydraulics) -> Misfit | None:
    """Return how the membrane's coefficient changes from start to end of the ultrafiltration, relative."""
    mean, uf = found.means.mean, found.uf_flow
    if not {"prefilter", "return", "uf"} <= set(mean):
        return None
    p = {tap: mean[tap] - found.zero.get(tap, 0.0) for tap in ("prefilter", "return", "uf")}
    tmp = 0.5 * (p["prefilter"] + p["return"]) - p["uf"]
    used = found.means.turning & np.isfinite(tmp) & (uf > _UF_ON) & (tmp > _LEAST_TMP)
    if used.sum() < _FEWEST:
        return None
    coefficient = uf[used] / tmp[used]
    time = found.means.windows.centre[used]
    groups = np.unique(found.means.level[used] * 100000 + np.arange(time.size) // 2, return_inverse=True)[1]
    span = max(float(np.ptp(time)), 1.0)
    columns = np.stack([np.ones_like(time), (time - time.mean()) / span], axis=-1)
    slope, sd = last_coefficient(columns, coefficient / coefficient.mean() - 1.0, groups)
    return Misfit("resistance_trend", "k_uf", slope, sd, "1", _RESISTANCE)


def _meter_step(found: Hydraulics) -> Misfit | None:
    share = metered_share(found.means, found.uf_flow)
    return Misfit("meter_step", None, *share, "1", 0.5) if share is not None else None


def _residual_line(one: Aligned, residual: np.ndarray, passages: Passages) -> list[Misfit]:
    windows, frequency = passages.windows.of(passages.turning), passages.frequency[passages.turning]
    if windows.size < 3:
        return []
    left = harmonics(one.time, residual, windows, frequency, (1.0,))
    whole = harmonics(one.time, np.where(one.good, one.bench, np.nan), windows, frequency, (1.0,)).amplitude(1)
    power = np.abs(left.coefficients[:, 0]) ** 2 - 2.0 * left.errors[:, 0] ** 2
    kept = np.isfinite(power) & np.isfinite(whole) & (whole > 0)
    if kept.sum() < 3:
        return []
    # The noise's own share is taken off before the mean; what is left may be negative by chance.
    share = power[kept] / whole[kept] ** 2
    mean, sd = float(share.mean()), float(share.std(ddof=1)) / math.sqrt(kept.sum())
    value = math.sqrt(max(mean, 0.0))
    return [
        Misfit(
            "residual_line", one.name, value, sd / (2.0 * value) if value > 0 else math.sqrt(max(sd, 0.0)), "1", _LINE
        )
    ]


def all_misfits(
    taps: Sequence[tuple[Aligned, Deming]], alignment: Alignment, passages: Passages, circuit: Hydraulics | None
) -> list[Misfit]:
    """Return the checks of all taps and of the circuit."""
    found = [check for one, line in taps for check in misfits_of_tap(one, line, alignment, passages)]
    return found + (misfits_of_circuit(circuit) if circuit is not None else [])
