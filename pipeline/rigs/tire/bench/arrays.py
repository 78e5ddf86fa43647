"""The tables beside the findings, SI: what the report draws, what tire.road carries on, what others may go on with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings import Parameter
from pipeline.rigs.tire.bench.arrays_ring import ring_tables
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.reference import SPEED
from pipeline.rigs.tire.passages.features import revolution_features
from pipeline.rigs.tire.ring.sensor import divider_voltage, highest_order
from pipeline.rigs.tire.ring.shape_lengths import lengths

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, Any]]
# Revolutions and angles of the waterfall.
_STACKED, _FINE = 14, 4
_CURVE = 60


def arrays_of(found: Campaign, others: Sequence[BenchRun], parameters: Sequence[Parameter]) -> dict[str, pd.DataFrame]:
    """Return all tables by name; one without rows keeps its columns."""
    tables = {
        "runs": _table(("run", "load", "speed"), (_run(run) for run in found.runs)),
        "waveforms": _frames(
            ("run", "angle", "time", "change", "std_error", "resistance", "voltage", "curvature", "model"),
            [_waveform(found, run) for run in found.runs],
        ),
        "marks": _table(("run", "kind", "angle", "change"), (row for run in found.runs for row in _marks(found, run))),
        "waterfall": _frames(("run", "revolution", "angle", "change"), [_waterfall(run) for run in found.runs]),
        "revolutions": _frames(
            ("run", "revolution", "time", "speed", "peak", "peak_se", "dip_leading", "dip_trailing", "deformation", "resistance", "whole", "repaired"),
            [_revolutions(found, run) for run in found.runs],
        ),
        "calibration": _table(
            ("run", "load", "load_sd", "peak", "peak_sd", "voltage", "residual", "read_load", "read_low", "read_high", "used"),
            (_peak(found, run) for run in found.runs if math.isfinite(run.load)),
        ),
        "calibration_curve": _frames(("load", "peak", "low", "high", "voltage"), [_curve(found)]),
        "calibration_covariance": _calibration_covariance(found),
        "speed": _table(("run", "rotation", "speed", "radius", "radius_sd", "used"),
                        (_rolling(found, run) for run in found.runs if math.isfinite(run.point.speed))),
        "film": _frames(("run", "angle", "measured", "predicted"), _film(found)),
        "film_orders": _frames(("run", "order", "measured", "predicted"), _film_orders(found)),
        "passages": _table(
            ("run", "used", "loss", "longest_gap", "revolutions", "lost", "rejected", "polarity", "skewness", "first_harmonic", "speed_scatter",
             "drift", "temperature", "pressure"),
            (_passages(found, run) for run in [*found.runs, *others]),
        ),
        "energy": _table(("run", "gated", "current", "voltage", "power", "time_base"), (row for run in [*found.runs, *others] for row in _energy(run))),
    }  # fmt: skip
    return {**tables, **ring_tables(found, parameters)}


def _table(columns: Sequence[str], rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(list(rows), columns=list(columns))


def _frames(columns: Sequence[str], parts: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Join tables given as columns of one length and single values; empty ones are left out."""
    import pandas as pd

    frames = [pd.DataFrame(part, columns=list(columns)) for part in parts if part]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=list(columns))


def _run(run: BenchRun) -> dict[str, Any]:
    speed = run.reference.value(SPEED)
    return {"run": run.name, "load": run.load, "speed": speed if math.isfinite(speed) else run.nominal_speed}


def _model(found: Campaign, run: BenchRun) -> np.ndarray | None:
    fit = next((one for one in found.ring.runs if one.run == run.name), None) if found.ring is not None else None
    return None if fit is None else np.asarray(fit.model)


def _waveform(found: Campaign, run: BenchRun) -> dict[str, Any]:
    wave, model = run.waveform, _model(found, run)
    level = float(np.nanmean(wave.mean - wave.change))
    told = found.ring is not None and found.verdict is not None and found.verdict.fits
    gain = found.ring.values.sensor_gain if found.ring is not None and told else math.nan
    return {
        "run": run.name,
        "angle": wave.theta,
        "time": (wave.theta - wave.theta[0]) / run.rotation,
        "change": wave.change,
        "std_error": wave.std_error,
        "resistance": wave.mean,
        "voltage": divider_voltage(wave.mean, run.device.supply_voltage, run.device.divider_resistance),
        "curvature": wave.change / gain,
        "model": model - level if model is not None else np.full(wave.theta.size, math.nan),
    }


def _marks(found: Campaign, run: BenchRun) -> Rows:
    """Return dips, extreme slopes and the fitted edges of the contact on the run's angles."""
    shape = run.waveform.shape(highest_order(found.tire.length, found.radius))
    marks = lengths(shape, found.radius)
    half = 0.5 * marks.slope / found.radius
    rows = [
        {"run": run.name, "kind": "dip", "angle": marks.dip_leading_angle, "change": marks.dip_leading},
        {"run": run.name, "kind": "dip", "angle": marks.dip_trailing_angle, "change": marks.dip_trailing},
    ]
    if math.isfinite(half):
        places = marks.peak_angle + np.array([-half, half])
        rows += [
            {"run": run.name, "kind": "slope", "angle": float(angle), "change": float(value)}
            for angle, value in zip(places, shape.at(places), strict=True)
        ]
    fit = next((one for one in found.ring.runs if one.run == run.name), None) if found.ring is not None else None
    if fit is not None and found.verdict is not None and found.verdict.fits:
        rows += [
            {"run": run.name, "kind": "contact", "angle": float(a), "change": math.nan} for a in (fit.front, fit.rear)
        ]
    return [row for row in rows if math.isfinite(float(str(row["angle"])))]


def _waterfall(run: BenchRun) -> dict[str, Any]:
    """Return the first revolutions on a coarser grid of angles, NaN where nothing was received."""
    revolutions = run.revolutions[:_STACKED]
    m = len(revolutions)
    if not m:
        return {}
    near = np.abs(run.waveform.theta) <= 0.5 * np.pi
    kept = np.flatnonzero(near)[: near.sum() // _FINE * _FINE]
    level = np.nan_to_num(revolutions.level, nan=float(np.nanmedian(revolutions.level)))
    blocks = (revolutions.resistance - level[:, None])[:, kept].reshape(m, -1, _FINE)
    lost = np.isnan(blocks).sum(axis=2) > _FINE // 2
    counted = np.maximum((~np.isnan(blocks)).sum(axis=2), 1)
    values = np.where(lost, math.nan, np.nansum(blocks, axis=2) / counted)
    angles = run.waveform.theta[kept].reshape(-1, _FINE).mean(axis=1)
    return {
        "run": run.name,
        "revolution": np.repeat(np.arange(m), angles.size),
        "angle": np.tile(angles, m),
        "change": values.ravel(),
    }


def _revolutions(found: Campaign, run: BenchRun) -> dict[str, Any]:
    revolutions = run.revolutions
    marks = revolution_features(revolutions, run.waveform, found.radius, highest_order(found.tire.length, found.radius))
    return {
        "run": run.name,
        "revolution": np.arange(len(revolutions)),
        "time": revolutions.times,
        "speed": revolutions.speed,
        "peak": marks.peak,
        "peak_se": marks.peak_se,
        "dip_leading": marks.dip_leading,
        "dip_trailing": marks.dip_trailing,
        "deformation": marks.deformation,
        "resistance": revolutions.level,
        "whole": revolutions.whole,
        "repaired": revolutions.repaired,
    }


def _volts(run: BenchRun, change: np.ndarray | float) -> np.ndarray:
    """Return the voltage of a change of R2 from its mean over that of the mean, V."""
    VIN, R1, R0 = run.device.supply_voltage, run.device.divider_resistance, run.level
    return np.asarray(
        divider_voltage(np.asarray(R0 + np.asarray(change)), VIN, R1) - divider_voltage(np.asarray(R0), VIN, R1)
    )


def _peak(found: Campaign, run: BenchRun) -> dict[str, Any]:
    marks, fit = found.features[run.name], found.calibration
    place = next((i for i, p in enumerate(fit.points) if p.run == run.name), None) if fit is not None else None
    peak = marks.value.peak + run.lift
    able = fit is not None and fit.curve is not None and math.isfinite(peak)
    reading = fit.load_of(peak, run.waveform.revolutions) if fit is not None and able else None
    return {
        "run": run.name,
        "load": run.load - found.friction.get(run.name, 0.0),
        "load_sd": run.load_se,
        "peak": peak,
        "peak_sd": marks.error.peak,
        "voltage": float(_volts(run, peak)),
        "residual": float(fit.residuals[place]) if fit is not None and place is not None else math.nan,
        "read_load": reading.load if reading else math.nan,
        "read_low": reading.low if reading else math.nan,
        "read_high": reading.high if reading else math.nan,
        "used": place is not None,
    }


def _curve(found: Campaign) -> dict[str, Any]:
    if found.calibration is None or found.calibration.curve is None:
        return {}
    curve = found.calibration.curve
    x = np.linspace(curve.least, curve.most, _CURVE)
    peak, half = curve.at(x), curve.band(x, 1.0)
    return {"load": x, "peak": peak, "low": peak - half, "high": peak + half, "voltage": _volts(found.runs[0], peak)}


def _calibration_covariance(found: Campaign) -> pd.DataFrame:
    names = ["calibration_0", "calibration_1", "calibration_2"]
    curve = found.calibration.curve if found.calibration is not None else None
    rows = [
        {"parameter": name, **dict(zip(names, row, strict=True))}
        for name, row in zip(names, curve.covariance if curve is not None else (), strict=False)
    ]
    return _table(("parameter", *names), rows)


def _rolling(found: Campaign, run: BenchRun) -> dict[str, Any]:
    p = run.point
    radius = p.speed / p.rotation
    used = found.line is not None and any(point.run == run.name for point in found.line.points)
    sd = radius * math.hypot(p.speed_se / p.speed, p.rotation_se / p.rotation)
    return {"run": run.name, "rotation": p.rotation, "speed": p.speed, "radius": radius, "radius_sd": sd, "used": used}


def _film(found: Campaign) -> list[dict[str, Any]]:
    if found.film is None:
        return []
    return [
        {"run": one.run, "angle": found.run(one.run).waveform.theta, "measured": one.film, "predicted": one.predicted}
        for one in found.film.runs
    ]


def _film_orders(found: Campaign) -> list[dict[str, Any]]:
    if found.film is None:
        return []
    parts = []
    for one in found.film.runs:
        mean = found.run(one.run).waveform.mean
        X = 2.0 * np.abs(np.fft.rfft(mean - np.nanmean(mean))[one.orders]) / mean.size
        parts.append(
            {
                "run": one.run,
                "order": one.orders,
                "measured": np.abs(one.measured) * X,
                "predicted": np.abs(one.modelled) * X,
            }
        )
    return parts


def _passages(found: Campaign, run: BenchRun) -> dict[str, Any]:
    wave, revolutions = run.waveform, run.revolutions
    level = revolutions.level[np.isfinite(revolutions.level)]
    quarter = max(level.size // 4, 1)
    drift = (level[-quarter:].mean() - level[:quarter].mean()) / level.mean() if level.size else math.nan
    return {
        "run": run.name,
        "used": run in found.runs,
        "loss": run.device.loss.share,
        "longest_gap": run.device.loss.longest,
        "revolutions": wave.revolutions,
        "lost": int((~revolutions.whole).sum()),
        "rejected": wave.rejected,
        "polarity": revolutions.polarity,
        "skewness": wave.skewness,
        "first_harmonic": wave.first_harmonic / run.peak,
        "speed_scatter": wave.speed_scatter,
        "drift": drift,
        "temperature": run.told("liner_temperature") or math.nan,
        "pressure": run.told("inflation_pressure") or math.nan,
    }


def _energy(run: BenchRun) -> Rows:
    if not run.supply:
        return []
    current, voltage = run.supply
    base = run.told("time_base")
    return [
        {"run": run.name, "gated": run.device.gated, "current": current, "voltage": voltage, "power": current * voltage,
         "time_base": math.nan if base is None else base}
    ]  # fmt: skip
