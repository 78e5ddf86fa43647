"""What pulsation and resistances say of air and filter against the calibration; needs neither E2 nor, with a meter, E3 (rap.md, 5.3, 5.8, 8)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.results import Campaign
from pipeline.rigs.rap.flow.sets import CALIBRATION
from pipeline.rigs.rap.flow.windows import FlowWindows

# Resistances beyond that ratio to the calibration's are another circuit; pulsation beyond that one at the same speed is another compliance.
_CHANGED, _PULSATES = 0.15, 0.10
# Windows are compared with those of the calibration at a frequency and a back pressure within these shares.
_SAME_SPEED, _SAME_PRESSURE = 0.03, 0.08


def changed_resistances(found: Campaign, of_run: FlowWindows) -> str:
    """Say which resistances of a run differ from those of the calibration; '' where none does."""
    reference = _reference(found, of_run)
    flow, usual = _flow(found, of_run), _flow(found, reference)
    ratios = {
        "filter": _median((of_run.prefilter - of_run.back) / flow)
        / _median((reference.prefilter - reference.back) / usual),
        "return line": _median(of_run.back / flow) / _median(reference.back / usual),
    }
    changed = [
        f"that of the {name} is {value:.2f} times" for name, value in ratios.items() if abs(value - 1.0) > _CHANGED
    ]
    if not changed:
        return ""
    return f"resistances differ from those of the calibration, {' and '.join(changed)}: another filter or return line, or clots"


def changed_circuit(found: Campaign, of_run: FlowWindows) -> list[QualityFinding]:
    """Tell air and another filter in a run where E2 and E3 are not both there to be held against each other."""
    if "E2" in found.laws and "E3" in found.laws:
        return []
    text = changed_resistances(found, of_run)
    ratio = _pulsation(of_run, _reference(found, of_run))
    if not text and abs(ratio - 1.0) > _PULSATES:
        text = f"compliance changed: the pulsation is {ratio:.2f} times that of the calibration at the same speed and back pressure, "
        text += (
            "as with air in the circuit or a bubble at the transducer"
            if ratio < 1.0
            else "as with less air than in the calibration"
        )
    if not text:
        return []
    span = (float(of_run.time.min()), float(of_run.time.max()))
    text = f"{text}. E2 of one such circuit does not hold for the other"
    return [QualityFinding("warning", text, str(of_run.run[0]), "pressure_prefilter_rap", span)]


def _reference(found: Campaign, of_run: FlowWindows) -> FlowWindows:
    """Return the windows of the other calibration runs, or of all where there is no other."""
    inside = found.windows.of(found.windows.role == CALIBRATION)
    others = inside.of(inside.run != of_run.run[0])
    return others if others.size else inside


def _flow(found: Campaign, windows: FlowWindows) -> np.ndarray:
    """Return the flow by E3 where it is calibrated, else by the meter, m^3/s, shape (w,)."""
    return found.laws["E3"].flow(windows) if "E3" in found.laws else windows.flow


def _pulsation(windows: FlowWindows, reference: FlowWindows) -> float:
    """Return A_1 over that of the reference at the same speed and back pressure, the median of the windows; NaN where none compare.

    Without access pressure the same clamp stands for the same back pressure.
    """
    speed = np.abs(windows.f[:, None] / reference.f - 1.0) < _SAME_SPEED
    pressure = np.abs(windows.back_pressure[:, None] / reference.back_pressure - 1.0)
    pressure = np.where(np.isfinite(pressure), pressure < _SAME_PRESSURE, windows.clamp[:, None] == reference.clamp)
    alike = speed & pressure & np.isfinite(reference.A_1)
    count = alike.sum(axis=1)
    usual = np.where(alike, reference.A_1, 0.0).sum(axis=1) / np.where(count > 0, count, np.nan)
    return _median(windows.A_1 / usual)


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan
