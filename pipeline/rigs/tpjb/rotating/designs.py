"""Tables of the findings from which the next runs are planned: law, information and noise of each static load."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.estimation.design import Information
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.information import run_information
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit
from pipeline.rigs.tpjb.rotating.models import M5, Model
from pipeline.rigs.tpjb.rotating.parameters import clearance_of


def design_tables(groups: Sequence[LoadGroup]) -> dict[str, pd.DataFrame]:
    """Return the tables "design" (a row a static load), "design_law" and "design_information"; empty where no law holds."""
    rows, laws, information = [], [], []
    for group in groups:
        trusted = group.trusted
        if trusted is None or not trusted.static_load:
            continue
        fit = _planned_from(trusted)
        planned = M5 if fit.model.is_linear else fit.model
        theta = np.array([fit.p[COEFFICIENTS.index(name)] for name in M5.free]) if planned is M5 else fit.theta
        known, inflation = _known(fit, planned, theta)
        rows.append(_row(trusted, fit, planned, inflation))
        laws.append(pd.DataFrame({"group": group.label, "name": planned.free, "value": theta}))
        a, b = np.indices(known.matrix.shape)
        names = np.array(planned.free)
        table = {
            "group": group.label,
            "row": names[a.ravel()],
            "column": names[b.ravel()],
            "value": known.matrix.ravel(),
        }
        information.append(pd.DataFrame(table))
    if not rows:
        return {}
    return {
        "design": pd.DataFrame(rows),
        "design_law": pd.concat(laws, ignore_index=True),
        "design_information": pd.concat(information, ignore_index=True),
    }


def _planned_from(group: LoadGroup) -> ModelFit:
    """Return the fit to plan with: of a linear law the quadratic one beside it, where its terms are known well enough.

    The linear residual holds what quadratic terms move, which is no noise of the next run; and how far that one moves, and
    so tells, depends on them. Well enough: better than where stiffness would be in proportion to load, kyy2 = kyy^2/(2 W).
    """
    fit, quadratic = group.selected, group.comparison.fits.get(M5.name)
    if not fit.model.is_linear or quadratic is None:
        return fit
    least = 0.5 * float(np.abs(fit.p[:4]).max()) ** 2 / float(group.static_load or math.nan)
    errors = [quadratic.estimates[name].std_error for name in M5.free[4:]]
    return quadratic if all(error is not None and error < least for error in errors) else fit


def _known(fit: ModelFit, planned: Model, theta: np.ndarray) -> tuple[Information, float]:
    """Return what the runs tell, and by how much (variances) the fit's errors exceed those of noise alone."""
    parts = [
        run_information(planned, theta, orbit.time, orbit.force, noise.sigma * low, noise.force)
        for orbit, noise, low in zip(fit.orbits, fit.noises, fit.low_sigma, strict=True)
    ]
    alone = sum(parts[1:], parts[0])
    if planned is not fit.model:
        return alone, 1.0
    found = Information.from_covariance(planned.free, fit.covariance.matrix)
    ratios = [found.std_error(name) / alone.std_error(name) for name in planned.free]
    told = [ratio for ratio in ratios if math.isfinite(ratio) and ratio > 0]
    return found, float(np.median(told)) ** 2 if told else 1.0


def _row(group: LoadGroup, fit: ModelFit, planned: Model, inflation: float) -> dict[str, float | str | bool]:
    record = group.highest.record
    motion = np.sqrt(np.mean([(n.sigma * low) ** 2 for n, low in zip(fit.noises, fit.low_sigma, strict=True)], axis=0))
    speed = group.at.get("shaft_speed")
    return {
        "group": group.label,
        "bearing": group.bearing,
        "static_load": float(group.static_load or math.nan),
        "shaft_speed": float(speed) if isinstance(speed, int | float) else math.nan,
        "law": planned.name,
        "linear": group.selected.model.is_linear,
        "largest_ratio": record.ratio or math.nan,
        "dwell": all(turns.record.rotation.has_dwell for turns in group.runs),
        "clearance": clearance_of(group) or math.nan,
        "frequency": abs(record.rotation.frequency),
        "step": record.orbit.step,
        "motion_x": float(motion[0] * math.sqrt(inflation)),
        "motion_y": float(motion[1] * math.sqrt(inflation)),
        "force_noise": float(np.mean([noise.force for noise in fit.noises]) * math.sqrt(inflation)),
    }
