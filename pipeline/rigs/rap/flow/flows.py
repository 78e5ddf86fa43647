"""Estimated flow of every run and set-point with its uncertainty, doubted where estimators or the meter contradict (rap.md, 5.3, 5.8)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.rap.flow.calibration import Calibrated
from pipeline.rigs.rap.flow.circuit_changes import changed_circuit
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.results import Campaign, FlowRow
from pipeline.rigs.rap.flow.sets import other_tube
from pipeline.rigs.rap.flow.windows import FlowWindows

# The meter contradicts an estimate from so many of its standard errors on, and from that share.
_SIGMAS, _LEAST = 3.0, 0.01


def flow_rows(found: Campaign, settings: FlowSettings) -> list[FlowRow]:
    """Return a row for every run, set-point and estimator E2, E3."""
    rows = []
    for run in dict.fromkeys(found.windows.run):
        of_run = found.windows.of(found.windows.run == run)
        changed = "".join(finding.message for finding in changed_circuit(found, of_run))
        for level in np.unique(of_run.set_point):
            inside = of_run.of((of_run.set_point == level) | (np.isnan(level) & np.isnan(of_run.set_point)))
            rows += [_row(found, inside, "E2", changed, settings), _row(found, inside, "E3", "", settings)]
    return rows


def _row(found: Campaign, inside: FlowWindows, estimator: str, changed: str, settings: FlowSettings) -> FlowRow:
    """Return the flow by one estimator; `changed` says why its circuit is not the calibrated one, '' where it is."""
    metered = float(np.nanmean(inside.flow)) if np.isfinite(inside.flow).any() else math.nan
    row = FlowRow(
        str(inside.run[0]),
        float(inside.flow_set[0]),
        estimator,
        math.nan,
        math.nan,
        math.nan,
        math.inf,
        metered,
        inside.size,
    )
    law = found.laws.get(estimator)
    if law is None:
        return _without(row, f"{estimator} is not calibrated: {found.refused[estimator]}")
    values = law.flow(inside)
    known = np.isfinite(values)
    if not known.any():
        return _without(row, f"the run lacks a pressure that {estimator} needs")
    mean = float(values[known].mean())
    random = _random(law, inside.of(known))
    tube = _tube_u(found, law, inside.of(known), mean, settings)
    doubts = [f"its tube was not calibrated: stroke volume uncertain by {100 * settings.tube_u:g} %"] if tube else []
    off = mean / metered - 1.0 if math.isfinite(metered) else math.nan
    why_not = f"no meter tells the flow, and {changed}" if changed and not math.isfinite(off) else ""
    if (apart := _apart(found, inside)) > settings.disagreement:
        text = f"E2 and E3 are {100 * apart:.1f} % apart"
        if _wrong(found, inside, estimator):
            why_not = f"{text}, and {estimator} is the one that contradicts the meter" if math.isfinite(off) else (
                f"{text} and no meter tells which is right; E2 is the one that a changed compliance or filter invalidates"
            )  # fmt: skip
        else:
            doubts += [
                f"{text}; {'the meter agrees with this one' if math.isfinite(off) else 'no meter tells which is right'}"
            ]
            random = math.hypot(random, 0.0 if math.isfinite(off) else apart / 2.0)
    if math.isfinite(off) and abs(off) > max(_SIGMAS * math.hypot(random, tube), _LEAST):
        doubts += [f"the meter reads {100 * abs(off):.1f} % {'less' if off > 0.0 else 'more'}; that is in the error"]
        random = math.hypot(random, off)
    if why_not:
        return _without(row, why_not)
    systematic = math.hypot(found.gain_u, found.uf_u, tube)
    dof = law.covariance.dof if law.covariance is not None else math.inf
    return FlowRow(
        row.run, row.flow_set, estimator, mean, random, systematic, dof, metered, int(known.sum()), "; ".join(doubts)
    )


def _tube_u(found: Campaign, law: Calibrated, inside: FlowWindows, flow: float, settings: FlowSettings) -> float:
    """Return the relative error (type B) of a flow through a tube that was not calibrated: that of its stroke volume; else 0."""
    if not other_tube(inside, found.tube).any():
        return 0.0
    return float(settings.tube_u * law.values[0] * np.mean(inside.f) / flow)


def _random(law: Calibrated, inside: FlowWindows) -> float:
    """Return the relative error (type A) of a mean over these windows: what set-points share, and the rest by operating point.

    The noise of windows is in the latter already.
    """
    if not math.isfinite(law.misfit):
        return law.scatter / math.sqrt(inside.size)
    own = max(law.misfit**2 - law.shared**2, 0.0) / np.unique(inside.point).size
    return math.sqrt(law.shared**2 + own)


def _without(row: FlowRow, why: str) -> FlowRow:
    return FlowRow(
        row.run,
        row.flow_set,
        row.estimator,
        math.nan,
        math.nan,
        math.nan,
        math.inf,
        row.metered,
        row.count,
        why_not=why,
    )


def _apart(found: Campaign, inside: FlowWindows) -> float:
    """Return by how much E2 and E3 differ in these windows, relative, absolute value; 0 where one is missing."""
    if "E2" not in found.laws or "E3" not in found.laws:
        return 0.0
    a, b = found.laws["E2"].flow(inside), found.laws["E3"].flow(inside)
    both = np.isfinite(a) & np.isfinite(b)
    return float(abs(np.mean(a[both] / b[both] - 1.0))) if both.any() else 0.0


def _wrong(found: Campaign, inside: FlowWindows, estimator: str) -> bool:
    """Tell whether this one of E2 and E3 is the one that is off: by the meter, else E2."""
    known = inside.of(np.isfinite(inside.flow))
    if not known.size:
        return estimator == "E2"
    off = {name: abs(float(np.nanmean(found.laws[name].errors(known)))) for name in ("E2", "E3")}
    return max(off, key=off.__getitem__) == estimator
