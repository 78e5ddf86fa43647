"""The tables beside the findings, SI: what the report draws, what others may go on with. Agreement here, circuit in `arrays_circuit`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.rap.pressures.agreement import Agreement, Limits
from pipeline.rigs.rap.pressures.arrays_circuit import circuit_tables
from pipeline.rigs.rap.pressures.declaration import PressuresSettings
from pipeline.rigs.rap.pressures.judgements import judged, within
from pipeline.rigs.rap.pressures.misfit import Misfit
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers, Tap
from pipeline.rigs.rap.pressures.tables_of import Rows, joined, table

if TYPE_CHECKING:
    import pandas as pd

# Seconds of the overlay; points of a scatter plot and of a line.
_OVERLAY, _DRAWN, _CURVE = 10.0, 1500, 40


def arrays_of(runs: Sequence[RunNumbers], settings: PressuresSettings) -> dict[str, pd.DataFrame]:
    """Return all tables by name; one without rows keeps its columns."""
    of_taps = _each(runs)
    tables = {
        "runs": table(("run", "bench", "fluid_temperature", "density"), [_run(run) for run in runs]),
        "verdicts": table(
            ("run", "tap", "question", "answer", "word", "mood"), [vars(answer) for answer in judged(runs, settings)]
        ),
        "overlay": joined(("run", "channel", "time", "bench", "corrected", "residual"), of_taps(_overlay)),
        "correlation": joined(("run", "lag", "correlation"), [_correlation(run) for run in runs]),
        "clock": table(
            ("run", "lag", "lag_sd", "rate", "rate_sd", "reference", "lag_end", "coarse_lag", "peak", "second", "second_lag", "margin", "jitter", "method",
             "told", "bench_pole", "bench_pole_stated"),
            [row for run in runs for row in _clock(run)],
        ),
        "lag_track": joined(("run", "time", "lag", "sd", "used"), [_track(run) for run in runs]),
        "lines": joined(("run", "channel", "harmonic", "frequency", "ratio", "sd", "model", "used"), [_lines(run) for run in runs]),
        "agreement": table(
            ("run", "channel", "kind", "bias", "bias_low", "bias_high", "lower", "lower_low", "lower_high", "upper", "upper_low", "upper_high", "sd", "n",
             "blocks", "slope", "slope_sd"),
            [row for rows in of_taps(_limits) for row in rows],
        ),
        "bland_altman": joined(("run", "channel", "kind", "time", "mean", "difference"), [part for parts in of_taps(_differences) for part in parts]),
        "deming_points": joined(("run", "channel", "time", "bench", "device"), of_taps(_means)),
        "deming_band": joined(("run", "channel", "bench", "fit", "low", "high"), of_taps(_band)),
        "gains": table(
            ("run", "channel", "gain", "gain_low", "gain_high", "offset", "offset_low", "offset_high", "noise_ratio", "pole", "pulsation_gain", "gain_word",
             "gain_mood", "offset_word", "offset_mood"),
            [_gain(run, name, tap, settings) for run in runs for name, tap in run.taps.items()],
        ),
        "coherence": table(
            ("run", "channel", "flow_set", "harmonic", "frequency", "coherence", "coherence_low", "coherence_high", "threshold", "gain", "phase", "folded"),
            [row for rows in of_taps(_coherence) for row in rows],
        ),
        "checks": table(("run", "name", "channel", "value", "std_error", "unit", "limit", "exceeds"), [_check(run, one) for run in runs for one in run.checks]),
        "coherence_spectra": joined(("run", "channel", "flow_set", "frequency", "coherence"), [part for parts in of_taps(_spectra) for part in parts]),
    }  # fmt: skip
    return {**tables, **circuit_tables(runs)}


def _each(runs: Sequence[RunNumbers]) -> Callable[[Callable[[RunNumbers, str, Tap], Any]], list[Any]]:
    """Return what applies a function to every tap of every run."""
    return lambda made: [made(run, name, tap) for run in runs for name, tap in run.taps.items()]


def _run(run: RunNumbers) -> dict[str, Any]:
    temperature = run.record.number("fluid_temperature")
    return {
        "run": run.name, "bench": run.alignment is not None, "density": run.record.density,
        "fluid_temperature": math.nan if temperature is None else temperature,
    }  # fmt: skip


def _check(run: RunNumbers, one: Misfit) -> dict[str, Any]:
    return {
        "run": run.name, "name": one.name, "channel": one.channel or "", "value": one.value, "std_error": one.std_error, "unit": one.unit,
        "limit": one.limit, "exceeds": one.exceeds and one.name != "meter_step",
    }  # fmt: skip


def _number(found: Estimate) -> float:
    return math.nan if found.value is None else found.value


def _interval(found: Estimate, name: str) -> dict[str, float]:
    low, high = found.ci95 or (math.nan, math.nan)
    return {name: _number(found), f"{name}_low": low, f"{name}_high": high}


def _corrected(tap: Tap) -> tuple[float, float]:
    """Return gain and offset that make the device's reading the bench's; 1 and 0 where they are not told."""
    gain, offset = tap.deming.gain.value, tap.deming.offset.value
    return (1.0, 0.0) if gain is None or offset is None or gain == 0.0 else (gain, offset)


def _overlay(run: RunNumbers, name: str, tap: Tap) -> dict[str, Any]:
    """Return ten seconds within the last level with the pump on, corrected by gain and offset."""
    one = tap.aligned
    running = [level for level in run.levels if level.turning and level.steady and level.end - level.start > _OVERLAY]
    middle = 0.5 * (running[-1].start + running[-1].end) if running else float(np.median(one.time))
    rows = (np.abs(one.time - middle) <= 0.5 * _OVERLAY) & one.good
    gain, offset = _corrected(tap)
    corrected = (one.device[rows] - offset) / gain
    return {
        "run": run.name, "channel": name, "time": one.time[rows], "bench": one.bench[rows], "corrected": corrected,
        "residual": corrected - one.bench[rows],
    }  # fmt: skip


def _correlation(run: RunNumbers) -> dict[str, Any]:
    if run.alignment is None:
        return {}
    coarse = run.alignment.coarse
    return {"run": run.name, "lag": coarse.lags, "correlation": coarse.correlation}


def _clock(run: RunNumbers) -> Rows:
    found = run.alignment
    if found is None:
        return []
    coarse, clock = found.coarse, found.clock
    sure = found.lag.value is not None
    told = (
        f"Yes: the second peak is {coarse.margin:.2f} of the first." if sure else f"No: {found.lag.reason.rstrip('.')}."
    )
    last = float(found.track.time[-1]) if found.track is not None and found.track.time.size else clock.reference
    return [
        {
            "run": run.name, "lag": clock.lag, "lag_sd": math.sqrt(max(clock.covariance[0, 0], 0.0)), "rate": clock.rate,
            "rate_sd": math.sqrt(max(clock.covariance[1, 1], 0.0)), "reference": clock.reference, "lag_end": float(clock.lag_at(np.array([last]))[0]),
            "coarse_lag": coarse.lag, "peak": coarse.peak, "second": coarse.second, "second_lag": coarse.second_lag, "margin": coarse.margin,
            "jitter": found.jitter, "method": found.method, "told": told, "bench_pole": found.bench_pole, "bench_pole_stated": found.bench_pole_stated,
        }
    ]  # fmt: skip


def _track(run: RunNumbers) -> dict[str, Any]:
    if run.alignment is None or run.alignment.track is None:
        return {}
    track = run.alignment.track
    return {"run": run.name, "time": track.time, "lag": track.lag, "sd": track.sd, "used": track.used}


def _lines(run: RunNumbers) -> dict[str, Any]:
    if run.alignment is None or run.alignment.ratios is None:
        return {}
    one = run.alignment.ratios
    return {
        "run": run.name, "channel": one.name, "harmonic": one.order, "frequency": one.order * one.frequency, "ratio": np.abs(one.ratio), "sd": one.sd,
        "model": np.abs(one.model), "used": one.used,
    }  # fmt: skip


def _kinds(agreement: Agreement) -> list[tuple[str, Limits]]:
    kinds = [("samples", agreement.samples), ("means", agreement.means)]
    if agreement.amplitude is not None:
        kinds.append(("amplitude", agreement.amplitude))
    return [*kinds, ("as logged", agreement.unequalised)]


def _limits(run: RunNumbers, name: str, tap: Tap) -> Rows:
    trend = tap.agreement.trend.slope
    return [
        {
            "run": run.name, "channel": name, "kind": kind, **_interval(limits.bias, "bias"), **_interval(limits.lower, "lower"),
            **_interval(limits.upper, "upper"), "sd": limits.sd, "n": limits.difference.size, "blocks": limits.blocks,
            "slope": _number(trend) if kind == "means" else math.nan,
            "slope_sd": trend.std_error if kind == "means" and trend.std_error is not None else math.nan,
        }
        for kind, limits in _kinds(tap.agreement)
        if limits.bias.value is not None
    ]  # fmt: skip


def _differences(run: RunNumbers, name: str, tap: Tap) -> list[dict[str, Any]]:
    parts = []
    for kind, limits in (("samples", tap.agreement.samples), ("means", tap.agreement.means)):
        drawn = slice(None, None, max(limits.difference.size // _DRAWN, 1))
        parts.append(
            {"run": run.name, "channel": name, "kind": kind, "time": limits.time[drawn], "mean": limits.level[drawn], "difference": limits.difference[drawn]}
        )  # fmt: skip
    return parts


def _means(run: RunNumbers, name: str, tap: Tap) -> dict[str, Any]:
    means = tap.deming.means
    return {"run": run.name, "channel": name, "time": means.time, "bench": means.bench, "device": means.device}


def _band(run: RunNumbers, name: str, tap: Tap) -> dict[str, Any]:
    gain, offset = tap.deming.gain.value, tap.deming.offset.value
    if gain is None or offset is None:
        return {}
    bench = np.linspace(tap.deming.means.bench.min(), tap.deming.means.bench.max(), _CURVE)
    fit, half = offset + gain * bench, 1.96 * tap.deming.band(bench)
    return {"run": run.name, "channel": name, "bench": bench, "fit": fit, "low": fit - half, "high": fit + half}


def _gain(run: RunNumbers, name: str, tap: Tap, settings: PressuresSettings) -> dict[str, Any]:
    found = run.alignment
    pulsation = next((g for g in (found.gains if found is not None else ()) if g.at.get("channel") == name), None)
    gain, offset = tap.deming.gain, tap.deming.offset
    words = (*within(gain, 1.0, settings.gain_tolerance), *within(offset, 0.0, settings.offset_tolerance))
    return {
        "run": run.name, "channel": name, **_interval(gain, "gain"), **_interval(offset, "offset"), "noise_ratio": tap.deming.ratio,
        "pole": found.pole_by_name.get(name, math.nan) if found is not None else math.nan,
        "pulsation_gain": _number(pulsation) if pulsation is not None else math.nan,
        **dict(zip(("gain_word", "gain_mood", "offset_word", "offset_mood"), words, strict=True)),
    }  # fmt: skip


def _coherence(run: RunNumbers, name: str, tap: Tap) -> Rows:
    return [
        {
            "run": run.name, "channel": name, "flow_set": math.nan if at.flow_set is None else at.flow_set, "harmonic": line.harmonic,
            "frequency": line.frequency, **_interval(line.coherence, "coherence"), "threshold": at.threshold, "gain": line.gain, "phase": line.phase,
            "folded": line.folded,
        }
        for at in tap.coherence
        for line in at.lines
    ]  # fmt: skip


def _spectra(run: RunNumbers, name: str, tap: Tap) -> list[dict[str, Any]]:
    return [
        {
            "run": run.name, "channel": name, "flow_set": math.nan if at.flow_set is None else at.flow_set, "frequency": at.spectra.frequency,
            "coherence": at.spectra.coherence,
        }
        for at in tap.coherence
    ]  # fmt: skip
