"""What the estimators and the meter tell of each other: air, another filter, another tube, wear, a misplaced meter (rap.md, 5.3, 5.8, 8)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.calibration import Calibrated
from pipeline.rigs.rap.flow.circuit_changes import changed_circuit, changed_resistances
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.location import Location
from pipeline.rigs.rap.flow.results import Campaign
from pipeline.rigs.rap.flow.sets import CALIBRATION, HOLDOUT
from pipeline.rigs.rap.flow.windows import FlowWindows

# Both estimators off alike by more than that (share), and by so many standard errors of the calibration.
_OFF, _SIGMAS = 0.01, 4.0
# Wear is told over that time at least, s, in blocks of that length, where the whole drift is more than that share.
_LONG, _BLOCK, _DRIFT = 1800.0, 300.0, 0.01
_WORN_SIGMAS = 4.0


def doubts(found: Campaign, settings: FlowSettings) -> list[QualityFinding]:
    """Return what must be told of the campaign's runs."""
    rows = _location(found.location) if any(run.run.meter is not None for run in found.runs) else []
    for run in dict.fromkeys(found.windows.run):
        of_run = found.windows.of(found.windows.run == run)
        apart = _apart(found, of_run, settings) or changed_circuit(found, of_run)
        rows += apart
        rows += _drift(found, of_run) or ([] if apart else _biased(found, of_run))
    return rows


def not_told(found: Campaign) -> list[QualityFinding]:
    """Return what the campaign as a whole lacks: estimators that are not calibrated, a hold-out."""
    rows = [
        QualityFinding("warning", f"{name} is not calibrated: {found.refused[name]}")
        for name in ("E2", "E3")
        if name in found.refused
    ]
    if found.laws and not any(row.set == HOLDOUT for row in found.errors):
        text = "no hold-out run has a blood flow of the meter: errors are those of the fit, and say less of what the estimators predict"
        rows.append(QualityFinding("warning", text))
    return rows


def _location(location: Location) -> list[QualityFinding]:
    """Tell what the UF pump's switching says of the meter's line."""
    size = f"{location.response:+.2f} ± {1.96 * location.error:.2f} of the UF rate (95 %)"
    told = f"switching the UF pump changes the meter's reading by {size}"
    if location.contradicted:
        other = {
            "return": "meter reads Q_b - Q_uf: it sits on the return line",
            "access": "meter reads Q_b: it sits on the access line",
        }
        how = (
            told
            if location.switched
            else (
                f"an offset of {size} stands between meter and E3; UF was never off, so that it cannot be seen to vanish with it"
            )
        )
        text = (
            f"{other[location.found]}, though flowmeter_location says {location.stated}: {how}. Windows with UF on are not held against the meter; mend the "
            "condition or the tubing, or log with UF off"
        )
        return [QualityFinding("warning", text, channel="blood_flow_bench")]
    if location.silent:
        text = (
            f"flowmeter_location is not stated for {listing(location.silent, 6)}, and it is mandatory: of these only windows with UF off are held "
            "against the meter"
        )
        return [QualityFinding("warning", text, channel="blood_flow_bench")]
    if not location.stated and location.found and location.switched:
        text = (
            f"flowmeter_location is not stated in any run; the logs themselves say {location.found}: {told}. State it"
        )
        return [QualityFinding("warning", text, channel="blood_flow_bench")]
    if not location.stated:
        text = (
            "flowmeter_location is not stated in any run, and it is mandatory: a meter on the return line reads the blood flow less the UF rate, "
            "8.3 to 5 % less at 60 to 100 mL/min with 5 mL/min of UF. Only windows with UF off are held against the meter"
        )
        return [QualityFinding("warning", text, channel="blood_flow_bench")]
    return []


def _apart(found: Campaign, of_run: FlowWindows, settings: FlowSettings) -> list[QualityFinding]:
    """Tell a run in which E2 and E3 part, and what else changed with it."""
    if "E2" not in found.laws or "E3" not in found.laws:
        return []
    means, worst_value = _worst_point(found, of_run)
    if abs(worst_value) <= settings.disagreement:
        return []
    worst = max(means, key=lambda p: abs(means[p]))
    many = sum(abs(value) > settings.disagreement for value in means.values())
    level = of_run.of(of_run.point == worst)
    text = (
        f"E2 and E3 disagree by {100 * means[worst]:+.1f} % (at {level.set_point[0]:g} mL/min), by more than {100 * settings.disagreement:g} % at {many} of "
        f"{len(means)} operating points: {_cause(found, of_run, means[worst])}. E2 is invalid there; refit it or use E3"
    )
    return [QualityFinding("warning", text, str(of_run.run[0]), "pressure_prefilter_rap", _span(of_run))]


def _worst_point(found: Campaign, windows: FlowWindows) -> tuple[dict[int, float], float]:
    """Return E2 over E3 less 1 of each operating point, and the largest of them (0 where there is none)."""
    ratio = found.laws["E2"].flow(windows) / found.laws["E3"].flow(windows) - 1.0
    points = windows.point
    means = {
        int(p): float(np.nanmean(ratio[points == p]))
        for p in np.unique(points)
        if np.isfinite(ratio[points == p]).any()
    }
    return means, max(means.values(), key=abs, default=0.0)


def _cause(found: Campaign, of_run: FlowWindows, apart: float) -> str:
    """Say what changed beside the pulsation, against the calibration."""
    own = _worst_point(found, found.calibration)[1]
    if abs(own) > 0.5 * abs(apart):
        return (
            f"E2 is as far as {100 * abs(own):.1f} % from E3 on its own calibration, so that its admittance is no straight line over speeds so far apart, or the circuit "
            "changed between the calibration's settings"
        )
    if changed := changed_resistances(found, of_run):
        return changed
    if not np.isfinite(of_run.prefilter - of_run.back).any():
        return "what a pascal of pulsation stands for has changed: air, another filter, or one of the sensors' zeros"
    if apart > 0.0:
        return (
            "compliance changed at the same resistances: the pulsation is weaker than the calibration lets expect, as with air in the circuit or a "
            "bubble at the transducer"
        )
    return "the pulsation is stronger than the calibration lets expect at the same resistances: less air than in the calibration, or a pressure's zero moved"


def _span(windows: FlowWindows) -> tuple[float, float]:
    return float(windows.time.min()), float(windows.time.max())


def _errors(found: Campaign, of_run: FlowWindows) -> tuple[Calibrated, np.ndarray] | None:
    """Return the steadier law that is calibrated, and its errors against the meter, shape (w,)."""
    law = found.laws.get("E3", found.laws.get("E2"))
    if law is None:
        return None
    errors = law.errors(of_run)
    return (law, errors) if np.isfinite(errors).any() else None


def _biased(found: Campaign, of_run: FlowWindows) -> list[QualityFinding]:
    """Tell a run in which the estimators are off alike: volume of the tube, or gain of the meter."""
    judged = _errors(found, of_run)
    calibrates = {run.run.name for run in found.runs if run.run.role == CALIBRATION}
    if judged is None or of_run.role[0] == CALIBRATION or str(of_run.run[0]) in calibrates:
        return []
    law, errors = judged
    known = errors[np.isfinite(errors)]
    mean = float(known.mean())
    scatter = math.hypot(law.misfit if math.isfinite(law.misfit) else 0.0, law.scatter / math.sqrt(known.size))
    if abs(mean) < max(_OFF, _SIGMAS * scatter):
        return []
    tube = str(of_run.tube[0])
    known_other = bool(tube and found.tube and tube != found.tube)
    volume = 1.0 / (1.0 + mean) - 1.0
    if known_other:
        why = f"its tube ({tube}) is another than the calibrated one ({found.tube}), and a stroke of it holds {more(volume)}"
    else:
        why = f"a stroke holds {more(volume)} (tube replaced or worn; state tube_set_id), or the meter's gain changed by as much"
        if law.law.name == "E2":
            why += "; E3, which is not there, would tell that from air and another filter"
    text = f"{law.law.name} reads {more(mean)} than the meter throughout the run: {why}. Calibrate each tube"
    return [QualityFinding("note" if known_other else "warning", text, str(of_run.run[0]), None, _span(of_run))]


def more(share: float) -> str:
    """Return ``"3.1 % more"`` or ``"2.9 % less"``."""
    return f"{100 * abs(share):.1f} % {'more' if share > 0.0 else 'less'}"


def _drift(found: Campaign, of_run: FlowWindows) -> list[QualityFinding]:
    """Tell estimates that run away from the meter over hours."""
    judged = _errors(found, of_run)
    if judged is None or np.ptp(of_run.time) < _LONG:
        return []
    law, errors = judged
    known = np.isfinite(errors)
    time, means = _blocks(of_run.time[known], errors[known])
    if time.size < 5 or np.ptp(time) < _LONG:
        return []
    centred = time - time.mean()
    slope = float(centred @ means / (centred @ centred))
    residual = means - means.mean() - slope * centred
    error = math.sqrt(float(residual @ residual) / (time.size - 2) / float(centred @ centred))
    total = slope * float(np.ptp(time))
    if abs(total) < _DRIFT or abs(slope) < _WORN_SIGMAS * error:
        return []
    first = float(means.mean() + slope * centred[0])
    text = (
        f"{law.law.name} drifts against the meter from {100 * first:+.1f} to {100 * (first + total):+.1f} % over {np.ptp(time) / 3600.0:.1f} h: the tube wears and loses "
        "volume, or the meter drifts. Neither estimator can see it; recalibrate during long runs"
    )
    return [QualityFinding("warning", text, str(of_run.run[0]), None, _span(of_run))]


def _blocks(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return means of blocks of time."""
    number = ((time - time.min()) // _BLOCK).astype(int)
    kept = np.unique(number)
    return np.array([time[number == k].mean() for k in kept]), np.array([values[number == k].mean() for k in kept])
