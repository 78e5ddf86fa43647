"""Tables beside the findings of `tpjb.rotating`: what figures are drawn from and others can go on with. SI."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.rigs.tpjb.rotating.clearance import Clearance
from pipeline.rigs.tpjb.rotating.consistency import Consistency
from pipeline.rigs.tpjb.rotating.group import LoadGroup, model_orbit
from pipeline.rigs.tpjb.rotating.harmonics import amplitude, circularity, openness
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.linear_limit import model_distortion
from pipeline.rigs.tpjb.rotating.model_fit import LawFit, ModelFit
from pipeline.rigs.tpjb.rotating.parameters import candidate_of, clearance_of
from pipeline.rigs.tpjb.rotating.turns import Turns

_ORDERS = np.arange(0.1, 8.01, 0.1)
_AROUND = 2.0 * np.pi * np.arange(181) / 180


def arrays_of(
    groups: Sequence[LoadGroup], clearances: Mapping[str, Clearance], consistency: Sequence[Consistency]
) -> dict[str, pd.DataFrame]:
    """Return the tables; those without rows are left out."""
    pairs = [(group, turns) for group in groups for turns in group.runs]
    tables: dict[str, list[Any]] = {
        "runs": [_run(group, turns) for group, turns in pairs],
        "samples": [_samples(group, turns, clearances) for group, turns in pairs],
        "model_orbits": [part for group, turns in pairs for part in _model_orbits(group, turns)],
        "limit": [_limit(group) for group in groups if group.static_load and not group.selected.model.is_linear],
        "models": [_model(group, fit) for group in groups for fit in group.fits]
        + [_load_model(group, fit) for group in groups for fit in group.dependent],
        "harmonics": [_harmonics(turns) for _, turns in pairs if turns.motion is not None],
        "axis_harmonics": [_axis_harmonics(turns) for _, turns in pairs if turns.motion is not None],
        "spectra": [_spectrum(turns) for _, turns in pairs if turns.motion is not None],
        "filtered": [_filtered(turns) for _, turns in pairs if turns.motion is not None],
        "consistency": [_comparison(entry) for entry in consistency],
        "polygon": [clearance.outline.assign(bearing=name) for name, clearance in clearances.items()],
    }
    made = {}
    for name, rows in tables.items():
        if rows:
            made[name] = pd.concat(rows, ignore_index=True) if isinstance(rows[0], pd.DataFrame) else pd.DataFrame(rows)
    return made


def _run(group: LoadGroup, turns: Turns) -> dict[str, Any]:
    record, distortion = turns.record, group.distortions.get(turns.run)
    linear, first = group.linear[turns.run], group.linear[group.lowest.run]
    path = linear.paths[0]
    moved = record.orbit.displacement - record.orbit.displacement.mean(axis=1, keepdims=True)
    c = clearance_of(group)
    radius = np.hypot(*(record.orbit.displacement - group.equilibrium(turns.run)[:, None] - group.drift(turns.run)))
    drift = np.ptp(group.drift(turns.run), axis=1)
    row: dict[str, Any] = {
        "run": turns.run,
        "group": group.label,
        "bearing": str(record.conditions.get("bearing", "")),
        "static_load": record.static_load if record.static_load else math.nan,
        "shaft_speed": record.speed if record.speed is not None else math.nan,
        "force": record.rotation.size,
        "ratio": record.ratio if record.ratio is not None else math.nan,
        "frequency": record.rotation.frequency,
        "turns": record.rotation.turns,
        "wander": record.rotation.wander,
        "dwell": record.rotation.has_dwell,
        "displacement": float(np.nanmax(radius[record.rotation.steady])),
        "over_clearance": float(np.nanmax(radius[record.rotation.steady])) / c if c else math.nan,
        "misfit_linear": float(np.sqrt((path.residual**2).mean() / (moved**2).mean())),
        "kxx_apparent": linear.p[0],
        "kyy_apparent": linear.p[3],
        "stiffness_change": _stiffness_change(linear, first),
        "drift_x": drift[0],
        "drift_y": drift[1],
        "equilibrium_x": group.equilibrium(turns.run)[0],
        "equilibrium_y": group.equilibrium(turns.run)[1],
    }
    row |= {
        "thd": distortion.value if distortion else math.nan,
        "thd_sd": distortion.std_error if distortion else math.nan,
        "thd_raw": distortion.raw if distortion else math.nan,
        "thd_load": distortion.load if distortion else math.nan,
        "first": turns.amplitude,
    }
    row |= _of_harmonics(turns)
    return row


def _stiffness_change(linear: ModelFit, first: ModelFit) -> float:
    """Return the change of sqrt(det K) of the linear fit against that at the lowest ratio; NaN for that one itself."""
    if linear is first:
        return math.nan
    own, lowest = (math.sqrt(abs(float(np.linalg.det(fit.K)))) for fit in (linear, first))
    return own / lowest - 1.0


def _of_harmonics(turns: Turns) -> dict[str, Any]:
    if turns.motion is None or turns.load is None:
        names = (
            "circularity",
            "second_x",
            "second_y",
            "second_load",
            "openness",
            "openness_sd",
            "tilt_1x",
            "backward_1x",
        )
        return {**dict.fromkeys(names, math.nan), "open": False}
    motion, load = turns.motion, turns.load
    value, sd, is_open = openness(motion)
    size = math.hypot(abs(load.x[0]), abs(load.y[0]))
    ellipse = motion.ellipse(1)
    return {
        "circularity": circularity(load),
        "second_x": abs(motion.x[1]) / abs(motion.x[0]),
        "second_y": abs(motion.y[1]) / abs(motion.y[0]),
        "second_load": math.hypot(abs(load.x[1]), abs(load.y[1])) / size,
        "openness": value,
        "openness_sd": sd,
        "open": is_open,
        "tilt_1x": ellipse.tilt,
        "backward_1x": abs(motion.at(-1)) / abs(motion.at(1)),
    }


def _samples(group: LoadGroup, turns: Turns, clearances: Mapping[str, Clearance]) -> pd.DataFrame:
    orbit = turns.record.orbit
    path = group.selected.paths[group.index[turns.run]]
    own = orbit.displacement - path.offset[:, None] - group.drift(turns.run)
    clearance = clearances.get(str(turns.record.conditions.get("bearing", "")))
    centre = clearance.centre if clearance is not None else np.zeros(2)
    return pd.DataFrame(
        {
            "run": turns.run,
            "time": orbit.time,
            "fx": orbit.force[0],
            "fy": orbit.force[1],
            "dx": orbit.displacement[0] - centre[0],
            "dy": orbit.displacement[1] - centre[1],
            "x": own[0],
            "y": own[1],
            "mx": path.displacement[0],
            "my": path.displacement[1],
            "steady": _whole_turns(turns),
            "dwell": turns.record.rotation.dwell,
        }
    )


def _whole_turns(turns: Turns) -> np.ndarray:
    """Return the mask of the whole turns in the middle of the steady part; all of it below one turn."""
    rotation, time = turns.record.rotation, turns.record.orbit.time
    whole = math.floor(rotation.turns + 0.02)
    if whole < 1:
        return rotation.steady
    steady = time[rotation.steady]
    middle, half = 0.5 * (steady[0] + steady[-1]), 0.5 * whole / abs(rotation.frequency)
    return np.asarray(rotation.steady & (np.abs(time - middle) <= half))


def _model_orbits(group: LoadGroup, turns: Turns) -> list[pd.DataFrame]:
    parts = []
    place = group.index[turns.run]
    for fit in (*group.fits, *group.dependent):
        if fit.name in group.comparison.hidden:
            continue
        # Each law found its own equilibrium: shown as it was fitted.
        offset = fit.paths[place].offset - group.equilibrium(turns.run)
        x, y = model_orbit(fit, turns.record.rotation.size) + offset[:, None]
        rms = float(np.sqrt((fit.paths[place].residual ** 2).mean()))
        table = {"run": turns.run, "model": fit.name, "x": x, "y": y, "rms": rms, "selected": fit is group.selected}
        parts.append(pd.DataFrame(table))
    return parts


def _model(group: LoadGroup, fit: ModelFit) -> dict[str, Any]:
    sd = np.sqrt(np.maximum(np.diag(np.nan_to_num(fit.p_covariance)), 0.0))
    candidate = group.comparison.candidate(fit.name)
    size = group.highest.record.rotation.size
    shift = np.zeros(2) if fit.model.is_linear else fit.mean_shift(size)
    row: dict[str, Any] = {
        "group": group.label,
        "model": fit.name,
        "selected": fit is group.selected,
        "hidden": "" if group.selected.model.is_linear else group.comparison.hidden.get(fit.name, ""),
        "n_parameters": fit.size,
        "chi2_reduced": fit.chi2_reduced,
        "bic": candidate.bic - candidate_of(group, group.comparison.best).bic,
        "rms": fit.rms,
        "fold_margin": fit.fold_margin,
        "mean_shift_x": shift[0],
        "mean_shift_y": shift[1],
        "effect": group.comparison.effects[fit.name],
        "at_bound": ", ".join(fit.at_bound),
    }
    for j, name in enumerate(COEFFICIENTS):
        free = bool(fit.model.matrix[j].any())
        row[name], row[f"{name}_sd"] = (fit.p[j], sd[j]) if free else (math.nan, math.nan)
    return row


def _load_model(group: LoadGroup, fit: LawFit) -> dict[str, Any]:
    """A load-dependent form: what it shares with the models."""
    best = group.comparison.best
    pairs = zip(fit.paths, best.paths, group.runs, strict=True)
    effect = max(float(np.sqrt(((a.residual - b.residual) ** 2).mean())) / t.amplitude for a, b, t in pairs)
    row: dict[str, Any] = {
        "group": group.label,
        "model": fit.name,
        "selected": False,
        "hidden": "",
        "n_parameters": fit.size,
        "chi2_reduced": fit.chi2_reduced,
        "bic": candidate_of(group, fit).bic - candidate_of(group, best).bic,
        "rms": fit.rms,
        "effect": effect,
        "at_bound": ", ".join(fit.at_bound),
    }
    return row | dict(zip(fit.law.free, fit.theta.tolist(), strict=True))


def _comparison(entry: Consistency) -> dict[str, Any]:
    names = ("group", "kind", "name", "left", "left_sd", "right", "right_sd", "unit", "z", "holds", "meaning")
    return {name: getattr(entry, name) for name in names}


def _limit(group: LoadGroup) -> pd.DataFrame:
    """THD of the chosen model under a circular load over the load ratio, with the 1X amplitude."""
    assert group.static_load is not None
    largest = max(turns.record.rotation.size for turns in group.runs) / group.static_load
    ratios = np.linspace(0.005, max(1.1 * largest, 0.2), 80)
    thd, first = model_distortion(group.selected.p, ratios * group.static_load)
    return pd.DataFrame({"group": group.label, "ratio": ratios, "thd": thd, "displacement": first})


def _harmonics(turns: Turns) -> pd.DataFrame:
    assert turns.motion is not None
    assert turns.load is not None
    return pd.DataFrame(
        {
            "run": turns.run,
            "k": turns.motion.k,
            "motion": np.abs(turns.motion.Z),
            "motion_real": turns.motion.Z.real,
            "motion_imaginary": turns.motion.Z.imag,
            "motion_sigma": turns.motion.sigma,
            "load": np.abs(turns.load.Z),
            "load_sigma": turns.load.sigma,
        }
    )


def _axis_harmonics(turns: Turns) -> pd.DataFrame:
    assert turns.motion is not None
    assert turns.load is not None
    rows = []
    for order in range(1, 7):
        for signal in ("x", "y"):
            found = amplitude(turns.motion, turns.noise, signal, order)
            rows.append((turns.run, signal, order, found.value, found.std_error))
        load = math.hypot(abs(turns.load.x[order - 1]), abs(turns.load.y[order - 1])) / math.sqrt(2.0)
        own = math.hypot(turns.load.sigma_at(order), turns.load.sigma_at(-order)) / math.sqrt(2.0)
        rows.append((turns.run, "load", order, load, own))
    return pd.DataFrame(rows, columns=["run", "signal", "order", "amplitude", "sigma"])


def _spectrum(turns: Turns) -> pd.DataFrame:
    """Amplitude over order of x, y and the load (rms of its axes), whole turns, drift out."""
    assert turns.motion is not None
    assert turns.load is not None
    steady, frequency = turns.steady, abs(turns.record.rotation.frequency)
    whole = steady.time - steady.time[0] < int(turns.record.rotation.turns + 0.05) / frequency
    time = steady.time[whole]
    # A Hann window: the skirts of the 1X would hide the other harmonics.
    turning = np.exp(-2j * np.pi * frequency * np.multiply.outer(_ORDERS, time - time[0])) * np.hanning(time.size)
    sizes = {}
    for name, found, vector in (("d", turns.motion, steady.displacement), ("f", turns.load, steady.force)):
        tau = 2.0 * (steady.time - steady.time[0]) / (steady.time[-1] - steady.time[0]) - 1.0
        slow = found.offset + found.drift[0] * tau + found.drift[1] * (tau**2 - 1.0 / 3.0)
        rest = (vector - np.stack([slow.real, slow.imag]))[:, whole]
        sizes[name] = 2.0 * np.abs(rest @ turning.T) / np.hanning(time.size).sum()
    signals = {"x": sizes["d"][0], "y": sizes["d"][1], "load": np.sqrt((sizes["f"] ** 2).mean(axis=0))}
    return pd.concat(
        [pd.DataFrame({"run": turns.run, "signal": s, "order": _ORDERS, "amplitude": a}) for s, a in signals.items()],
        ignore_index=True,
    )


def _filtered(turns: Turns) -> pd.DataFrame:
    assert turns.motion is not None
    parts = []
    for order in (1, 2, 3):
        x, y = turns.motion.filtered(order, _AROUND / order)
        parts.append(pd.DataFrame({"run": turns.run, "order": order, "x": x, "y": y}))
    return pd.concat(parts, ignore_index=True)
