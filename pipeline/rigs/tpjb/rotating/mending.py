"""One static load fitted with what stands in its forces taken off: a delay, or friction of the load cells.

What the log does not tell apart is said and not taken off; the errors of what is taken off reach the coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import listing
from pipeline.findings.findings import OperatingPoint
from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.force_errors import (
    Cause,
    Doubt,
    cause_in,
    cause_of,
    doubt_of,
    explained,
    friction_of,
    widened,
)
from pipeline.rigs.tpjb.rotating.group import LoadGroup, fit_group
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit, fit_model
from pipeline.rigs.tpjb.rotating.record import Record
from pipeline.rigs.tpjb.rotating.turns import Turns, turns_of
from pipeline.signals.resampling import interpolated

# What is taken off blurs what tells it: again until what is left is this small against its error.
_MENDINGS, _REST = 8, 0.1


def mended(
    at: OperatingPoint, members: Sequence[Turns], settings: RotatingSettings
) -> tuple[LoadGroup, list[QualityFinding]]:
    """Fit one static load; take off a delay or friction of its forces and fit again.

    Raises
    ------
    InputError
        If no model could be fitted.
    """
    group = fit_group(at, members, settings)
    cause = cause_in(group.selected)
    if cause is None:
        return group, []
    if isinstance(cause, Doubt):
        return _in_doubt(group, cause), [_told_doubt(group, cause)]
    total, sd, fit = _settled(group, cause)
    if not explained(fit):  # a cause that explains all leaves nothing to another one
        doubt = doubt_of(group.selected)
        return _in_doubt(group, doubt), [_told_doubt(group, doubt)]
    runs = [turns_of(record, settings) for record in _corrected(group, cause, total)]
    again = fit_group(at, runs, settings)
    parts = len(total) if cause.kind == "delay" else len(total) // len(group.runs)
    spread = {
        turns.run: sd if cause.kind == "delay" else sd[place * parts : (place + 1) * parts]
        for place, turns in enumerate(group.runs)
    }
    told = _told_delay(group, total[0], sd[0], cause) if cause.kind == "delay" else _told_friction(group, total, sd)
    return _each(again, lambda one: widened(one, cause.kind, spread)), [told]


def _settled(group: LoadGroup, cause: Cause) -> tuple[np.ndarray, np.ndarray, ModelFit]:
    """Return the cause where taking it off leaves none of it, its standard error, and the fit of then."""
    total, found, fit = np.zeros_like(cause.values), cause, group.selected
    for _ in range(_MENDINGS):
        total = total + found.values
        orbits = [record.orbit for record in _corrected(group, cause, total)]
        fit = fit_model(orbits, fit.model, start=fit.theta)
        found = cause_of(fit, cause.kind)
        if (np.abs(found.values) < _REST * found.sd).all():
            break
    # Noise of the force blurs the rate that tells the cause: it shows less of it than there is, the first time.
    shown = np.clip(np.abs(cause.values) / np.maximum(np.abs(total), 1e-300), 0.2, 1.0)
    return total, found.sd / shown, fit


def _corrected(group: LoadGroup, cause: Cause, total: np.ndarray) -> list[Record]:
    """Return the records of a group, as measured, with a cause taken off."""
    if cause.kind == "delay":
        return [_shifted(turns.record, float(total[0])) for turns in group.runs]
    parts = total.reshape(len(group.runs), -1)
    return [
        replace(r, orbit=replace(r.orbit, force=r.orbit.force - friction_of(group.selected, i, cause.kind, parts[i])))
        for i, r in enumerate(turns.record for turns in group.runs)
    ]


def _shifted(record: Record, late: float) -> Record:
    """Return a run with its forces earlier by `late`, s; samples at the ends that lack a partner are dropped."""
    orbit = record.orbit
    force = np.stack([interpolated(orbit.time, row, orbit.time + late, np.inf) for row in orbit.force])
    inside = np.isfinite(force).all(axis=0)
    return replace(
        record,
        orbit=replace(orbit, force=force).part(inside),
        tilt=None if record.tilt is None else record.tilt[:, inside],
        planes={plane: d[:, inside] for plane, d in record.planes.items()},
    )


def _in_doubt(group: LoadGroup, doubt: Doubt) -> LoadGroup:
    """Return the group with coefficients as uncertain as what the larger cause would move them."""
    causes = (doubt.delay, doubt.friction)
    large = max(causes, key=lambda cause: float(np.abs(cause.effects @ cause.values / group.selected.law.scale).max()))
    parts = large.values.reshape(len(group.runs), -1) if large.kind != "delay" else None
    spread = {
        turns.run: np.abs(large.values if parts is None else parts[place]) for place, turns in enumerate(group.runs)
    }
    return _each(group, lambda one: widened(one, large.kind, spread))


def _each(group: LoadGroup, change: Callable[[ModelFit], ModelFit]) -> LoadGroup:
    """Return a group with every fit changed."""
    comparison = group.comparison
    fits = {name: change(fit) for name, fit in comparison.fits.items()}
    return replace(
        group,
        comparison=replace(
            comparison, fits=fits, selected=fits[comparison.selected.name], best=fits[comparison.best.name]
        ),
        linear={run: change(fit) for run, fit in group.linear.items()},
        lower=None if group.lower is None else _each(group.lower, change),
    )


def _told_delay(group: LoadGroup, late: float, sd: float, cause: Cause) -> QualityFinding:
    word = "late" if late > 0 else "early"
    text = (
        f"{group.label}: the forces are {abs(late):.3g} ± {1.96 * sd:.1g} s {word} against the motion (clock slip or delay), "
        f"told from ramps and unrest of the load; as cross coupling it would count {100 * cause.share:.2g} % of the "
        "stiffness. They were shifted by it, and its error stands in the intervals of the coefficients."
    )
    return QualityFinding("warning", text, None, "force_u")


def _told_friction(group: LoadGroup, total: np.ndarray, sd: np.ndarray) -> QualityFinding:
    parts, errors = total.reshape(len(group.runs), -1), sd.reshape(len(group.runs), -1)
    each = "" if parts.shape[1] == 1 else ", along u and along v"
    sizes = listing(
        f"{turns.run}: {' and '.join(f'{f:.3g} ± {1.96 * e:.1g} N' for f, e in zip(own, error, strict=True))} "
        f"({100 * np.abs(own).max() / turns.record.rotation.size:.2g} % of the load)"
        for turns, own, error in zip(group.runs, parts, errors, strict=True)
    )
    text = (
        f"{group.label}: a force of constant size stands against the motion{each}, {sizes}: friction of stabilisers, hoses or "
        "actuators? A delay of the forces does not fit: it would grow with the rate of the load. It was taken off the load "
        "cells, and its error stands in the intervals; left in, it would count as cross coupling (kxy - kyx)."
    )
    return QualityFinding("warning", text, None, "force_u")


def _told_doubt(group: LoadGroup, doubt: Doubt) -> QualityFinding:
    late, share = float(doubt.delay.values[0]), 100 * max(doubt.delay.share, doubt.friction.share)
    size = float(np.abs(doubt.friction.values).max())
    word = "late" if late > 0 else "early"
    text = (
        f"{group.label}: something turns the force against the motion by up to {share:.2g} % of the load: forces "
        f"{abs(late):.2g} s {word} (clock slip or delay), or friction of about {size:.2g} N (stabilisers, hoses, actuators), or "
        "both; ramps and unrest of the load do not tell which. Nothing was taken off; the coefficients, kxy and kyx above "
        "all, are as uncertain as the larger of both would move them."
    )
    return QualityFinding("warning", text, None, "force_u")
