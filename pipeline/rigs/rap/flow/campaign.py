"""All runs of a campaign together: meter's line, calibration, errors on each set, estimated flows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.calibration import LAWS, Calibrated, LeftOut, calibrate, leave_set_points_out, usable
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.determined import unphysical, why_not_pressure, why_not_pulsation
from pipeline.rigs.rap.flow.flows import flow_rows
from pipeline.rigs.rap.flow.location import Location, blood_flow, locate
from pipeline.rigs.rap.flow.odd_run import without_odd_run
from pipeline.rigs.rap.flow.results import ESTIMATORS, Campaign, ErrorRow
from pipeline.rigs.rap.flow.run_windows import RunNumbers
from pipeline.rigs.rap.flow.sets import CALIBRATION, HOLDOUT, Sets, other_tube, sets_of
from pipeline.rigs.rap.flow.trap import trap_of, unclamped
from pipeline.rigs.rap.flow.windows import FlowWindows, stacked

# The paper's lowest set-point, at which E0 is calibrated, m^3/s.
_LOWEST = 1e-6


def campaign_of(runs: Sequence[RunNumbers], settings: FlowSettings) -> Campaign:
    """Calibrate on the calibration windows, and try what came out on all."""
    windows = stacked([run.windows for run in runs])
    problems: list[QualityFinding] = []
    location, windows = _by_line(runs, windows)
    sets = sets_of(windows)
    sets = without_odd_run(windows, sets)
    problems += sets.problems
    windows = replace(windows, role=sets.label, group=sets.group)
    fitted = windows.of((sets.label == CALIBRATION) & np.isfinite(windows.flow))
    laws, refused = _laws(fitted, _nothing(windows, fitted, location))
    left_out = {name: _left_out(law) for name, law in laws.items() if name in ("E2", "E2 quadratic", "E3")}
    gain_u, stated = _gain_u(runs, settings)
    uf_u = 0.0
    if "return" in location.trusted and fitted.size:
        uf_u = settings.uf_gain_u * float(np.mean(fitted.uf / fitted.flow))
    zero_u = 0.0 if any(run.zeros[t].known for run in runs for t in run.zeros if t == "prefilter") else settings.zero_u
    found = Campaign(
        runs=list(runs),
        windows=windows,
        calibration=fitted,
        location=location,
        laws=laws,
        refused=refused,
        left_out=left_out,
        errors=_errors(windows, sets, laws),
        flows=[],
        trap=trap_of(fitted, _held_out(windows, sets.tube)),
        tube=sets.tube,
        gain_u=gain_u,
        gain_stated=stated,
        uf_u=uf_u,
        zero_u=zero_u * float(np.sqrt(2.0)),
        problems=problems,
    )
    return replace(found, flows=flow_rows(found, settings))


def _by_line(runs: Sequence[RunNumbers], windows: FlowWindows) -> tuple[Location, FlowWindows]:
    """Return where the meter sits, and the windows with the blood flow that it stands for; each run by its own line where they differ."""
    stated = {run.run.name: run.run.location for run in runs if run.run.meter is not None}
    lines = set(stated.values())
    if len(lines) < 2:
        location = locate(lines.pop() if lines else "", windows)
        return location, blood_flow(windows, location.trusted)
    flow = windows.flow.copy()
    for line in lines:
        of_line = np.array([stated.get(str(run)) == line for run in windows.run], dtype=bool)
        flow[of_line] = blood_flow(windows.of(of_line), line).flow
    silent = tuple(run for run, line in stated.items() if not line)
    words = " or ".join(sorted(lines - {""}))
    return Location(words, float("nan"), float("nan"), silent=silent), replace(windows, flow=flow)


def _nothing(windows: FlowWindows, fitted: FlowWindows, location: Location) -> str:
    """Return why nothing at all can be calibrated; '' where something can."""
    if fitted.size:
        return ""
    inside = windows.role == CALIBRATION
    if not inside.any():
        return "no run states the set 'calibration', or none of those has a window in which the pump turns steadily"
    if not np.isfinite(windows.metered[inside]).any():
        return (
            "no calibration run has a flow meter (blood_flow_bench) in its windows: there is nothing to calibrate the estimators against. A "
            "device's own blood_flow_rap is an estimate itself"
        )
    why = (
        "the runs state different lines or none"
        if not location.stated
        else "the readings contradict the line that is stated"
    )
    return (
        f"flowmeter_location: {why}, and ultrafiltrate was drawn in all windows: a meter on the return line reads the blood flow less the UF rate, "
        "5 to 8 % too little at 60 to 100 mL/min with 5 mL/min. State flowmeter_location (access or return), or calibrate with UF off"
    )


def _laws(fitted: FlowWindows, nothing: str) -> tuple[dict[str, Calibrated], dict[str, str]]:
    """Return the laws that these windows determine, and why others are not."""
    laws: dict[str, Calibrated] = {}
    refused: dict[str, str] = {}
    for name, law in LAWS.items():
        inside = usable(law, fitted)
        if nothing:
            refused[name] = nothing
            continue
        if name == "E0":
            inside = _lowest(inside)
        why = {"E2": why_not_pulsation, "E2 quadratic": why_not_pulsation, "E3": why_not_pressure}.get(name)
        reason = (
            why(inside)
            if why
            else ("" if inside.size else "no calibration window has a frequency and a blood flow of the meter")
        )
        if reason:
            refused[name] = reason
            continue
        done = calibrate(law, inside)
        if not np.isfinite(done.values).all():
            refused[name] = "the calibration windows do not tell its coefficients apart"
        elif reason := unphysical(law.names, done.values):
            refused[name] = reason
        else:
            laws[name] = done
    return laws, refused


def _lowest(windows: FlowWindows) -> FlowWindows:
    """Return the unclamped windows of the set-point nearest to 60 mL/min."""
    open_line = windows.of(unclamped(windows))
    if not open_line.size:
        return open_line
    level = open_line.flow_set if np.isfinite(open_line.flow_set).all() else open_line.flow
    nearest = level[np.argmin(np.abs(level - _LOWEST))]
    return open_line.of(np.abs(level - nearest) < 0.05 * nearest)


def _left_out(law: Calibrated) -> list[LeftOut]:
    return leave_set_points_out(law.law, law.windows)


def _held_out(windows: FlowWindows, tube: str) -> FlowWindows:
    """Return the held-out windows with a meter, those of the calibrated tube where there are any."""
    held_out = windows.of((windows.role == HOLDOUT) & np.isfinite(windows.flow))
    same = held_out.of(~other_tube(held_out, tube))
    return same if same.size else held_out


def _errors(windows: FlowWindows, sets: Sets, laws: dict[str, Calibrated]) -> list[ErrorRow]:
    """Return the errors of every estimator, and of the device's own estimate, on each set; a hold-out of several tubes by tube."""
    rows = []
    judged = np.isfinite(windows.flow) & (windows.flow > 0.0)
    groups = dict.fromkeys((name, tube) for name, tube in zip(sets.label, sets.tubes, strict=True) if name)
    for name, tube in sorted(groups, key=lambda group: (group[0] != CALIBRATION, group[1])):
        inside = windows.of(judged & (sets.label == name) & (sets.tubes == tube))
        errors = {one: laws[one].errors(inside) for one in (*ESTIMATORS, "E2 quadratic", "affine") if one in laws}
        errors["rap"] = inside.own / inside.flow - 1.0
        rows += [row for one, e in errors.items() for row in _row(one, (name, tube), inside, e)]
    return rows


def _row(estimator: str, group: tuple[str, str], inside: FlowWindows, errors: np.ndarray) -> list[ErrorRow]:
    known = np.isfinite(errors)
    if not known.any():
        return []
    e = errors[known]
    line = errors[known & unclamped(inside)]
    at = int(np.flatnonzero(known)[np.argmax(np.abs(e))])
    where = f"run {inside.run[at]}"
    if np.isfinite(inside.flow_set[at]):
        where += f", {inside.set_point[at]:g} mL/min"
    if inside.clamp[at]:
        where += f", clamp {inside.clamp[at]}"
    return [
        ErrorRow(
            estimator,
            group[0],
            float(np.abs(e).max()),
            float(np.abs(line).max()) if line.size else float("nan"),
            float(np.sqrt(np.mean(e**2))),
            float(np.mean(e)),
            int(e.size),
            where,
            group[1],
        )
    ]


def _gain_u(runs: Sequence[RunNumbers], settings: FlowSettings) -> tuple[float, bool]:
    """Return the largest type B uncertainty of the meter's gain that a run states, else the setting; whether it is stated."""
    stated = [u for run in runs if (u := run.run.number("flowmeter_gain_u")) is not None]
    return (max(stated), True) if stated else (settings.flow_gain_u, False)
