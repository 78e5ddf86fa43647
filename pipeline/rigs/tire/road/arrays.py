"""The tables beside the findings, SI: every revolution, and what the report draws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.rigs.tire.road.run_numbers import RunNumbers

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.rigs.tire.road.tracking import Track

# The columns of `revolutions`, which the rig's sheet fixes (section 11).
REVOLUTIONS = (
    "run", "revolution", "time", "speed", "speed_se", "vertical_load", "vertical_load_se", "longitudinal_force",
    "longitudinal_force_se", "speed_filtered", "speed_se_filtered", "vertical_load_filtered", "vertical_load_se_filtered",
    "longitudinal_force_filtered", "longitudinal_force_se_filtered",
)  # fmt: skip

# A track is predicted through lost passages until its error is so many times the usual one, no longer than so long (s).
_BLIND, _LONGEST = 10.0, 5.0
# What is lost is told by so many stretches of the drive.
_STRETCHES = 240


def arrays_of(runs: Sequence[RunNumbers]) -> dict[str, pd.DataFrame]:
    """Return all tables by name."""
    return {
        "revolutions": _stacked([_revolutions(run) for run in runs]),
        "evidence": _stacked([_evidence(run) for run in runs]),
        "asymmetry": _stacked([_asymmetry(run) for run in runs]),
        "asymmetry_model": _stacked([_asymmetry_model(run) for run in runs]),
        "gaps": _stacked([_gaps(run) for run in runs]),
        "noise": _stacked([_noise(run) for run in runs]),
        "misfit_by_angle": _stacked([_misfit_by_angle(run) for run in runs]),
        "common_errors": _table(
            ("run", "source", "load", "force"),
            [
                {"run": run.run, "source": source, "load": load, "force": force}
                for run in runs
                for source, (load, force) in run.common.sources.items()
            ],
        ),
        "events": _table(
            ("run", "event", "kind", "time", "time_se", "first", "last", "change", "revolutions", "cut"),
            [row for run in runs for row in _events(run)],
        ),
        "drives": _table(_DRIVE, [_drive(run) for run in runs]),
    }


_DRIVE = (
    "run", "duration", "rate", "packet_loss", "longest_gap", "revolutions", "used", "passages_lost", "radius", "radius_sd",
    "radius_source", "reason", "bench", "least_bench_load", "most_bench_load", "pressure", "bench_pressure", "load_sd",
    "force_sd", "extrapolated", "lowest_load", "highest_load", "bandwidth_low", "bandwidth_high", "nis_load", "nis_force",
    "nis_rotation", "q_load", "q_force", "q_rotation", "ratio_sd", "bonding", "offset", "offset_sd",
    "offset_applied", "load_bias", "force_bias", "speed_rms",
)  # fmt: skip


def _table(columns: Sequence[str], rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(list(rows), columns=list(columns))


def _stacked(parts: Sequence[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.concat([pd.DataFrame(part) for part in parts], ignore_index=True)


def filtered(track: Track | None, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return value and standard error of a track, NaN where there is none or it says nothing any more, shape (m,) each."""
    nothing = np.full(m, math.nan)
    if track is None:
        return nothing, nothing
    measured = np.isfinite(track.nis)
    last = np.maximum.accumulate(np.where(measured, track.time, -math.inf))
    tells = (track.time - last < _LONGEST) & (track.se < _BLIND * np.median(track.se[measured]))
    return np.where(tells, track.value, math.nan), np.where(tells, track.se, math.nan)


def _revolutions(run: RunNumbers) -> dict[str, Any]:
    """Return the sheet's columns; standard errors hold what the bench leaves uncertain too."""
    forces, m = run.forces, len(run.forces)
    Re = run.carried.radius.value
    rotation, rotation_se = filtered(run.tracks.get("rotation"), m)
    load, load_se = filtered(run.tracks.get("load"), m)
    force, force_se = filtered(None if run.reversed else run.tracks.get("force"), m)
    forward = forces.fits & (not run.reversed)
    columns = (
        np.full(m, run.run), np.arange(m), forces.time, run.speed, np.hypot(run.speed_se, run.speed_sd),
        _where(forces.fits, forces.load), _where(forces.fits, np.hypot(forces.load_se, run.common.load_sd)),
        _where(forward, forces.force), _where(forward, np.hypot(forces.force_se, run.common.force_sd)),
        Re * rotation, np.hypot(Re * rotation_se, run.speed_sd), load, np.hypot(load_se, _filled(run.common.load_sd)),
        force, np.hypot(force_se, _filled(run.common.force_sd)),
    )  # fmt: skip
    return dict(zip(REVOLUTIONS, columns, strict=True))


def _where(known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.where(known, values, math.nan)


def _filled(values: np.ndarray) -> np.ndarray:
    """Return values with those unknown (lost passages) taken from the middle of the others."""
    known = np.isfinite(values)
    return np.where(known, values, np.median(values[known])) if known.any() else values


def _evidence(run: RunNumbers) -> dict[str, Any]:
    """Return what stands behind each revolution: random and common errors apart, innovations, the references."""
    forces, m = run.forces, len(run.forces)
    nothing = np.full(m, math.nan)
    compared = run.comparison

    def nis(name: str) -> np.ndarray:
        return run.tracks[name].nis if name in run.tracks else nothing

    def gated(name: str) -> np.ndarray:
        return run.tracks[name].gated if name in run.tracks else np.zeros(m, dtype=bool)

    def reference(name: str) -> np.ndarray:
        found = getattr(compared, name, None) if compared is not None else None
        return nothing if found is None else found

    return {
        "run": np.full(m, run.run), "revolution": np.arange(m), "time": forces.time, "rotation": forces.speed,
        "load_random": forces.load_se, "load_common": run.common.load_sd, "force_random": forces.force_se,
        "force_common": run.common.force_sd, "misfit": forces.misfit, "share": forces.share, "fits": forces.fits,
        "extrapolated": forces.extrapolated, "resistance": forces.resistance, "film_ratio": _ratio(run),
        "nis_load": nis("load"), "nis_force": nis("force"), "nis_rotation": nis("rotation"),
        "gated": gated("load") | gated("force"), "reference_load": reference("load"), "reference_force": reference("force"),
        "reference_speed": reference("speed"),
    }  # fmt: skip


def _ratio(run: RunNumbers) -> np.ndarray:
    """Return the flex sensor's answer over the film's, 1 at the beginning of the drive."""
    if run.bonding is None or not run.bonding.mean > 0.0:
        return np.full(len(run.forces), math.nan)
    return run.ratio / run.bonding.mean


def _asymmetry(run: RunNumbers) -> dict[str, Any]:
    found = run.asymmetry
    reference = run.comparison.force if run.comparison is not None and run.comparison.force is not None else None
    force = run.forces.force if reference is None else reference
    return {
        "run": np.full(found.index.size, run.run), "revolution": found.index, "asymmetry": found.value,
        "force": force[found.index], "reference": np.full(found.index.size, reference is not None),
    }  # fmt: skip


def _asymmetry_model(run: RunNumbers) -> dict[str, Any]:
    found = run.asymmetry
    return {"run": np.full(found.model.size, run.run), "force": found.model_force, "asymmetry": found.model}


def _events(run: RunNumbers) -> list[dict[str, Any]]:
    return [
        {
            "run": run.run, "event": number, "kind": event.kind, "time": event.time, "time_se": event.time_se,
            "first": event.first, "last": event.last, "change": event.change, "revolutions": event.revolutions,
            "cut": event.cut,
        }
        for number, event in enumerate(run.events)
    ]  # fmt: skip


def _gaps(run: RunNumbers) -> dict[str, Any]:
    """Return what share of the samples each stretch of the drive lacks, and the longest gap (s) that begins in it."""
    layout, device = run.device.layout, run.device
    starts = layout.places[1:] - 1
    rows = np.diff(np.append(layout.rows, layout.size))
    gaps = layout.places[1:] - layout.places[:-1] - rows[:-1]
    stretches = max(1, min(_STRETCHES, int(device.duration)))
    edges = np.linspace(0.0, layout.samples, stretches + 1)
    place = np.clip(np.searchsorted(edges, starts - gaps, side="right") - 1, 0, stretches - 1)
    missing = np.bincount(place, gaps, stretches) / np.diff(edges)
    longest = np.zeros(stretches)
    np.maximum.at(longest, place, gaps / device.rate)
    middle = device.span[0] + 0.5 * (edges[1:] + edges[:-1]) / device.rate
    return {
        "run": np.full(stretches, run.run), "time": middle, "share": np.minimum(missing, 1.0), "longest": longest,
    }  # fmt: skip


def _noise(run: RunNumbers) -> dict[str, Any]:
    spectrum = run.noise
    frequency = spectrum.frequency if spectrum is not None else np.zeros(0)
    density = spectrum.values if spectrum is not None else np.zeros(0)
    return {"run": np.full(frequency.size, run.run), "frequency": frequency, "density": density}


def _misfit_by_angle(run: RunNumbers) -> dict[str, Any]:
    """Return the mean residual of the fits by angle, its standard error and the mean signal, rad and V."""
    shape = run.shape_error
    angle, left, error, signal = (
        (shape.angle, shape.left, shape.left_se, shape.signal) if shape is not None else [np.zeros(0)] * 4
    )
    return {"run": np.full(angle.size, run.run), "angle": angle, "residual": left, "std_error": error, "signal": signal}


def _drive(run: RunNumbers) -> dict[str, Any]:
    """Return one row on the drive as a whole."""
    forces, tire, device = run.forces, run.carried.tire, run.device
    load = forces.load[forces.fits]
    band = run.bandwidth
    compared = run.comparison
    least, most = tire.bench.loads if tire is not None else (math.nan, math.nan)

    def middle(values: np.ndarray) -> float:
        known = values[np.isfinite(values)]
        return float(np.median(known)) if known.size else math.nan

    row: dict[str, Any] = {
        "run": run.run, "duration": device.duration, "rate": device.rate, "packet_loss": device.loss.share,
        "longest_gap": device.loss.longest, "revolutions": len(forces), "used": int(run.usable.sum()),
        "passages_lost": run.passages_lost, "radius": run.carried.radius.value, "radius_sd": run.carried.radius.std_error,
        "radius_source": run.carried.radius.source, "reason": run.carried.reason,
        "bench": tire.bench.campaign if tire is not None else "", "least_bench_load": least, "most_bench_load": most,
        "pressure": tire.pressure_ratio * (tire.bench.pressure or math.nan) if tire is not None else math.nan,
        "bench_pressure": tire.bench.pressure if tire is not None else math.nan,
        "load_sd": middle(run.common.load_sd[forces.fits]), "force_sd": middle(run.common.force_sd[forces.fits]),
        "extrapolated": float(forces.extrapolated[forces.fits].mean()) if load.size else math.nan,
        "lowest_load": float(np.percentile(load, 0.5)) if load.size else math.nan,
        "highest_load": float(np.percentile(load, 99.5)) if load.size else math.nan,
        "bandwidth_low": band[0], "bandwidth_high": band[1],
        "ratio_sd": run.bonding.sd if run.bonding is not None else math.nan,
        "bonding": run.bonding.verdict if run.bonding is not None else "cannot be told: there is no PVDF film",
    }  # fmt: skip
    for name in ("load", "force", "rotation"):
        track = run.tracks.get(name)
        row[f"nis_{name}"] = track.mean_nis if track is not None else math.nan
        row[f"q_{name}"] = track.q if track is not None else math.nan
    for key, name in (
        ("offset", "offset"), ("offset_sd", "offset_se"), ("offset_applied", "offset_applied"), ("load_bias", "load_bias"),
        ("force_bias", "force_bias"), ("speed_rms", "speed_rms"),
    ):  # fmt: skip
        row[key] = getattr(compared, name) if compared is not None else math.nan
    return row
