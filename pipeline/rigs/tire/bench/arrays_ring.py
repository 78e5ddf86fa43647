"""The tables of the ring fit: what the report draws and what tire.road carries on with its errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings import Parameter
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.identifiability import statements
from pipeline.rigs.tire.bench.ring_fit import RingFit
from pipeline.rigs.tire.bench.ring_information import SOURCES
from pipeline.rigs.tire.bench.ring_model import SIZES
from pipeline.rigs.tire.bench.same_tire import pressure_of

if TYPE_CHECKING:
    import pandas as pd

_WEAK = 0.3


def ring_tables(found: Campaign, parameters: Sequence[Parameter]) -> dict[str, pd.DataFrame]:
    """Return the tables by name, with their columns where nothing was fitted.

    ``ring_covariance`` holds the covariance of the logarithms, type A; ``type_b`` the relative standard uncertainty of what all
    runs share with d ln(parameter)/d ln(source).
    """
    import pandas as pd

    fit = found.ring
    names = list(fit.names) if fit is not None else []
    tables: dict[str, list[dict[str, Any]]] = {
        "fit": [_about(found)],
        "ring": _parameters(found, fit, parameters) if fit is not None else [],
        "ring_runs": _runs(found, fit) if fit is not None else [],
        "ring_covariance": _matrix(names, fit.log_covariance) if fit is not None else [],
        "ring_correlation": _matrix(names, fit.correlation) if fit is not None else [],
        "ring_singular": _singular(fit) if fit is not None else [],
        "type_b": _type_b(fit) if fit is not None else [],
        "information": _information(fit) if fit is not None else [],
        "information_about": [_information_about(found, fit)] if fit is not None else [],
        "ring_statements": _statements(found),
    }
    columns = {
        "ring": ["parameter", "value", "sd", "relative", "relative_a", "with_gain", "prior", "told"],
        "ring_runs": ["run", "load", "rotation", "chi2_reduced", "rms", "relative", "contact_length", "contact_length_sd", "loaded_radius"],
        "ring_covariance": ["parameter", *names],
        "ring_correlation": ["parameter", *names],
        "ring_singular": ["number", "value", "direction"],
        "type_b": ["source", "relative", *names],
        "information": ["parameter", "coordinate", *names, *SOURCES],
        "ring_statements": ["statement"],
    }  # fmt: skip
    return {name: pd.DataFrame(rows, columns=columns.get(name)) for name, rows in tables.items()}


def _about(found: Campaign) -> dict[str, Any]:
    """Return one row of what the fit took and how well it holds, NaN where there is none."""
    fit, verdict, line = found.ring, found.verdict, found.line
    curve = found.calibration.curve if found.calibration is not None else None
    nan = math.nan
    fits = verdict is not None and verdict.fits
    return {
        "model_fits": fits,
        "chi2_reduced": fit.chi2_reduced if fit is not None else nan,
        "R": found.radius,
        "R_u": found.radius_u,
        "Ro": found.free_radius,
        "p0": found.tire.pressure if found.tire.pressure is not None else nan,
        "sensor_length": fit.values.sensor_length if fit is not None and fits else (found.tire.sensor_length or nan),
        "sensor_length_sd": fit.std_error("sensor_length") if fit is not None and fits else nan,
        "film_length": found.tire.film_length or nan,
        "least_load": curve.least if curve is not None else nan,
        "most_load": curve.most if curve is not None else nan,
        "load_gain_u": found.tire.load_gain_u,
        "pressure_u": found.tire.pressure_u,
        "intercept": line.intercept if line is not None else nan,
        "intercept_sd": line.intercept_se if line is not None else nan,
        "intercept_p": line.p_value if line is not None else nan,
    }


def _parameters(found: Campaign, fit: RingFit, parameters: Sequence[Parameter]) -> list[dict[str, Any]]:
    known = {p.name for p in parameters if p.value is not None}
    fits = found.verdict is not None and found.verdict.fits
    gain = fit.names.index("sensor_gain")
    rows = []
    for i, name in enumerate(fit.names):
        value, sd = float(getattr(fit.values, name)), fit.std_error(name)
        size = abs(value) or 1.0
        told = name in known or (name == "sensor_length" and fits)
        kept = 1.0 if told else math.nan
        rows.append({
            "parameter": name, "value": kept * value, "sd": kept * sd, "relative": kept * sd / size,
            "relative_a": kept * fit.std_error(name, combined=False) / size, "with_gain": float(fit.correlation[i, gain]), "prior": _prior(fit, name),
            "told": told,
        })  # fmt: skip
    return rows


def _prior(fit: RingFit, name: str) -> str:
    known = fit.known
    if name == "sensor_length":
        return f"{1e3 * known.sensor_length:.4g} mm ± {100 * known.sensor_length_u:.2g} % (stated, standard)"
    if name in fit.at_bound:
        return "ended at a bound"
    if name == "belt_width":
        if known.belt_width_u is not None and known.belt_width is not None:
            return f"{1e3 * known.belt_width:.4g} mm ± {100 * known.belt_width_u:.2g} % (stated, standard)"
        if fit.scale_held:
            return "held at a guess"
    if name in SIZES:
        return "none"
    return "none, within a decade of the start"


def _runs(found: Campaign, fit: RingFit) -> list[dict[str, Any]]:
    rows = []
    kept = 1.0 if found.verdict is not None and found.verdict.fits else math.nan
    for one in fit.runs:
        rms = float(np.sqrt(np.nanmean(one.residual**2)))
        height = float(np.nanmax(one.model)) - one.resistance
        rows.append({
            "run": one.run, "load": one.load, "rotation": one.rotation, "chi2_reduced": one.chi2_reduced, "rms": rms, "relative": rms / height,
            "contact_length": kept * one.contact_length, "contact_length_sd": kept * one.contact_length_se, "loaded_radius": kept * one.loaded_radius,
        })  # fmt: skip
    return rows


def _matrix(names: Sequence[str], matrix: np.ndarray) -> list[dict[str, Any]]:
    return [{"parameter": name, **dict(zip(names, row, strict=True))} for name, row in zip(names, matrix, strict=True)]


def _singular(fit: RingFit) -> list[dict[str, Any]]:
    """Return the singular values over the first, and in words what moves along each direction (eigenvectors of the covariance)."""
    sd = np.sqrt(np.diag(fit.covariance))
    _, directions = np.linalg.eigh(fit.covariance / np.outer(sd, sd))
    values = np.asarray(fit.singular) / float(fit.singular[0])
    return [
        {"number": float(i + 1), "value": float(value), "direction": _in_words(fit.names, directions[:, i])}
        for i, value in enumerate(values)
    ]


def _in_words(names: Sequence[str], direction: np.ndarray) -> str:
    direction = direction * np.sign(direction[int(np.argmax(np.abs(direction)))])
    strong = [(name, x) for name, x in zip(names, direction, strict=True) if abs(x) > _WEAK]
    up = ", ".join(name.replace("_", " ") for name, x in strong if x > 0)
    down = ", ".join(name.replace("_", " ") for name, x in strong if x < 0)
    return f"{up} together" + (f", against {down}" if down else "")


def _type_b(fit: RingFit) -> list[dict[str, Any]]:
    scale = np.array([1.0 / (abs(float(getattr(fit.values, n))) or 1.0) if n in SIZES else 1.0 for n in fit.names])
    return [
        {"source": one.source, "relative": one.relative, **dict(zip(fit.names, one.slopes * scale, strict=True))}
        for one in fit.influences
    ]


def _information(fit: RingFit) -> list[dict[str, Any]]:
    """Return the Fisher information of the fit's coordinates (`ring_model`) and what shared sources add to its right-hand side."""
    known = fit.information
    return [
        {"parameter": name, "coordinate": at, **dict(zip(fit.names, row, strict=True)), **dict(zip(SOURCES, pull, strict=True))}
        for name, at, row, pull in zip(fit.names, fit.values.coordinates(), known.matrix, known.pulls, strict=True)
    ]  # fmt: skip


def _information_about(found: Campaign, fit: RingFit) -> dict[str, Any]:
    """Return one row: how the runs measure and what is known beside them, as `advise` needs it."""
    known, device = fit.known, found.runs[0].device
    return {
        "model_fits": found.verdict is not None and found.verdict.fits, "R": known.R, "R_u": known.R_u, "Ro": known.Ro,
        "sensor_length": known.sensor_length, "sensor_length_u": known.sensor_length_u, "pressure_u": known.pressure_u,
        "load_gain_u": known.load_gain_u, "outer_radius_u": known.outer_radius_u, "scatter_load": fit.scatter.load,
        "scatter_gain": fit.scatter.gain, "scatter_pressure": fit.scatter.pressure, "uneven": fit.scatter.uneven, "held": fit.held,
        "noise": fit.noise, "load_se": fit.load_se, "R0": float(np.nanmean([run.level for run in found.runs])),
        "supply_voltage": device.supply_voltage, "divider_resistance": device.divider_resistance, "bins": found.runs[0].waveform.theta.size,
        "pressure": pressure_of(found.runs[0], found.tire),
    }  # fmt: skip


def _statements(found: Campaign) -> list[dict[str, Any]]:
    if found.ring is None or found.verdict is None:
        return []
    said = [found.verdict.statement, *statements(found.ring, found.verdict)]
    return [{"statement": one} for one in dict.fromkeys(said)]
