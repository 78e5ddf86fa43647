"""Lag, rate and poles as estimates from what the pump's lines tell, with what their scatter does not show (rap.md, 5.1 b)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.by_lines import ByLines, wander
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.coarse_stamps import SpreadErrors, spread_errors
from pipeline.rigs.rap.alignment.fine import model_of
from pipeline.rigs.rap.alignment.result import BENCH_POLE, Alignment, Coarse, Ratios
from pipeline.rigs.rap.alignment.stamps import jitter
from pipeline.rigs.rap.alignment.told import ambiguous, told_clock, told_coarse

BENCH_POLE_SD = 5e-3
"""Standard uncertainty of the bench's time constant where the run does not state it, s."""
_UNSTATED = (
    f"the run does not state bench_sensor_time_constant: {1e3 * BENCH_POLE:g} ms with a standard uncertainty of "
    f"{1e3 * BENCH_POLE_SD:g} ms taken"
)
# A lag from the pump's lines with a larger standard error is none, s; a rate of which nothing is known, relative.
_LARGEST_ERROR, _ANY_RATE = 0.1, 100e-6
# Told from that jitter on, s.
_JITTER = 5e-4


def from_lines(found: ByLines, coarse: Coarse, stated: bool, search: float) -> Alignment:
    """Return the alignment that the pump's lines tell.

    Parameters
    ----------
    found
        From `by_lines`.
    coarse
        What steps tell.
    stated
        Whether the run states the time constant of the bench's sensors.
    search
        Lags up to that were expected, s.
    """
    fit, fine, dof = found.fine.fit, found.fine, found.fine.fit.covariance.dof
    shaken, strays, spread = jitter(found.pairs[0].device.time), wander(found.track), spread_errors(found.pairs)
    type_b = _type_b(found, stated, shaken, strays)
    sd = {name: float(np.hypot(fit.std_error[name], type_b[name])) for name in fit.names}
    doubt = ambiguous(coarse, float(1.0 / np.nanmedian(found.strokes.frequency)), found.sure)
    if not doubt and not sd["delay"] < _LARGEST_ERROR:
        best = f" (lag to {sd['delay']:.2g} s at best)" if sd["delay"] < 1.0 else ""
        doubt = (
            f"the pump's lines do not tell lag and pole apart{best}: pulsation is hardly seen, or both sides hold "
            "the readings of one sensor"
        )
    clock = _clock(found, sd, spread)
    remark = "" if stated else _UNSTATED
    words = "; ".join(filter(None, (remark, spread.remark)))
    rows = fine.rows
    return Alignment(
        clock=clock,
        method="harmonics",
        sure=not doubt,
        lag=undetermined("lag", doubt)
        if doubt
        else estimate("lag", clock.lag, math.hypot(sd["delay"], spread.lag), dof=dof, reason=words),
        rate=estimate("clock_rate", clock.rate, math.hypot(sd["rate"], spread.rate), dof=dof, reason=spread.remark)
        if "rate" in sd
        else undetermined(
            "clock_rate", "the record is too short to tell a drift of the clock: log minutes, not seconds"
        ),
        coarse=coarse,
        poles=tuple(_pole(found, name, sd[name], remark) for name in sorted({fine.pole(p) for p in fine.pairs})),
        gains=tuple(
            estimate(
                "pulsation_gain", fit.values[f"gain_{p}"], sd[f"gain_{p}"], dof=dof, at={"channel": found.pairs[p].name}
            )
            for p in fine.pairs
        ),
        pole_by_name={found.pairs[p].name: fit.values[fine.pole(p)] for p in fine.pairs},
        bench_pole=found.bench_pole,
        bench_pole_stated=stated,
        track=found.track,
        ratios=Ratios(
            np.array([pair.name for pair in found.pairs])[rows.pair],
            found.strokes.windows.centre[rows.window],
            found.strokes.frequency[rows.window],
            rows.order,
            rows.ratio * np.exp(-1j * rows.omega * (fit.values["delay"] + fit.values["rate"] * rows.ahead)),
            rows.sd,
            model_of(rows, fit.values, found.bench_pole, fine.separate, delayed=False),
            fine.used,
        ),
        jitter=shaken,
        evened=found.device_evened,
        bench_evened=found.bench_evened,
        stroke=float(1.0 / np.nanmedian(found.strokes.frequency)),
        problems=(
            *told_coarse(coarse, search),
            *told_clock(clock, found.track, doubt),
            *_told(found, stated, shaken, strays),
        ),
    )


def _type_b(found: ByLines, stated: bool, shaken: float, strays: float) -> dict[str, float]:
    """Return by unknown what the scatter of the windows does not show: bench's pole, evened jitter, a clock that wanders."""
    fit = found.fine.fit
    type_b = dict.fromkeys(fit.names, 0.0)
    if not stated:
        other = found.refitted(found.bench_pole + BENCH_POLE_SD).fit.values
        type_b = {name: abs(other.get(name, fit.values[name]) - fit.values[name]) for name in fit.names}
    delays, rates = [type_b["delay"], strays], [type_b.get("rate", 0.0)]
    if strays:
        rates.append(strays * math.sqrt(12.0) / float(np.ptp(found.track.time)))
    if found.device_evened:
        # What jitter leaves in an evened grid is the same for all windows.
        stamps = found.pairs[0].device.time
        delays.append(shaken / math.sqrt(stamps.size))
        rates.append(shaken * math.sqrt(12.0 / stamps.size) / float(np.ptp(stamps)))
    type_b["delay"] = math.hypot(*delays)
    if "rate" in type_b:
        type_b["rate"] = math.hypot(*rates)
    return type_b


def _clock(found: ByLines, sd: Mapping[str, float], spread: SpreadErrors) -> Clock:
    fit, below = found.fine.fit, found.clock
    covariance = np.diag([sd["delay"] ** 2 + spread.lag**2, sd.get("rate", _ANY_RATE) ** 2 + spread.rate**2])
    if "rate" in sd:
        at = [list(fit.names).index(name) for name in ("delay", "rate")]
        covariance[0, 1] = covariance[1, 0] = fit.covariance.matrix[at[0], at[1]]
    return Clock(below.reference, below.lag + fit.values["delay"], below.rate + fit.values["rate"], covariance)


def _pole(found: ByLines, name: str, sd: float, remark: str) -> Estimate:
    fit = found.fine.fit
    at = {} if name == "pole" else {"channel": found.pairs[int(name.removeprefix("pole_"))].name}
    if name in fit.at_bound or not math.isfinite(sd):
        return undetermined("sensor_pole", "the pump's lines that stand out do not tell it", at)
    return estimate("sensor_pole", fit.values[name], sd, dof=fit.covariance.dof, at=at, reason=remark)


def _told(found: ByLines, stated: bool, shaken: float, strays: float) -> list[QualityFinding]:
    told = []
    if strays:
        told.append(
            QualityFinding(
                "warning",
                f"the clocks do not drift evenly: the lag strays from a straight line by {1e3 * strays:.1f} ms rms; lag and rate carry it",
            )
        )
    if not stated:
        told.append(QualityFinding("note", f"{_UNSTATED}; lag and pole carry it"))
    for name in found.strange:
        told.append(
            QualityFinding(
                "warning",
                f"the pulsation of {name} differs in size between device and bench by more than 30 %: left out of the alignment",
                channel=name,
            )
        )
    if found.device_evened and shaken > _JITTER:
        told.append(
            QualityFinding(
                "note",
                f"the device's stamps jitter by {1e3 * shaken:.1f} ms while its samples were taken evenly: stamps were evened",
            )
        )
    return told
